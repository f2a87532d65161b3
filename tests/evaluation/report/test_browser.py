"""Pages as a browser shows them: Chromium, headless, on light and dark, wide and narrow screens."""

import json
import os
import re
import shutil
import subprocess
from contextlib import nullcontext
from html import escape, unescape
from pathlib import Path

import msgspec
import numpy as np
import pytest

from fgnav.evaluation.comparison import compare
from fgnav.evaluation.flights import compare_flights
from fgnav.evaluation.report.contents import comparison_report
from fgnav.evaluation.report.flights import flights_report
from fgnav.evaluation.report.save import write
from fgnav.integers.resolvers.registry import resolver_named
from fgnav.methods import method_named
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate

BROWSER = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)
CHECK = (Path(__file__).parent / "self_check.js").read_text(encoding="utf-8")
SIZES = {"wide": (1440, 900), "middle": (1280, 900), "phone": (390, 844)}
DARK, LIGHT = 0, 1  # of Blink's preferred colour schemes

pytestmark = pytest.mark.skipif(
    BROWSER is None, reason="no Chromium here: apt-get install chromium"
)


def looked_at(page, tmp_path, size=SIZES["wide"], scheme=LIGHT):
    """Return what the check found in a page that has it at its end, and what the console said."""
    text = page.read_text(encoding="utf-8")
    copy = tmp_path / "checked.html"
    checked = text.replace("</body>", f"<script>{CHECK}</script></body>")
    # A window is never narrower than 500: a phone is a frame within one.
    style = f"width:{size[0]}px;height:{size[1]}px;border:0"
    frame = f'<iframe style="{style}" srcdoc="{escape(checked)}"></iframe>'
    head = '<meta name="color-scheme" content="light dark">'
    copy.write_text(f"<!doctype html>{head}<body>{frame}</body>", encoding="utf-8")
    command = [
        BROWSER,
        "--headless=new",
        "--disable-gpu",
        "--no-first-run",
        "--enable-logging=stderr",
        f"--user-data-dir={tmp_path / 'profile'}",
        "--window-size=1500,1000",
        f"--blink-settings=preferredColorScheme={scheme}",
        "--virtual-time-budget=20000",
        "--dump-dom",
        *(["--no-sandbox"] if os.geteuid() == 0 else []),
        copy.as_uri(),
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    report = re.search(r'<pre id="found">(.*?)</pre>', done.stdout, flags=re.DOTALL)
    assert report, done.stdout[-2000:]
    console = [line for line in done.stderr.splitlines() if ":CONSOLE" in line]
    return json.loads(unescape(report[1])), console


@pytest.fixture(scope="module")
def flights():
    demo = msgspec.structs.replace(load_scenario("demo"), duration_s=4.0)
    return [simulate(demo, np.random.default_rng(seed)) for seed in (1, 2)]


@pytest.fixture(scope="module")
def methods():
    names = ("closed-form", "maximum-likelihood", "forward", "smoother", "batch", "rtk")
    return [method_named(name, resolver_named("lambda")) for name in names]


@pytest.fixture(scope="module")
def report(flights, methods, tmp_path_factory):
    path = tmp_path_factory.mktemp("browser") / "report.html"
    made = compare(flights[0], methods)
    write(comparison_report(made, flights[0], seed=1, source='name = "demo"'), path)
    return path


@pytest.fixture(scope="module")
def report_of_flights(flights, methods, tmp_path_factory):
    path = tmp_path_factory.mktemp("browser") / "flights.html"
    named = ((f"flight {k}", flight) for k, flight in enumerate(flights))
    comparison = compare_flights(named, methods, watch=lambda _name: nullcontext())
    write(flights_report(comparison), path)
    return path


@pytest.mark.parametrize("scheme", [LIGHT, DARK], ids=["light", "dark"])
@pytest.mark.parametrize("size", SIZES.values(), ids=SIZES)
def test_a_report_is_whole_in_a_browser(report, tmp_path, size, scheme):
    found, console = looked_at(report, tmp_path, size, scheme)
    assert console == []
    assert found["wrong"] == []
    assert found["loaded"] == []
    assert found["plots"] > 80
    assert found["tables"] > 8
    assert found["width"] == size[0]
    assert found["scrolls"] <= size[0]  # never to the side
    assert (found["ground"] > 0.5) == (scheme == LIGHT)


@pytest.mark.parametrize("size", SIZES.values(), ids=SIZES)
def test_a_report_of_several_flights_is_whole_in_a_browser(report_of_flights, tmp_path, size):
    found, console = looked_at(report_of_flights, tmp_path, size)
    assert console == []
    assert found["wrong"] == []
    assert found["loaded"] == []
    assert found["plots"] == 6
    assert found["scrolls"] <= size[0]


def test_what_is_broken_is_found(report, tmp_path):
    broken = tmp_path / "broken.html"
    text = report.read_text(encoding="utf-8")
    empty = (
        '<figure><svg viewBox="0 0 480 210" aria-label="empty"><text x="470">cut off</text></svg>'
    )
    text = text.replace("</main>", f"{empty}</figure><script>undefined.x</script></main>")
    text = text.replace("return sign *", "return 0 *")
    broken.write_text(text, encoding="utf-8")
    found, console = looked_at(broken, tmp_path)
    assert len(console) == 1
    assert any("does not sort" in one for one in found["wrong"])
    assert any("is cut off" in one for one in found["wrong"])
