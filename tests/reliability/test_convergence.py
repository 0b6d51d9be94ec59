"""A step whose contact problem was not solved to the tolerance is never silent."""

import re

from command_line import call, read_info
from scenes import write_small

from multicor_cli.store import open_run

RUN = (
    "run", "small.toml", "-o", "run", "-q", "--set", "solver.max_sweeps=3",
    "--set", "solver.tolerance_rms=1e-6",
)  # fmt: skip


def test_unconverged_steps_are_counted_and_told(tmp_path):
    write_small(tmp_path)
    done = call(*RUN, cwd=tmp_path)
    assert done.returncode == 0
    info = read_info(tmp_path / "run")
    count = info["solver"]["unconverged_steps"]
    line = next(line for line in done.stderr.splitlines() if "steps not converged" in line)
    assert f"({count} of {info['step']})" in line
    assert 0 < count <= info["step"]
    with open_run(tmp_path / "run") as run:
        assert run.series["unconverged"].sum() == count
        worst = int(run.series["residual_rms"].argmax())
        residual, step = run.series["residual_rms"][worst], run.series["step"][worst]
    assert residual > 1e-6
    assert info["worst_step"]["step"] == step
    shown = call("info", "run", cwd=tmp_path).stdout
    assert f"({count} of {info['step']})" in shown
    assert f"{residual:.4g} of the reference velocity (rms of a step), by step {step}" in shown


def test_or_stop_the_run_where_asked(tmp_path):
    write_small(tmp_path)
    done = call(*RUN, "--set", 'solver.on_failure="error"', cwd=tmp_path)
    assert done.returncode == 4
    assert re.search(r"step \d+: the contact solver did not converge in 3 sweeps: rms", done.stderr)
    assert "Traceback" not in done.stderr
    assert read_info(tmp_path / "run")["status"] == "failed"
