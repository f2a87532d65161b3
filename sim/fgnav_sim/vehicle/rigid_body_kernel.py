"""A rigid body's right-hand side and its Runge-Kutta steps, compiled (Eqs. 1, 2, 16, 17).

The state is inertial (frame ``i``: the Earth's axes at ``t_s = 0``), so the Earth's rotation enters
through the start and the air only, and nothing here needs to know the time of day: gravity, height
and the local axes are the same along a parallel.
"""

import zlib
from pathlib import Path

import numpy as np

from fgnav.checks import FloatArray
from fgnav.geometry import earth
from fgnav.kernels.compiled import kernel
from fgnav_sim.vehicle import autopilot, forces
from fgnav_sim.vehicle.autopilot import attitude_demand, deflections
from fgnav_sim.vehicle.forces import (
    CANARD,
    COEFFICIENTS,
    FINS,
    PATH,
    SIZE,
    SPIN,
    Body,
    Flow,
    Frame,
    Inertia,
    Model,
    P,
    Q,
    Quaternion,
    V,
    Vector,
    W,
    added,
    air_at,
    airframe,
    axisymmetric,
    burning,
    canards,
    coefficients_at,
    cross,
    dot,
    jet_damping,
    mass_at,
    rotate,
    rotate_back,
    wind_at,
)  # fmt: skip

# As an argument's default this is part of the compiled functions' key: numba's cache notices a
# change of a function's own file only, not of what it calls in others.
SOURCES = zlib.crc32(b"".join(Path(str(m.__file__)).read_bytes() for m in (forces, autopilot)))

_A, _E2, _F = earth.SEMI_MAJOR_AXIS_M, earth.ECCENTRICITY_SQUARED, earth.FLATTENING
_EQUATOR_GRAVITY_MPS2, _SOMIGLIANA = (
    9.7803253359,
    1.931852652458e-3,
)  # WGS-84, as in fgnav.geometry.earth
_M = earth.EARTH_RATE_RADPS**2 * _A**3 * (1 - _F) / earth.GM_M3PS2
# What a flight may not exceed: loss of the quaternion's length in a step, and height.
LARGEST_LOSS, LARGEST_M = 1e-3, 1e12
_CONSTANT_MPS2 = earth.STANDARD_GRAVITY_MPS2


@kernel
def rotation(y: FloatArray) -> Frame:
    """Return R_ib of a state, whatever the length of its quaternion."""
    w, a, b, c = y[Q], y[Q + 1], y[Q + 2], y[Q + 3]
    s = 2.0 / (w * w + a * a + b * b + c * c)
    return (
        (1 - s * (b * b + c * c), s * (a * b - w * c), s * (a * c + w * b)),
        (s * (a * b + w * c), 1 - s * (a * a + c * c), s * (b * c - w * a)),
        (s * (a * c - w * b), s * (b * c + w * a), 1 - s * (a * a + b * b)),
    )


@kernel
def place(body: Body, p: Vector) -> tuple[float, float, Frame]:
    """Return height, sine of latitude, and north, east, down in ``i`` (Bowring, one step)."""
    rho2 = p[0] * p[0] + p[1] * p[1]
    rho, r = np.sqrt(rho2), np.sqrt(rho2 + p[2] * p[2])
    a, e2, bulge_m = body.axis_m, body.e2, body.bulge_m
    su, cu = body.polar_m * p[2] * (r + bulge_m), a * rho * r
    u2 = su * su + cu * cu
    u3 = u2 * np.sqrt(u2)
    s = p[2] * u3 + bulge_m * su * su * su
    c = rho * u3 - e2 * a * cu * cu * cu
    k = 1.0 / np.sqrt(s * s + c * c)
    s, c = s * k, c * k
    height = rho * c + p[2] * s - a * np.sqrt(1 - e2 * s * s)
    k = 1.0 / rho if rho > 0.0 else 0.0
    so, co = (k * p[1], k * p[0]) if rho > 0.0 else (0.0, 1.0)
    return height, s, ((-s * co, -s * so, c), (-so, co, 0.0), (-c * co, -c * so, -s))


