"""Heat that flows through the contacts of one frame: its network, and numbers of it."""

from __future__ import annotations

import numpy as np

from multicor_cli.model import Model
from multicor_cli.post.contacts import HeatFlows, heat_flows, with_conduction
from multicor_cli.post.grain_map import make_scene
from multicor_cli.post.source import Run, frame_index, left_out, model_of, need_grains, need_heat
from multicor_cli.post.table import Column, Table, values_of_quantities

_STRONGEST = 0.1  # part of the contacts whose share of the flow is told

_NUMBERS = {
    "contacts": "contacts that conduct",
    "wall_contacts": "  of these with walls",
    "coordination": "conducting contacts per grain",
    "idle_share": "share of grains without any",
    "flow_mean": "mean heat flow of a contact, without sign [W]",
    "flow_max": "largest heat flow of a contact [W]",
    "strongest_share": "share of the strongest 10 % in the sum of flows",
    "from_walls": "heat flow from walls into grains, net of each [W]",
    "to_walls": "heat flow from grains into walls, net of each [W]",
}
HEAT_SUMMARY = tuple(_NUMBERS)
"""Names of the numbers of a whole network."""


class HeatNetwork(Table):
    """The contacts of a frame that conduct heat; ``c`` of them.

    The flow of a contact is H (T_j − T_i), with the conductances H of the last step and the
    temperatures of the frame; see `multicor_cli.post.contacts.heat_flows`.

    Attributes:
        scene: Where the grains and walls are.
        i: First grain, shape ``(c,)``.
        j: Second grain, or wall shape (not below the number of grains), shape ``(c,)``.
        start: Center of the grain i [m], shape ``(c, 2)``.
        end: Center of grain j, free or glued, or where i touches a smooth wall [m], ``(c, 2)``.
        touch: Where i touches j [m], shape ``(c, 2)``.
        flow: Heat flow into i [W], shape ``(c,)``.
        conductance: H [W/K], shape ``(c,)``.
        is_wall: Whether a contact is one of a grain with a wall, shape ``(c,)``.
        temperature: Of the grains [K], shape ``(n,)``.
        frame: Index of the frame.
        time: Time of the frame [s].
        left_out: What else conducts in the run, and is not counted; empty if nothing does.
        summary: The numbers of `HEAT_SUMMARY`, by name; nan where there is no contact. Flows from
            walls are sums over the walls that give heat to the grains, flows to walls over those
            that take some.
    """


def heat_network(source: Run, frame: int = -1) -> HeatNetwork:
    """The network of the heat that contacts conduct in one frame.

    Args:
        source: The run, with heat.
        frame: Index of the frame; negative counts from the last one.

    Raises:
        PostError: If there is no such frame, or no grain in it, its contacts are not known, or the
            run has no heat.
        StoreError: If the run cannot be read.
    """
    index = frame_index(source.frames, frame)
    need_grains(source, np.array([index]))
    with_conduction(source, np.array([index]))
    chosen = source.frames[index]
    model, scene = model_of(source, chosen), make_scene(source, chosen)
    flows = heat_flows(chosen, model)
    contacts = flows.contacts
    start = scene.center[contacts.i]
    touch = start + contacts.arm
    columns = [Column("i", "", contacts.i), Column("j", "", contacts.j)]
    columns += [Column(f"touch_{k}", "m", touch[:, a], k) for a, k in enumerate("xy")]
    columns += [Column("conductance", "W/K", flows.conductance), Column("flow", "W", flows.flow)]
    summary = _numbers(flows, model)
    parts = {
        "scene": scene, "start": start, "end": start - contacts.branch, "touch": touch,
        "is_wall": contacts.is_wall, "temperature": need_heat(chosen.temperature),
        "summary": summary,
    }  # fmt: skip
    facts = {
        "frame": index, "time": float(np.asarray(source.frames.time)[index]),
        "left_out": left_out(source), **summary,
    }  # fmt: skip
    lines = [(_NUMBERS[name], value) for name, value in summary.items()]
    return HeatNetwork(values_of_quantities(lines), facts, columns, **parts)


def _numbers(flows: HeatFlows, model: Model) -> dict[str, float]:
    contacts, size = flows.contacts, np.sort(np.abs(flows.flow))[::-1]
    count, n, with_walls = size.size, model.grain_count, int(contacts.is_wall.sum())
    total = float(size.sum())
    # a tenth of them, of the last only the part that is left of it
    strongest = float(
        np.interp(_STRONGEST * count, np.arange(count + 1), np.append(0.0, np.cumsum(size)))
    )
    of_shape = np.bincount(
        contacts.j[contacts.is_wall] - n, flows.flow[contacts.is_wall], model.shape_count
    )
    of_wall = np.bincount(model.shapes.wall, of_shape, model.wall_count)
    return {
        "contacts": count,
        "wall_contacts": with_walls,
        "coordination": (2 * count - with_walls) / n,
        "idle_share": float(np.count_nonzero(contacts.counts == 0)) / n,
        "flow_mean": total / count if count else np.nan,
        "flow_max": float(size[0]) if count else np.nan,
        "strongest_share": strongest / total if total > 0.0 else np.nan,
        "from_walls": float(np.maximum(of_wall, 0.0).sum()),
        "to_walls": float(np.maximum(-of_wall, 0.0).sum()),
    }
