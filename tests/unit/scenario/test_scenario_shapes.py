"""Shapes of grains and their orientation: what is right, and what is refused and how."""

import json

import numpy as np
import pytest
from scenario_problems import check_one
from scenarios import toml

from multicor_cli.packing import build
from multicor_cli.scenario import parse_scenario

FIVE = {"kind": "polygon", "sides": 5}


def clump(*pieces):
    return {"kind": "clump", "pieces": list(pieces)}


def drawn(rows, *holes):
    every = [*rows, *(row for hole in holes for row in hole)]
    columns = zip(("grain", "x", "y"), zip(*every, strict=True), strict=True)
    ring = [k for k, part in enumerate((rows, *holes)) for _ in part]
    return {"kind": "file", **{key: list(column) for key, column in columns}} | (
        {"ring": ring} if holes else {}
    )


BOX = [(1.0, 0.0, 0.0), (1.0, 2.0, 0.0), (1.0, 2.0, 1.0), (1.0, 0.0, 1.0)]

# shape, further keys of the group, key below the group, words that the message must have
MISTAKES = {
    "unknown shape": ({"kind": "hexagon"}, {}, "shape.kind", "'polygon'"),
    "no word": ("disk", {}, "shape", "'disc', 'sphere'", "mean 'disc'"),
    "kind in place of its table": ("ellipse", {}, "shape", "'disc', 'sphere'", 'write { kind = "ellipse", … }'),
    "word of no kind": ("square", {}, "shape", "'disc', 'sphere'", 'as { kind = "polygon", sides = 5 }'),
    "number": (5, {}, "shape", "5 is not one of", 'as { kind = "polygon", sides = 5 }'),
    "key of another shape": ({"kind": "rod", "aspect": 2.0, "sides": 3}, {}, "shape.sides", 'unknown key of kind = "rod"', "'polygon', 'ellipse'"),
    "key of one other shape": ({"kind": "ellipse", "aspect": 2.0, "irregular": 0.1}, {}, "shape.irregular", "belongs to 'polygon'"),
    "misspelled key": ({"kind": "polygon", "sides": 5, "iregular": 0.1}, {}, "shape.iregular", "'irregular'"),
    "no sides": ({"kind": "polygon"}, {}, "shape", "neither sides nor vertices", "give one"),
    "both": ({**FIVE, "vertices": [[0, 0], [1, 0], [0, 1]]}, {}, "shape", "both sides and vertices"),
    "few sides": ({"kind": "polygon", "sides": 2}, {}, "shape.sides", "at least 3"),
    "many sides": ({"kind": "polygon", "sides": 65}, {}, "shape.sides", "at most 64"),
    "not convex": ({"kind": "polygon", "vertices": [[0, 0], [4, 0], [1, 1], [0, 4]]}, {}, "shape.vertices.2", "not convex at [1.0, 1.0]", '"clump"'),
    "clockwise and not convex": ({"kind": "polygon", "vertices": [[0, 4], [1, 1], [4, 0], [0, 0]]}, {}, "shape.vertices.1", "not convex"),
    "crossed": ({"kind": "polygon", "vertices": [[0, 0], [1, 1], [1, 0], [0, 1]]}, {}, "shape.vertices.0", "crosses"),
    "on a line": ({"kind": "polygon", "vertices": [[0, 0], [1, 1], [3, 3]]}, {}, "shape.vertices.0", "back on itself"),
    "corner twice": ({"kind": "polygon", "vertices": [[0, 0], [1, 0], [1, 0]]}, {}, "shape.vertices.2", "given twice"),
    "stretched corners": ({"kind": "polygon", "vertices": [[0, 0], [1, 0], [0, 1]], "elongation": 2.0}, {}, "shape.elongation", "regular polygons"),
    "too round": ({**FIVE, "rounding": 1.0}, {}, "shape.rounding", "0.99"),
    "short rod": ({"kind": "rod", "aspect": 0.5}, {}, "shape.aspect", "at least 1"),
    "piece of nothing": (clump({"radius": 1.0}), {}, "shape.pieces.0", "neither center nor vertices"),
    "piece without area": (clump({"center": [0, 0]}), {}, "shape.pieces.0", "no area", "radius"),
    "line without area": (clump({"vertices": [[0, 0], [1, 0]]}), {}, "shape.pieces.0", "no area"),
    "piece not convex": (clump({"vertices": [[0, 0], [4, 0], [1, 1], [0, 4]]}), {}, "shape.pieces.0.vertices.2", "not convex"),
    "no pieces": (clump(), {}, "shape.pieces", "at least 1"),
    "outline that crosses itself": (drawn([*BOX, (2.0, 0, 0), (2.0, 4, 4), (2.0, 4, 0), (2.0, 0, 4)]), {}, "shape.grain", "grain 2: the side from", "crosses or touches", "make_valid"),
    "outline that touches itself": (drawn([(1.0, 0, 0), (1.0, 4, 0), (1.0, 4, 3), (1.0, 2, 0), (1.0, 0, 3)]), {}, "shape.grain", "grain 1: the side from"),
    "corners that nearly touch": (drawn([(1.0, 0, 0), (1.0, 4, 0), (1.0, 4, 3), (1.0, 2, 1e-12), (1.0, 0, 3)]), {}, "shape.grain", "nearly touch", "simplify"),
    "many pieces": (drawn([(1.0, k, k % 2) for k in range(134)] + [(1.0, 133, 5), (1.0, 0, 5)]), {}, "shape.grain", "convex pieces are more than 64", "simplify"),
    "hole beside": (drawn(BOX, [(1.0, 5, 0), (1.0, 6, 0), (1.0, 5, 1)]), {}, "shape.grain", "grain 1: hole 1 is not inside"),
    "hole that touches": (drawn(BOX, [(1.0, 0.5, 0), (1.0, 1, 0.5), (1.0, 0.5, 0.5)]), {}, "shape.grain", "hole 1 is not inside"),
    "hole in a hole": (drawn(BOX, [(1.0, 0.1, 0.1), (1.0, 1.5, 0.1), (1.0, 0.1, 0.9)], [(1.0, 0.2, 0.2), (1.0, 0.4, 0.2), (1.0, 0.2, 0.4)]), {}, "shape.grain", "holes 1 and 2 touch or overlap"),
    "hole around a hole": (drawn(BOX, [(1.0, 0.2, 0.2), (1.0, 0.4, 0.2), (1.0, 0.2, 0.4)], [(1.0, 0.1, 0.1), (1.0, 1.5, 0.1), (1.0, 0.1, 0.9)]), {}, "shape.grain", "holes 1 and 2 touch or overlap"),
    "crossed hole": (drawn(BOX, [(1.0, 0.1, 0.1), (1.0, 0.9, 0.9), (1.0, 0.9, 0.1), (1.0, 0.1, 0.9)]), {}, "shape.grain", "grain 1: hole 1: the side from"),
    "rings that descend": ({**drawn(BOX), "ring": [0, 1, 0, 1]}, {}, "shape.ring", "ring 0 follows 1"),
    "rings that lack": ({**drawn(BOX), "ring": [0, 1]}, {}, "shape", "4 corners with 2 rings"),
    "outline with two corners": (drawn([*BOX, (2.0, 0, 0), (2.0, 4, 0)]), {}, "shape.grain", "grain 2: less than three corners are left", "a third corner"),
    "outline in two parts": (drawn([*BOX, (2.0, 0, 0), (1.0, 4, 0)]), {}, "shape.grain", "grain 1 follows 2"),
    "no outline": ({"kind": "file"}, {}, "shape", "no outlines are given", "give file"),
    "no mass": ({**FIVE, "solid": 0.0}, {}, "shape.solid", "greater than 0"),
    "much inertia": ({**FIVE, "gyration": 1.1}, {}, "shape.gyration", "at most 1"),
    "inertia of a disc": ({"kind": "rod", "aspect": 1.0, "gyration": 0.9}, {}, "shape.gyration", "½ m r²"),
    "sliver": ({"kind": "polygon", "vertices": [[0, 0], [1, 0], [1, 1e-3]]}, {}, "shape", "the outline has an area of", "wider or shorter"),
    "drawn sliver": (drawn([*BOX, (2.0, 0, 0), (2.0, 4, 0), (2.0, 4, 1e-3)]), {}, "shape", "grain 2 of the outlines has an area of"),
    "center outside": ({"kind": "polygon", "vertices": [[0, 0], [1, 0], [1, 1]], "center": [0.4, 1.6], "gyration": 0.5}, {}, "shape.center", "within"),
    "center within the box around a triangle": ({"kind": "polygon", "vertices": [[0, 0], [1, 0], [1, 1]], "center": [0.1, 0.9], "gyration": 0.5}, {}, "shape.center", "convex hull"),
    "center far outside": ({"kind": "polygon", "vertices": [[0, 0], [1, 0], [1, 1]], "center": [5, 5], "gyration": 0.5}, {}, "shape.center", "within"),
    "center of a regular polygon": ({**FIVE, "center": [0, 0], "gyration": 0.5}, {}, "shape.center", "give vertices"),
    "center without inertia": ({"kind": "polygon", "vertices": [[0, 0], [1, 0], [0, 1]], "center": [0.2, 0.2]}, {}, "shape.center", "gyration too"),
    "center of a clump without inertia": ({**clump({"center": [0, 0], "radius": 1.0}, {"center": [1, 0], "radius": 1.0}), "center": [0.2, 0.2]}, {}, "shape.center", "gyration too"),
    "no thickness": (FIVE, {"thickness": None}, "", "no spheres need a thickness"),
    "placed as not drawn": (FIVE, {"packing": {"kind": "outlines"}, "sizes": None, "count": None}, "shape", "no file of outlines"),
    "turned discs": ("disc", {"orientation": {"kind": "uniform"}}, "orientation", "discs and spheres"),
    "turned discs of another name": ({"kind": "rod", "aspect": 1.0}, {"orientation": {"kind": "uniform"}}, "orientation", "discs and spheres"),
    "turned as drawn": (drawn(BOX), {"orientation": {"kind": "fixed", "angle": 1.0}, "packing": {"kind": "outlines"}, "sizes": None, "count": None}, "orientation", "no meaning", '"outlines"'),
    "sizes as drawn": (drawn(BOX), {"packing": {"kind": "outlines"}, "count": None}, "sizes", "no meaning"),
    "unknown orientation": (FIVE, {"orientation": {"kind": "random"}}, "orientation.kind", "'uniform'"),
    "too many": (FIVE, {"count": 5000}, "count", "cover more than"),
}  # fmt: skip


