"""Every command once, with its help and a wrong line, of the package of this interpreter.

Prints what went wrong, a line each, and how many lines were tried; needs all extras, and nothing of
the tests' own.
"""

import contextlib
import io
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from unittest import mock

sys.path.insert(0, str(Path(__file__).parent))

from scenes import CONDUCTING, RAIN, SMALL, WARM
from shaped_run import write_shaped_run

STUDY = """\
[study]
name = "drawn"
scenario = "small.toml"
[set]
"loading.1.until.strain.value" = 0.02
[vary]
sample = { kind = "KIND", count = 4 }
"contacts.0.friction" = { from = 0.2, to = 0.5 }
[[observe]]
name = "steps"
info = "step"
"""

LINES = """\
doctor
schema
new mine
validate small.toml
run small.toml -o run
run warm.toml -o warm
run packed.toml -o packed
run rain.toml -o rain
info run
verify run
report run --frames 3
bench bed --grains 1000 --rounds 1
post profile run --plot profile.png
post theta-eta warm --wall floor --plot theta.svg
post map warm --of temperature --plot map.pdf
post map warm --plot term
post forces run --plot forces.png
post rheology run --from 0 --plot rheology.png
post forces run --mobilization --plot mobilization.png
post fabric run --from 0 --plot fabric.png
post lifetimes run --from 0 --plot lifetimes.png
post chains run --plot chains.png
post chains run --frame -1 --plot chain-map.png
post clusters run --plot clusters.png
post conductivity packed --frames : --plot conductivity.png
post conductivity packed --network --plot network.png
post heat-network warm --frame 5 --plot heat.png
post wall-heat warm --from 0 --plot walls.png
post hot-spots warm --from 0 --plot spots.png
post diffusion run --margin 1 --from 0 --plot diffusion.png
post structure packed --factor --plot structure.png
post mixing rain --plot mixing.png
post mixing rain --profile share --frames 1: --plot segregation.png
post residence rain --plot residence.png
post avalanches run --of kinetic --plot drops.png
post structure packed --voronoi --plot cells.png
post correlation run --margin 0 --plot correlation.png
post region run --in {min=[0.0,0.002],max=[0.01,0.006]} --plot region.png
post fields run --plot fields.png
post energy warm --plot energy.png
post compare run run --plot compare.png
post series run --plot series.png
post flow run --from 0 --line 0.01,0.0:0.01,0.01 --plot flow.png
post animate run -o film.gif --frames 0:3
export gsd run -o run.gsd
export vtkhdf shaped -o grains.vtkhdf
export csv run -o tables --frames 0:2
export fclib run -o problem.h5 --frame 1
study validate latin-hypercube.toml
study validate sobol.toml
study run sobol.toml
study status sobol.toml
study table sobol.toml --parquet table.parquet
study plot sobol.toml steps.png --of steps --against contacts.0.friction --fit line
study report sobol.toml --runs
study cancel sobol.toml"""
"""A line for each command; those that need another's files come after it."""


def commands(node, path=()):
    """Words of every command below a node, and whether it can be called without more."""
    if hasattr(node, "commands"):
        for name, below in node.commands.items():
            yield from commands(below, (*path, name))
    else:
        yield path, not any(parameter.required for parameter in node.params)


def run_here(words):
    """Run what ends with a text in this process, which need not start another."""
    from multicor_cli.cli.app import main

    out, err = io.StringIO(), io.StringIO()
    with (
        mock.patch.object(sys, "argv", ["multicor", *words]),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        try:
            main()
            code = 0
        except SystemExit as leave:
            code = leave.code if isinstance(leave.code, int) else int(leave.code is not None)
    return subprocess.CompletedProcess(words, code, out.getvalue(), err.getvalue())


def run(folder, words):
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    command = [sys.executable, "-P", "-m", "multicor_cli", *words]
    return subprocess.run(
        command, cwd=folder, env=kept, capture_output=True, text=True, timeout=900, check=False
    )


def fault(words, done, code):
    """What is wrong with how a command ended; empty if nothing is."""
    said = done.stdout + done.stderr
    is_right = done.returncode == code and not any(
        word in said for word in ("Traceback", "internal error", "Warning:")
    )
    return (
        ""
        if is_right
        else f"{' '.join(words)}: exit code {done.returncode}, not {code}: {said.strip()[-400:]}"
    )


def main():
    from typer.main import get_command

    from multicor_cli.cli.app import app

    known = dict(commands(get_command(app)))
    lines = [line.split() for line in LINES.splitlines()]
    called = {path for path in known if any(tuple(words[: len(path)]) == path for words in lines)}
    faults = [f"{' '.join(path)}: is not called here" for path in known if path not in called]
    texts = [([*path, "--help"], 0) for path in known]
    texts += [([*path, "--no-such-option"], 2) for path in known]
    texts += [(list(path), 2) for path, is_whole in known.items() if not is_whole]
    texts += [
        (["--help"], 0), (["--version"], 0), (["nonsense"], 2),
        (["new", "x", "--template", "none"], 2),
    ]  # fmt: skip
    faults += [text for words, code in texts if (text := fault(words, run_here(words), code))]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for file, text in {
            "small": SMALL,
            "warm": WARM,
            "packed": CONDUCTING,
            "rain": RAIN,
        }.items():
            (folder / f"{file}.toml").write_text(text)
        write_shaped_run(folder / "shaped")
        for kind in ("sobol", "latin-hypercube"):
            (folder / f"{kind}.toml").write_text(STUDY.replace("KIND", kind))
        faults += [text for words in lines if (text := fault(words, run(folder, words), 0))]
    for text in faults:
        print(text)
    print(f"{len(texts) + len(lines)} lines, {len(faults)} faults")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
