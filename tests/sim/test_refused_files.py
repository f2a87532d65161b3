"""What a scenario, a world or a vehicle may not say: one line with file, key, rule and value.

In the tables lines of a file stand above the message that they cause, which is indented.
"""

import re
from pathlib import Path

import pytest

import fgnav_sim
from fgnav.checks import BadInputError
from fgnav_sim.data_sets.world import load_world
from fgnav_sim.scenario import load_scenario
from fgnav_sim.vehicle.tables import load_vehicle

ROCKET = Path(fgnav_sim.__file__).parent / "vehicles" / "rocket.toml"
FLOWN = """\
[flown]
vehicle = "rocket"
start = { v_b_mps = [100.0, 0.0, 0.0], euler_deg = [0.0, 80.0, 0.0] }
"""
SCENARIOS = r"""
duraton_s = 5
    duraton_s: unknown; the nearest known key is .*duration_s
duration_s = -5
    duration_s: must be float > 0.0, got -5
duration_s = 1e9
    duration_s: must be float <= 604800.0, got 1000000000.0
duration_s = nan
    duration_s: must be finite, got nan
duration_s = "x"
    duration_s: must be float, got str, got 'x'
start = "1970-01-01T00:00:00"
    start: must not lie before 1980-01-06T00:00:00
start = "2020-06-25T00:00:00Z"
    start: must be datetime with no timezone
gravity = "moon"
    gravity: must be
antennas_b_m = []
    antennas_b_m: must hold one antenna or more
antennas_b_m = [[0, 0]]
    antennas_b_m\[0\]: .*length 3
antennas_b_m = [[0, 0, inf]]
    antennas_b_m\[0\]\[2\]: must be finite, got inf
origin = { latitude_deg = 91 }
    origin.latitude_deg: must be float <= 90.0, got 91
motion = { rol = {} }
    motion.rol: unknown; the nearest known key is .*roll
motion = { roll = { kind = 'sinus' } }
    motion.roll.kind: must be one of hold, ramp, sine, rate, got 'sinus'
motion = { roll = { amplitude_deg = 3 } }
    motion.roll.kind: must be one of .*, got nothing
motion = { roll = { kind = 'sine', amplitude = 3 } }
    motion.roll.amplitude: unknown; the nearest known key is .*amplitude_deg
motion = { roll = { kind = 'sine' } }
    motion.roll: 'amplitude_deg' is missing
motion = { path = { kind = 'arc', radius_m = 0 } }
    motion.path.radius_m: must be float > 0.0, got 0
gnss = { signals = { R = ['1C'] } }
    gnss.signals.R: the constellation must be one of G \
gnss = { signals = {} }
    gnss.signals: must name one constellation or more
gnss = { signals = { G = [] } }
    gnss.signals.G: must name one signal or more, each once
gnss = { signals = { G = ['L1'] } }
    gnss.signals.G: 'L1' is not a RINEX 3 signal
gnss = { elevation_weights = 'cosine' }
    gnss.elevation_weights: must be
gnss = { clock = { offset_s = 1 } }
    gnss.clock.offset_s: must be float <= 0.001, got 1
gnss = { antenna_noise = [1, 2] }
    gnss.antenna_noise: must hold a factor for each of 8 antennas, got 2
gnss = { rinex = '2.11' }
    gnss.rinex: must be
gnss = { choose = 3 }
    gnss.choose: must be int >= 4, got 3
gnss = { choose = 'some' }
    gnss.choose: must be
gnss = { orbits = ['none.sp3'] }
    gnss.orbits: no such file, got '.*none.sp3'
gnss = { navigation = ['none.rnx'] }
    gnss.navigation: no such file, got '.*none.rnx'
gnss = { slips = { rate_per_hour = 0 } }
    gnss.slips.rate_per_hour: must be float > 0.0, got 0
gnss = { slips = {} }
    gnss.slips: 'rate_per_hour' is missing; add it
gnss = { slips = { rate_per_hour = 1, flagged_share = 2 } }
    gnss.slips.flagged_share: must be float <= 1.0, got 2
gnss = { outages = [{ from_s = 5, until_s = 5 }] }
    gnss.outages\[0\].until_s: must lie after from_s, got 5
gnss = { outages = [{ elevation_deg = [30, 10] }] }
    gnss.outages\[0\].elevation_deg: must increase, got \[30.*10
gnss = { outages = [{ antennas = ['a9'] }] }
    gnss.outages\[0\].antennas: must be among a1 to a8, got 'a9'
gnss = { body_mask = { axes_b = [[0, 0, 0]] } }
    gnss.body_mask.axes_b: .* none of them zero
gnss = { body_mask = { axes_b = [[0, 0, 1], [0, 1, 0]] } }
    gnss.body_mask.axes_b: must hold one vector, or one for each of 8 antennas, got 2
gnss = { multipath = { code_m = 1, phase_m = 0 } }
    gnss.multipath: 'time_constant_s' is missing
gnss = { multipath = { code_m = -1, phase_m = 0, time_constant_s = 1 } }
    gnss.multipath.code_m: must be float >= 0.0, got -1
gnss = { reflectors = [{ point_b_m = [0, 0, 1], normal_b = [0, 0, 0] }] }
    gnss.reflectors\[0\].normal_b: must not be zero
gnss = { reflectors = [{ point_b_m = [0, 0, 1], normal_b = [0, 0, 1], amplitude = 1 }] }
    gnss.reflectors\[0\].amplitude: must be float < 1.0, got 1
gnss = { base = { latitude_deg = 91.0, longitude_deg = 0.0, height_m = 0.0 } }
    gnss.base.latitude_deg
gnss = { base = { latitude_deg = 40.0, longitude_deg = 0.0 } }
    gnss.base: 'height_m' is missing
gnss = { base = { latitude_deg = 40.0, longitude_deg = 0.0, height_m = 0.0, rate_hz = 1.0 } }
    gnss.base.rate_hz: unknown
imu = { gyroscope_scale = 1e-3 }
    imu.gyroscope_noise_radps_per_sqrt_hz: goes with the other gyroscope keys
imu = { gyroscope_bias_radps = 1e-3 }
    imu.gyroscope_noise_radps_per_sqrt_hz: goes with the other gyroscope keys
photodetector = {}
    photodetector: 'landmark' is missing
photodetector = { landmark = {}, field_of_view_deg = 30 }
    photodetector.field_of_view_deg: the spot must stay on the detector, within 13.8
photodetector = { landmark = {}, occlusions = [{ quadrant = 5 }] }
    photodetector.occlusions\[0\].quadrant: must be int <= 4, got 5
photodetector = { landmark = {}, occlusions = [{ quadrant = 1, from_s = 2, until_s = 1 }] }
    photodetector.occlusions\[0\].until_s: must lie after from_s, got 1
name =
    must be TOML
"""
FLOWN_SCENARIOS = r"""
ground_m = 800.0
    origin.height_m: the flight must start above flown.
origin = { height_m = -2e4 }
    origin.height_m: must be float > -10000.0
origin = { height_m = -6000.0 }
    origin.height_m: the flight must start above flown
motion = { roll = { kind = 'rate', rate_degps = 1 } }
    motion: a flown scenario has none
imu = {}
earth = { flattening = 0.0 }
    flown.earth: table imu knows the WGS-84 Earth
earth = { flattening = 0.0 }
    flown.gravity: wgs84-normal is the WGS-84 Earth's
earth = { flattening = 0.5 }
    flown.earth.flattening: must be from 0 to below 0.1
imu = {}
gravity = 'j2'
    flown.gravity: an inertial unit feels gravity = 'wgs84-normal'
air = false
gusts = { sigma_mps = 1.0 }
    flown.gusts: need air = true
vehicle = "rigid_body"
attitude = {}
    flown.attitude: needs a vehicle with a table \[autopilot\]
vehicle = "none.toml"
    flown.vehicle: no such file
wind = { height_m = [1.0, 0.0] }
    flown.wind.height_m: must increase, row 1 has 0 after 1
wind = { height_m = [] }
    flown.wind.height_m: must hold one height or more
wind = { north_mps = [1.0, 2.0] }
    flown.wind.north_mps: must hold 1 values, one for each of height_m, got 2
dispersions = { flown.vehicle.body.mas_kg = 1.0 }
    dispersions.flown.vehicle.body.mas_kg: unknown; the nearest known
dispersions = { imu.rate_hz = 1.0 }
    dispersions.imu.rate_hz: unknown; the nearest known key is
"""
ABOVE = ("origin", "motion", "imu", "dispersions")  # tables beside the flown one
WORLDS = r"""
kind = 'sky'
    kind: must be array or gravity, got 'sky'
epochs = 0
    epochs: must be int >= 1, got 0
nosie = {}
    nosie: unknown; the nearest known key is noise
shard_epochs = 10
runs = { epochs = 3 }
    shard_epochs: must hold whole runs of 3
runs = { epochs = 5761 }
shard_epochs = 5761
    times.duration_s: must be longer than
sites = { kind = 'moon' }
    sites.kind: must be one of fixed, anywhere, got 'moon'
sites = { kind = 'fixed', place = { latitude_deg = 91.0 } }
    sites.place.latitude_deg
satellites = { choose = [6, 4] }
    satellites.choose: must be above zero, and a range
satellites = { choose = 0 }
    satellites.choose: must be above zero
satellites = { signals = {} }
    satellites.signals: must name one constellation
satellites = { signals = { X = ['1C'] } }
    satellites.signals.X: the constellation must be one of
satellites = { signals = { G = ['9C'] } }
    satellites.signals.G: '9C' is not a RINEX 3 signal
noise = { code_m = -1.0 }
    noise.code_m: must be above zero, and a range
noise = { phase_m = [0.1, 0.2, 0.3] }
    noise.phase_m: must be above zero, and a range
antennas_b_m = [[0, 0, 0]]
    antennas_b_m: must hold two antennas or more
kind = 'gravity'
shard_epochs = 30
    shard_epochs: must hold whole flights of 20
kind = 'gravity'
motion = { climb_deg = [9, 5] }
    motion.climb_deg: must be zero or more, and a range
kind = 'gravity'
motion = { speed_mps = [0, 5] }
    motion.speed_mps: must be above
"""
VEHICLES = r"""
cd0 = => cd_0 =
    aerodynamics.cd_0: unknown; the nearest known key is .*cd0
[autopilot] => [pilot]
    pilot: unknown; the nearest known key is autopilot
1.5, 2.0 => 2.5, 2.0
    aerodynamics\.mach: must increase, row 7 has 2 after 2.5
cd0 = [0.38,  => cd0 = [
    aerodynamics.cd0: must hold 9 .* for each of mach, got 8
"d/2v" => "d/3v"
    aerodynamics.rate_terms: must be
"axisymmetric" => "round"
    aerodynamics.kind: must be one of axisymmetric, airframe
slope = [2.6,  => slope = [
    canards.slope: must hold 9 values
mass_kg = 17.2 => mass_kg = 0
    body.mass_kg: must be float > 0.0, got 0
mass_kg = 17.2 => mass_kg = nan
    body.mass_kg: must be finite, got nan
mass_kg = 17.2 => # none
    body: 'mass_kg' is missing
[0.0255, 16.8, 16.8] => [0.0255, 16.8, 18.0]
    body.inertia_kgm2: no body has
[0.028, 20.3, 20.3] => [99.0, 20.3, 20.3]
    motor.loaded_inertia_kgm2: no body has
0.1, 0.5, 1.5 => 0.1, 0.05, 1.5
    motor.time_s: must increase, row 2 has 0.05
[0.0, 1700.0 => [1700.0
    motor.thrust_n: must hold 7 values
forebody_inertia_kgm2 = 0.004 => forebody_inertia_kgm2 = 0.1
    .*must be below .* 0.0255
station_m = 3.1 => station_m = 1.813
    canards.station_m: must differ
deflection_deg = 15.0 => deflection_deg = 95.0
    canards.deflection_deg: .* < 90
"""
BODIES = r"""
[autopilot]
    autopilot: needs a table \[canards\]
[canards]
area_m2 = 1
station_m = 1
arm_m = 1
    canards: need a table \[aerodynamics\]
[aerodynamics]
kind = "axisymmetric"
diameter_m = 0.1
mach = []
    aerodynamics.mach: must hold 1 values or more
[motor]
propellant_kg = 1
loaded_inertia_kgm2 = [1, 1, 1]
loaded_centre_m = 0
time_s = [0, 1]
thrust_n = [0, 0]
    motor.thrust_n: must rise above zero
"""