def text_of(shape, keys=(), **said):
    """A scenario of one group."""
    group = {
        "sizes": {"kind": "list", "radii": [1e-3]}, "count": 20, "packing": {"kind": "random"},
        "thickness": 1e-3, "shape": shape, **dict(keys),
    }  # fmt: skip
    group = {key: value for key, value in group.items() if value is not None}
    document = toml(particles=[group], **said)
    return (
        document.replace("thickness = 0.001\n", "")
        if dict(keys).get("thickness", 1) is None
        else document
    )


@pytest.mark.parametrize("name", MISTAKES)
def test_each_mistake_is_told_once_at_its_key(name):
    shape, keys, key, *words = MISTAKES[name]
    path = "particles.0" + (f".{key}" if key else "")
    check_one(text_of(shape, keys), path, None, *words)


GLASS = {
    "density": 2500.0,
    "young": 70e9,
    "poisson": 0.22,
    "conductivity": 1.0,
    "heat_capacity": 800.0,
    "emissivity": 0.9,
}

# tables beside the group, key, words
NOT_YET = {
    "rolling": ({"contacts": [{"pair": ["*", "glass"], "friction": 0.4, "rolling_friction": 0.1}]}, "contacts.0.rolling_friction", "rolling resistance of 0.1"),
}  # fmt: skip


