"""Checks of factors: Jacobians against central differences, and the NEES of what they estimate.

With the truth known, every variable gets a Gaussian prior whose mean is drawn about it. The factors
then join the priors, and the error e of the minimum is tested by its information ``J' J`` [1]_::

    nees = e' J' J e / d,    d the degrees of freedom,    d * nees is chi-square distributed

A covariance that is right leaves it within ``low`` and ``high``. Public names: ``check_factors``,
``check_sensor``, ``jacobian_misfit``, ``random_states``, ``random_motion``.

References
----------
.. [1] Bar-Shalom, Li, Kirubarajan: Estimation with Applications to Tracking and Navigation, 2001,
   section 5.4.2: consistency of estimators.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import gtsam
import numpy as np
from scipy.stats import chi2

from fgnav.checks import FloatArray
from fgnav.geometry.rotations import exp
from fgnav.graph.build import Layout, insert_constants, insert_keyframe
from fgnav.graph.custom import NamedFactor
from fgnav.graph.keys import letter
from fgnav.graph.residual_model import STEP, ResidualModel, Variable
from fgnav.graph.types.motion import Motion
from fgnav.graph.types.parameters import NO_PARAMETERS, Parameters
from fgnav.graph.types.sensor import Sensor
from fgnav.graph.types.states import AUX, GYROSCOPE_AUX, States

TAIL = 5e-4  # probability of a right factor below the band, and above it
# 1-sigmas of the priors: small, as the band is one of linear propagation.
_SIGMA_POSE = np.repeat([0.005, 1.0], 3)  # rad, m
_SIGMA_VELOCITY_MPS, _SIGMA_OTHERS = 1.0, 0.01
_TOLERANCE = 1e-9  # of the cost: at the minimum the linear term vanishes


class FactorCheck(NamedTuple):
    """Outcome of a check of factors.

    Attributes
    ----------
    jacobian : float
        Largest difference from central differences, over the largest element.
    nees : float
        Over the degrees of freedom: 1 is expected.
    low, high : float
        Band that a right covariance leaves once in a thousand.
    """

    jacobian: float
    nees: float
    low: float
    high: float

    @property
    def consistent(self) -> bool:
        """True if the NEES is within its band."""
        return self.low < self.nees < self.high


def check_sensor(sensor: Sensor, truth: States, rng: np.random.Generator) -> FactorCheck:
    """Check the factors of a sensor whose measurements were drawn at true states.

    Parameters
    ----------
    sensor : Sensor
        Its ``row`` counts the keyframes of ``truth``.
    truth : States
    rng : numpy.random.Generator
        Of the priors.

    Returns
    -------
    FactorCheck

    Examples
    --------
    >>> import numpy as np
    >>> from fgnav.graph import Position, check_sensor, random_states
    >>> rng = np.random.default_rng(1)
    >>> truth = random_states(50, rng)
    >>> position = Position(
    ...     row=np.arange(50), value_n_m=truth.p_n_m + rng.normal(size=(50, 3)),
    ...     white=np.tile(np.eye(3), (50, 1, 1)), arm_b_m=np.zeros(3),
    ... )
    >>> check_sensor(position, truth, rng).consistent
    True
    """
    factors = [sensor.factor(i, int(k)) for i, k in enumerate(sensor.row)]
    return check_factors(factors, values_of(truth, sensor.constants), rng)


def check_factors(
    factors: Sequence[gtsam.NonlinearFactor | NamedFactor],
    truth: gtsam.Values,
    rng: np.random.Generator,
) -> FactorCheck:
    """Check factors whose measurements were drawn at the true values of their variables.

    Parameters
    ----------
    factors : sequence of gtsam.NonlinearFactor or NamedFactor
    truth : gtsam.Values
        Poses, velocities, biases and vectors by the keys of ``fgnav.graph``.
    rng : numpy.random.Generator
        Of the priors.

    Returns
    -------
    FactorCheck

    Examples
    --------
    >>> import gtsam, numpy as np
    >>> from fgnav.graph import check_factors, pose, random_states, values_of
    >>> rng = np.random.default_rng(1)
    >>> truth = random_states(50, rng)
    >>> noise = gtsam.noiseModel.Isotropic.Sigma(3, 1.0)
    >>> fixes = truth.p_n_m + rng.normal(size=(50, 3))
    >>> factors = [gtsam.GPSFactor(pose(k), fix, noise) for k, fix in enumerate(fixes)]
    >>> check_factors(factors, values_of(truth), rng).consistent
    True
    """
    graph = gtsam.NonlinearFactorGraph()
    for factor in factors:
        graph.add(factor.factor if isinstance(factor, NamedFactor) else factor)
    keys = tuple(graph.keyVector())
    true, start, freedom = gtsam.Values(), gtsam.Values(), 0
    for key, variable in zip(keys, _variables(keys, truth), strict=True):
        prior, mean = _prior(key, variable, rng)
        graph.add(prior)
        true.insert(key, variable)
        start.insert(key, mean)
        freedom += prior.dim()
    parameters = gtsam.LevenbergMarquardtParams()
    parameters.setRelativeErrorTol(_TOLERANCE)
    parameters.setAbsoluteErrorTol(_TOLERANCE)
    found = gtsam.LevenbergMarquardtOptimizer(graph, start, parameters).optimize()
    linear, error = graph.linearize(found), found.localCoordinates(true)
    nees = 2 * (linear.error(error) - linear.error(found.zeroVectors())) / freedom
    low, high = chi2.ppf([TAIL, 1 - TAIL], freedom) / freedom
    misfit = max(jacobian_misfit(factor, truth) for factor in factors)
    return FactorCheck(misfit, nees, float(low), float(high))


def jacobian_misfit(factor: gtsam.NonlinearFactor | NamedFactor, values: gtsam.Values) -> float:
    """Compute the largest error of a factor's Jacobians against central differences.

    Parameters
    ----------
    factor : gtsam.NonlinearFactor or NamedFactor
    values : gtsam.Values
        Where it is linearised; all variables of the factor are among them.

    Returns
    -------
    float
        Over the largest element; about 1e-9 of right ones.

    Examples
    --------
    >>> import gtsam
    >>> from fgnav.graph import jacobian_misfit, pose, residual_factor
    >>> values = gtsam.Values()
    >>> values.insert(pose(0), gtsam.Pose3())
    >>> height = residual_factor("height", [pose(0)], lambda x: [-x.z()], 0.5, dimension=1)
    >>> jacobian_misfit(height, values) < 1e-8
    True
    """
    whole = factor.factor if isinstance(factor, NamedFactor) else factor
    keys = tuple(whole.keys())

    def whitened(*variables: Variable) -> FloatArray:
        moved = gtsam.Values()
        for key, variable in zip(keys, variables, strict=True):
            moved.insert(key, variable)
        return -np.asarray(whole.linearize(moved).jacobian()[1])

    given, right = whole.linearize(values).jacobian()
    model = ResidualModel(
        name="check", keys=keys, residual=whitened, jacobian=None, rows=len(right)
    )
    expected = np.concatenate(model.differences(model.variables(values)), axis=1)
    return float(np.abs(given - expected).max() / max(np.abs(expected).max(), STEP))


def random_states(
    n: int,
    rng: np.random.Generator,
    constants: Parameters = NO_PARAMETERS,
    *,
    gyroscope: bool = False,
) -> States:
    """Draw states of keyframes, attitudes from the whole sphere.

    Parameters
    ----------
    n : int
        Number of keyframes.
    rng : numpy.random.Generator
    constants : Parameters, optional
        Drawn from their prior.
    gyroscope : bool, optional
        Biases of both sensors; else the accelerometer's, rate and its derivatives.

    Returns
    -------
    States

    Examples
    --------
    >>> import numpy as np
    >>> from fgnav.graph import random_states
    >>> random_states(3, np.random.default_rng(1)).R_nb.shape
    (3, 3, 3)
    """
    root = np.linalg.cholesky(constants.covariance)
    return States(
        R_nb=exp(rng.normal(size=(n, 3))),
        p_n_m=50 * rng.normal(size=(n, 3)),
        v_n_mps=10 * rng.normal(size=(n, 3)),
        aux=rng.normal(size=(n, GYROSCOPE_AUX if gyroscope else 2 * GYROSCOPE_AUX)),
        constants=constants.mean + root @ rng.normal(size=constants.width),
    )


def random_motion(motion: Motion, start: States, rng: np.random.Generator) -> States:
    """Draw the states that a motion model leads to from the first, with its noise.

    Parameters
    ----------
    motion : Motion
        Of n keyframes.
    start : States
        Row 0 is the first keyframe.
    rng : numpy.random.Generator

    Returns
    -------
    States
        n keyframes.
    """
    drawn = [start.at(slice(0, 1))]
    for k in np.arange(len(motion.t_s) - 1):
        after = motion.predict(drawn[-1], np.array([k]))
        by_after = motion.linearise(drawn[-1], after, np.array([k])).after[0]
        step = np.linalg.solve(by_after, rng.standard_normal(len(by_after)))
        drawn.append(after.moved(step[None], np.zeros(len(start.constants))))
    arrays = (np.concatenate([states[i] for states in drawn]) for i in range(4))
    return States._make((*arrays, start.constants))


def values_of(states: States, constants: Parameters = NO_PARAMETERS) -> gtsam.Values:
    """Return states and constants as GTSAM's variables of keyframes 0, 1, ...

    Parameters
    ----------
    states : States
    constants : Parameters, optional

    Returns
    -------
    gtsam.Values

    Examples
    --------
    >>> import numpy as np
    >>> from fgnav.graph import random_states, values_of
    >>> values_of(random_states(2, np.random.default_rng(1))).size()
    6
    """
    values, width = gtsam.Values(), states.width - AUX
    layout = Layout(gyroscope=width == GYROSCOPE_AUX, constants=constants)
    insert_constants(values, layout, states.constants)
    for k in range(len(states.R_nb)):
        insert_keyframe(values, layout, k, states, k)
    return values


def _variables(keys: tuple[int, ...], values: gtsam.Values) -> list[Variable]:
    """Return variables as they are in the values."""
    model = ResidualModel(name="check", keys=keys, residual=len, jacobian=None, rows=0)
    return model.variables(values)


def _prior(
    key: int, true: Variable, rng: np.random.Generator
) -> tuple[gtsam.NonlinearFactor, Variable]:
    """Return a prior about a mean drawn near the truth, and that mean."""
    factor: Any = gtsam.PriorFactorVector
    if isinstance(true, gtsam.Pose3):
        factor, sigma = gtsam.PriorFactorPose3, _SIGMA_POSE
    elif isinstance(true, gtsam.imuBias.ConstantBias):
        factor, sigma = gtsam.PriorFactorConstantBias, np.full(GYROSCOPE_AUX, _SIGMA_OTHERS)
    else:
        each = _SIGMA_VELOCITY_MPS if letter(key) == "v" else _SIGMA_OTHERS
        sigma = np.full(len(true), each)
    step = sigma * rng.standard_normal(len(sigma))
    mean = true + step if isinstance(true, np.ndarray) else true.retract(step)
    return factor(key, mean, gtsam.noiseModel.Diagonal.Sigmas(sigma)), mean
