"""Columns of arrays with a few numbers for each body or contact. Kernels take them as constants.

| array | columns |
|---|---|
| positions of grains and walls | `X`, `Y` [m], `ANGLE` [rad] |
| velocities of grains and walls; inverse masses per degree of freedom | `X`, `Y`, `SPIN` |
| bodies of a step: grains | `X`, `Y`, `SURFACE` = a ω [m/s], `INVERSE_MASS` [1/kg] |
| bodies of a step: walls | `X`, `Y` [m/s], `SURFACE` = Ω [rad/s], `BELT` = −V_s [m/s] |
| the wall that is a cell: velocity gradient [1/s]; inverse inertias | `XX`, `YY`, `XY` |
| … and its sides: width, height, tilt [m] | `XX`, `YY`, `XY` |
| impulses, and relative velocities in the frame of a contact | `NORMAL`, `TANGENTIAL` |
| pairs of bodies | `FIRST`, `SECOND` |
| frames of contacts | `NX`, `NY`, `GAP` [m], `BIAS` [m/s], `MU` |
| frames of contacts in a sweep | `NX`, `NY`, `MASS` = 1/W_nn [kg] or `W_NN`, `BIAS`, `MU` |
| … and | `W_NT`, `W_TT` [1/kg], `SLIDE` = s_j that is taken from u_t [m/s] |
| geometry of wall shapes (`shapes.SHAPES`) | `X`, `Y`; discs, circles: `RADIUS` |
| … other shapes | `X`, `Y`, `TAIL_X`, `TAIL_Y` |
| heat of contacts | `FRICTION`, `IMPACT` [J] |
| heat of walls | `GIVEN` to grains by conduction, `RECEIVED` from friction and impacts [J] |

The surface of a wall, as that of a grain, is positive counter-clockwise.
"""

from __future__ import annotations

X, Y = 0, 1
ANGLE = SPIN = SURFACE = 2
INVERSE_MASS = BELT = 3

XX, YY, XY = 0, 1, 2
"""Components of the velocity gradient of a cell, which is a wall without shapes."""

NORMAL, TANGENTIAL = 0, 1
FIRST, SECOND = 0, 1

NX, NY, BIAS, MU = 0, 1, 3, 4
GAP = MASS = W_NN = 2
W_NT, W_TT, SLIDE = 5, 6, 7
"""Normal, bias and friction have the same columns in the frames of all kinds of contacts."""

RADIUS = 2
TAIL_X, TAIL_Y = 2, 3

FRICTION, IMPACT = 0, 1
GIVEN, RECEIVED = 0, 1
