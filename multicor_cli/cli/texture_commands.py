"""Commands ``post fabric``, ``lifetimes``, ``chains``, ``clusters``: the texture of a packing."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from multicor_cli import store
from multicor_cli.cli.options import RunPath, option
from multicor_cli.cli.post_output import (
    Between,
    End,
    Frames,
    Margin,
    Shown,
    Start,
    selected,
    span_of,
)
from multicor_cli.text import with_error


def fabric(
    directory: RunPath,
    start: Start = None,
    end: End = None,
    frames: Frames = None,
    margin: Margin = None,
    between: Between = None,
) -> Shown:
    """Measure the fabric of the contacts between grains and of their strong and weak networks:
    means with errors; over time as CSV, JSON and figure.

    Anisotropies of contacts, forces and branch lengths are those along the major principal stress;
    half of their sum is about q/p. Strong contacts carry more than the mean normal force. In a
    layer between two walls contacts of the bulk count, elsewhere all.
    """
    from multicor_cli import post

    selection = selected(start, end, frames)
    with store.open_run(directory) as run:
        table = post.fabric(run, selection, margin=margin, between=between)
    return Shown(table, _about_bulk(table), directory)


def _about_bulk(table: Any) -> str:
    about = span_of(table.frames.size, "frame", table.times)
    return f"{about}; the bulk begins {table.margin:g} m from each wall" if table.margin else about


def lifetimes(
    directory: RunPath,
    start: Start = None,
    end: End = None,
    frames: Frames = None,
    margin: Margin = None,
    between: Between = None,
) -> Shown:
    """Measure how long contacts live: the share of them that are still there after a time lag, and
    mean lifetimes, of all, of strong and of sliding contacts.

    A contact that opens and closes again between two frames has lived on: take frames so close
    together that few end between two.
    """
    from multicor_cli import post

    selection = selected(start, end, frames)
    with store.open_run(directory) as run:
        table = post.lifetimes(run, selection, margin=margin, between=between)
    about = _about_bulk(table)
    for kind, name in zip(("all", "strong", "sliding"), post.LIFETIMES, strict=True):
        value, error = getattr(table, name), getattr(table, f"{name}_error")
        about += f"\nmean lifetime, {kind} contacts: {with_error(value, error)} s"
        if table.shear_rate > 0.0:
            about += f", {value * table.shear_rate:.3g} in strain"
    return Shown(table, about, directory, is_detailed=False)


_CHAIN_ANGLE = "Largest angle (in °) between a link and the major principal stress of its grains."
ChainAngle = Annotated[float, option("--angle A", _CHAIN_ANGLE)]
HasLengths = Annotated[bool, option("--lengths", "Show how long chains are instead.")]
_CHAIN_FRAME = (
    "Show the chains of this frame instead: their grains as CSV, the chains in the force network "
    "as figure; -1 is the last one."
)
ChainFrame = Annotated[int | None, option("--frame K", _CHAIN_FRAME, False)]


def chains(
    directory: RunPath,
    angle: ChainAngle = 45.0,
    has_lengths: HasLengths = False,
    frame: ChainFrame = None,
    start: Start = None,
    end: End = None,
    frames: Frames = None,
) -> Shown:
    """Find force chains: how many there are, how long, in which direction; means with errors; over
    time as CSV, JSON and figure.

    Chains are three or more grains whose major principal stress is above the mean, linked by
    contacts along it (Peters et al. 2005). That needs scipy.
    """
    from multicor_cli import post

    if has_lengths and frame is not None:
        raise typer.BadParameter("--lengths and --frame exclude each other")
    selection = selected(start, end, frames)
    if frame is not None and selection != post.Selection():
        raise typer.BadParameter("--frame is about one frame: leave out --frames, --from and --to")
    with store.open_run(directory) as run:
        if frame is not None:
            shown = post.chain_map(run, frame, angle=angle)
            about = f"force chains in frame {shown.frame} at t = {shown.time:g} s"
            return Shown(shown, about, directory)
        if has_lengths:
            lengths = post.chain_lengths(run, selection, angle=angle)
            about = span_of(lengths.frames.size, "frame", lengths.times)
            decay = with_error(lengths.decay_length, lengths.decay_length_error)
            return Shown(lengths, f"{about}; decay length of P: {decay} grains", directory,
                is_detailed=False)  # fmt: skip
        table = post.chains(run, selection, angle=angle)
    return Shown(table, span_of(table.frames.size, "frame", table.times), directory)


def clusters(
    directory: RunPath, start: Start = None, end: End = None, frames: Frames = None
) -> Shown:
    """Find clusters of sliding contacts, which have grains in common: how many, how large; means
    with errors; over time as CSV, JSON and figure.

    That needs scipy.
    """
    from multicor_cli import post

    with store.open_run(directory) as run:
        table = post.clusters(run, selected(start, end, frames))
    return Shown(table, span_of(table.frames.size, "frame", table.times), directory)
