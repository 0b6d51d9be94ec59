"""Options become comparisons; each returns its text and its JSON."""

from __future__ import annotations

import argparse
import platform
import sys
from pathlib import Path
from typing import Any

from case import FlowPlan
from peers import SoftPeer, find_peers, find_siconos, find_yade, siconos_version
from shape_peers import PACKAGES, find_shape_peer

_BETWEEN = 0.02  # strain between two frames
_LARGEST_COLLAPSE = 10_000  # grains
_LIMIT = 20.0  # time that a solver gets for one contact problem [s]
_COURSES = 8  # of the masonry


class Session:
    """The peers that are installed, and what was asked for."""

    def __init__(self, options: argparse.Namespace, folder: Path) -> None:
        """Look for the peers.

        Args:
            options: What was asked for.
            folder: Where the other codes work.
        """
        self._options, self._folder = options, folder
        self._names = [name for name in options.peers.split(",") if name]
        self._peers, self._missing = find_peers(
            self._names, options.lammps, options.cores, options.substeps
        )
        self._yade = find_yade(options.cores, options.substeps) if "yade" in self._names else None
        if "yade" in self._names and self._yade is None:
            self._missing.append(("yade", "apt install yade"))
        self._siconos = find_siconos(options.siconos) if "siconos" in self._names else None
        if "siconos" in self._names and self._siconos is None:
            self._missing.append(("siconos", "apt install python3-siconos"))
        self._shape_peers = []
        for name in [name for name in PACKAGES if name in self._names]:
            peer = find_shape_peer(name, options.python)
            if peer is None:
                self._missing.append((name, f"pip install --no-deps {PACKAGES[name]}"))
            else:
                self._shape_peers.append(peer)

    def about(self) -> list[str]:
        """What the machine is and which codes take part."""
        there = [f"{peer.name}: {peer.version()}" for peer in self._soft_peers()]
        if self._siconos is not None:
            there.append(f"siconos: {siconos_version(self._siconos)}")
        there += [f"{peer.name}: {peer.version()}" for peer in self._shape_peers]
        missing = [
            f"{name} is not installed ({how}) and is left out" for name, how in self._missing
        ]
        return [
            f"{platform.machine()}, {platform.platform()}, {self._options.cores} core(s)",
            *there,
            *missing,
        ]

    def compare(self, case: str) -> tuple[str, dict[str, Any]]:
        """Run one comparison."""
        return {
            "shear": self._shear,
            "bed": self._bed,
            "heat": self._heat,
            "problems": self._problems,
            "shapes": self._shapes,
        }[case]()

    def _say(self, text: str) -> None:
        print(text, file=sys.stderr, flush=True)

    def _soft_peers(self) -> list[SoftPeer]:
        return [*self._peers, *([] if self._yade is None else [self._yade])]

    def _shear(self) -> tuple[str, dict[str, Any]]:
        from shear import Wanted, as_json, as_text, compare_shear

        o, quick = self._options, self._options.quick
        strain, settle = (0.1, 0.04) if quick else (o.strain, o.settle)
        soft = 0.02 if quick else o.soft_strain
        wanted = Wanted(
            grains=o.grains or (400 if quick else 1680),
            inertial=o.inertial,
            kappas=tuple(o.kappa),
            rounds=1 if quick else o.rounds,
            plan=_plan(settle, strain),
            stiff_plan=_plan(0.5 * soft, soft),
            dt_tau=o.dt_tau,
            tolerance=o.tolerance,
            cores=o.cores,
            reference=0.2 if quick else o.reference,
            begin=0.5 if quick else 1.5,
            friction=o.friction,
            sizes=o.sizes,
        )
        result = compare_shear(wanted, self._soft_peers(), self._folder, self._say)
        return as_text(result), as_json(result)

    def _bed(self) -> tuple[str, dict[str, Any]]:
        from bed import BedWanted, as_json, as_text, compare_bed

        o, quick = self._options, self._options.quick
        wanted = BedWanted(
            grains=o.grains or (400 if quick else 10_000),
            kappas=tuple(o.kappa),
            rounds=1 if quick else o.rounds,
            frames=40,
            dt=o.dt_bed,
            tolerance=o.tolerance,
            cores=o.cores,
        )
        found = compare_bed(wanted, self._peers, self._folder, self._say)
        return as_text(*found), as_json(*found)

    def _heat(self) -> tuple[str, dict[str, Any]]:
        from heat import as_json, as_text, compare_heat

        o, quick = self._options, self._options.quick
        grains, rounds = o.grains or (1_000 if quick else 10_000), 1 if quick else o.rounds
        found = compare_heat(grains, rounds, o.cores, self._peers, self._folder, self._say)
        return as_text(found), as_json(found)

    def _problems(self) -> tuple[str, dict[str, Any]]:
        from problems import as_json, as_text, race

        o = self._options
        sizes = [o.grains] if o.grains else ([500] if o.quick else [1_000, 10_000, 50_000])
        # The collapse is no tile that can be repeated: a large one costs minutes to prepare.
        scenes = [
            (name, n)
            for n in sizes
            for name in ("bed", "shear", "collapse")
            if name != "collapse" or n <= _LARGEST_COLLAPSE
        ]
        races = race(
            scenes,
            self._siconos,
            1 if o.quick else o.rounds,
            2.0 if o.quick else _LIMIT,
            self._folder,
            self._say,
        )
        return as_text(races), as_json(races)

    def _shapes(self) -> tuple[str, dict[str, Any]]:
        from shapes import as_json, as_text, compare_shapes

        o = self._options
        found = compare_shapes(
            o.grains or (40 if o.quick else 1_000),
            2 if o.quick else _COURSES,
            1 if o.quick else o.rounds,
            self._shape_peers,
            self._folder,
            self._say,
        )
        return as_text(found), as_json(found)


def _plan(settle: float, strain: float) -> FlowPlan:
    """Both strains in whole intervals between frames; short ones have five."""
    between = min(_BETWEEN, strain / 5.0)
    return FlowPlan(
        round(settle / between) * between, max(1, round(strain / between)) * between, between
    )
