"""The command ``fgnav referee``."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from fgnav.cli.arguments.options import ReportFile, SmootherOptions
from fgnav.json_file import JsonFile, write_json
from fgnav.terminal import progress, show_report, width


def referee(  # a command has as many options as it takes
    *networks: Path,
    flights: Annotated[list[Path], Parameter(consume_multiple=True)],
    method: str = "batch",
    noise: str | None = None,
    json: JsonFile = None,
    report: ReportFile = None,
) -> None:
    """Judge networks on flights with truth: their answers, and their worth in a method.

    Each is compared with no network, and with the best constant sigma of the other flights.

    Example: fgnav referee heading.toml --flights a/flight b/flight

    Parameters
    ----------
    networks
        Manifests, TOML or JSON, the ONNX file beside each; folders of these; or names of installed
        ones.
    flights
        Folders with a flight.toml, or folders of such folders, of flights not trained on.
    method
        That takes factors: batch, smoother or forward.
    noise
        Noise of the method: estimated from the flight, or nominal.
    """
    from fgnav.checks import BadInputError  # noqa: PLC0415  # lazy, like all below
    from fgnav.cli.arguments.estimators import estimators_named, flights_in, load  # noqa: PLC0415
    from fgnav.evaluation.networks import referee as judged  # noqa: PLC0415
    from fgnav.evaluation.networks.report import networks_report, on_screen  # noqa: PLC0415
    from fgnav.evaluation.report.save import check_report, write  # noqa: PLC0415
    from fgnav.evaluation.report.text import text_lines  # noqa: PLC0415
    from fgnav.integers.resolvers.registry import DEFAULT  # noqa: PLC0415
    from fgnav.methods.smoothing.custom_sources import factor_source  # noqa: PLC0415
    from fgnav.neural.factor import NeuralFactor  # noqa: PLC0415
    from fgnav.terminal import check_outputs  # noqa: PLC0415

    sources = [factor_source(str(path)) for place in networks for path in _manifests(place)]
    factors = [source for source in sources if isinstance(source, NeuralFactor)]
    if not factors or len(factors) < len(sources):
        raise BadInputError("referee: requires networks: manifests, or folders of these")
    (estimator,) = estimators_named(method, DEFAULT, SmootherOptions(noise=noise))
    if not hasattr(estimator, "factors"):
        raise BadInputError(f"--method {method}: takes no factors; take batch, smoother or forward")
    folders = flights_in(tuple(flights))
    for folder in folders:
        check_outputs(folder, json, report=report)
    check_report(report)
    with progress(len(folders) * (2 + 2 * len(factors)) + len(factors)) as step:
        loaded = [load(folder, step) for folder in folders]
        outcome = judged(factors, loaded, estimator, watch=step)
    write_json(json, outcome.to_dict())
    files = [] if report is None else write(networks_report(outcome), report)
    if json != "-":
        print("\n".join(text_lines(on_screen(outcome), width())))
        show_report(files)


def _manifests(place: Path) -> list[Path]:
    """Return the manifests of a folder, sorted; anything else is one itself."""
    if not place.is_dir():
        return [place]
    return sorted(path for path in place.iterdir() if path.suffix in (".json", ".toml"))
