"""The contacts of a step: which pairs they are, with what they begin, and what they end with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from multicor_cli.arithmetic import hypot
from multicor_cli.engine.contact.adhesion import (
    attract,
    begin_attraction,
    bridges_after,
    longest_reach,
)
from multicor_cli.engine.contact.contacts import (
    Contacts,
    Speeds,
    begin_walls,
    scatter_impulses,
    vary_friction,
    warm_rows,
)
from multicor_cli.engine.contact.faces import begin_faces
from multicor_cli.engine.contact.flight import leave_flights_out
from multicor_cli.engine.contact.impacts import are_contacts
from multicor_cli.engine.contact.rolling import begin_rolling
from multicor_cli.engine.contact.selection import AHEAD, LASTS
from multicor_cli.engine.contact.solve import ResidualScale
from multicor_cli.engine.contact.system import OrderedSystem, assemble, begin_grains, pack_bodies
from multicor_cli.engine.contact.vector_step import SUMS, VIRIAL
from multicor_cli.engine.energy.account import (
    ContactSums,
    account_contacts,
    account_faces,
    account_grains,
)
from multicor_cli.engine.geometry.drift import cutoff_of_velocities
from multicor_cli.engine.geometry.pieces import Pieces
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.motion.cell import require_slowness
from multicor_cli.engine.motion.layout import Layout
from multicor_cli.engine.motion.prediction import Prediction
from multicor_cli.engine.motion.walls import WallMotion
from multicor_cli.model.columns import SURFACE
from multicor_cli.model.model import ContactLaws, Floats, Ints, Model

NEAREST = 0.01
"""Gap up to which points of pairs with corners always count, over the mean diameter."""
_NONE, _NO_FALL = np.empty(0), np.zeros(2)


@dataclass(frozen=True)
class StepContacts:
    """Contacts of steps with these grains, motions of walls and contact laws.

    Attributes:
        model: What does not change, with all grains; ``layout`` is of those that are present.
        restitution: Largest coefficient of all pairs of materials.
    """

    model: Model
    layout: Layout
    motion: WallMotion
    laws: ContactLaws
    restitution: float

    # ---- Which pairs they are

    def cutoff_after(self, step: Prediction, after: Floats) -> float:
        """A gap that no pair closes in the step with the velocities v⁺ [m]."""
        layout = self.layout
        walls = after[layout.model.grain_count :, :3].copy()
        cutoff = cutoff_of_velocities(
            step.scene, after, _NO_FALL, walls, walls, self.motion.extent, step.dt,
            layout.pairs.largest,
        )  # fmt: skip
        return require_slowness(cutoff, layout.state.step)

    def far(self, step: Prediction, cutoff: float, bodies: Floats) -> float:
        """A gap that no points of a pair close [m], with spins too.

        ``cutoff`` is one that no pair closes by moving on, with the velocities of ``bodies``.
        """
        model, pieces = self.layout.model, self.layout.pieces
        if pieces is None or not pieces.is_face.any():
            return cutoff
        count, reach = model.grain_count, model.grains.radius / model.spin_radius
        turning = float(np.abs(bodies[:count, SURFACE] * reach).max(initial=0.0))
        return cutoff + 2.0 * AHEAD * step.dt * turning

    def least_gap(self) -> float:
        """Gap up to which all points of pairs with corners count [m]."""
        return max(NEAREST * self.layout.model.mean_diameter, longest_reach(self.laws))

    def select(self, step: Prediction, *, closes: bool = False) -> None:
        """The contacts of the state, or others if a pair that is none of them may close.

        Where it is known already that one ``closes``, the list has been looked at, too.
        """
        layout, scene = self.layout, step.scene
        if not closes:
            layout.selection.take(layout.state)
            layout.pairs.update(scene, step.cutoff)
            closes, _ = layout.selection.closing(
                scene, step.pieces, layout.before, layout.free,
                self.far(step, step.cutoff, layout.before), AHEAD * step.dt,
                longest_reach(self.laws),
            )  # fmt: skip
        if layout.selection.is_crowded(layout.state) or (closes and not self.receive(step)):
            self.seek(step)
        self.select_impacts(step)

    def receive(self, step: Prediction) -> bool:
        """Pairs that close soon become contacts, beside those that there are, if there is room."""
        layout = self.layout
        return layout.selection.receive(
            step.scene, self.motion.is_free, self.laws, layout.before, layout.free, layout.state,
            step.cutoff, step.dt, longest_reach(self.laws),
        )  # fmt: skip

    def select_impacts(self, step: Prediction) -> None:
        """All pairs that have had an impact are contacts."""
        selection = self.layout.selection
        if step.flight is not None and not are_contacts(
            step.flight.impacts, selection.i, selection.j
        ):
            selection.add(step.scene, step.flight.impacts)

    def seek(self, step: Prediction, least: float = 0.0) -> float:
        """Other contacts: all pairs up to a gap that is returned [m], ``least`` or more."""
        layout = self.layout
        return layout.selection.seek(
            step.scene, step.pieces, layout.before, layout.free, step.cutoff, step.dt,
            longest_reach(self.laws), least,
        )  # fmt: skip

    def list_up_to(self, gap: float, step: Prediction) -> None:
        """Let the list be complete up to a gap at q_m, where it has been looked at before."""
        layout = self.layout
        if gap > layout.pairs.complete:
            layout.pairs.update(step.scene, gap)

    # ---- With what they begin

    def gather(
        self, step: Prediction, least: float, stopped: NDArray[np.bool_]
    ) -> tuple[Contacts, ResidualScale, bool, float, Floats]:
        """The contacts, warm-started, the scale of the residuals, and if any is to be solved.

        Last what `begin_faces` returns, with ``least`` and ``stopped``: up to where room was
        lacking, and how far points are that do not count.
        """
        layout, state, laws, dt = self.layout, self.layout.state, self.laws, step.dt
        selection, scene, start = layout.selection, step.scene, layout.before
        contacts, i, j = selection.contacts, selection.i, selection.j
        lanes = selection.schedule(scene, self.motion.is_free, laws, start, state)
        ratio = dt / state.last_dt if state.last_dt > 0.0 else 0.0
        pack_bodies(
            scene, start, layout.free, lanes.place, lanes.velocity, lanes.start, lanes.middle
        )
        grains = begin_grains(
            lanes.middle, lanes.start, lanes.pair, lanes.about, lanes.frame, lanes.impulse,
            lanes.before, lanes.gap, lanes.branch, dt, ratio, scene.period, scene.height,
            scene.tilt, *self._gradient(start),
        )  # fmt: skip
        walls = begin_walls(scene, laws, start, dt, ratio, lanes.of_walls, contacts)
        faces, beyond, lacking = None, _NONE, 0.0
        if selection.faces.first.size:
            assert step.pieces is not None
            faces, lacking, beyond = begin_faces(
                scene, step.pieces, laws, start, layout.free, dt, ratio, least, LASTS * dt,
                selection.faces, stopped, contacts,
            )  # fmt: skip
        opening = None
        if step.growth is not None:
            opening = layout.push(step.growth.rate, dt, contacts)
        if laws.softening_rate.size or laws.table_speed.size or laws.flash_speed.size:
            vary_friction(scene, laws, i, j, lanes.slot, lanes.before, lanes.frame)
        if laws.adhesion.size or laws.rolling.size:
            selection.tabulate()
        attraction = self._begin_adhesion(scene, step.pieces, dt) if laws.adhesion.size else 0.0
        if laws.rolling.size:
            row = warm_rows(layout.model.grain_count, state.contact_i)
            begin_rolling(
                scene, laws, start, row, state.contact_j, state.contact_couple, ratio, contacts
            )
            contacts["mu_r"][selection.faces.rows] = 0.0  # which is for discs to have
        speeds, is_solved = [grains, walls], True
        closing = grains.closing or walls.closing or (faces is not None and faces.closing)
        if opening is not None and not closing:
            speeds.append(opening)
        if faces is not None:
            speeds.append(faces)
        if step.flight is not None:
            left = leave_flights_out(
                scene, step.flight.flying, self.motion.is_free, i, j, lanes.lane, lanes.frame,
                lanes.before, contacts, layout.free,
            )  # fmt: skip
            speeds.append(step.flight.speeds)
            is_solved = left > 0
        of_all = Speeds(*map(sum, zip(*speeds, strict=True)))
        scale = self.scale(step, of_all, self.pushes(step), attraction)
        if scale.velocity == 0.0 or not is_solved:
            # Nothing closes and nothing pushes: the last impulses must not act once more.
            lanes.impulse[:] = 0.0
            contacts["p_n"], contacts["p_t"], contacts["p_r"] = 0.0, 0.0, 0.0
        return contacts, scale, is_solved, lacking, beyond

    def pushes(self, step: Prediction) -> tuple[float, float]:
        """What weight does in a step, Δt |g| [m/s], and loads over a diameter, Δt P d̄ [N s]."""
        diameter = self.layout.model.mean_diameter
        return (
            step.dt * hypot(*step.gravity.tolist()), step.dt * self.motion.pressure() * diameter
        )  # fmt: skip

    def scale(
        self, step: Prediction, speeds: Speeds, pushes: tuple[float, float], attraction: float = 0.0
    ) -> ResidualScale:
        """The scale of the residuals, with the sums over all contacts and what `pushes`."""
        layout = self.layout
        return ResidualScale.of(
            speeds, layout.mass, layout.model.grain_count, *pushes, attraction, self.restitution,
            layout.model.mean_diameter / step.dt, step.rounding,
        )  # fmt: skip

    def _begin_adhesion(self, scene: Scene, pieces: Pieces | None, dt: float) -> float:
        """Attraction into all contacts and free velocities; returns the largest F Δt [N s]."""
        layout, state, selection = self.layout, self.layout.state, self.layout.selection
        contacts, lanes = selection.contacts, selection.lanes
        row = warm_rows(layout.model.grain_count, state.bridge_i)
        begin_attraction(
            scene, pieces, self.laws, contacts, selection.i, selection.j, layout.before, row,
            state.bridge_j, dt, selection.faces, state.contact_i.size == 0,
        )  # fmt: skip
        scatter_impulses(contacts, lanes.slot, lanes.impulse)
        attract(
            scene, contacts, lanes.place, self.motion.inverse, layout.model.shape_factor,
            lanes.velocity,
        )  # fmt: skip
        return float(contacts["attraction"].max(initial=0.0))

    def assemble(self, scene: Scene, contacts: Contacts) -> OrderedSystem:
        layout, motion = self.layout, self.motion
        return assemble(
            scene, contacts, layout.selection.lanes, motion.belt, motion.inverse,
            layout.model.shape_factor, self.laws.rolling.size > 0, layout.pieces is not None,
        )  # fmt: skip

    def _gradient(self, bodies: Floats) -> tuple[float, float, float]:
        """That of a cell, by the velocities of all bodies; else zeros."""
        if not self.model.is_cell:
            return 0.0, 0.0, 0.0
        xx, yy, xy = bodies[self.layout.model.grain_count, :3].tolist()
        return xx, yy, xy

    # ---- What they end with

    def account(
        self, step: Prediction, end: Scene, pieces: Pieces | None, contacts: Contacts,
        after: Floats, virial: Floats,
    ) -> tuple[ContactSums, Floats]:  # fmt: skip
        """What the contacts lose and exert; bridges that are left go into the state.

        ``virial`` is what that of contacts lacks in a cell, by impacts. Also returns what pairs
        with corners overlap, over their smaller radii, as `account_faces` finds it.
        """
        laws, selection = self.laws, self.layout.selection
        lanes = selection.lanes
        if laws.adhesion.size or laws.rolling.size:
            selection.tabulate()
            if laws.is_wet.any():
                state = self.layout.state
                state.bridge_i, state.bridge_j = bridges_after(end, pieces, laws, contacts)
            of_discs = np.ones(contacts.size, np.bool_)
            of_discs[selection.faces.rows] = False
            which, of_grains = np.flatnonzero(of_discs).astype(np.int32), np.zeros(SUMS)
        else:
            which, of_grains = lanes.of_walls, account_grains(
                lanes.middle, lanes.velocity, lanes.pair, lanes.about, lanes.frame, lanes.impulse,
                lanes.before, lanes.gap, lanes.branch, lanes.depth, step.dt, step.scene.period,
                *self._gradient(after),
            )  # fmt: skip
        sums = account_contacts(step.scene, end, contacts, after, which, of_grains)
        overlaps = np.zeros(selection.faces.first.size)
        if pieces is not None:
            attracted = account_faces(
                step.scene, end, pieces, contacts, after, selection.faces, sums.total,
                sums.wall_impulse, sums.belt_impulse, overlaps,
            )  # fmt: skip
            sums = sums._replace(adhesion_work=sums.adhesion_work + attracted)
        if self.model.is_cell:
            sums.total[VIRIAL : VIRIAL + 4] += virial
            of_contacts = sums.total[[VIRIAL, VIRIAL + 3, VIRIAL + 1]]
            sums.wall_impulse[0] = of_contacts + step.convected
        return sums, overlaps

    def deep_pairs(self, least: float) -> tuple[Ints, Ints, float]:
        """Pairs of discs and walls, of which some may overlap by more than ``least`` after a step.

        All others do by what is returned last at most, over the smaller radius.
        """
        laws, selection = self.laws, self.layout.selection
        if laws.adhesion.size or laws.rolling.size or self.model.is_cell:
            return selection.pair_i, selection.pair_j, 0.0  # `account` has not asked the lanes
        return selection.deep_pairs(least)
