"""Short runs between walls of every kind, to be read: sixty grains pressed, heated, moved."""

import tomllib
from dataclasses import dataclass

import tomli_w
from scenarios import document

FLOOR, LID, PERIOD = 0.005, 0.045, 0.06
"""Heights of floor and, at first, lid [m], where glued grains have centers; the period [m]."""

FRICTION, COUNT = 0.4, 60

_REST = """
heat = { temperature = 300.0, gas = { conductivity = 0.026, reach = 0.5 } }
[[loading]]
name = "gather"
duration = 0.025
[[loading]]
name = "soak"
duration = 2000.0
frozen = true
dt = 500.0
[[loading]]
name = "move"
duration = 0.016
"""


def _level(text: str, y: float, last: str = "") -> str:
    """A wall across the period, between two points at its height."""
    return text.replace("ENDS", f"from = [0, {y}], to = [0.06, {y}]") + last


def _rough(sizes: str) -> tuple[str, str]:
    return (
        _level('kind = "rough", ENDS, side = "left"', FLOOR, sizes),
        _level('kind = "rough", ENDS, side = "right"', LID, sizes),
    )


LAYERS = {
    "planes": (
        'kind = "plane", point = [0, 0.005], normal = [0, 1]',
        'kind = "plane", point = [0, 0.045], normal = [0, -1]',
    ),
    "lines": (
        'kind = "polyline", points = [[0, 0.005], [0.06, 0.005]]',
        'kind = "polyline", points = [[0, 0.045], [0.03, 0.045], [0.06, 0.045]]',
    ),
    "polygons": (
        'kind = "polygon", points = [[0.002, 0], [0.058, 0], [0.058, 0.005], [0.002, 0.005]], grains = "outside"',
        'kind = "polygon", points = [[0.002, 0.045], [0.058, 0.045], [0.058, 0.05], [0.002, 0.05]], grains = "outside"',
    ),
    "boxes": (
        'kind = "box", min = [0, 0.005], max = [0.06, 0.02], open = ["left", "right", "top"]',
        'kind = "box", min = [0, 0.03], max = [0.06, 0.045], open = ["left", "right", "bottom"]',
    ),
    "rough": _rough(""),
    "rough, one larger": _rough(
        ', sizes = { kind = "list", radii = [1.8e-3, 2.5e-3], fractions = [0.9, 0.1] }'
    ),
    "rough, unequal": _rough(', sizes = { kind = "uniform", min = 1e-3, max = 4e-3 }'),
    "rough, of few grains": _rough(', sizes = { kind = "list", radii = [6e-3, 9e-3] }'),
    "clusters": (
        f'kind = "cluster", discs = {[[4e-3 * k + 2e-3, FLOOR, 2e-3] for k in range(14)]}',
        f'kind = "cluster", discs = {[[8e-3 * k + 4e-3, LID, 4e-3 - 1e-4 * k] for k in range(7)]}',
    ),
}
"""Geometries of a floor and a lid; with the mixed ones below, of every kind that bounds a layer."""
LAYERS["plane and rough"] = (LAYERS["planes"][0], LAYERS["rough"][1])
LAYERS["rough and lines"] = (LAYERS["rough, one larger"][0], LAYERS["lines"][1])

SEEDS = {"rough": (1, 2), "rough, one larger": (1, 2, 3), "rough, unequal": (1, 2)}
SMOOTH = ("planes", "lines", "polygons", "boxes")

_INSIDE = "min = [0.005, 0.005], max = [0.055, 0.065]"
_CORNERS = "[[0.005, 0.005], [0.055, 0.005], [0.055, 0.065], [0.005, 0.065]]"
_DRUM = 'kind = "circle", center = [0.03, 0.03], radius = 0.03'
_SIDES = {
    "left": 'kind = "plane", point = [0.005, 0], normal = [1, 0]',
    "right": 'kind = "plane", point = [0.055, 0], normal = [-1, 0]',
}

ROOMS = {
    "drum": {"drum": _DRUM},
    "rough drum": {"drum": f'{_DRUM}, rough = "grains"'},
    "closed box": {"box": f'kind = "box", {_INSIDE}'},
    "open box": {"box": f'kind = "box", {_INSIDE}, open = ["top"]'},
    "polygon": {"room": f'kind = "polygon", points = {_CORNERS}, grains = "inside"'},
    "box of planes": {"floor": LAYERS["planes"][0], "lid": LAYERS["planes"][1].replace("0.045",
        "0.065"), **_SIDES},
    "no walls": {},
}  # fmt: skip
"""Geometries of what grains lie in, by the names of the walls; the first one is hot."""

CHANNELS = {
    "channel": {"floor": LAYERS["rough"][0]},
    "smooth channel": {"floor": LAYERS["planes"][0]},
    "channel under a lid": {"floor": LAYERS["rough"][0], "lid": LAYERS["rough"][1].replace("0.045",
        "0.075")},
}  # fmt: skip
"""Floors that grains fall on, in a periodic domain; the floor is hot."""


@dataclass(frozen=True)
class Walled:
    kind: str
    seed: int

    @property
    def is_layer(self) -> bool:
        """Whether grains without weight are pressed between a floor and a lid."""
        return self.kind in LAYERS

    @property
    def walls(self) -> dict[str, str]:
        if self.is_layer:
            return dict(zip(("floor", "lid"), LAYERS[self.kind], strict=True))
        return {**ROOMS, **CHANNELS}[self.kind]

    @property
    def bounds(self) -> tuple[str, str]:
        """Names of the walls below and above the grains; empty where there is none."""
        return "floor" if "floor" in self.walls else "", "lid" if "lid" in self.walls else ""

    @property
    def is_periodic(self) -> bool:
        """Whether there are no side walls."""
        return self.kind not in ROOMS

    @property
    def text(self) -> str:
        walls = {
            name: {"geometry": tomllib.loads(f"it = {{ {shape} }}")["it"], "mass": 1e-3}
            for name, shape in self.walls.items()
        }
        for hot in [*walls.values()][:1]:
            hot["thermal"] = {"temperature": 400.0}
        low, high = (0.0095, 0.0405) if self.is_layer else (0.01, 0.06)
        left, right = (0.0, PERIOD) if self.is_periodic else (0.008, 0.052)
        mover, move = self.bounds[1] if self.is_periodic else "", {"x": {"velocity": 0.2}}
        if "few" in self.kind:
            low, high = 0.017, 0.034
        if "drum" in self.kind:
            low, high, left, right = 0.012, 0.048, 0.012, 0.048
            mover, move = "drum", {"spin": {"velocity": 5.0}}
        tables = document(
            _REST, name="walled", seed=self.seed, size=[0.06, 0.08], periodic=self.is_periodic,
            gravity=[0, 0] if self.is_layer or not self.walls else [0, -50],
            friction=FRICTION, walls=walls, dt=5e-4, frame_interval=2e-3,
            grains={
                "shape": "sphere", "sizes": {"kind": "uniform", "min": 1.6e-3, "max": 2.4e-3},
                "count": COUNT, "region": {"min": [left, low], "max": [right, high]},
            },
        )  # fmt: skip
        gather, _, moving = tables["loading"]
        if self.is_layer:
            gather["drives"] = {"lid": {"y": {"force": -0.5, "damping": 0.5}}}
        if mover:
            moving["drives"] = {mover: move}
        return tomli_w.dumps(tables)


RUNS = [
    Walled(kind, seed) for kind in (*LAYERS, *ROOMS, *CHANNELS) for seed in SEEDS.get(kind, (1,))
]
