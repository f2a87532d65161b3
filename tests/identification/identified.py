"""What is found in a flight, and the estimate by it: of one identification, which takes long."""

from functools import partial

from fgnav.frontend.position.by_observations import LastObservations
from fgnav.frontend.problem import build_problem
from fgnav.identification.apply import with_findings
from fgnav.identification.findings import findings
from fgnav.methods.smoother import Smoother

SETTINGS = Smoother().preparation


def found_in(flight, settings=SETTINGS):
    build = partial(build_problem, last=LastObservations())
    return findings(flight, settings, build(flight, settings), build)


def estimate_by(found, flight):
    prepared = with_findings(flight, SETTINGS, found, build_problem)
    return Smoother().estimate_prepared(flight, prepared)