@pytest.mark.parametrize("name", NOT_YET)
def test_what_is_not_known_of_other_shapes_is_refused(name):
    said, key, *words = NOT_YET[name]
    check_one(text_of(FIVE, **said), key, None, *words, "is not known of the grains of 'grains'")
    parse_scenario(text_of("disc", **said), "shear.toml")
    parse_scenario(text_of({"kind": "ellipse", "aspect": 1.0}, **said), "shear.toml")


@pytest.mark.parametrize("model", ["batchelor", "vargas"])
def test_gas_by_formulas_of_spheres_is_refused(model):
    said = {"heat": {"gas": {"conductivity": 0.026, "model": model}}, "materials": {"glass": GLASS}}
    text = text_of(FIVE, **said)
    check_one(text, "heat.gas.model", None, f'"{model}" is a formula for spheres', "'grains'")
    parse_scenario(text.replace(f'"{model}"', '"parallel"'), "shear.toml")


def test_grains_of_other_shapes_may_grow_and_wear():
    said = {
        "heat": {"wear_shrinks": True}, "contacts": [{"friction": 0.4, "wear": 1e-4}],
        "materials": {"glass": {**GLASS, "expansion": 9e-6, "hardness": 5e9}},
    }  # fmt: skip
    model = build(parse_scenario(text_of(FIVE, **said), "shear.toml"))[0]
    assert model.sheds
    assert model.expansion.tolist() == [9e-6]


