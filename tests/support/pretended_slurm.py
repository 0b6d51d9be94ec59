"""A SLURM that is none: ``sbatch`` starts the job on this machine at once, ``scancel`` ends it."""

import os

import psutil

TAG = "PRETENDED_SLURM"
"""Variable that every process of a study has whose jobs these are, and each that it starts."""

SBATCH = """\
#!/bin/sh
cp "$1" "$PRETENDED_SLURM/job-$$.sh"  # the client removes its own
setsid bash "$PRETENDED_SLURM/job-$$.sh" >"$PRETENDED_SLURM/job-$$.log" 2>&1 </dev/null &
echo "Submitted batch job $!"
"""
SCANCEL = """\
#!/bin/sh
kill -- "-$1"
"""


def pretend_slurm(folder):
    """Write the commands; gives the environment with which they are found."""
    folder.mkdir()
    for name, text in (("sbatch", SBATCH), ("scancel", SCANCEL)):
        (folder / name).write_text(text)
        (folder / name).chmod(0o755)
    return {TAG: str(folder), "PATH": f"{folder}{os.pathsep}{os.environ['PATH']}"}


def processes_of(tag):
    """All processes with this value of the variable."""
    found = []
    for process in psutil.process_iter():
        try:
            if process.environ().get(TAG) == tag:
                found.append(process)
        except psutil.Error:
            continue
    return found
