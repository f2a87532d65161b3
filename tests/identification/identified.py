"""What is found in a flight, and the estimate by it: of one identification, which takes long."""

from fgnav.frontend.problem import build_problem
from fgnav.identification.apply import with_findings
from fgnav.identification.findings import findings
from fgnav.methods.smoother import Smoother

SETTINGS = Smoother().preparation


def found_in(flight, settings=SETTINGS):
    return findings(flight, settings, build_problem(flight, settings), build_problem)


def estimate_by(found, flight):
    prepared = with_findings(flight, SETTINGS, found, build_problem)
    return Smoother().estimate_prepared(flight, prepared)
