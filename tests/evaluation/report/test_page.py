"""The page of a comparison: whole, well formed, complete, and without a wire to the outside."""

import re
import shutil
import subprocess
from dataclasses import replace
from html.parser import HTMLParser
from importlib.resources import files
from xml.etree import ElementTree as ET

import msgspec
import numpy as np
import pytest

from fgnav.checks import BadInputError, Loss
from fgnav.evaluation.comparison import compare
from fgnav.evaluation.report.contents import comparison_report
from fgnav.evaluation.report.drawing.chart import Axis, Chart, Line, spanning
from fgnav.evaluation.report.html.page import save_page
from fgnav.evaluation.report.save import check_report, save_report
from fgnav.integers.resolvers.registry import resolver_named
from fgnav.methods.maximum_likelihood import MaximumLikelihood
from fgnav.types.estimate import Consistency, Constant, Rejected
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate

VOID = {"meta", "input", "br", "hr"}


class Nesting(HTMLParser):
    """Collects what is open, and what was closed in the wrong order."""

    def __init__(self):
        super().__init__()
        self.open, self.wrong, self.addresses, self.ids = [], [], [], []

    def handle_starttag(self, tag, attrs):
        values = dict(attrs)
        self.addresses += [values[k] for k in ("src", "href", "srcset", "data") if k in values]
        self.ids += [values["id"]] if "id" in values else []
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag):
        if not self.open or self.open.pop() != tag:
            self.wrong.append(tag)


def saved(comparison, flight, path, **more):
    save_page(comparison_report(comparison, flight, **more), path)


def read(path):
    text = path.read_text(encoding="utf-8")
    page = Nesting()
    page.feed(text)
    page.close()
    assert page.open == []
    assert page.wrong == []
    return text, page


def sure(off, name, **more):
    covariance = np.tile(1e-4 * np.eye(3), (100, 1, 1))
    stated = dict.fromkeys(
        ("attitude_covariance_rad2", "position_covariance_m2", "velocity_covariance_m2ps2"),
        covariance,
    )
    return off(name, (0.01, 0.0, 0.0), position_m=0.1, more=stated | more)


@pytest.fixture(scope="module")
def flown(flown_report, tmp_path_factory):
    """Return the page of two methods on two seconds of a simulated array."""
    path = tmp_path_factory.mktemp("page") / "report.html"
    save_page(flown_report, path)
    return path


def test_a_page_is_well_formed_and_has_every_section(flown):
    _, page = read(flown)
    wanted = (
        "summary",
        "errors",
        "motion",
        "sky",
        "residuals",
        "quality",
        "integers",
        "exclusions",
    )
    wanted += ("consistency", "separation", "allan")
    assert set(wanted) | {"set-up", "versions"} <= set(page.ids)
    assert len(page.ids) == len(set(page.ids))


def test_a_page_loads_nothing(flown):
    text, page = read(flown)
    assert all(address.startswith("#") for address in page.addresses)
    assert {address[1:] for address in page.addresses} <= set(page.ids)
    assert not re.search(r"https?:|//[a-z]|url\(|@import|import\(|fetch\(|XMLHttp", text)


def test_every_drawing_is_sound_and_named(flown):
    text = flown.read_text()
    drawings = re.findall(r"<svg viewBox.*?</svg></figure>", text, flags=re.DOTALL)
    assert len(drawings) > 25
    for drawing in drawings:
        root = ET.fromstring(drawing.removesuffix("</figure>"))
        assert root.get("aria-label")
        assert "nan" not in drawing.lower().split("aria-label")[0]
    assert not re.search(r'd="[^"]*(nan|inf)', text)


def test_a_method_has_one_colour_everywhere(flown):
    text = flown.read_text()
    marks = set(re.findall(r'class="l (m\d)" [^>]*><title>maximum-likelihood</title>', text))
    assert marks == {"m0"}
    assert 'data-m="m0"><span class="key m0"></span>maximum-likelihood' in text


def test_a_page_says_seed_set_up_and_versions_and_escapes_them(flown):
    text = flown.read_text()
    assert "simulated with seed 17" in text
    assert "name = &quot;&lt;demo&gt;&quot;" in text
    assert "<demo>" not in text
    for word in ("numpy", "gtsam", "gnss_noise phase_m", "antenna a8", " 1C"):
        assert word in text


