"""Fabric: directions of contacts and of what they carry, in the strong and the weak network."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats, Model
from multicor_cli.post.bins import Between
from multicor_cli.post.bulk import Bulk, find_bulk
from multicor_cli.post.contacts import LoadedContacts, loaded_contacts, with_forces
from multicor_cli.post.forces import direction_of, sum_directions, waves_of
from multicor_cli.post.mobilization import laws_over_time, mobilized
from multicor_cli.post.rings import axes_of, has_axes, order_of
from multicor_cli.post.source import (
    Frame,
    PostError,
    Run,
    Selection,
    chosen_frames,
    frames_of,
)
from multicor_cli.post.spots import KINDS, kinds_of
from multicor_cli.post.table import Quantity, TimeTable

_KINDS = (
    ("a_c", "anisotropy of contacts a_c", "a_c"),
    ("a_n", "of normal forces a_n", "a_n"),
    ("a_t", "of tangential forces a_t", "a_t"),
    ("a_l", "of branch lengths a_l", "a_l"),
    ("sliding", "share of sliding contacts", ""),
    ("mobilization", "mean mobilization of friction", ""),
)


def _of_network(name: str) -> tuple[Quantity, ...]:
    return tuple(
        Quantity(f"{name}_{key}", f"{name}: {label}", symbol) for key, label, symbol in _KINDS
    )


QUANTITIES = (
    Quantity("contacts", "contacts between grains"),
    Quantity("stress_ratio", "stress ratio q/p of these contacts", "q/p"),
    Quantity("stress_fabric", "½(a_c + a_n + a_t + a_l)"),
    Quantity("difference", "q/p less that"),
    Quantity("stress_fabric_full", "the same sum with products of these"),
    Quantity("theta_s", "direction of the major principal stress", r"\theta_\sigma", "deg"),
    Quantity("theta_c", "main direction of contacts", r"\theta_c", "deg"),
    *(Quantity(*kind) for kind in _KINDS),
    Quantity("strong_share", "strong: share of the contacts"),
    Quantity("strong_pressure", "strong: share of p"),
    Quantity("strong_deviator", "strong: share of q"),
    *_of_network("strong"),
    *_of_network("weak"),
)
"""What `fabric` measures, in the order of the table."""

_SHARES = (
    ("edge_edge", "contacts of edges with edges"),
    ("edge_corner", "contacts of edges with corners"),
    ("corner_corner", "contacts of corners"),
)

OF_SHAPES = (
    *(Quantity(f"{of}a_lt", f"{name}of branches across normals a_lt", "a_{lt}")
      for of, name in (("", ""), ("strong_", "strong: "), ("weak_", "weak: "))),
    *(Quantity(name, f"{label}, share") for name, label in _SHARES),
    *(Quantity(f"{name}_force", f"{label}, share of the normal forces") for name, label in _SHARES),
    Quantity("nematic_order", "nematic order", "S"),
    Quantity("nematic_director", "director of the long axes", r"\theta_S", "deg"),
)  # fmt: skip
"""What else it measures where not all grains are discs."""

_DIRECTIONS = ("theta_s", "theta_c", "nematic_director")


class Fabric(TimeTable):
    """Fabric of the contacts between grains; ``f`` frames, which count alike in means.

    Of each frame the densities and means over directions θ are

    - E(θ) = (1 + a_c cos 2(θ − θ_c))/2π of contacts, ⟨f_n⟩(θ) = f₀ (1 + a_n cos 2(θ − θ_n)),
    - ⟨f_t⟩(θ) = −f₀ a_t sin 2(θ − θ_t), ⟨ℓ⟩(θ) = ℓ₀ (1 + a_l cos 2(θ − θ_l))

    (Rothenburg & Bathurst, Géotechnique 39, 601, 1989), with the moments of
    `multicor_cli.post.forces.waves_of`. The table has their parts a cos 2(θ_a − θ_σ) along the
    major principal stress of all these contacts: negative where most lies across it (Azéma &
    Radjaï, Phys. Rev. E 85, 031303, 2012). Branches of discs are along normals; those of other
    grains are not, ℓ is then their part along normals, and ⟨ℓ_t⟩(θ) = −ℓ₀ a_lt sin 2(θ − θ_lt) that
    along tangents.

    If all directions agree and forces do not depend on lengths, σ = Σ f⊗ℓ/A has

        q/p = (S + ⅛ a_c (3 a_n a_l + a_t a_l + a_n a_lt − a_t a_lt))
              /(1 + ½ (a_c a_n + a_c a_l + a_n a_l + a_t a_lt)),
        S = ½ (a_c + a_n + a_t + a_l + a_lt)

    with q = ½ (σ₁ − σ₂), p = ½ (σ₁ + σ₂); S, its first order, is the stress–force–fabric relation.

    The strong network are the contacts with f_n > ⟨f_n⟩, the weak one those with 0 < f_n ≤ ⟨f_n⟩,
    with the mean over the contacts of the frame that press (Radjaï, Wolf, Jean & Moreau, Phys. Rev.
    Lett. 80, 61, 1998). Its share of q is along the principal axes of the whole stress: negative if
    it would be sheared the other way; shares of strong, weak and tensile contacts add up to 1.

    Where not all grains are discs, there are `OF_SHAPES`, too: shares of contacts by kind, and what
    they have of the sum of the normal forces that press (`multicor_cli.post.spots.kinds_of`);
    and, if any has a long axis, nematic order and director of those with their center in the bulk.

    Attributes:
        values: Each of `QUANTITIES` by name, nan where not known, shape ``(f,)``.
        margin: What is left out next to the surface of each wall [m]; 0 if nothing is.
    """


def fabric(
    source: Run,
    selection: Selection | None = None,
    *,
    margin: float | None = None,
    between: Between | None = None,
) -> Fabric:
    """Fabric of the contacts between grains: of a cell, of the bulk of a layer, or of all.

    Args:
        source: The run.
        selection: Which frames with forces; default: the later half of the last stage.
        margin: As `multicor_cli.post.rheology.rheology`.
        between: Names of the walls below and above; default: those that bound the grains.

    Raises:
        PostError: If these frames have no contact forces, or none between grains in the bulk; or as
            `multicor_cli.post.bulk.find_bulk`.
        StoreError: If the run cannot be read.
    """
    chosen = with_forces(source, chosen_frames(source, selection))
    bulk, laws = find_bulk(source, chosen, margin, between), laws_over_time(source)
    rows = []
    for frame in frames_of(source, chosen):
        model = frame.model
        contacts = loaded_contacts(frame, model)
        part = mobilized(contacts, contacts.sliding, laws(frame), model, frame)
        counted = ~contacts.is_wall & bulk.holds(frame, contacts)
        virial = [contacts.virial(a, b)[counted] for a in (0, 1) for b in (0, 1)]
        rows.append(_measure(
            contacts.normal[counted], contacts.force[counted], _lengths(contacts)[:, counted],
            np.array(virial), np.column_stack([contacts.sliding[counted], part[counted]]),
        ))  # fmt: skip
        if model.outlines is not None:
            rows[-1] |= _of_shapes(contacts, counted, model, frame, bulk)
    shown = QUANTITIES if source.model.outlines is None else (*QUANTITIES, *OF_SHAPES)
    if not has_axes(source.model):
        shown = tuple(q for q in shown if not q.name.startswith("nematic"))
    values = {q.name: np.array([row.get(q.name, np.nan) for row in rows]) for q in shown}
    if not values["contacts"].any():
        raise PostError(
            "no two grains press on each other in the bulk in these frames: choose other frames, "
            "or lower --margin where there are walls"
        )
    for name in values.keys() & _DIRECTIONS:  # within 90° of their mean, which is within 0 … 180°
        middle = direction_of(complex(np.nansum(np.exp(2j * np.radians(values[name])))))
        values[name] = middle + (values[name] - middle + 90.0) % 180.0 - 90.0
    return Fabric.of_frames(source, chosen, shown, values, margin=bulk.margin)


def _lengths(contacts: LoadedContacts) -> Floats:
    """Branches along normals [m], and along tangents unless all grains are discs, ``(…, c)``."""
    if contacts.shaped is None:
        return contacts.reach[np.newaxis]
    (x, y), (u, v) = contacts.normal.T, contacts.branch.T
    return np.array([u * x + v * y, v * x - u * y])


def _of_shapes(
    contacts: LoadedContacts, counted: NDArray[np.bool_], model: Model, frame: Frame, bulk: Bulk
) -> dict[str, float]:
    """`OF_SHAPES` but for anisotropies, as far as there are any."""
    found = {}
    kind, force = kinds_of(contacts, model, frame)[counted], contacts.force[counted, 0]
    force = np.maximum(force, 0.0)
    for k, name in enumerate(KINDS):
        if kind.size:
            found[name] = float((kind == k).mean())
        if force.any():
            found[f"{name}_force"] = float(force[kind == k].sum() / force.sum())
    order = order_of(axes_of(model, frame)[bulk.inside(frame)])
    return found | dict(zip(("nematic_order", "nematic_director"), order, strict=True))


def _measure(
    normal: Floats, force: Floats, length: Floats, virial: Floats, friction: Floats
) -> dict[str, float]:
    """`QUANTITIES` of the contacts of a frame, as far as there are any.

    Args:
        normal: Unit normals, shape ``(c, 2)``.
        force: Normal and tangential forces [N], shape ``(c, 2)``.
        length: Branches along normals, and perhaps along tangents [m], shape ``(1 or 2, c)``.
        virial: f⊗ℓ: xx, xy, yx, yy [N m], shape ``(4, c)``.
        friction: Whether contacts slide, and how far their friction is mobilized, ``(c, 2)``.
    """
    found: dict[str, float] = {"contacts": float(len(force))}
    if not len(force):
        return found
    pressure = 0.5 * (virial[0] + virial[3])
    deviator = 0.5 * (virial[0] - virial[3]) + 0.5j * (virial[1] + virial[2])  # q e^{2iθ}
    p, q = float(pressure.sum()), complex(deviator.sum())
    axis = q / abs(q) if q else np.nan

    def of(counted: NDArray[np.bool_]) -> dict[str, float]:
        n, f = normal[counted], force[counted]
        if not len(f):
            return {}
        waves = waves_of(*sum_directions(n, (*f.T, *length[:, counted])))
        anisotropies = {f"a_{key}": (wave / axis).real for key, wave in waves.items()}
        slides, mobilization = friction[counted].T
        known = np.isfinite(mobilization)
        mean = float(mobilization[known].mean()) if known.any() else np.nan
        own = {"sliding": float(slides.mean()), "mobilization": mean}
        return anisotropies | own | {"theta_c": direction_of(waves["c"])}

    found |= of(np.ones(len(force), np.bool_))
    c, n, t, along = (found[f"a_{key}"] for key in "cntl")
    first, full = _stress_fabric(c, n, t, along, found.get("a_lt", 0.0))
    ratio = abs(q) / p if p > 0.0 else np.nan
    found |= {
        "stress_ratio": ratio, "stress_fabric": first, "difference": ratio - first,
        "stress_fabric_full": full, "theta_s": direction_of(axis),
    }  # fmt: skip
    presses = force[:, 0] > 0.0
    if not presses.any():
        return found
    strong = force[:, 0] > force[presses, 0].mean()
    for name, network in (("strong", strong), ("weak", presses & ~strong)):
        found |= {f"{name}_{key}": value for key, value in of(network).items()}
    return found | {
        "strong_share": float(strong.mean()),
        "strong_pressure": float(pressure[strong].sum()) / p if p > 0.0 else np.nan,
        "strong_deviator": (complex(deviator[strong].sum()) / q).real if q else np.nan,
    }


def _stress_fabric(
    c: float, n: float, t: float, length: float, across: float
) -> tuple[float, float]:
    """q/p of anisotropies of one direction: their first order, and with products; see `Fabric`."""
    first = 0.5 * (c + n + t + length) + 0.5 * across
    full = first + 0.125 * c * length * (3.0 * n + t) + 0.125 * c * across * (n - t)
    return first, full / (1.0 + 0.5 * (c * n + c * length + n * length) + 0.5 * t * across)
