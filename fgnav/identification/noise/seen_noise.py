"""How loud an inertial unit's white noise can be, by its own samples.

White noise of density N shows in means of neighbouring samples over tau: their Allan deviation is
N / sqrt(tau), and whatever else there is, such as motion, only adds to it. So what is identified as
louder than that at all tau from a sample to the next measurement is no noise: an axis, a sign, a
scale or a time that is not as stated. A quadrotor's accelerometer is 80 to 440 times as loud as its
data sheet says, .08 to .7 of this limit; a gyroscope's axis that reads zero for a turn is 6 times
above it, at 300 times its data sheet.
"""

import numpy as np

from fgnav.identification.allan import FEWEST, allan_deviation, longest_run
from fgnav.types.flight import Imu


def greatest_noise(imu: Imu, until_s: float) -> dict[str, float]:
    """Return the greatest density of white noise by component, of its loudest axis.

    Parameters
    ----------
    imu : Imu
    until_s : float
        From a measurement of other sensors to the next.

    Returns
    -------
    dict of str to float
        ``accelerometer``, m/s2/sqrt(Hz), and ``gyroscope``, rad/s/sqrt(Hz), where there is one;
        empty where samples without a gap are too few.
    """
    run = longest_run(imu.t_s)
    if run.stop - run.start < FEWEST:
        return {}
    interval_s = float(np.median(np.diff(imu.t_s[run])))
    records = {"accelerometer": imu.f_b_mps2, "gyroscope": imu.w_b_radps}
    found = {}
    for name, values in records.items():
        if values is not None:
            tau_s, deviation = allan_deviation(values[run], interval_s)
            near = tau_s <= max(until_s, interval_s)
            found[name] = float((deviation[near] * np.sqrt(tau_s[near, None])).max())
    return found
