"""Draw the pictures of a report for README and documents: ``python docs/pictures.py``.

The page is shown by Chromium, where there is one.
"""

import shutil
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from PIL import Image

from fgnav import compare
from fgnav.evaluation.report.save import save_report
from fgnav.integers.resolvers.registry import resolver_named
from fgnav.methods import method_named
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate

ROOT = Path(__file__).resolve().parents[1]
METHODS = ("closed-form", "maximum-likelihood", "forward", "smoother", "batch", "rtk")
PAGE, SHOWN, SHEET = "1440,960", (840, 560), (2338, 1500)


def main() -> None:
    """Compare methods on the demo; keep the page's beginning, and that of the errors."""
    flight = simulate(load_scenario("demo"), np.random.default_rng(1))
    resolver = resolver_named("network-arcs")
    comparison = compare(flight, [method_named(name, resolver) for name in METHODS])
    with TemporaryDirectory() as folder:
        page = Path(folder) / "report.html"
        save_report(comparison, flight, page.with_suffix(".png"))
        with Image.open(page.with_name("report-errors.png")) as errors:
            begin = errors.crop((0, 0, *SHEET)).quantize(128)
            begin.save(ROOT / "sim/gallery/demo.png", optimize=True)
        save_report(comparison, flight, page)
        browser = shutil.which("chromium") or shutil.which("google-chrome")
        if browser is not None:
            shot = page.with_name("shot.png")
            command = [browser, "--headless=new", "--no-sandbox", "--hide-scrollbars"]
            command += [f"--screenshot={shot}", f"--window-size={PAGE}", page.as_uri()]
            subprocess.run(command, check=True)
            keep(shot)


def keep(shot: Path) -> None:
    """Keep a screenshot of the report's beginning, small."""
    with Image.open(shot) as image:
        begin = image.convert("RGB").resize(SHOWN, Image.Resampling.LANCZOS).quantize(16)
        begin.save(ROOT / "docs/tutorial/report.png", optimize=True)


if __name__ == "__main__":
    main()
