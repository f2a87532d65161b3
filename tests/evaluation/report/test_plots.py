import sys
from dataclasses import replace

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.evaluation.comparison import compare
from fgnav.evaluation.report.lines import drawable
from fgnav.evaluation.report.plots import check_figure, save_figure

PNG = b"\x89PNG\r\n\x1a\n"


def with_covariance(off, name, sigma_rad=0.01, **chosen):
    covariance = np.tile(sigma_rad**2 * np.eye(3), (100, 1, 1))
    return off(name, more={"attitude_covariance_rad2": covariance}, **chosen)


def test_a_figure_is_written_with_truth(flight, off, lost, tmp_path):
    methods = [with_covariance(off, "sure", position_m=0.1), off("tilted", (0, 0.02, 0)), lost()]
    save_figure(compare(flight, methods), tmp_path / "report.png")
    assert (tmp_path / "report.png").read_bytes().startswith(PNG)
    assert [path.name for path in tmp_path.iterdir()] == ["report.png"]


def test_a_figure_is_written_without_truth(flight, off, tmp_path):
    flight = replace(flight, truth=None)
    methods = [with_covariance(off, "sure"), off("tilted", (0, 0.02, 0)), off("third")]
    save_figure(compare(flight, methods), tmp_path / "report.png")
    assert (tmp_path / "report.png").stat().st_size > 10_000


def test_unobservable_angles_are_left_out_and_the_figure_still_stands(flight, off, tmp_path):
    blind = off("blind", more={"unobservable": ("attitude",)})
    for named, data in (("a.png", flight), ("b.png", replace(flight, truth=None))):
        save_figure(compare(data, [blind]), tmp_path / named)
        assert (tmp_path / named).exists()


def test_long_lines_keep_their_spikes():
    t_s = np.arange(36_000) * 0.1
    y = np.zeros(36_000)
    y[12_345], y[20_001] = 5.0, -7.0
    _, drawn = drawable(t_s, y, 1200)
    assert len(drawn) < 3000
    assert np.nanmax(drawn) == 5.0
    assert np.nanmin(drawn) == -7.0


def test_lines_break_at_gaps():
    t_s = np.concatenate([np.arange(0, 5, 0.1), np.arange(9, 12, 0.1)])
    _, drawn = drawable(t_s, np.ones(len(t_s)), 1200)
    assert np.isnan(drawn).sum() == 1
    assert np.isnan(drawn[50])


def test_a_figure_is_written_as_pdf(flight, off, tmp_path):
    save_figure(compare(flight, [with_covariance(off, "sure")]), tmp_path / "report.pdf")
    assert (tmp_path / "report.pdf").read_bytes().startswith(b"%PDF-")


def test_a_figure_of_another_kind_is_an_error(tmp_path):
    with pytest.raises(BadInputError, match=r"report.bmp: a figure is PNG or PDF; end its name"):
        check_figure(tmp_path / "report.bmp")


def test_without_matplotlib_the_error_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setattr("fgnav.evaluation.report.plots.find_spec", lambda _: None)
    with pytest.raises(BadInputError, match=r"needs matplotlib; pip install 'fgnav\[report\]'"):
        check_figure(tmp_path / "report.png")


def test_nothing_to_draw_is_an_error(flight, lost, tmp_path):
    with pytest.raises(BadInputError, match="no method has an estimate to draw"):
        save_figure(compare(flight, [lost()]), tmp_path / "report.png")


def test_matplotlib_is_not_loaded_before_a_figure_is_drawn():
    import subprocess

    code = "import sys, fgnav.evaluation.report.plots; sys.exit('matplotlib' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)