def test_what_was_left_out_and_estimated_stands_with_its_reason(flight, off, tmp_path):
    t_s = np.concatenate([np.arange(0, 4, 0.1), np.arange(6, 10, 0.1)])
    method = off(
        "careful",
        t_s=t_s,
        more={
            "epochs": 100,
            "rejections": (
                Rejected(what="phase", link="a3 G05 1C", from_s=1.0, until_s=2.0, reason="echo"),
            ),
            "losses": (Loss(what="a2 link", reason="below the mask", count=7),),
            "consistency": (
                Consistency(what="doppler", count=50, freedom=150, nis=2.0, beyond_99=0.1),
            ),
            "constants": (
                Constant(
                    name="boresight",
                    axes=("about y_b",),
                    unit="rad",
                    value=np.array([0.25]),
                    covariance=np.array([[0.01]]),
                ),
            ),
        },
    )
    saved(compare(flight, [method]), flight, tmp_path / "a.html")
    text, _ = read(tmp_path / "a.html")
    for word in ("echo", "a3 G05 1C", "below the mask", "3.90", "6.00", "boresight", "about y_b"):
        assert word in text
    doppler = text[text.index("doppler") :]
    assert ">above<" in doppler[: doppler.index("</tr>")]  # chi2 of 150: 1 ± 0.23


def test_a_page_without_truth_or_sensors_still_stands(flight, off, lost, tmp_path):
    flight = replace(flight, truth=None)
    saved(compare(flight, [sure(off, "a"), off("b"), lost()]), flight, tmp_path / "a.html")
    text, page = read(tmp_path / "a.html")
    assert "errors" not in page.ids
    assert "RMS differences of methods" in text
    assert "a − b" in text
    assert "yaw: not in the data" in text


def test_a_name_is_no_markup(flight, off, tmp_path):
    saved(compare(flight, [sure(off, "<b>&")]), flight, tmp_path / "a.html")
    assert "<b>" not in read(tmp_path / "a.html")[0]


def test_an_hour_is_a_small_page(flight, off, true_state, tmp_path):
    t_s = np.arange(36_000) * 0.1
    covariance = np.tile(1e-4 * np.eye(3), (len(t_s), 1, 1))
    noise = 0.01 * np.random.default_rng(1).standard_normal((len(t_s), 3))
    stated = dict.fromkeys(
        ("attitude_covariance_rad2", "position_covariance_m2", "velocity_covariance_m2ps2"),
        covariance,
    )
    methods = [off(f"m{k}", noise, 0.1, t_s=t_s, more=stated) for k in range(5)]
    flight = replace(flight, truth=true_state(t_s))
    saved(compare(flight, methods), flight, tmp_path / "a.html")
    assert (tmp_path / "a.html").stat().st_size < 7e6


def test_a_method_without_an_answer_alone_is_an_error(flight, lost, tmp_path):
    with pytest.raises(BadInputError, match="no method has an estimate to report"):
        save_report(compare(flight, [lost()]), flight, tmp_path / "a.html")


@pytest.mark.skipif(shutil.which("node") is None, reason="nothing here runs JavaScript")
def test_the_script_of_a_page_is_sound():
    script = files("fgnav.evaluation.report.html") / "page.js"
    subprocess.run(["node", "--check", str(script)], check=True)


def test_a_report_is_of_the_kind_that_its_name_says(flight, off, tmp_path):
    comparison = compare(flight, [sure(off, "a")])
    heads = {"html": b"<!doctype html>", "png": b"\x89PNG", "pdf": b"%PDF-"}
    for suffix, head in heads.items():
        path = tmp_path / f"report.{suffix}"
        save_report(comparison, flight, path)
        assert path.read_bytes().startswith(head)
    with pytest.raises(BadInputError, match=r"end its name in \.html, \.png or \.pdf"):
        check_report(tmp_path / "report.docx")
    with pytest.raises(BadInputError, match="its folder does not exist"):
        check_report(tmp_path / "absent" / "report.html")


def test_ticks_are_round_and_inside():
    for low, high in ((0.0, 1.0), (-3.7, 12.2), (1e-7, 3e-7), (700.0, 701.0)):
        ticks = Axis(name="", low=low, high=high).ticks()
        assert 3 <= len(ticks) <= 7
        assert all(low <= value <= high for value, _ in ticks)


def test_a_constant_series_and_a_series_of_nothing_have_an_axis():
    for values in (np.full(5, 3.0), np.full(5, np.nan), np.zeros(0)):
        axis = spanning("", [values])
        assert axis.high > axis.low
        line = Line(mark="m0", name="", x=np.arange(len(values)) * 1.0, y=values)
        Chart(title="", x=Axis(name="", low=0, high=4), y=axis, lines=[line]).drawing()


