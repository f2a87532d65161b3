"""Forces and moments on a body, compiled: air, coefficients, thrust, canards (Eqs. 3-15).

Vectors are tuples of three numbers, which the compiler keeps in registers. A flight's scalars are
one record, its tables one flat array: counting references to an array for each table costs time.
Equations are those of the source paper, in the forms of exterior ballistics, as it gives their
dependencies only.
"""

from typing import Any, NamedTuple, TypeAlias

import numpy as np

from fgnav.checks import FloatArray
from fgnav.kernels.compiled import kernel
from fgnav_sim.vehicle.atmosphere import CELL_M, FLOOR_M, GEOPOTENTIAL_RADIUS_M

Vector: TypeAlias = tuple[float, float, float]
Quaternion: TypeAlias = tuple[float, float, float, float]
Frame: TypeAlias = tuple[Vector, Vector, Vector]
Inertia: TypeAlias = tuple[float, float, float, float, float, float]
Flow: TypeAlias = tuple[float, float, Vector, Vector]  # density, pressure, v_b and w_b against air
Body: TypeAlias = Any  # a record of BODY

# Where things are in a state: position, velocity, quaternion wxyz of R_ib, rate w_ib_b, inertial
# spin of a decoupled rear body, distance flown through the air, deflections of four canards.
P, V, Q, W, SPIN, PATH, FINS, SIZE = 0, 3, 6, 10, 13, 14, 15, 19

# Scalars of one flight. Inertias are xx, yy, zz, xy, xz, yz; stations count from the tail.
#   axis_m, polar_m, e2, bulge_m: the planet's semi-axes a and b, e^2, e'^2 b; oblateness_m2 is
#     3/2 J2 a^2
#   reference_m: where the coefficients' moments act; length_m: diameter or chord; rate_factor: 1
#     for p d / V, 1/2 for p d / 2V
#   fore_kgm2: axial inertia of a roll-decoupled forebody; 0: one rigid body
#   canard_m2: of one canard; 0: no canards; canard_clock_rad: of the first, from +y_b towards +z_b,
#     the others follow by 90 degrees
#   frequency_radps: of the autopilot; 0: none
_SCALARS = """axis_m polar_m e2 bulge_m earth_radps gm_m3ps2 oblateness_m2 dry_kg propellant_kg
    dry_centre_m loaded_centre_m nozzle_m reference_m area_m2 length_m span_m rate_factor
    gust_interval_m fore_kgm2 bearing_nms canard_m2 canard_station_m canard_arm_m canard_clock_rad
    deflection_rad rate_radps lag_s frequency_radps damping command_interval_s"""
# Where tables start in the flat array of all, and their numbers of rows. mach: grid, then cubics
# (row, power, COEFFICIENTS), highest power first; burn: times, then quartics (row, power, (thrust,
# fraction burnt)); wind: heights, then (row, (north, east)); gust: (row, (north, east, down));
# command: (row, (roll, pitch, yaw, and their rates)).
_TABLES = "mach machs burn burns wind winds gust gusts command commands"
BODY = np.dtype(
    [("gravity", "i8"), ("aerodynamics", "i8")]  # indices into GRAVITY, AERODYNAMICS
    + [(name, "f8") for name in _SCALARS.split()]
    + [("dry_kgm2", "f8", (6,)), ("loaded_kgm2", "f8", (6,))]
    + [(name, "i8") for name in _TABLES.split()]
)
GRAVITY = ("j2", "spherical", "wgs84-normal", "constant")
AERODYNAMICS = ("none", "axisymmetric", "airframe")
# Coefficients stand in the order of the fields of ``tables.Axisymmetric`` and ``tables.Airframe``;
# the canards' slope comes after either set; their number is a multiple of four.
CANARD, COEFFICIENTS = 14, 16
_NOT_NEGATIVE = 2**48 - 1  # a mask that says so: indices need no check, loops vectorise


class Model(NamedTuple):
    """A flight."""

    body: Body
    tables: Any  # whose parts start where the body says
    air: Any  # see ``atmosphere.us_1976``


@kernel
def cross(a: Vector, b: Vector) -> Vector:
    """Return a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def dot(a: Vector, b: Vector) -> float:
    """Return a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def added(a: Vector, b: Vector, factor: float) -> Vector:
    """Return a + factor b."""
    return a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]


@kernel
def rotate(R: Frame, v: Vector) -> Vector:
    """Return R v, with R as three rows."""
    return dot(R[0], v), dot(R[1], v), dot(R[2], v)


@kernel
def rotate_back(R: Frame, v: Vector) -> Vector:
    """Return R' v."""
    w = added((0.0, 0.0, 0.0), R[0], v[0])
    return added(added(w, R[1], v[1]), R[2], v[2])


