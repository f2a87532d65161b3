"""Released networks of integers, by name: ``fgnav.neural``'s manifests, in ``weights``."""

from collections.abc import Mapping
from pathlib import Path

from fgnav.checks import BadInputError
from fgnav.neural.measures import Sensor
from fgnav.neural.network import Network, load_network

WEIGHTS = Path(__file__).resolve().parent.parent / "weights"


def released() -> tuple[str, ...]:
    """Return the names of the networks that come with the package."""
    return tuple(sorted(path.stem for path in WEIGHTS.glob("*.onnx")))


def load(name_or_path: str | Path) -> Network:
    """Return a network of integers, ready to run, after checking its file against its manifest.

    Parameters
    ----------
    name_or_path : str or Path
        A released network's name (``released()``), or a manifest, TOML or JSON.

    Raises
    ------
    BadInputError
        If there is no such network, or as ``fgnav.neural.network.load_network``.
    """
    path = Path(name_or_path)
    if path.suffix in {".json", ".toml"}:
        return load_network(path, integers=True)
    if str(name_or_path) not in released():
        names = ", ".join(released()) or "none"
        raise BadInputError(
            f"network {str(name_or_path)!r}: not one of {names}, nor a manifest, .toml or .json"
        )
    return load_network(WEIGHTS / f"{name_or_path}.json", integers=True)


def for_resolver(
    name_or_path: str | Path, given: Mapping[str, Sensor], forms: set[str], figures: set[str]
) -> Network:
    """Return a network that takes what a resolver gives, and says what it uses.

    Parameters
    ----------
    name_or_path : str or Path
        As of ``load``.
    given : mapping of str to Sensor
        What the resolver computes of an epoch, in the order of the network's inputs.
    forms : set of str
        Of how sure it is.
    figures : set of str
        That the resolver holds against the domain.

    Raises
    ------
    BadInputError
        Naming the key and what it must be; or as of ``load``.
    """
    network = load(name_or_path)
    manifest, path = network.manifest, network.path
    if [spec.sensor for spec in manifest.inputs] != list(given):
        raise BadInputError(f"{path}: key inputs: the sensors must be {', '.join(given)}, in order")
    for index, spec in enumerate(manifest.inputs):
        sensor = given[spec.sensor]
        for key, stated, right in (
            ("unit", spec.unit, sensor.unit),
            ("frame", spec.frame, sensor.frame),
            ("range", len(spec.range), sensor.channels),
        ):
            if stated != right:
                what = f"be {right}" if key != "range" else f"have {right} entries"
                raise BadInputError(
                    f"{path}: key inputs[{index}].{key}: must {what}, as the resolver gives "
                    f"{spec.sensor!r}, got {stated}"
                )
    if manifest.output.covariance.form not in forms:
        raise BadInputError(
            f"{path}: key output.covariance.form: must be {' or '.join(sorted(forms))}, got "
            f"{manifest.output.covariance.form}"
        )
    if sorted(spec.name for spec in manifest.domain) != sorted(figures):
        raise BadInputError(
            f"{path}: key domain: must state {', '.join(sorted(figures))}, each once, and no others"
        )
    return network
