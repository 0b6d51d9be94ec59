"""How long force chains are, and where they are in one frame."""

from __future__ import annotations

import numpy as np

from multicor_cli.post.chains import ANGLE, LEAST, chains, decay_length, find_all
from multicor_cli.post.forces import force_network
from multicor_cli.post.rheology_sums import average_rows
from multicor_cli.post.source import PostError, Run, Selection, frame_index, frames_told
from multicor_cli.post.sums import Sums, average
from multicor_cli.post.table import Column, Table, values_of_quantities

# ---- Lengths


class ChainLengths(Table):
    """Distribution of the lengths of force chains; a row for each of ``r`` lengths from 3 on.

    Attributes:
        length: Lengths l in grains, shape ``(r,)``.
        P: Share of the chains of all frames, shape ``(r,)``; ``error``: standard errors.
        count: Chains in all frames, shape ``(r,)``.
        decay_length: l₀ of P(l) ∝ exp(−l/l₀) of greatest likelihood; ``decay_length_error``.
        angle: Largest angle of `Chains` [°].
        frames: Indices of the frames.
        times: Times of the first and last frame [s].
    """


def chain_lengths(
    source: Run, selection: Selection | None = None, *, angle: float = ANGLE
) -> ChainLengths:
    """How long force chains are.

    Args:
        source: The run.
        selection: Which frames with forces; default: the later half of the last stage.
        angle: As `chains`.

    Raises:
        PostError: As `chains`, or if there is no chain in these frames.
        MissingLibrary: If SciPy is not installed.
        StoreError: If the run cannot be read.
    """
    chosen, found = find_all(source, selection, angle)
    lengths = [own.length for _, own in found]
    longest = max(int(own.max(initial=0)) for own in lengths)
    if not longest:
        raise PostError("there is no force chain in these frames: choose others, or raise --angle")
    count = np.array([np.bincount(own, minlength=longest + 1)[LEAST:] for own in lengths])
    number = count.sum(axis=1, dtype=np.float64)
    weight = np.repeat(number[:, np.newaxis], count.shape[1], axis=1)
    share, error = average(Sums(count.astype(np.float64), weight, weight))
    sums = np.column_stack([[own.sum() for own in lengths], number])
    times = np.asarray(source.frames.time, np.float64)[chosen]
    decay = average_rows(lambda rows: {"it": decay_length(rows[:, 0] / rows[:, 1])}, sums, times)
    columns = [
        Column("length", "", np.arange(LEAST, longest + 1), "grains"),
        Column("P", "1", share),
        Column("error", "1", error, "standard error", "standard_error"),
        Column("count", "", count.sum(axis=0), "chains"),
    ]
    facts = {
        "decay_length": decay.mean["it"], "decay_length_error": float(decay.spread["it"].error),
        "angle": angle, **frames_told(source, chosen),
    }  # fmt: skip
    return ChainLengths(columns, facts, frames=chosen)


# ---- The chains of one frame


class ChainMap(Table):
    """The force chains of one frame: numbers of them as rows, the grains in chains as details.

    Attributes:
        chain: Number of the chain, from the longest on, of each grain in one, shape ``(g,)``.
        grain: These grains, shape ``(g,)``.
        stress: Their major principal stress [N/m], shape ``(g,)``.
        degrees: Its direction, shape ``(g,)``.
        network: The force network of the frame.
        link: Which of its contacts are links of chains.
        frame: Index of the frame.
        time: Time of the frame [s].
    """


def chain_map(source: Run, frame: int = -1, *, angle: float = ANGLE) -> ChainMap:
    """The force chains of one frame.

    Args:
        source: The run.
        frame: Index of the frame; negative counts from the last one.
        angle: As `chains`.

    Raises:
        PostError: If there is no such frame, or as `chains`.
        MissingLibrary: If SciPy is not installed.
        StoreError: If the run cannot be read.
    """
    index = frame_index(source.frames, frame)
    selection = Selection(frames=slice(index, index + 1))
    found = chains(source, selection, angle=angle)
    [(_, own)] = find_all(source, selection, angle)[1]
    network = force_network(source, index)
    in_chain = np.flatnonzero(own.of_grain >= 0)
    grain = in_chain[np.argsort(own.of_grain[in_chain], kind="stable")]
    degrees = np.degrees(own.direction[grain]) % 180.0
    x, y = network.scene.center[grain].T
    details = [
        Column("chain", "", own.of_grain[grain]), Column("grain", "", grain),
        Column("x", "m", x), Column("y", "m", y),
        Column("stress", "N/m", own.stress[grain], "major principal stress"),
        Column("degrees", "deg", degrees, "its direction"),
    ]  # fmt: skip
    rows = [(column.heading, found.mean[column.name]) for column in found.quantities]
    facts = {"frame": index, "time": network.time, "angle": angle, **found.mean}
    return ChainMap(values_of_quantities(rows), facts, details, network=network, link=own.link)