@kernel
def air_at(air: FloatArray, height: float) -> tuple[float, float]:
    """Return density and speed of sound; above the table density fades with its last slope."""
    geopotential = GEOPOTENTIAL_RADIUS_M * height / (GEOPOTENTIAL_RADIUS_M + height)
    x = (geopotential - FLOOR_M) * (1 / CELL_M)
    k = min(max(int(x), 0), len(air) - 1)
    x = (x - k) * CELL_M
    beyond = max(x - CELL_M, 0.0)
    x -= beyond
    density = ((air[k, 0] * x + air[k, 1]) * x + air[k, 2]) * x + air[k, 3]
    if beyond > 0.0 and density > 0.0:
        slope = (3 * air[k, 0] * x + 2 * air[k, 1]) * x + air[k, 2]
        density *= np.exp(beyond * slope / density)
    return density, ((air[k, 4] * x + air[k, 5]) * x + air[k, 6]) * x + air[k, 7]


@kernel
def interval_of(tables: FloatArray, at: int, count: int, value: float) -> int:
    """Return the interval of an increasing grid that holds a value, the nearest one outside."""
    low, high = 0, count - 1
    while high - low > 1:
        middle = (low + high) // 2
        if value < tables[at + middle]:
            high = middle
        else:
            low = middle
    return low


@kernel
def wind_at(body: Body, tables: FloatArray, height: float, path: float) -> Vector:
    """Return wind and gust, north, east, down."""
    grid, wind = body.wind, body.wind + body.winds
    north, east = tables[wind], tables[wind + 1]
    if body.winds > 1:
        k = interval_of(tables, grid, body.winds, height)
        x = (height - tables[grid + k]) / (tables[grid + k + 1] - tables[grid + k])
        x, wind = min(max(x, 0.0), 1.0), wind + 2 * k
        north = tables[wind] + x * (tables[wind + 2] - tables[wind])
        east = tables[wind + 1] + x * (tables[wind + 3] - tables[wind + 1])
    gust = body.gust
    if body.gusts == 1:
        return north + tables[gust], east + tables[gust + 1], tables[gust + 2]
    x = min(max(path / body.gust_interval_m, 0.0), body.gusts - 1.0)
    k = max(min(int(x), body.gusts - 2), 0)  # where x is no number, too
    x, gust = x - k, gust + 3 * k
    return (
        north + tables[gust] + x * (tables[gust + 3] - tables[gust]),
        east + tables[gust + 1] + x * (tables[gust + 4] - tables[gust + 1]),
        tables[gust + 2] + x * (tables[gust + 5] - tables[gust + 2]),
    )


@kernel
def coefficients_at(body: Body, tables: FloatArray, mach: float, out: FloatArray) -> None:
    """Write all coefficients at a Mach number; outside the table its ends hold."""
    grid, n = body.mach, COEFFICIENTS
    mach = min(max(mach, tables[grid]), tables[grid + body.machs - 1])
    k = interval_of(tables, grid, body.machs, mach)
    x = mach - tables[grid + k]
    c = (grid + body.machs + 4 * n * k) & _NOT_NEGATIVE
    for j in range(n):
        value = (tables[c + j] * x + tables[c + n + j]) * x + tables[c + 2 * n + j]
        out[j] = value * x + tables[c + 3 * n + j]


@kernel
def axisymmetric(
    body: Body, c: FloatArray, flow: Flow, spin: float
) -> tuple[Vector, Vector, float]:
    """Return force, and moment without and with spin damping apart, of the paper's Eqs. 3-13."""
    density, _, v_b, w_b = flow
    x, y, z = v_b
    v = np.sqrt(dot(v_b, v_b))
    alpha2 = np.arctan2(np.sqrt(y * y + z * z), x) ** 2
    d, k = body.length_m, 0.5 * density * body.area_m2
    rate = body.rate_factor * d
    drag, lift = -k * v * (c[0] + c[1] * alpha2), k * (c[2] + c[3] * alpha2)
    damping, magnus = k * v * rate * c[4], k * rate * spin * c[5]
    force = (
        drag * x + lift * (v * v - x * x),
        (drag - lift * x) * y + damping * w_b[2] + magnus * z,
        (drag - lift * x) * z - damping * w_b[1] - magnus * y,
    )
    over, damping = k * d * v * (c[6] + c[7] * alpha2), k * d * v * rate * c[8]
    magnus = k * d * rate * spin * c[9]
    moment = (
        0.0,
        over * z + damping * w_b[1] + magnus * y,
        -over * y + damping * w_b[2] + magnus * z,
    )
    return force, moment, k * d * v * rate * c[10] * spin


