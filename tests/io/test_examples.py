"""Examples of io's public functions run."""

import doctest
import inspect
from pathlib import Path

import numpy as np
import pytest

import fgnav
from fgnav.io import exports, importers
from fgnav.io.exports.recorded import save_estimate
from fgnav.io.exports.tables import write_outcome
from fgnav.io.flight.folder import load_flight, save_flight
from fgnav.io.flight.local_frame import place_of_n
from fgnav.io.importers.assemble import assemble, write
from fgnav.io.importers.guess import guess_table
from fgnav.io.importers.recognise import recognise_format
from fgnav.io.importers.settings import Settings, read_settings
from fgnav.io.rinex import reader, writer
from fgnav.io.sp3 import read_precise, write_precise
from fgnav.types.flight import Flight
from tests.io.flights import START_GPS_S, whole_flight
from tests.io.test_exports import ORIGIN, estimate

PUBLIC = [importers.importer_named(name) for name in importers.IMPORTERS]
PUBLIC += [exports.exporter_named(name) for name in exports.EXPORTERS]
PUBLIC += [
    importers.importer_named,
    exports.exporter_named,
    assemble,
    write,
    guess_table,
    recognise_format,
]
PUBLIC += [read_settings, reader.read_rinex, reader.read_navigation, writer.write_observations]
PUBLIC += [writer.write_navigation, read_precise, write_precise, place_of_n, write_outcome]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with a flight, an estimate and orbits."""
    place, flight = tmp_path_factory.mktemp("examples"), whole_flight(np.random.default_rng(5))
    save_flight(flight, place / "demo" / "flight")
    (place / "run").mkdir()
    named = Flight(name="demo", start_gps_s=START_GPS_S, origin=ORIGIN)
    save_estimate(estimate(np.random.default_rng(1)), named, place / "run" / "estimate.npz")
    (place / "igs.sp3").write_bytes((place / "demo" / "flight" / "precise.sp3").read_bytes())
    return place


@pytest.mark.parametrize("public", dict.fromkeys(PUBLIC), ids=lambda public: public.__name__)
def test_a_public_function_has_an_example_and_it_runs(public, folder, monkeypatch):
    monkeypatch.chdir(folder)
    names = {
        "fgnav": fgnav,
        "np": np,
        "Path": Path,
        "Settings": Settings,
        "load_flight": load_flight,
    }
    names |= {one.__name__: one for one in PUBLIC} | vars(inspect.getmodule(public))
    (example,) = doctest.DocTestFinder(recurse=False).find(public, globs=names)
    assert example.examples
    outcome = []
    doctest.DocTestRunner().run(example, out=outcome.append)
    assert outcome == []
