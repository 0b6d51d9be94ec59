"""What commands refuse: the exit code, one clear message, nothing on stdout and no file."""

import pytest

NO_RUN = [
    "info HERE", "verify HERE", "report HERE", "post profile HERE", "post theta-eta HERE",
    "post map HERE", "post forces HERE",
    "post rheology HERE", "post energy HERE", "post compare HERE HERE", "export csv HERE -o more",
]  # fmt: skip

NO_SENSE = {
    "nosuch": "Usage",
    "run": "Usage",
    "run a.toml --nosuch": "Usage",
    "run a.toml --threads x": "Usage",
    "post theta": "Usage",
    "new 'a b'": "a b",
    "new a --template nosuch": "nosuch",
    "run SMALL -o ''": "the name is empty",
    "post profile RUN --json --csv": "--csv",
    "post profile RUN --of wetness": "wetness",
    "post profile RUN --frames 3": "--frames",
    "post profile RUN --frames a:b": "--frames",
    "post profile RUN --frames 1:2 --to 3": "--frames",
    "post profile RUN --from 1e9": "no frame",
    "post profile RUN --plot figure.gif": ".gif",
    "post profile RUN --bins 0": "--bins",
    "post profile RUN --bin-width 0": "bins cannot be 0 mean diameters wide: choose at least",
    "post profile RUN --bin-width 1e-9": "bins cannot be 1e-09 mean diameters wide: choose at",
    "post profile RUN --bins 3 --bin-width 2": "exclude each other",
    "post profile RUN --exclude-walls 99": "nothing is left",
    "post theta-eta HEATED": "--wall",
    "post theta-eta HEATED --wall lid": "no wall 'lid'",
    "post theta-eta HEATED --wall bottom": "--reference",
    "post theta-eta HEATED --wall top --frame 99": "no frame 99",
    "post theta-eta HEATED --wall top --grains": "--grains needs",
    "post theta-eta HEATED --wall top --height -1": "positive",
    "post forces RUN --angles --distribution": "exclude each other",
    "post forces RUN --angles --mobilization": "exclude each other",
    "post forces RUN --frames 1:": "needs --distribution, --angles or --mobilization",
    "post fabric RUN --margin 99": "no bulk is left",
    "post lifetimes RUN --frames -1:": "lifetimes need two frames",
    "post chains RUN --angle 90": "between 0 and 90 degrees",
    "post chains RUN --frame 0 --lengths": "--lengths and --frame exclude each other",
    "post chains RUN --frame 0 --frames 1:": "leave out --frames",
    "post chains RUN --frame 999": "no frame 999",
    "post rheology RUN --from 0 --margin 99": "no bulk is left",
    "post rheology RUN --frames -1:": "needs two frames",
    "post conductivity RUN": "the run has no heat",
    "post conductivity HEATED --from 0 --margin 1": "--margin needs --network",
    "post conductivity HEATED --frames -1:": "what flows needs two frames",
    "post heat-network RUN": "the run has no heat",
    "post heat-network HEATED --frame 99": "no frame 99",
    "post wall-heat RUN": "the run has no heat",
    "post wall-heat HEATED --wall lid": "no wall 'lid'",
    "post wall-heat HEATED --near 0": "must be positive",
    "post hot-spots HEATED": "spots need young",
    "post diffusion RUN --frames -2:": "needs three frames, not 2",
    "post structure RUN --factor": "needs a cell that is periodic in x and y",
    "post structure RUN --reach 1e9": "--reach 1e+09 is too far",
    "post structure RUN --reach 1e308": "--reach 1e+308 is too far",
    "post fields RUN --radial --center 1e18,0": "the center lies 1e+18 m away from all grains",
    "post fields RUN --radial --center 1e300,0": "the center lies 1e+300 m away from all grains",
    "post structure RUN --margin 1e9": "lower --margin",
    "post structure RUN --bins 0": "--bins",
    "post mixing RUN": "there is only",
    "post mixing RUN --group none": "there is no group 'none'",
    "post mixing RUN --times 2": "--times needs --profile",
    "post mixing RUN --profile size --cell 5": "--cell excludes --profile",
    "post mixing RUN --profile mass": "there is no profile of 'mass'",
    "post mixing RUN --profile share": "there is only",
    "post mixing RUN --profile size --times 9999": "cannot be parted into 9999 times",
    "post residence RUN": "no grain comes or goes",
    "post avalanches RUN": "--of",
    "post avalanches RUN --of nothing": "the time series has no 'nothing'",
    "post avalanches RUN --of force_x": "are several columns",
    "post avalanches RUN --of kinetic --threshold -1": "must be positive",
    "post avalanches RUN --of kinetic --threshold 1e9": "never drops",
    "post map RUN --scale 3:1": "is no range",
    "post map RUN --scale 0": "is no range",
    "post map RUN --scale nan:1": "is no range",
    "post map RUN --of group --scale 0:1 --plot term": "has no scale",
    "post forces RUN --scale 0": "positive force",
    "post forces RUN --scale 1 --angles": "positive force",
    "post structure RUN --factor --margin 2": "--factor excludes --margin",
    "post structure RUN --voronoi --factor": "--voronoi excludes --factor",
    "post structure RUN --voronoi --reach 2": "--voronoi excludes --reach",
    "post structure RUN --voronoi --margin -1": "must not be negative",
    "post correlation RUN --reach 1e9": "--reach 1e+09 is too far",
    "post correlation RUN --margin 1e9": "lower --margin",
    "post map RUN --of d2min --frame 0": "since the frame before; frame 0 has none",
    "post profile RUN --of d2min --frames -1:": "needs two frames; only one is selected",
    "post region RUN --in circle": "is not a region",
    "post region RUN --in '{ min = [0, 0], max = [0, 1] }'": "not above and to the right",
    "post region RUN --in '{ kind = \"circle\", center = [0, 0] }'": "radius",
    "post region RUN --in '{ min = [50, 50], max = [51, 51] }'": "no grain is in the region",
    "post energy RUN --from 1e9": "no row in this time",
    "post compare RUN RUN --of wetness": "choose from",
    "post compare RUN RUN --of stress": "several components",
    "post compare RUN HEATED --of temperature": "full: the run has no heat",
    "post compare HEATED RUN --of temperature": "full: the run has no heat",
    "post animate RUN --of heat -o a.gif": "has no heat",
    "post animate RUN --of wetness -o a.gif": "wetness",
    "post animate RUN -o a.avi": ".mp4 or .gif",
    "post animate RUN --frames 99: -o a.gif": "no frame is selected",
    "report HEATED -o page.txt": ".html",
    "report HEATED --frames 0": "--frames",
    "export csv RUN -o more --frames 1000:": "from 0 to",
    "export csv RUN -o more --frames x": "--frames",
    "export fclib RUN -o b.hdf5 --frame 500": "500",
}