@kernel
def gravitation(body: Body, p: Vector, height: float, s: float, ned: Frame) -> Vector:
    """Return gravitation in ``i``: what is called gravity on the ground, less the centrifugal."""
    if body.gravity < 2:
        r2 = 1.0 / dot(p, p)
        z2, q = p[2] * p[2] * r2, body.oblateness_m2 * r2
        k = -body.gm_m3ps2 * r2 * np.sqrt(r2)
        level = k * (1 + q * (1 - 5 * z2))
        return level * p[0], level * p[1], k * (1 + q * (3 - 5 * z2)) * p[2]
    north, down = 0.0, _CONSTANT_MPS2
    if body.gravity == 2:  # Groves Eqs. 2.134, 2.139, 2.140, as fgnav.geometry.earth has it
        s2 = s * s
        down = _EQUATOR_GRAVITY_MPS2 * (1 + _SOMIGLIANA * s2) / np.sqrt(1 - _E2 * s2)
        linear = 2 / _A * (1 + _F * (1 - 2 * s2) + _M) * height
        down *= 1 - linear + 3 * height**2 / _A**2
        north = -8.08e-9 * height * 2 * s * np.sqrt(max(0.0, 1 - s2))
    pull = -(body.earth_radps**2)
    g = added((pull * p[0], pull * p[1], 0.0), ned[2], down)
    return added(g, ned[0], north)


@kernel
def momentum(inertia: Inertia, w: Vector) -> Vector:
    """Return I w."""
    a, b, c, ab, ac, bc = inertia
    return (
        a * w[0] + ab * w[1] + ac * w[2],
        ab * w[0] + b * w[1] + bc * w[2],
        ac * w[0] + bc * w[1] + c * w[2],
    )


@kernel
def divided(inertia: Inertia, m: Vector) -> Vector:
    """Return I^-1 m of a symmetric inertia."""
    a, b, c, ab, ac, bc = inertia
    first = (b * c - bc * bc, ac * bc - ab * c, ab * bc - ac * b)
    determinant = a * first[0] + ab * first[1] + ac * first[2]
    k = 1.0 / determinant
    return (
        k * dot(first, m),
        k * dot((first[1], a * c - ac * ac, ab * ac - a * bc), m),
        k * dot((first[2], ab * ac - a * bc, a * b - ab * ab), m),
    )


@kernel
def turning(
    t: float, body: Body, tables: FloatArray, y: FloatArray, flow: Flow, turn: Vector,
    dy: FloatArray, c: FloatArray,
) -> tuple[Vector, float]:  # fmt: skip
    """Write the rates of spins and canards; return force in body axes and mass.

    ``turn`` is the angular acceleration that the autopilot wants.
    """
    w, w_b = (y[W], y[W + 1], y[W + 2]), flow[3]
    thrust, left, left_rate = burning(body, tables, t)
    mass, centre_m, inertia = mass_at(body, left)
    rear = inertia[0] - body.fore_kgm2 if body.fore_kgm2 > 0.0 else 0.0
    inertia = (inertia[0] - rear, *inertia[1:])

    force, moment, slowing = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0
    if flow[1] > 0.0 and body.aerodynamics > 0:
        if body.aerodynamics == 1:
            spin = y[SPIN] - (w[0] - w_b[0]) if rear > 0.0 else w_b[0]
            force, moment, slowing = axisymmetric(body, c, flow, spin)
        else:
            force, moment = airframe(body, c, flow)
        lever = body.reference_m - centre_m
        moment = (moment[0], moment[1] - lever * force[2], moment[2] + lever * force[1])
    dy[SPIN] = 0.0
    if rear > 0.0:
        bearing = body.bearing_nms * (y[SPIN] - w[0])
        dy[SPIN] = (slowing - bearing) / rear
        slowing = bearing
    moment = added(moment, (slowing, 0.0, 0.0), 1.0)
    moment = added(moment, jet_damping(body, centre_m, left_rate, w), 1.0)
    H = added(momentum(inertia, w), (rear * y[SPIN], 0.0, 0.0), 1.0)
    moment = added(moment, cross(w, H), -1.0)

    for fin in range(4):
        dy[FINS + fin] = 0.0
    if body.canard_m2 > 0.0:
        demand = added(momentum(inertia, turn), moment, -1.0)
        deflections(body, c[CANARD], centre_m, flow, demand, y, dy)
        if flow[1] > 0.0:
            push, twist = canards(body, c[CANARD], centre_m, flow, y)
            force, moment = added(force, push, 1.0), added(moment, twist, 1.0)
    dy[W], dy[W + 1], dy[W + 2] = divided(inertia, moment)
    return added(force, (thrust, 0.0, 0.0), 1.0), mass


