"""An estimate as columns of one table, in the frame ``n``, with every covariance in full."""

from typing import Any

from fgnav.checks import FloatArray
from fgnav.geometry.rotations import quaternion_wxyz

_NED, _XYZ = ("n", "e", "d"), ("x", "y", "z")
_VECTORS = {
    "p_n_m": ("p_{}_m", _NED),
    "v_n_mps": ("v_{}_mps", _NED),
    "angular_rate_b_radps": ("w_{}_radps", _XYZ),
    "accelerometer_bias_mps2": ("accelerometer_bias_{}_mps2", _XYZ),
    "gyroscope_bias_radps": ("gyroscope_bias_{}_radps", _XYZ),
}
_COVARIANCES = {
    "attitude_covariance_rad2": ("cov_attitude_{}_rad2", _XYZ),
    "position_covariance_m2": ("cov_p_{}_m2", _NED),
    "velocity_covariance_m2ps2": ("cov_v_{}_m2ps2", _NED),
    "accelerometer_bias_covariance_m2ps4": ("cov_accelerometer_bias_{}_m2ps4", _XYZ),
    "gyroscope_bias_covariance_rad2ps2": ("cov_gyroscope_bias_{}_rad2ps2", _XYZ),
}


def estimate_table(estimate: Any) -> dict[str, FloatArray]:  # noqa: ANN401  # that type knows this
    """Return (n,) columns by name: ``t_s``, ``roll_deg``, ``qw``, ``p_n_m``, ``cov_p_ne_m2``, ….

    The quaternion turns body coordinates into ``n``; covariances of attitude and biases are in body
    axes. Columns of what the method does not estimate are absent.
    """
    table = {"t_s": estimate.t_s}
    angles = zip(("roll", "pitch", "yaw"), estimate.euler_deg.T, strict=True)
    table |= {f"{name}_deg": angle for name, angle in angles}
    parts = zip("wxyz", quaternion_wxyz(estimate.R_nb).T, strict=True)
    table |= {f"q{axis}": component for axis, component in parts}
    for field, (name, axes) in _VECTORS.items():
        vectors = getattr(estimate, field)
        if vectors is not None:
            table |= {name.format(axis): vectors[:, k] for k, axis in enumerate(axes)}
    for field, (name, axes) in _COVARIANCES.items():
        matrices = getattr(estimate, field)
        if matrices is not None:
            table |= {
                name.format(axes[i] + axes[j]): matrices[:, i, j]
                for i in range(3)
                for j in range(i, 3)
            }
    return table


def labelled(
    estimate: Any,  # noqa: ANN401  # as above
) -> tuple[dict[str, tuple[tuple[str, ...], FloatArray]], dict[str, list[str]]]:
    """Return every array with the names of its axes, and the labels along those axes."""
    labels = {"n": list(_NED), "b": list(_XYZ)}
    arrays: dict[str, tuple[tuple[str, ...], FloatArray]] = {
        "R_nb": (("t_s", "n", "b"), estimate.R_nb)
    }
    for field, (_, axes) in (_VECTORS | _COVARIANCES).items():
        values = getattr(estimate, field)
        if values is not None:
            axis = "n" if axes is _NED else "b"
            names = (axis,) if field in _VECTORS else (axis, f"{axis}_")
            labels[names[-1]] = list(axes)
            arrays[field] = (("t_s", *names), values)
    return arrays, labels
