"""How long `friso app` takes from an input event to the painted picture, in Chromium: python -m benchmarks.app.

A slider of the thesis rig is moved step by step; each step waits for the picture. Prints medians and 95th percentiles
[ms] of the picture, and of the first picture of a map and of the Bode plots from the click on their tabs.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
from typing import Any

import numpy as np

import friso

WATCH = """(window.painted = (place) => new Promise((done) => {
  const begun = performance.now();
  const watch = new MutationObserver(() => { watch.disconnect();
    requestAnimationFrame(() => requestAnimationFrame(() => done(performance.now() - begun))); });
  watch.observe(document.querySelector(place), { subtree: true, childList: true, attributes: true });
})) && 0"""

STEP = """async ([place, value]) => {
  const slider = document.querySelector('[data-path="controller.crossover"] input[type=range]');
  const painted = window.painted(place);
  slider.value = value;
  slider.dispatchEvent(new Event("input"));
  return painted;
}"""


def main() -> None:
    """Measure, and print a table."""
    from playwright.sync_api import sync_playwright

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=100, help="steps of the slider")
    steps = parser.parse_args().steps
    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    command = [
        sys.executable,
        "-m",
        "friso",
        "app",
        str(friso.example("thesis_rig")),
        "--no-browser",
        "--port",
        "0",
    ]
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f} before")
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server, sync_playwright() as play:
        assert server.stdout is not None
        address = re.search(r"http://\S+", server.stdout.readline())
        assert address is not None
        browser = play.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1600, "height": 1000})
        page.goto(address[0])
        page.wait_for_selector(".js-plotly-plot .main-svg", timeout=120_000)
        page.wait_for_selector("#answer .rest .note", timeout=120_000)
        page.evaluate(WATCH)
        _report("picture of a dragged slider", _steps(page, ".plots", steps))
        page.evaluate("""document.querySelector('[data-path="controller.crossover"] input[type=range]')
            .dispatchEvent(new Event("change"))""")
        page.wait_for_timeout(1000)
        _report("map: first picture", _times(page, "map", ".heatmaplayer image", 5))
        _report("Bode plots", _times(page, "bode", ".plot .main-svg", 5))
        browser.close()
        server.terminate()


def _steps(page: Any, place: str, count: int) -> list[float]:
    """Times [ms] from an input event of the slider to the picture."""
    return [page.evaluate(STEP, [place, 480 + k % 80]) for k in range(count)]


def _times(page: Any, tab: str, painted: str, count: int) -> list[float]:
    """Times [ms] from a click on a tab to its picture."""
    wait = """async ([tab, painted]) => { const begun = performance.now();
      document.getElementById(`tab-${tab}`).click();
      while (!document.querySelector(painted)) await new Promise(requestAnimationFrame);
      return performance.now() - begun; }"""
    times = []
    for _ in range(count):
        page.click("#tab-run")
        page.wait_for_selector(".plot .main-svg")
        page.wait_for_timeout(500)
        times.append(page.evaluate(wait, [tab, painted]))
    return times


def _report(what: str, times: list[float]) -> None:
    print(f"{what:<30} median {np.median(times):6.0f} ms   p95 {np.percentile(times, 95):6.0f} ms   of {len(times)}")


if __name__ == "__main__":
    main()