def cases(table):
    """Return what is written, and the message, of a table."""
    found = re.findall(r"((?:^\S.*\n)+)    (.*)\n", table, re.MULTILINE)
    return [(lines.rstrip("\n"), message.rstrip("\\")) for lines, message in found]


def assert_refused(load, path, text, message):
    path.write_text(text, encoding="utf-8")
    with pytest.raises(BadInputError, match=rf"^{path}: (key )?{message}") as caught:
        load(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("text", "message"), cases(SCENARIOS))
def test_a_bad_scenario_is_refused_in_one_line(tmp_path, text, message):
    assert_refused(load_scenario, tmp_path / "flight.toml", text, message)


@pytest.mark.parametrize(("text", "message"), cases(FLOWN_SCENARIOS))
def test_a_bad_flown_scenario_is_refused_in_one_line(tmp_path, text, message):
    lines = text.split("\n")
    above = [line for line in lines if line.startswith(ABOVE)]
    inside = [line for line in lines if not line.startswith(ABOVE)]
    given = {line.partition(" ")[0] for line in inside}
    flown = [line for line in FLOWN.splitlines() if line.partition(" ")[0] not in given]
    whole = "\n".join([*above, *flown, *inside])
    assert_refused(load_scenario, tmp_path / "flown.toml", whole, message)


@pytest.mark.parametrize(("text", "message"), cases(WORLDS))
def test_a_bad_world_is_refused_in_one_line(tmp_path, text, message):
    assert_refused(load_world, tmp_path / "world.toml", text, message)


@pytest.mark.parametrize(("change", "message"), cases(VEHICLES))
def test_a_bad_vehicle_is_refused_in_one_line(tmp_path, change, message):
    old, new = change.split(" => ")
    rocket = ROCKET.read_text(encoding="utf-8")
    assert old in rocket
    changed = rocket.replace(old, new, 1)
    assert_refused(load_vehicle, tmp_path / "rocket.toml", changed, message)


@pytest.mark.parametrize(("text", "message"), cases(BODIES))
def test_a_part_that_a_body_cannot_have_is_refused_in_one_line(tmp_path, text, message):
    whole = f"[body]\nmass_kg = 1\ninertia_kgm2 = [1, 1, 1]\n{text}\n"
    assert_refused(load_vehicle, tmp_path / "body.toml", whole, message)
