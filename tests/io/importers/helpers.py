"""Importers as the command line calls them."""

from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace

from fgnav.cli import main
from fgnav.io.flight.folder import load_flight
from fgnav.io.importers import importer_named
from fgnav.io.importers.assemble import assemble, write
from fgnav.io.importers.settings import Settings, read_settings

AROUND = """
[barometer]
noise_m = 0.5
offset_m = 30.0
[magnetometer]
field_n_ut = [20.0, 0.0, 40.0]
noise_ut = 0.5
hard_iron_ut = 5.0
"""


def imported(tmp_path, name, *files, toml=None):
    """Return the flight that a format's importer makes of files, written and read again."""
    settings = Settings()
    if toml is not None:
        (tmp_path / "settings.toml").write_text(toml)
        settings = read_settings(tmp_path / "settings.toml")
    scratch = tmp_path / "scratch"
    scratch.mkdir(exist_ok=True)
    found = [importer_named(name)(file, settings, scratch) for file in files]
    whole = whole_of(found, settings, tmp_path / "flight")
    return whole, whole.flight


def whole_of(found, settings, folder=None):
    """Return what is made of recordings, with the flight as it is written and read again."""
    whole = assemble(found, settings)
    with TemporaryDirectory() as scratch:
        folder = folder or Path(scratch) / "flight"
        write(whole, folder, verify=False)
        return SimpleNamespace(
            flight=load_flight(folder),
            unused=whole.unused,
            notes=whole.notes,
            missing=whole.missing,
        )


def refused(capsys, tmp_path, file, *words):
    """Return the one line of a refusal."""
    assert main(["import", str(file), "--out", str(tmp_path / "refused"), *words]) == 2
    line, *rest = capsys.readouterr().err.splitlines()
    assert not rest
    assert not (tmp_path / "refused").exists()
    return line