def test_wrong_integers_show_in_time_and_residuals_by_satellite(off_one_cycle):
    comparison, flight, path = off_one_cycle
    saved(comparison, flight, path)
    text, _ = read(path)
    integers = text[text.index('id="integers"') :]
    strips = integers[: integers.index("</figure>")]
    assert strips.count('class="l cell wrong"') == 1
    assert 'class="l cell fixed"' in strips
    residuals = text[text.index('id="residuals"') : text.index('id="quality"')]
    assert all(name in residuals for name in ("G16 1C", "G16 1575"))


@pytest.fixture
def off_one_cycle(tmp_path):
    """Return the comparison of a method half of whose epochs have one integer off by a cycle."""
    demo = load_scenario("demo")
    flight = simulate(msgspec.structs.replace(demo, duration_s=2.0), np.random.default_rng(1))
    right = compare(flight, [MaximumLikelihood(resolver=resolver_named("lambda"))])
    (method,) = right.methods
    cycles = method.estimate.integers.cycles.copy()
    cycles[10:, 0, :] += method.estimate.integers.fixed[10:, 0, :]
    wrong = replace(method.estimate.integers, cycles=cycles)
    estimate = replace(method.estimate, integers=wrong)
    spoilt = replace(right, methods=(replace(method, estimate=estimate),))
    return spoilt, flight, tmp_path / "page.html"


def test_without_a_forward_pass_the_page_says_what_to_ask_for(flown):
    text, _ = read(flown)
    assert "Not compared: this needs the methods forward and smoother" in text


def test_a_filter_is_held_against_the_smoother_of_the_same_measurements(flight, off, tmp_path):
    def pair(suffix, wide):
        covariance = np.tile(1e-4 * np.eye(3), (100, 1, 1))
        more = {"attitude_covariance_rad2": covariance}
        yield off(f"smoother{suffix}", more=more)
        yield off(f"forward{suffix}", wide, more={"attitude_covariance_rad2": 5 * covariance})

    methods = [*pair("", (0.02, 0.0, 0.0)), *pair(" without doppler", (0.0, 0.08, 0.0))]
    saved(compare(flight, methods), flight, tmp_path / "a.html")
    text, _ = read(tmp_path / "a.html")
    table = text[text.index("filter against smoother in figures") :]
    rows = re.findall(r"<tr><th scope=.row.>(.*?)</tr>", table[: table.index("</table>")])
    ratios = {
        (row.split("</th>")[0], re.findall(r">([^<]*)</td>", row)[1]): re.findall(
            r">([^<]*)</td>", row
        )[3]
        for row in rows
    }
    # Off by 0.02 rad of a root of 4e-4 rad2, and by 0.08.
    assert ratios["smoother", "about x"] == "1.000"
    assert ratios["smoother without doppler", "about y"] == "4.000"
    assert float(ratios["smoother", "about y"]) < 1e-9


def test_gaps_and_epochs_without_gnss_show_in_the_quality(flight, off, tmp_path):
    t_s = np.concatenate([np.arange(0, 4, 0.1), np.arange(6, 10, 0.1)])
    saved(compare(flight, [off("holed", t_s=t_s)]), flight, tmp_path / "a.html")
    text, _ = read(tmp_path / "a.html")
    quality = text[text.index('id="quality"') :]
    strips = quality[: quality.index("</figure>")]
    assert strips.count('class="l cell absent"') == 1
    assert strips.count('class="l cell predicted"') == 2  # no satellites at all, on either side
    assert "fixed" not in re.findall(r'class="l cell (\w+)"', strips)


def test_innovations_have_a_histogram_by_decile(flight, off, tmp_path):
    tested = Consistency(
        what="doppler",
        count=100,
        freedom=300,
        nis=1.0,
        beyond_99=0.01,
        deciles=(*[5] * 5, *[15] * 5),
    )
    method = off("one", more={"consistency": (tested,)})
    saved(compare(flight, [method]), flight, tmp_path / "a.html")
    text, _ = read(tmp_path / "a.html")
    chart = text[text.index("NIS of doppler: share by decile") :]
    assert "95 % of 100 independent" in chart[: chart.index("</figure>")]


def test_arcs_are_listed_by_the_chance_that_their_integer_is_wrong(tmp_path):
    demo = load_scenario("demo")
    flight = simulate(msgspec.structs.replace(demo, duration_s=1.0), np.random.default_rng(2))
    comparison = compare(flight, [MaximumLikelihood(resolver=resolver_named("lambda"))])
    (method,) = comparison.methods
    listed = method.to_dict()["arcs"]
    assert len(listed) == len(method.arcs) == method.estimate.integers.fixed.any(axis=0).sum()
    assert {one["by"] for one in listed} <= {"resolver", "arc", "array"}
    saved(comparison, flight, tmp_path / "page.html")
    text = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert f"chance that their integer is wrong, of {len(listed)}" in text
