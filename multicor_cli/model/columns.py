"""Names for the columns of arrays with a few numbers for each body or contact. Kernels take them as
constants.

| array | columns |
|---|---|
| positions of grains and walls | `X`, `Y` [m], `ANGLE` [rad] |
| velocities of grains and walls; inverse masses per degree of freedom | `X`, `Y`, `SPIN` |
| bodies of a step | `X`, `Y` [m/s], `SURFACE` = a ω of a grain [m/s] or Ω of a wall [rad/s],
  `INVERSE_MASS` of a grain [1/kg] or |
| | `BELT` of a wall = −V_s [m/s]: its surface, as that of a grain, is positive counter-clockwise |
| impulses, and relative velocities in the frame of a contact | `NORMAL`, `TANGENTIAL` |
| pairs of bodies | `FIRST`, `SECOND` |
| frames of contacts | `NX`, `NY`, `GAP` [m], `BIAS` [m/s], `MU` |
| frames of contacts in a sweep | `NX`, `NY`, `MASS` = 1/W_nn [kg] or `W_NN`, `BIAS`, `MU`, and
  `W_NT`, `W_TT` [1/kg], and |
| | `SLIDE` = s_j that is taken from u_t [m/s] |
| geometry of wall shapes | `X`, `Y`; discs, circles: `RADIUS`; others: `TAIL_X`, `TAIL_Y`; see
  `multicor_cli.model.shapes.SHAPES` |
| rolling resistance of contacts | `LIMIT` = μ_r, `ARM` = a* [m], `BEFORE` = u_r⁻ [m/s], `COUPLE` =
  p_r [N s] |
| heat of contacts | `FRICTION`, `IMPACT` [J] |
| heat of walls | `GIVEN` to grains by conduction, `RECEIVED` from friction and impacts [J] |
"""

from __future__ import annotations

X, Y = 0, 1
ANGLE = SPIN = SURFACE = 2
INVERSE_MASS = BELT = 3

NORMAL, TANGENTIAL = 0, 1
FIRST, SECOND = 0, 1

NX, NY, BIAS, MU = 0, 1, 3, 4
GAP = MASS = W_NN = 2
W_NT, W_TT, SLIDE = 5, 6, 7
"""Normal, bias and friction have the same columns in the frames of all kinds of contacts."""

LIMIT, ARM, BEFORE, COUPLE = 0, 1, 2, 3

RADIUS = 2
TAIL_X, TAIL_Y = 2, 3

FRICTION, IMPACT = 0, 1
GIVEN, RECEIVED = 0, 1