@kernel
def derivative(
    t: float, body: Body, tables: FloatArray, air: FloatArray, y: FloatArray, dy: FloatArray,
    c: FloatArray, sources: int = SOURCES,  # noqa: ARG001  # see SOURCES
) -> None:  # fmt: skip
    """Write the time derivative of one flight's state; ``c`` is scratch for the coefficients."""
    p, w = (y[P], y[P + 1], y[P + 2]), (y[W], y[W + 1], y[W + 2])
    R_ib = rotation(y)
    height, sine, ned = place(body, p)
    density, sound = air_at(air, height)
    turn_radps = body.earth_radps
    past = (y[V] + turn_radps * y[P + 1], y[V + 1] - turn_radps * y[P], y[V + 2])
    wind = rotate_back(ned, wind_at(body, tables, height, y[PATH]))
    v_b = rotate_back(R_ib, added(past, wind, -1.0))
    w_b = added(w, R_ib[2], -turn_radps)  # against the Earth and its air
    v = np.sqrt(dot(v_b, v_b))
    if body.aerodynamics > 0:
        coefficients_at(body, tables, v / sound, c)
    flow = (density, 0.5 * density * v * v, v_b, w_b)
    turn = (0.0, 0.0, 0.0)
    if body.frequency_radps > 0.0:
        turn = attitude_demand(body, tables, t, R_ib, ned, w_b)
    force, mass = turning(t, body, tables, y, flow, turn, dy, c)
    a = gravitation(body, p, height, sine, ned)
    dy[V], dy[V + 1], dy[V + 2] = added(a, rotate(R_ib, force), 1.0 / mass)
    for k in range(3):
        dy[P + k] = y[V + k]
    q = y[Q], y[Q + 1], y[Q + 2], y[Q + 3]
    dy[Q] = -0.5 * (w[0] * q[1] + w[1] * q[2] + w[2] * q[3])
    dy[Q + 1] = 0.5 * (w[0] * q[0] + w[2] * q[2] - w[1] * q[3])
    dy[Q + 2] = 0.5 * (w[1] * q[0] - w[2] * q[1] + w[0] * q[3])
    dy[Q + 3] = 0.5 * (w[2] * q[0] + w[1] * q[1] - w[0] * q[2])
    dy[PATH] = v


@kernel
def rotate_quaternion(q: Quaternion, angle: Vector) -> Quaternion:
    """Return a quaternion turned about its own axes by a rotation vector, at unit length."""
    x2 = 0.25 * dot(angle, angle)
    if x2 < 0.01:  # series, whose rest is below 1e-17
        k = 0.5 - x2 * (1 / 12 - x2 * (1 / 240 - x2 * (1 / 10080 - x2 / 725760)))
        c = 1 - x2 * (1 / 2 - x2 * (1 / 24 - x2 * (1 / 720 - x2 * (1 / 40320 - x2 / 3628800))))
    else:
        half = np.sqrt(x2)
        k, c = 0.5 * np.sin(half) / half, np.cos(half)
    x, y, z = k * angle[0], k * angle[1], k * angle[2]
    w = c * q[0] - x * q[1] - y * q[2] - z * q[3]
    a = c * q[1] + x * q[0] + z * q[2] - y * q[3]
    b = c * q[2] + y * q[0] + x * q[3] - z * q[1]
    d = c * q[3] + z * q[0] + y * q[1] - x * q[2]
    n = 1.5 - 0.5 * (w * w + a * a + b * b + d * d)  # Newton's step to 1 / length, from 1
    return w * n, a * n, b * n, d * n


@kernel
def precession_lag(body: Body, left: float, spin: float, w: Vector, h: float) -> Vector:
    """Return by how much the rates that a Runge-Kutta step leaves lag behind, to leading order.

    A free body's angular momentum obeys ``H' = H x w``. What of ``w`` is along ``H`` does nothing;
    the rest, ``u``, hardly changes while a body spins, and of ``H' = H x u`` the step leaves out
    ``(h u)^5 / 120``: at 5 Hz and 1 ms that is 20 times all other error of the attitude.
    """
    _, _, inertia = mass_at(body, left)
    rear = inertia[0] - body.fore_kgm2 if body.fore_kgm2 > 0.0 else 0.0
    inertia = (inertia[0] - rear, *inertia[1:])
    H = added(momentum(inertia, w), (rear * spin, 0.0, 0.0), 1.0)
    lateral = 2.0 / (inertia[1] + inertia[2])
    u = added(w, H, -lateral)
    u2 = dot(u, u) * h * h
    return added((0.0, 0.0, 0.0), cross(H, u), lateral * u2 * u2 * h / 120)


