"""Flows through a line, columns of the time series, and parts of a run by group, against counts by
hand."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from from_wall_to_wall import profile
from made_up_frames import frame_of, source_of
from scene_parts import between_planes

from multicor_cli.post import PostError, Selection, SeriesTable, flow_through, grain_map, series
from multicor_cli.store.frames import NamedColumn

ALL = Selection(frames=slice(None))


def falling(x, y, numbers=None, period=4.0):
    """Frames with centers ``(frames, n)`` of grains of radius 0.1 and, of the second half, 0.2."""
    position = np.stack(np.broadcast_arrays(x, np.array(y)), axis=-1)
    n = position.shape[1]
    model = replace(between_planes(np.repeat([0.1, 0.2], [n // 2, n - n // 2])), period=period)
    frames = []
    for k, at in enumerate(position):
        frame = SimpleNamespace(position=at, unwrapped=at, velocity=np.full((n, 3), 2.0))
        if numbers is not None:
            frame.number, frame.is_open = np.array(numbers[k]), True
            frame.model = model.with_grains(frame.number)
            frame.position = frame.unwrapped = at[frame.number]
            frame.velocity = frame.velocity[frame.number]
        frames.append(frame)
    return source_of(model, frames, 0.5 * np.arange(len(frames)))


def test_grains_that_cross_are_counted_with_their_mass():
    """Four grains: one falls through the line, one beside it, one comes back, one goes up."""
    x = np.array([1.0, 3.5, 1.5, 2.0])
    y = [[0.9, 0.9, 0.6, 0.2], [0.6, 0.6, 0.4, 0.3], [0.3, 0.3, 0.7, 0.4], [0.1, 0.1, 0.8, 0.7]]
    source = falling(x, y)
    table = flow_through(source, ((3.0, 0.5), (0.0, 0.5)), ALL)  # its left is below
    mass = source.model.grains.mass
    assert table.crossed["grains"].tolist() == [1, 1 - 1, -1]
    assert table.crossed["mass"] == pytest.approx([mass[2], mass[0] - mass[2], -mass[3]])
    assert (table.forth, table.back) == (2, 2)
    assert table.mean["mass"] == pytest.approx((mass[0] - mass[3]) / 1.5)
    assert table.rate["area"][2] == pytest.approx(-np.pi * 0.04 / 0.5)
    back = flow_through(source, ((0.0, 0.5), (3.0, 0.5)), ALL)
    assert back.mean["mass"] == pytest.approx(-table.mean["mass"])
    assert [row[0] for row in table.rows][-1] == "grains to the right [1]"
    assert len(table.detail_rows) == len(table.as_dict()["time"]) == 3
    with pytest.raises(PostError, match="two frames"):
        flow_through(source, ((0.0, 0.5), (3.0, 0.5)), Selection(frames=slice(0, 1)))
    with pytest.raises(PostError, match="no length"):
        flow_through(source, ((0.0, 0.5), (0.0, 0.5)), ALL)
    for far in (1e300, np.inf, np.nan):
        with pytest.raises(PostError, match="give ends"):
            flow_through(source, ((0.0, 0.5), (far, 0.5)), ALL)


def test_every_passage_through_a_periodic_cell_counts():
    """Grains that go round: through x = 1 and its images once per period, however many periods a
    step takes them."""
    x = np.array([[0.5, 3.9], [1.5, 5.1], [9.5, 13.1], [8.5, 11.9]])
    table = flow_through(falling(x, 0.5), ((1.0, 1.0), (1.0, 0.0)), ALL)  # its left is towards +x
    expected = np.diff(np.floor((x - 1.0) / 4.0), axis=0)
    assert table.crossed["grains"].tolist() == expected.sum(axis=1).tolist()
    alone = flow_through(falling(x, 0.5, period=0.0), ((1.0, 1.0), (1.0, 0.0)), ALL)
    assert alone.crossed["grains"].tolist() == [1, 0, 0]
    flow_through(falling(x, 0.5), ((4.0, 0.5), (0.0, 0.5)), ALL)  # as wide as the period
    with pytest.raises(PostError, match="5 m wide, more than the period of 4 m"):
        flow_through(falling(x, 0.5), ((5.0, 0.5), (0.0, 0.5)), ALL)


def test_grains_that_come_and_go_count_while_they_are_there():
    source = falling(1.0, [[0.9, 0.9], [0.4, 0.4], [0.1, 0.6]], [[0], [0, 1], [1]])
    assert flow_through(source, ((2.0, 0.5), (0.0, 0.5)), ALL).crossed["grains"].tolist() == [1, -1]
    # Falling through a line at 0.5; between the second and the third frame the outlet has given the
    # first one back, 9 higher
    source = falling(1.0, [[0.9, 0.8], [0.4, 0.3], [9.4, 0.1]], [[0, 1]] * 3)
    table = flow_through(source, ((2.0, 0.5), (0.0, 0.5)), ALL)
    assert (table.forth, table.back, table.lost) == (2, 0, 1)
    assert "1 time a grain came or went" in table.note
    assert table.as_dict()["not_counted"] == 1


def columns(rows):
    time = np.arange(rows) * 0.1
    return SimpleNamespace(
        series_columns=[
            NamedColumn("time", "s", time), NamedColumn("kinetic", "J", 2.0 * time),
            NamedColumn("floor: force_x", "N", time - 1.0),
            NamedColumn("lid: force_x", "N", 1.0 - time),
            NamedColumn("lid: force_y", "N", np.ones(rows)),
        ]
    )  # fmt: skip


def test_columns_of_the_series_by_name_by_wall_and_in_part():
    source = columns(21)
    everything = series(source)
    names = ["kinetic", "floor: force_x", "lid: force_x", "lid: force_y"]
    assert [column.name for column in everything.quantities] == names
    assert everything.rows[0][:2] == ("kinetic [J]", pytest.approx(2.0))
    assert everything.rows[0][3:7] == pytest.approx((4.0, 0.0, 4.0, 4.0))
    assert everything.rows[3][2] == 0.0
    later = series(source, ["force_x", "lid"], 0.5, 1.0)
    assert [column.name for column in later.quantities] == names[1:]
    assert later.time == pytest.approx(np.arange(5, 11) * 0.1)
    assert later.detail_rows[0] == pytest.approx((0.5, -0.5, 0.5, 1.0))
    assert later.as_dict()["mean"]["lid: force_y"] == 1.0
    assert [column.name for column in everything.overview().quantities] == names
    walls = [everything.quantities[1]._replace(name=f"w{k}: force_x") for k in range(9)]
    crowd = SeriesTable(everything.time, walls)
    assert len(crowd.overview().quantities) == 1  # nine lines of one unit could not be told apart
    with pytest.raises(PostError, match="no 'pressure'; choose from: kinetic, floor: force_x"):
        series(source, ["pressure"])
    with pytest.raises(PostError, match="no row at these times"):
        series(source, start=5.0)


def test_rows_in_which_no_grain_is_there_have_no_temperature():
    source = columns(5)
    source.series_columns += [
        NamedColumn("temperature_mean", "K", np.array([300.0, 310.0, 0.0, 320.0, 0.0])),
        NamedColumn("hottest_spot", "K", np.zeros(5)),
    ]
    (mean, *_, low, high, last, _), spot = series(source, ["temperature_mean", "hottest_spot"]).rows
    assert (low, high) == (300.0, 320.0)
    assert np.isnan(last)
    assert np.isnan(spot[1:7]).all()
    assert series(source, ["temperature_mean"]).mean["temperature_mean"] == pytest.approx(310.0)
    assert mean == "temperature_mean [K]"


def mixture():
    rng = np.random.default_rng(5)
    model = between_planes(rng.uniform(0.02, 0.06, 40))
    grains = replace(model.grains, group=np.arange(40) % 2)
    places = rng.uniform((0.0, 0.1), (4.0, 0.9), (3, 40, 2))
    frames = [frame_of(position, velocity=rng.normal(size=(40, 2))) for position in places]
    return source_of(replace(model, groups=("light", "heavy"), grains=grains), frames)


@pytest.mark.parametrize("period", [4.0, 0.0])
def test_groups_add_up_to_the_whole(period):
    source = mixture()
    source.model = replace(source.model, period=period)
    whole, light, heavy = (
        profile(source, "solid-fraction", ALL, 4, groups=g) for g in ((), ("light",), ("heavy",))
    )
    assert light.value + heavy.value == pytest.approx(whole.value)
    assert light.area + heavy.area == pytest.approx(whole.area)
    both = profile(source, "velocity", ALL, 4, groups=("heavy", "light"))
    assert both.value == pytest.approx(profile(source, "velocity", ALL, 4).value)
    one = profile(source, "velocity", ALL, 1, groups=["heavy"])
    heavier = source.model.grains.group == 1
    area = source.model.grains.radius[heavier] ** 2
    expected = np.mean([area @ frame.velocity[heavier, 0] for frame in source.frames]) / area.sum()
    assert one.value[0] == pytest.approx(expected)
    with pytest.raises(PostError, match="no group 'dust'; choose from: light, heavy"):
        profile(source, "velocity", ALL, groups=["dust"])


def test_maps_of_groups_count_them():
    table = grain_map(mixture(), "group")
    assert (table.headings, table.rows) == (("group", "grains"), [("light", 20.0), ("heavy", 20.0)])
    assert table.as_dict()["names"] == ["light", "heavy"]
    assert grain_map(mixture(), "material").rows == [("steel", 40.0)]
