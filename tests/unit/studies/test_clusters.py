"""Jobs of batch systems as far as their scripts go, and workers that somebody else has started."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from multicor_cli.store.errors import StoreError
from multicor_cli.studies.clusters import DoesNotFit, _cluster, existing, parse_memory
from multicor_cli.studies.forecast import Needs
from multicor_cli.studies.schema import Compute, Queue

pytest.importorskip("dask_jobqueue")

LINES = {
    "slurm": ["#SBATCH -p main", "#SBATCH -t 02:00:00", "--cpus-per-task=4", "--mem=8G"],
    "pbs": ["#PBS -q main", "walltime=02:00:00", "ncpus=4"],
    "sge": ["#$ -q main", "h_rt=02:00:00"],
    "lsf": ["#BSUB -q main", "#BSUB -W 02:00", "#BSUB -n 4"],
}


@pytest.mark.parametrize("name", LINES)
def test_scripts_of_jobs(name: str, tmp_path: Path) -> None:
    table = Queue(queue="main", walltime="02:00:00", cores=4, memory="8GB", jobs=3, job_extra_directives=["--account=me"])
    with _cluster(name, table, tmp_path, parse_memory(table.memory)) as cluster:
        script = cluster.job_script()
    for line in LINES[name]:
        assert line in script, script
    assert "--account=me" in script
    assert "--lifetime 7155s" in script  # 45 s before the walltime
    assert "--resources cores=4,memory=8000000000" in script
    assert "--nthreads 4" in script


def test_an_option_that_the_batch_system_does_not_have(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match=r"\[compute\] slurm: .*colour"):
        _cluster("slurm", Queue(colour="red"), tmp_path, 1e9)


class _Client:
    def __init__(self, *memories: float) -> None:
        self._workers = {str(k): {"nthreads": 2, "resources": {"memory": m} if m else {}} for k, m in enumerate(memories)}

    def scheduler_info(self, n_workers: int) -> dict[str, Any]:
        return {"workers": self._workers}


def test_workers_that_say_how_much_memory_they_have() -> None:
    site = existing(_Client(8e9, 4e9), Compute(), Needs(1, 2e9))
    assert site.asked == {"memory": 2e9}
    assert site.slots == 4
    assert existing(_Client(8e9, 0.0), Compute(), Needs(1, 2e9)).asked == {}  # one says nothing: it could never be asked
    assert existing(_Client(), Compute(), Needs(1, 2e9)).asked == {}
    with pytest.raises(DoesNotFit, match="a case takes about 9 GB, workers offer 8 GB at most"):
        existing(_Client(8e9, 4e9), Compute(), Needs(1, 9e9))
