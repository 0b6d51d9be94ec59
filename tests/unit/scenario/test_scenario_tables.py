"""Tables of sizes and signals, given in the scenario or read from CSV files."""

import pytest
from scenario_problems import problems_of
from scenes import SHEAR, changed

from multicor_cli.scenario import load_scenario


def load(path, *changes):
    (path / "shear.toml").write_text(changed(SHEAR, *changes))
    return load_scenario(path / "shear.toml")


def sizes_line():
    return next(line for line in SHEAR.splitlines() if line.startswith("sizes = "))


def signal_text():
    start = SHEAR.index("ramp = [0.0, 0.1]")
    return SHEAR[start : SHEAR.index("}", start)].strip()


def test_a_sieve_curve_from_a_file_is_the_table_with_its_numbers(tmp_path):
    (tmp_path / "sieve.csv").write_text(
        "# by laser\nDiameter, note, passing\n0.0008,a,0\n\n0.001,b,0.25\n0.0012,c,1\n"
    )
    read = load(tmp_path, (sizes_line(), 'sizes = { kind = "table", file = "sieve.csv" }'))
    given = load(tmp_path, (
        sizes_line(),
        (
            'sizes = { kind = "table", radii = [0.4e-3, 0.5e-3, 0.6e-3], passing = [0.0, '
            "0.25, 1.0] }"
        ),
    ))  # fmt: skip
    assert read == given
    assert read.particles[0].sizes.by == "mass"
    (tmp_path / "resolved.toml").write_text(read.resolved_toml())
    (tmp_path / "sieve.csv").unlink()  # what a run keeps does not need it
    assert load_scenario(tmp_path / "resolved.toml") == read


def test_a_signal_from_a_file_is_the_table_with_its_numbers(tmp_path):
    (tmp_path / "motion.csv").write_text("time,value\n0,0\n0.1,0.1\n")
    read = load(tmp_path, (signal_text(), 'file = "motion.csv"'))
    assert read == load(tmp_path, (signal_text(), "times = [0.0, 0.1], values = [0.0, 0.1]"))


def test_a_sine_has_a_period_or_a_frequency(tmp_path):
    by_period = load(tmp_path, (signal_text(), "sine = { amplitude = 0.1, period = 0.02 }"))
    by_frequency = load(tmp_path, (signal_text(), "sine = { amplitude = 0.1, frequency = 50.0 }"))
    assert [str(drive) for drive in by_period.drives()] == [
        str(drive) for drive in by_frequency.drives()
    ]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ((sizes_line(), 'sizes = { kind = "table", file = "none.csv" }'), ["sizes.file", "no file 'none.csv'", "relative to"]),
        ((sizes_line(), 'sizes = { kind = "table" }'), ["particles.0.sizes", "two rows", "radii and passing, or file"]),
        ((sizes_line(), 'sizes = { kind = "table", file = "x.csv", radii = [1e-3, 2e-3] }'), ["sizes.radii", "both file and radii", "one of them"]),
        ((sizes_line(), 'sizes = { kind = "table", radii = [4e-4, 6e-4], passing = [0.1, 1.0] }'), ["sizes.passing", "from 0.1 to 1", "begin with"]),
        ((sizes_line(), 'sizes = { kind = "table", radii = [4e-4, 5e-4, 6e-4], passing = [0.0, 2.0, 1.0] }'), ["sizes.passing.1", "2"]),
        ((sizes_line(), 'sizes = { kind = "table", radii = [4e-4, 5e-4, 5.5e-4, 6e-4], passing = [0.0, 0.6, 0.5, 1.0] }'), ["sizes.passing", "falls from 0.6 to 0.5", "cumulated"]),
        ((sizes_line(), 'sizes = { kind = "table", radii = [6e-4, 4e-4], passing = [0.0, 1.0] }'), ["sizes.radii", "must ascend", "sort the rows"]),
        ((sizes_line(), 'sizes = { kind = "normal", mean = 1e-3, sigma = 1e-4, min = 4e-4, max = 6e-4 }'), ["sizes.mean", "the mean 0.001 is outside", "between the two"]),
        ((signal_text(), "sine = { amplitude = 0.1 }"), ["velocity.sine", "neither period nor frequency", "give one of them"]),
        ((signal_text(), "sine = { amplitude = 0.1, period = 1.0, frequency = 1.0 }"), ["velocity.sine", "both period and frequency", "give one of them"]),
    ],
)  # fmt: skip
def test_mistakes(change, words):
    [problem] = problems_of(changed(SHEAR, change))
    assert [word for word in words if word not in str(problem)] == []


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("", ["is empty", "let the first line name the columns"]),
        ("time,speed\n0,0\n", ["no column value", "time,value"]),
        ("time,value,value\n0,0,1\n", ["several columns value", "time,value"]),
        ("time,value\n0,zero\n", ["line 2 of 'motion.csv'", "'zero' is not a number"]),
        ("time,value\n0\n", ["line 2 of 'motion.csv'", "'' is not a number"]),
        ("time,value\n0,nan\n", ["velocity", "line 2 of 'motion.csv'", "value = 'nan' is not finite"]),
        ("# in s\ntime,value\n\n0,0\n1,1e300\n", ["line 5 of 'motion.csv'", "value = '1e300' is not between -1e+12 and 1e+12"]),
        ("time,value\n-1,0\n", ["line 2 of 'motion.csv'", "time = '-1' is not between 0 and 1e+12"]),
        (b"time,value\n0,\xff\n", ["cannot be read", "UTF-8"]),
    ],
)  # fmt: skip
def test_mistakes_in_files(tmp_path, content, words):
    (tmp_path / "motion.csv").write_bytes(
        content if isinstance(content, bytes) else content.encode()
    )
    with pytest.raises(Exception, match=r"motion|velocity") as caught:
        load(tmp_path, (signal_text(), 'file = "motion.csv"'))
    assert [word for word in words if word not in str(caught.value)] == []