def test_heat_of_other_shapes_has_their_perimeter():
    said = {
        "heat": {
            "impact": True, "ambient": {"temperature": 300.0, "coefficient": 10.0},
            "radiation": {"surroundings": 300.0, "neighbors": True}, "collisional": True,
            "gas": {"conductivity": 0.026},
        },
        "materials": {"glass": GLASS},
    }  # fmt: skip
    model = build(parse_scenario(text_of(FIVE, **said), "shear.toml"))[0]
    assert model.thermal.capacity == pytest.approx(800.0 * model.grains.mass)
    assert model.grains.mass == pytest.approx(2500.0 * 1e-3 * model.area)
    assert model.thermal.surface == pytest.approx(1e-3 * 10.0 * 1e-3 * np.sin(np.pi / 5))


def test_spheres_and_outlines_do_not_mix():
    first = {"name": "a", "shape": "sphere"}
    text = toml(particles=[
        {"sizes": {"kind": "list", "radii": [1e-3]}, "count": 2, "packing": {"kind": "random"}, **each}
        for each in (first, {"name": "b", "shape": FIVE})
    ])  # fmt: skip
    check_one(text, "particles.1.shape", None, '"polygon"', '"sphere"', "thickness")


RIGHT = {
    "disc": ({"kind": "disc"}, 1.0),
    "square": ({"kind": "polygon", "sides": 4}, 2 / 3.141592653589793),
    "clockwise": ({"kind": "polygon", "vertices": [[-1, -1], [-1, 1], [1, 1], [1, -1]]}, 2 / 3.141592653589793),
    "a corner on a side": ({"kind": "polygon", "vertices": [[-1, -1], [0, -1], [1, -1], [1, 1], [-1, 1]]}, 2 / 3.141592653589793),
    "by area": ({"kind": "rod", "aspect": 8.0, "size": "area"}, 1.0),
    "capsule": ({"kind": "rod", "aspect": 2.0}, (1 + 3.141592653589793 / 4) / 3.141592653589793),
}  # fmt: skip


@pytest.mark.parametrize("name", RIGHT)
def test_what_shapes_fill_of_the_circle_around_them(name):
    shape, filled = RIGHT[name]
    scenario = parse_scenario(text_of(shape), "shear.toml")
    outline = scenario.particles[0].outline
    assert (1.0 if outline is None else outline.filled) == pytest.approx(filled)
    again = parse_scenario(scenario.resolved_toml(), "shear.toml")
    assert again == scenario