@kernel
def airframe(body: Body, c: FloatArray, flow: Flow) -> tuple[Vector, Vector]:
    """Return force and moment of an aeroplane's linear derivatives, drag against the airflow."""
    density, _, v_b, w_b = flow
    v = np.sqrt(dot(v_b, v_b))
    level = np.sqrt(v_b[0] * v_b[0] + v_b[2] * v_b[2])
    alpha, beta = np.arctan2(v_b[2], v_b[0]), np.arctan2(v_b[1], level)
    sine, cosine = (v_b[2] / level, v_b[0] / level) if level > 0.0 else (0.0, 1.0)
    k, rate = 0.5 * density * body.area_m2 * v, body.rate_factor
    p, q, r = w_b[0] * body.span_m, w_b[1] * body.length_m, w_b[2] * body.span_m
    cl = c[2] + c[3] * alpha
    drag, lift = -k * (c[0] + c[1] * cl * cl), k * v * cl
    force = (
        drag * v_b[0] + lift * sine,
        drag * v_b[1] + k * v * c[4] * beta,
        drag * v_b[2] - lift * cosine,
    )
    moment = (
        k * body.span_m * (v * c[5] * beta + rate * (c[6] * p + c[7] * r)),
        k * body.length_m * (v * (c[8] + c[9] * alpha) + rate * c[10] * q),
        k * body.span_m * (v * c[11] * beta + rate * (c[12] * p + c[13] * r)),
    )
    return force, moment


@kernel
def canard(
    body: Body, fin: int, centre_m: float, flow: Flow
) -> tuple[Vector, Vector, Vector, float]:
    """Return hinge and normal of a canard, where it is from the centre of mass, its incidence."""
    angle = body.canard_clock_rad + 0.5 * np.pi * fin
    hinge = (0.0, np.cos(angle), np.sin(angle))
    normal = (0.0, -hinge[2], hinge[1])
    lever = added((body.canard_station_m - centre_m, 0.0, 0.0), hinge, body.canard_arm_m)
    past = added(flow[2], cross(flow[3], lever), 1.0)
    return hinge, normal, lever, np.arctan2(dot(past, normal), past[0])


@kernel
def canards(
    body: Body, slope: float, centre_m: float, flow: Flow, y: FloatArray
) -> tuple[Vector, Vector]:
    """Return force and moment of the four canards (Eqs. 14-15), each along its turned normal."""
    force, moment = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for fin in range(4):
        _, normal, lever, incidence = canard(body, fin, centre_m, flow)
        push = flow[1] * body.canard_m2 * slope * (y[FINS + fin] - incidence)
        sine, cosine = np.sin(y[FINS + fin]), np.cos(y[FINS + fin])
        normal = (-sine, normal[1] * cosine, normal[2] * cosine)
        force = added(force, normal, push)
        moment = added(moment, cross(lever, normal), push)
    return force, moment


@kernel
def mass_at(body: Body, left: float) -> tuple[float, float, Inertia]:
    """Return mass, station of its centre and inertia with a fraction of the propellant left."""
    dry, loaded = body.dry_kgm2, body.loaded_kgm2
    inertia = (
        dry[0] + (loaded[0] - dry[0]) * left,
        dry[1] + (loaded[1] - dry[1]) * left,
        dry[2] + (loaded[2] - dry[2]) * left,
        dry[3] + (loaded[3] - dry[3]) * left,
        dry[4] + (loaded[4] - dry[4]) * left,
        dry[5] + (loaded[5] - dry[5]) * left,
    )
    centre_m = body.dry_centre_m + (body.loaded_centre_m - body.dry_centre_m) * left
    return body.dry_kg + body.propellant_kg * left, centre_m, inertia


@kernel
def jet_damping(body: Body, centre_m: float, left_rate: float, w: Vector) -> Vector:
    """Return the moment on pitch and yaw of what leaves, less what the inertia keeps of it."""
    jet = (body.nozzle_m - centre_m) ** 2 * body.propellant_kg
    pitch = jet - (body.loaded_kgm2[1] - body.dry_kgm2[1])
    yaw = jet - (body.loaded_kgm2[2] - body.dry_kgm2[2])
    return 0.0, pitch * left_rate * w[1], yaw * left_rate * w[2]


@kernel
def burning(body: Body, tables: FloatArray, t: float) -> tuple[float, float, float]:
    """Return thrust, fraction of propellant left, and its rate."""
    grid, last = body.burn, body.burn + body.burns - 1
    if body.propellant_kg == 0.0 or t < tables[grid]:
        return 0.0, 1.0, 0.0
    if t >= tables[last]:
        return 0.0, 0.0, 0.0
    k = interval_of(tables, grid, body.burns, t)
    x, thrust, burnt, rate = t - tables[grid + k], 0.0, 0.0, 0.0
    c = last + 1 + 10 * k
    for j in range(c, c + 10, 2):
        rate = rate * x + burnt  # Horner's scheme and its derivative
        thrust, burnt = thrust * x + tables[j], burnt * x + tables[j + 1]
    return thrust, 1.0 - burnt, -rate