@kernel
def step(
    t: float, h: float, body: Body, tables: FloatArray, air: FloatArray, y: FloatArray,
    work: FloatArray,
) -> float:  # fmt: skip
    """Advance a state by one Runge-Kutta step; return by how much its quaternion lost length.

    That quaternion only tells whether the step is short enough. The attitude kept is the old one
    turned by the step's mean rate, and by what two unlike rates turn beside it: the Magnus series
    to fourth order (Blanes et al., Physics Reports 470, 2009), which is exact for a steady spin.
    """
    total, rate, trial, c = work[0], work[1], work[2], work[3]
    q, w = (y[Q], y[Q + 1], y[Q + 2], y[Q + 3]), (y[W], y[W + 1], y[W + 2])
    derivative(t, body, tables, air, y, total, c)
    first = (total[W], total[W + 1], total[W + 2])
    for j in range(SIZE):
        trial[j] = y[j] + 0.5 * h * total[j]
    for stage in range(1, 4):
        weight, reach = (2.0, 0.5) if stage < 3 else (1.0, 1.0)
        derivative(t + reach * h, body, tables, air, trial, rate, c)
        reach = 0.5 if stage == 1 else 1.0
        for j in range(SIZE):
            total[j] += weight * rate[j]
            trial[j] = y[j] + reach * h * rate[j]
    lag = precession_lag(body, burning(body, tables, t)[1], y[SPIN], w, h)
    for j in range(SIZE):
        y[j] += h / 6 * total[j]
    y[W], y[W + 1], y[W + 2] = y[W] + lag[0], y[W + 1] + lag[1], y[W + 2] + lag[2]
    length2 = y[Q] * y[Q] + y[Q + 1] * y[Q + 1] + y[Q + 2] * y[Q + 2] + y[Q + 3] * y[Q + 3]
    # Simpson's rule on the stages' rates, which are w, w + h/2 dw_1, w + h/2 dw_2, w + h dw_3.
    turn = added((total[W], total[W + 1], total[W + 2]), first, 1.0)
    turn = added(turn, (rate[W], rate[W + 1], rate[W + 2]), -1.0)
    turn = added(turn, cross(w, (y[W], y[W + 1], y[W + 2])), 1.0)
    angle = (h * w[0], h * w[1], h * w[2])
    angle = added(angle, turn, h * h / 12)
    y[Q], y[Q + 1], y[Q + 2], y[Q + 3] = rotate_quaternion(q, angle)
    return float(abs(0.5 * (length2 - 1.0)))


@kernel
def fly(
    model: Model, h: float, steps_per_row: int, ground_m: float, out: FloatArray,
    sources: int = SOURCES,  # noqa: ARG001  # see SOURCES
) -> int:  # fmt: skip
    """Fill ``out`` (rows, SIZE) from its row 0; return the number of rows.

    A flight ends after its last row above the ground; a count below zero says that it diverged,
    and after how many rows.
    """
    body, tables, air = model
    work = np.zeros((4, SIZE))
    for row in range(1, len(out)):
        y, worst, first = out[row], 0.0, (row - 1) * steps_per_row
        for j in range(SIZE):
            y[j] = out[row - 1, j]
        for k in range(first, first + steps_per_row):
            worst = max(worst, step(k * h, h, body, tables, air, y, work))
        height = place(body, (y[P], y[P + 1], y[P + 2]))[0]
        if not (worst < LARGEST_LOSS and height < LARGEST_M):
            return -row
        if height < ground_m:
            return row
    return len(out)


@kernel
def rates(
    model: Model, t_s: FloatArray, y: FloatArray, dy: FloatArray,
    sources: int = SOURCES,  # noqa: ARG001  # see SOURCES
) -> None:  # fmt: skip
    """Fill ``dy`` (rows, SIZE) with the time derivatives of states."""
    body, tables, air = model
    c = np.zeros(COEFFICIENTS)
    for row in range(len(y)):
        derivative(t_s[row], body, tables, air, y[row], dy[row], c)
