"""A SLURM on this machine alone: daemons with their own configuration, started as root."""

import os
import secrets
import shutil
import socket
import subprocess
import time
from contextlib import contextmanager
from pathlib import Path

PROGRAMS = ("sbatch", "squeue", "scancel", "scontrol", "slurmctld", "slurmd", "munged", "munge")
KEY = Path("/etc/munge/munge.key")

CONFIGURATION = """\
ClusterName=one
SlurmctldHost={host}
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
ReturnToService=2
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
MpiDefault=none
KillWait=20
NodeName={host} CPUs={cpus} RealMemory=4000 State=UNKNOWN
PartitionName=debug Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""


def missing():
    """Why there can be no SLURM here; empty if there can."""
    if os.getuid() != 0:
        return "only root can start SLURM"
    absent = [name for name in PROGRAMS if shutil.which(name) is None]
    return f"{', '.join(absent)} not installed (slurm-wlm, munge)" if absent else ""


@contextmanager
def one_node_slurm(folder):
    """Start it; gives the environment that its commands need."""
    host = socket.gethostname().split(".")[0]
    for name in ("state", "spool"):
        (folder / name).mkdir()
    configuration = folder / "slurm.conf"
    configuration.write_text(
        CONFIGURATION.format(host=host, folder=folder, cpus=os.cpu_count(), ports=_free_ports())
    )
    _start_munge()
    daemons = [
        subprocess.Popen(
            [name, "-D", "-f", configuration], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        for name in ("slurmctld", "slurmd")
    ]
    found = {"SLURM_CONF": str(configuration)}
    try:
        _wait_until_idle({**os.environ, **found}, folder)
        yield found
    finally:
        subprocess.run(
            ["scancel", "--user=root"], env={**os.environ, **found}, check=False,
            capture_output=True,
        )  # fmt: skip
        for daemon in reversed(daemons):
            daemon.terminate()
        for daemon in daemons:
            try:
                daemon.wait(10.0)
            except subprocess.TimeoutExpired:
                daemon.kill()


def _free_ports():
    with socket.socket() as one, socket.socket() as two:
        for found in (one, two):
            found.bind(("127.0.0.1", 0))
        return [found.getsockname()[1] for found in (one, two)]


def _start_munge():
    if subprocess.run(["munge", "-n"], check=False, capture_output=True).returncode == 0:
        return
    for path in (Path("/run/munge"), Path("/var/log/munge"), Path("/var/lib/munge"), KEY.parent):
        path.mkdir(parents=True, exist_ok=True)
    if not KEY.exists():
        KEY.write_bytes(secrets.token_bytes(1024))
    for path in (
        Path("/run/munge"), Path("/var/log/munge"), Path("/var/lib/munge"), KEY.parent, KEY,
    ):  # fmt: skip
        shutil.chown(path, "munge", "munge")
    KEY.chmod(0o400)
    KEY.parent.chmod(0o700)
    Path("/run/munge").chmod(0o755)
    subprocess.run(
        ["setpriv", "--reuid=munge", "--regid=munge", "--clear-groups", "munged", "--force"],
        check=True,
        capture_output=True,
    )


def _wait_until_idle(environment, folder):
    for _ in range(150):
        done = subprocess.run(
            ["sinfo", "-h", "-o", "%T"], env=environment, check=False, capture_output=True,
            text=True,
        )  # fmt: skip
        if "idle" in done.stdout:
            return
        time.sleep(0.2)
    raise RuntimeError((folder / "slurmctld.log").read_text()[-2000:])
