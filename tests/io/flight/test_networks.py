"""Networks that a flight brings: what flight.toml may name, and what goes with a flight."""

import dataclasses

import pytest

from fgnav.checks import BadInputError
from fgnav.io.flight.folder import files_of, load_flight, save_flight
from fgnav.neural import read_manifest
from tests.io.flight.test_folder import PLAIN, write
from tests.neural import graphs


def brought(folder, *manifests):
    tables = "".join(f'[[network]]\nmanifest = "{name}"\n' for name in manifests)
    return write(folder, PLAIN + tables)


def test_a_flight_knows_its_networks_and_takes_them_along(tmp_path):
    manifest = graphs.heading(tmp_path)
    flight = load_flight(brought(tmp_path, "net.json"))
    assert flight.networks == (manifest,)
    assert "networks  net" in repr(flight)
    names = {path.name for path in files_of(tmp_path)}
    assert names == {"flight.toml", "net.json", "net.onnx"}

    save_flight(flight, tmp_path / "copy")
    again = load_flight(tmp_path / "copy")
    assert again.networks == (tmp_path / "copy" / "network-1" / "net.json",)
    copies = [path.name for path in again.networks[0].parent.iterdir()]
    assert sorted(copies) == ["net.json", "net.onnx"]
    assert read_manifest(again.networks[0]) == read_manifest(manifest)


@pytest.mark.parametrize(
    ("manifests", "text"),
    [
        (["absent.toml"], r"network\[0\].manifest: .*absent.toml: no such file; put it there"),
        (["net.onnx"], r"network\[0\].manifest: must be the name of a .toml or .json file, got"),
        (["net.json", "./net.json"], r"network\[1\].manifest: './net.json' is named twice"),
    ],
)
def test_what_is_no_manifest_is_refused_in_one_line(tmp_path, manifests, text):
    graphs.heading(tmp_path)
    with pytest.raises(BadInputError, match=rf"^{tmp_path}/flight.toml: key {text}") as raised:
        load_flight(brought(tmp_path, *manifests))
    assert "\n" not in str(raised.value)


def test_a_flight_whose_network_is_gone_cannot_be_written(tmp_path):
    manifest = graphs.heading(tmp_path)
    flight = load_flight(brought(tmp_path, "net.json"))
    manifest.with_name("net.onnx").unlink()
    with pytest.raises(BadInputError, match=r"net\.onnx: No such file"):
        save_flight(flight, tmp_path / "copy")
    assert not (tmp_path / "copy").exists()
    assert dataclasses.replace(flight, networks=()).networks == ()
