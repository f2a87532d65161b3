"""Comments of a new flight.toml: meanings of its keys, what is missing, how to mend it."""

from fgnav.io.flight.columns import RATE
from fgnav.io.importers.assemble import Assembled
from fgnav.types.instruments import USUAL_IMU_NOISE, imu_noise

_MEANING = {
    "start": "GPS time of t_s = 0 of all tables; leap seconds are not counted.",
    "rows": "Rows that were written to each table; what is missing later is counted. Change this "
    "with a table, or drop the line.",
    "antenna": "An antenna: the phase centre, forward, right, down, m, from the body's origin.",
    "origin": "Where north, east, down is fixed; WGS-84, height above the ellipsoid.",
    "gnss": "How raw observations are used. Noise that is not stated is identified.",
    "imu": "The inertial unit, forward, right, down.",
    "imu.position_b_m": "Where the accelerometer sits, m, from the body's origin.",
    "imu.axes": "Which axis of the samples points forward, right, down.",
    "imu.mounting_deg": "Roll, pitch, yaw of the unit, its axes so named, against the body. On "
    'wheels `fgnav check` finds them, where [vehicle] has kind = "wheeled".',
    "imu.clock_offset_s": "Added to t_s of the samples.",
    "fixes": "A receiver's own solution of one antenna.",
    "baseline": "A receiver's vector or heading, from the first antenna to the second.",
    "truth": "A reference that estimates are judged by.",
}
_MISSING = {
    "imu": "No inertial unit was found. Attitude then needs three antennas with observations or "
    "more; add a file of specific force and angular rate.",
    "fixes": "No fixes and no observations were found: nothing states a position. Add a .pos file, "
    "RINEX, or a receiver's file.",
    "truth": "No reference was found: methods are compared with each other. [truth] takes a table.",
    "navigation": "EDIT: no broadcast messages were found; observations cannot be used without. "
    "Fetch the day's, BRDC00IGS_R_*_01D_MN.rnx.gz, from an IGS data centre, and state it:\n"
    'navigation = ["brdc.rnx"]',
    "base": "A base station makes positions good to centimetres:\n"
    'base = { observations = "base.rnx", position_e_m = [x, y, z] }',
}


def comments(assembled: Assembled) -> dict[str, str]:
    """Return comments by key of flight.toml: meanings, then what only this flight lacks."""
    table = assembled.table
    by_key = {
        key: text
        for key, text in _MEANING.items()
        if getattr(table, key.split(".")[0]) or key == "truth"
    }
    if table.truth is None:
        by_key["truth"] = _MISSING["truth"]
    if table.imu is None:
        by_key["imu"] = _MISSING["imu"]
    else:
        gyroscope = RATE[0] in assembled.samples[table.imu.samples]
        if unstated := imu_noise(table.imu, gyroscope=gyroscope)["unstated"]:
            text = "Noise is not stated: it is identified, from these on. State the data sheet's:"
            usual = [f"{name} = {USUAL_IMU_NOISE[name]}" for name in unstated]
            by_key["imu.noise"] = "\n".join([text, *usual])
    if any(antenna.observations for antenna in table.antenna):
        by_key["gnss.base"] = _MISSING["base"]
        if not (table.gnss.navigation or table.gnss.orbits):
            by_key["gnss.navigation"] = _MISSING["navigation"]
    elif not table.fixes:
        by_key["fixes"] = _MISSING["fixes"]
    texts = [*assembled.notes.items()]
    texts += [(key, f"EDIT: {text}") for key, text in assembled.missing.items()]
    for key, text in texts:
        by_key[key] = f"{by_key[key]}\n{text}" if key in by_key else text
    return by_key
