"""Attitudes of single epochs in the form that the evidence of a rate prior is computed from."""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.geometry.rotations import log, transpose
from fgnav.process import evidence_kernel
from fgnav.process.evidence_kernel import RESTART, UPDATE, Epochs

_GAP = 10.0  # median spacings: turns across are not counted
# Of the mean rate: two turns a second are nothing special. Where attitudes are far apart, no more
# than what makes any turn between two alike, +-pi: others cannot be told from it.
_MEAN_RATE_SIGMA_RADPS, _ANY_TURN_RAD = 15.0, np.pi / np.sqrt(3)
_OPEN_RAD = 0.5  # 1-sigma of an attitude about an axis, beyond which a rotation vector will not do
NO_TAPE = evidence_kernel.tape(0)
MOST, _BLOCK = 600, 60  # looked at of a longer flight: blocks spread evenly
_FIRST_RATES = 5  # whose median starts the filter: one wrong attitude spoils two


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class AttitudeSeries:
    """Attitudes as the filter takes them; see ``evidence_kernel.log_densities``."""

    epochs: Epochs
    mean_rate: FloatArray  # (4,)

    def __post_init__(self) -> None:
        """Copy the arrays: any other layout, or a read-only one, is a type of its own to numba."""
        copies = Epochs._make(np.array(values, order="C") for values in self.epochs)
        object.__setattr__(self, "epochs", copies)

    @property
    def record_s(self) -> float:
        """Duration, gaps included."""
        return float(self.epochs.t_s[-1] - self.epochs.t_s[0])

    def log_densities(
        self,
        poles_per_s: FloatArray,
        variance_rad2ps2: FloatArray,
        tape: evidence_kernel.Tape = NO_TAPE,
    ) -> FloatArray:
        """Return the log density of each attitude given those before, (n,), under a prior.

        Its poles are those of all axes, (3,), or of each, (3, 3), and these as its variances, (3,),
        those of all intervals, or of each, (n - 1, 3, 3) and (n - 1, 3).
        """
        n = max(len(self.epochs.t_s) - 1, 1)
        return np.asarray(
            evidence_kernel.log_densities(
                self.epochs,
                self.mean_rate,
                np.full((n, 3, 3), poles_per_s, dtype=np.float64),
                np.full((n, 3), variance_rad2ps2, dtype=np.float64),
                tape,
            )
        )

    def turn_deviations(self) -> tuple[FloatArray, FloatArray]:
        """Compute deviations of rates from their median, rad/s: typical and overall, (3,).

        The former is a standard deviation unless attitudes are wrong or motion comes in bursts.
        """
        rates = turn_rates(self.epochs.t_s, self.epochs.R_nb)[self.epochs.use[1:] == UPDATE]
        deviations = np.abs(rates - np.median(rates, axis=0))
        usual = 1.5 * np.median(deviations, axis=0)  # of a normal one: 1.48
        return np.asarray(usual), np.asarray(np.sqrt((deviations**2).mean(axis=0)))


def attitude_series(
    t_s: FloatArray, R_nb: FloatArray, covariance_rad2: FloatArray, rows: IntArray, past: int
) -> AttitudeSeries:
    """Build the series of rows, (m,), of n attitudes.

    The spacing beyond which turns cannot be counted, and the mean rate about which the filter is
    linearised, are those of the first ``past`` attitudes: those after do not change them.
    """
    spacing_s = np.median(np.diff(t_s[:past]))
    variances, axes = np.linalg.eigh(covariance_rad2[rows])
    is_open = variances[:, 2] > _OPEN_RAD**2
    linked = (np.diff(rows) == 1) & (np.diff(t_s[rows]) < _GAP * spacing_s)
    epochs = Epochs(
        t_s=t_s[rows],
        R_nb=R_nb[rows],
        covariance_rad2=covariance_rad2[rows],
        open_axis=np.where(is_open[:, None], axes[:, :, 2], 0.0),
        use=np.append(RESTART, np.where(linked, UPDATE, RESTART)),
    )
    return AttitudeSeries(
        epochs=epochs,
        mean_rate=_mean_rate(t_s[:past], R_nb[:past], covariance_rad2[:past]),
    )


def spread(n: int) -> IntArray:
    """Select all of n attitudes, or evenly spread blocks of them."""
    if n <= MOST:
        return np.arange(n)
    starts = np.linspace(0, n - _BLOCK, MOST // _BLOCK).astype(np.int64)
    return np.unique(starts[:, None] + np.arange(_BLOCK))


def turn_rates(t_s: FloatArray, R_nb: FloatArray) -> FloatArray:
    """Return mean body rates between attitudes, (n - 1, 3)."""
    return np.asarray(log(transpose(R_nb[:-1]) @ R_nb[1:]) / np.diff(t_s)[:, None])


def _mean_rate(t_s: FloatArray, R_nb: FloatArray, covariance_rad2: FloatArray) -> FloatArray:
    """Return where the mean rate is linearised, (3,), and its 1-sigma before the flight, (4,).

    The median of the first turns, shrunk where attitudes do not tell it.
    """
    sigma = min(_MEAN_RATE_SIGMA_RADPS, _ANY_TURN_RAD / float(np.median(np.diff(t_s))))
    first = slice(_FIRST_RATES + 1)
    rate = np.median(turn_rates(t_s[first], R_nb[first]), axis=0)
    noise = 2 * covariance_rad2[first].mean(axis=0) / np.diff(t_s[first]).mean() ** 2
    signal = sigma**2 * np.eye(3)
    return np.asarray([*(signal @ np.linalg.solve(signal + noise, rate)), sigma])