def test_a_file_is_read_once_and_kept(tmp_path):
    (tmp_path / "a.csv").write_text(
        "# units: pixels\ngrain,id,x,y\n" + "".join(f"{g:g},0,{x},{y}\n" for g, x, y in BOX)
    )
    text = text_of({"kind": "file", "file": "a.csv"})
    scenario = parse_scenario(text, tmp_path / "shear.toml")
    (tmp_path / "a.csv").unlink()
    assert parse_scenario(scenario.resolved_toml(), "shear.toml") == scenario
    assert scenario.particles[0].shape.x == (0.0, 2.0, 2.0, 0.0)
    check_one(
        text_of({"kind": "file", "file": "b.csv"}),
        "particles.0.shape.file",
        None,
        "there is no file 'b.csv'",
    )


SQUARE = ["0 0", "4 0", "4 4", "0 4"]
HOLE = ["1 1", "1 3", "3 3", "3 1"]


def ring(corners, *, closed=True):
    return "(" + ", ".join(corners + corners[:1] * closed) + ")"


WKT = f"""# two grains, the second with a hole, over two lines
POLYGON ({ring(SQUARE[::-1])})
MULTIPOLYGON Z (({ring([c + " 7" for c in SQUARE])},
  {ring([c + " 7" for c in HOLE])}))
GEOMETRYCOLLECTION (POLYGON ({ring(["0 0", "0 0", "3 0", "1 1", "0 3"])}))
"""
GEOJSON = {"type": "FeatureCollection", "features": [
    {"type": "Feature", "properties": {"id": 3}, "geometry": {"type": "Polygon", "coordinates": rings}}
    for rings in (
        [[[0, 4], [4, 4], [4, 0], [0, 0], [0, 4]]],
        [[[0, 0], [4, 0], [4, 4], [0, 4], [0, 0]], [[1, 1], [1, 3], [3, 3], [3, 1], [1, 1]]],
        [[[0, 0], [3, 0], [1, 1], [0, 3], [0, 0]]],
    )
]}  # fmt: skip
CSV = "grain,ring,x,y\n" + "".join(
    f"{grain},{k},{','.join(corner.split())}\n"
    for grain, rings in ((1, [SQUARE]), (2, [SQUARE, HOLE]), (5, [["0 0", "3 0", "1 1", "0 3"]]))
    for k, corners in enumerate(rings)
    for corner in corners
)
FILES = {
    "a.wkt": WKT,
    "a.geojson": json.dumps(GEOJSON),
    "a.json": json.dumps(GEOJSON),
    "a.csv": CSV,
}


@pytest.mark.parametrize("name", FILES)
def test_outlines_are_alike_in_all_kinds_of_files(name, tmp_path):
    (tmp_path / name).write_text(FILES[name])
    text = text_of({"kind": "file", "file": name}, {"count": 3})
    scenario = parse_scenario(text, tmp_path / "shear.toml")
    (tmp_path / name).unlink()
    assert parse_scenario(scenario.resolved_toml(), "shear.toml") == scenario
    model = build(scenario)[0]
    outlines = model.outlines
    assert [len(outlines.pieces(k)) for k in range(3)] == [1, 4, 2]
    reach = [
        8**0.5,
        8**0.5,
        np.hypot(3 - 5 / 6, 5 / 6),
    ]  # two triangles, their center at (5/6, 5/6)
    area = np.array([16.0, 12.0, 3.0]) / np.square(reach) * 1e-6
    assert model.area == pytest.approx(area, rel=1e-12)
    assert model.perimeter[:2] == pytest.approx(np.array([16.0, 24.0]) / 8**0.5 * 1e-3)
    gyration = (4**4 / 6 - 2**4 / 6) / 12 / 8 * 1e-6  # of a square a⁴/6
    assert model.grains.inertia[1] / model.grains.mass[1] == pytest.approx(gyration, rel=1e-12)
    assert model.grains.mass == pytest.approx(2.5 * area)


