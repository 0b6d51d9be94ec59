"""Materials are defined, and every pair that can touch has one contact law."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations_with_replacement

from multicor_cli.scenario.checks.draft import Draft
from multicor_cli.scenario.materials import MAX_MATERIALS, PairFriction
from multicor_cli.scenario.problems import Finding, KeyPath, name_list, show
from multicor_cli.scenario.translate import did_you_mean

_MAX_NAMED_PAIRS = 5

Entries = Sequence[PairFriction | None]


def check(draft: Draft) -> Iterator[Finding]:
    """Findings about materials and contact laws."""
    if len(draft.material_names) > MAX_MATERIALS:
        return
    yield from _undefined_materials(draft)
    for path, entries in _lists(draft):
        yield from _double_entries(path, entries)
        yield from _ambiguous_pairs(path, entries, draft)
    yield from _uncovered_pairs(draft)


def _lists(draft: Draft) -> Iterator[tuple[KeyPath, Entries]]:
    """``[[contacts]]``, and what stages say of friction."""
    yield ("contacts",), draft.contacts
    for k, stage in enumerate(draft.loading):
        if stage:
            yield ("loading", k, "contacts"), stage.contacts


def _undefined_materials(draft: Draft) -> Iterator[Finding]:
    used: list[tuple[KeyPath, str]] = []
    for path, entries in _lists(draft):
        used += [((*path, k, "pair", e), name) for k, c in _given(entries) for e, name in enumerate(c.pair) if name != "*"]
    used += [(("particles", k, "material"), group.material) for k, group in enumerate(draft.particles) if group]
    used += [(("walls", k, "material"), wall.material) for k, wall in enumerate(draft.walls) if wall]
    known = draft.material_names
    for path, name in used:
        if known and name not in known:
            remedy = did_you_mean(name, known) or f"add [materials.{name}], or use one of {name_list(known)}"
            yield Finding(path, f"there is no material {show(name)}", remedy)


def _given(entries: Entries) -> Iterator[tuple[int, PairFriction]]:
    return ((k, entry) for k, entry in enumerate(entries) if entry)


def _key(a: str, b: str) -> tuple[str, str]:
    return (a, b) if a <= b else (b, a)


def _covering(a: str, b: str) -> set[tuple[str, str]]:
    """All pairs that an entry about the materials ``a`` and ``b`` can have; "*" sorts before all names."""
    return {_key(a, b), ("*", a), ("*", b), ("*", "*")}


def _by_pair(entries: Entries) -> dict[tuple[str, str], int]:
    """Index of the first entry of each unordered pair."""
    first: dict[tuple[str, str], int] = {}
    for k, entry in _given(entries):
        first.setdefault(_key(*entry.pair), k)
    return first


def _double_entries(path: KeyPath, entries: Entries) -> Iterator[Finding]:
    first = _by_pair(entries)
    for k, entry in _given(entries):
        if (before := first[_key(*entry.pair)]) != k:
            what = f"the pair {_show_pair(entry.pair)} is given twice, first in {_dotted(path)}.{before}"
            yield Finding((*path, k, "pair"), what, "remove one of the two")


def touching_pairs(draft: Draft) -> list[tuple[str, str]]:
    """Pairs of defined materials that can touch: grains with grains and with the walls that they meet."""
    known, groups = set(draft.material_names), [group for group in draft.particles if group]
    grains = sorted({group.material for group in groups} & known)
    pairs = set(combinations_with_replacement(grains, 2))
    for wall in draft.walls:
        if wall and wall.material in known:
            met = {group.material for group in groups if wall.groups is None or group.name in wall.groups}
            pairs |= {_key(material, wall.material) for material in met & known}
    return sorted(pairs)


def _show_pair(pair: tuple[str, str]) -> str:
    return f'["{pair[0]}", "{pair[1]}"]'


def _dotted(path: KeyPath) -> str:
    return ".".join(map(str, path))


def _ambiguous_pairs(path: KeyPath, entries: Entries, draft: Draft) -> Iterator[Finding]:
    """Pairs that two entries such as ["a", "*"] and ["b", "*"] cover, without an entry of their own."""
    first = _by_pair(entries)
    told: set[int] = set()
    for a, b in touching_pairs(draft):
        rivals = sorted(first[key] for key in {("*", a), ("*", b)} if key in first)
        if len(rivals) == 2 and (a, b) not in first and rivals[1] not in told:
            told.add(rivals[1])
            one, other = (f"{_dotted(path)}.{rival}" for rival in rivals)
            what = f"{one} and {other} both apply to the pair {_show_pair((a, b))}"
            yield Finding((*path, rivals[1], "pair"), what, f"add an entry with pair = {_show_pair((a, b))}")


def _uncovered_pairs(draft: Draft) -> Iterator[Finding]:
    """One finding for all pairs without a law, unless an entry that is wrong may be the one that is meant for them."""
    named = {name for _, entry in _given(draft.contacts) for name in entry.pair if name != "*"}
    if None in draft.contacts or not named <= set(draft.material_names):
        return
    given = _by_pair(draft.contacts).keys()
    uncovered = [pair for pair in touching_pairs(draft) if not given & _covering(*pair)]
    if not uncovered:
        return
    pairs = ", ".join(_show_pair(pair) for pair in uncovered[:_MAX_NAMED_PAIRS])
    more = f" and {len(uncovered) - _MAX_NAMED_PAIRS} more" if len(uncovered) > _MAX_NAMED_PAIRS else ""
    remedy = f'add [[contacts]] with pair = {_show_pair(uncovered[0])}, or ["*", "*"] for all others'
    yield Finding(("contacts",), f"no contact law for {pairs}{more}", remedy)
