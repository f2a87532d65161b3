"""A sample of a whole flight's epochs: about where its antenna was, and whether it had air."""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.gnss.single_point.adjustment import adjust
from fgnav.gnss.single_point.atmosphere_choice import Deciding
from fgnav.gnss.single_point.model import CodeChannels, code_ranges
from fgnav.types.flight import Flight
from fgnav.types.observations import Observations

_TRIAL_EPOCHS = 200


@dataclass(frozen=True, eq=False, slots=True)
class Starts:
    """Trial epochs, from whose places others take half the steps that they take from the origin."""

    epoch: IntArray
    p_e_m: FloatArray

    def at(self, epoch: IntArray) -> FloatArray | None:
        """Return about where the antenna was at epochs, (k, 3); None if all trials failed."""
        if not len(self.epoch):
            return None
        columns = (np.interp(epoch, self.epoch, column) for column in self.p_e_m.T)
        return np.stack(list(columns), axis=1)


def trial(
    flight: Flight,
    observations: Observations,
    channels: CodeChannels,
) -> tuple[Starts, bool]:
    """Solve a sample of the flight's epochs; return it, and whether there is an atmosphere."""
    epoch = np.linspace(0, len(observations.t_s) - 1, _TRIAL_EPOCHS).astype(np.int64)
    epoch = np.unique(epoch)
    ranges = code_ranges(flight, observations, channels, 0, epoch, rates=False)
    wanted = np.isfinite(ranges.range_m)
    tried = adjust(flight, channels, ranges, wanted, model=True)
    starts = Starts(epoch[tried.converged], tried.p_e_m[tried.converged])
    start_e_m = starts.at(epoch)
    without = adjust(flight, channels, ranges, wanted, model=False, start_e_m=start_e_m)
    deciding = Deciding.of(flight.gnss_noise, epoch, tried, without)
    return starts, not deciding.is_without(flight.broadcast)