OTHERS = {
    "run SMALL -o SMALL/run": (6, "small.toml is not a directory; choose another with -o"),
    "report HEATED -o no/such/folder/page.html": (5, "No such file"),
    "post animate RUN -o no/such/folder/a.gif": (5, "No such file"),
    "post profile RUN --plot SMALL/p.png": (5, "small.toml"),
    "validate nosuch.toml": (3, "nosuch.toml"),
    "validate .": (3, "."),
}

NO_HEAT = ["profile RUN --of temperature", "profile RUN --of heat", "theta-eta RUN", "map RUN"]


@pytest.mark.parametrize(("line", "code", "words"), [
    *((line, 6, "") for line in NO_RUN),
    *((line, 2, words) for line, words in NO_SENSE.items()),
    *((line, *said) for line, said in OTHERS.items()),
    *((f"post {line}", 2, "has no heat") for line in NO_HEAT),
])  # fmt: skip
def test_it_is_refused_in_one_way(line, code, words, typed, tmp_path):
    done = typed(line.replace("HERE", str(tmp_path)), code)
    said = " ".join(done.stderr.replace("│", " ").split())
    assert (words or str(tmp_path)) in said
    assert done.stdout == ""
    assert not any(word in said for word in ("internal error", "Traceback"))
    assert list(tmp_path.iterdir()) == []
    if code == 6 or line in OTHERS or words == "has no heat":
        assert len(done.stderr.splitlines()) == 1 or "frames from" in done.stderr
    if words == "has no heat" and "animate" not in line:
        assert "[heat]" in said
