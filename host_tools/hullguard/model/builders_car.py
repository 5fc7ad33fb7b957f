"""A car on its suspensions: one corner, two (a half car) or four; suspension, section 1.1.

Of every corner i the deflection (body over wheel), the body's velocity there, the tyre's compression and the wheel's velocity, in this order:

    deflection' = body - wheel        tyre' = wheel - road
    wheel_kg wheel' = spring deflection + damper deflection' - tyre_npm tyre - force
    body_i' = sum over corners j of W_ij (force_j - spring deflection_j - damper deflection_j')

W is the inverse of the body's mass as the corners feel it: 1/body_kg, and with inertia x_i x_j / pitch_kgm2 + y_i y_j / roll_kgm2 more. Four corners of a
rigid body move in three ways only; that they twist is a state that starts at 0 and stays there.
"""

from __future__ import annotations

import numpy as np

from hullguard.model.table import Array, Table

CORNERS = (1, 2, 4)
TYRE = "tyre_npm"
COMPONENTS = ("spring_npm", "damper_nspm", TYRE)  # what can lose a share of itself
STATES = ("deflection{i}_m", "body{i}_mps", "tyre{i}_m", "wheel{i}_mps")


def suspension(table: Table) -> tuple[Array, Array, Array]:
    """A, B of the forces, and G of the roads' vertical velocities (4 corners states)."""
    corners = table.whole("corners", 1, 4)
    if corners not in CORNERS:
        raise table.error("corners", "expected 1 (a quarter car), 2 (a half car) or 4")
    wheel, spring, damper, tyre = (table.number(key, 1e-6) for key in ("wheel_kg", "spring_npm", "damper_nspm", "tyre_npm"))
    W = _body(table, corners)
    A, B, G = np.zeros((4 * corners, 4 * corners)), np.zeros((4 * corners, corners)), np.zeros((4 * corners, corners))
    for i in range(corners):
        deflection, body, gap, axle = range(4 * i, 4 * i + 4)
        A[deflection, [body, axle]] = 1.0, -1.0
        A[gap, axle], G[gap, i] = 1.0, -1.0
        A[axle, [deflection, body, gap, axle]] = np.array([spring, damper, -tyre, -damper]) / wheel
        B[axle, i] = -1.0 / wheel
        for j in range(corners):
            A[4 * j + 1, [deflection, body, axle]] = np.array([-spring, -damper, damper]) * W[j, i]
            B[4 * j + 1, i] = W[j, i]
    return A, B, G


def _body(table: Table, corners: int) -> Array:
    """W: acceleration of corner i from a force at corner j."""
    W = np.full((corners, corners), 1.0 / table.number("body_kg", 1e-6))
    if corners > 1:
        front, rear = (table.number(key, 1e-3) for key in ("front_m", "rear_m"))  # from the centre of gravity to the axles
        x = np.array([front, -rear]) if corners == 2 else np.array([front, front, -rear, -rear])
        W = W + np.outer(x, x) / table.number("pitch_kgm2", 1e-6)
    if corners == 4:
        half = table.number("track_m", 1e-3) / 2
        y = np.array([half, -half, half, -half])
        W = W + np.outer(y, y) / table.number("roll_kgm2", 1e-6)
    return W


def component_force(component: str, corner: int, table: Table) -> Array:
    """Row c of c x, the force that the whole of a component exerts at a corner, in the direction of the actuator's: 4 corners numbers.

    The loss of a share of a spring or damper acts like share times this force; a tyre is none of these, what it lacks the road seems to add.
    """
    value, corners = table.number(component, 1e-6), table.whole("corners", 1, 4)
    c = np.zeros(4 * corners)
    if component == "spring_npm":
        c[4 * corner] = value
    elif component == "damper_nspm":
        c[4 * corner + 1], c[4 * corner + 3] = value, -value
    return c


def state_names(corners: int) -> tuple[str, ...]:
    """Names of the states, corner after corner."""
    return tuple(name.format(i=i) for i in range(1, corners + 1) for name in STATES)