CROSSED = "POLYGON ((0 0, 4 4, 4 0, 0 4, 0 0))"
TRIANGLE = {"type": "Polygon", "coordinates": [[[0, 0], [4, 0], [0, 4], [0, 0]]]}


def collection(*geometries):
    """A collection of features in GeoJSON."""
    features = [{"type": "Feature", "properties": {}, "geometry": each} for each in geometries]
    return json.dumps({"type": "FeatureCollection", "features": features})


BAD_FILES = {
    "a.wkt": (f"POLYGON ({ring(SQUARE)})\n\n{CROSSED}\n", "'a.wkt': grain 2: the side from", "make_valid"),
    "b.wkt": ("POLYGON ((0 0, 1 1\n", "'b.wkt': line 1 cannot be read"),
    "c.wkt": ("LINESTRING (0 0, 1 1)", "'c.wkt': line 1: a LineString is no outline of a grain"),
    "d.wkt": ("\nPOLYGON EMPTY", "'d.wkt': line 2: an empty Polygon"),
    "e.wkt": (f"POLYGON ({ring(['0 0', '1 0', '1e9 1'])})", "'e.wkt': grain 1 has a coordinate", "1e+06"),
    "f.wkt": ("# nothing\n", "'f.wkt': there is no polygon in it"),
    "a.geojson": ('{"type": "Polygon"', "'a.geojson': the file cannot be read"),
    "b.geojson": (collection(TRIANGLE, None), "'b.geojson': feature 2 has no geometry; give the geometry of a polygon, or remove feature 2"),
    "c.geojson": ('{"a": 1}', "'c.geojson': the file has no \"type\" of GeoJSON"),
    "d.geojson": (collection(TRIANGLE, {"type": "Polygon"}), "'d.geojson': feature 2 has no coordinates"),
    "e.geojson": (collection(TRIANGLE, {"type": "Point", "coordinates": [1, 2]}), "'e.geojson': feature 2: a Point is no outline"),
    "f.geojson": (collection({"type": "Polygon", "coordinates": []}), "'f.geojson': feature 1: an empty Polygon"),
    "g.geojson": (collection({"type": "Polygon", "coordinates": [[["a", 0], [1, 1], [1, 2]]]}), "feature 1 cannot be read: its coordinates are no arrays"),
    "h.geojson": ('{"type": "GeometryCollection", "geometries": [3]}', "'h.geojson': geometry 1 has no \"type\""),
    "i.geojson": ('{"type": "FeatureCollection", "features": 3}', "'i.geojson': the file has features that are no array"),
    "j.geojson": ("[" * 100_000, "'j.geojson': the file cannot be read"),
    "k.geojson": ('{"type":"Feature","geometry":' * 5000 + "3" + "}" * 5000, "'k.geojson': the file cannot be read"),
    "l.geojson": (collection({"type": "Polygon", "coordinates": [[[0, 0], [4, 0], [0, 4]]]}), "'l.geojson': feature 1 cannot be read: Points of LinearRing"),
    "c.csv": ("grain,x,y\n", "'c.csv' has no rows below its header"),
    "a.csv": ("grain,x,y\n1,0,0\n1,4,4\n1,4,0\n1,0,4\n", "'a.csv': grain 1: the side from"),
    "b.csv": ("grain,x\n1,0\n", "'b.csv' has no column y", "grain,x,y"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD_FILES)
def test_what_is_wrong_in_a_file_is_told_with_its_name(name, tmp_path):
    content, *words = BAD_FILES[name]
    (tmp_path / name).write_text(content)
    path = str(tmp_path / name)
    check_one(text_of({"kind": "file", "file": path}), "particles.0.shape.file", None,
              *(word.replace(name, path) for word in words))  # fmt: skip
