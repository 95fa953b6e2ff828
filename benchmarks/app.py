"""Time `friso app` in Chromium, from an input event to the painted picture.

Run by `python -m benchmarks.app`. A slider of the thesis rig is moved step by step; each step waits for the picture.
The benchmark prints medians and 95th percentiles [ms] for the picture, and for the first picture of a map and of the
Bode plots after the click on their tabs. Then the slider is dragged, a step with every frame that the browser paints.
It prints the time between frames, and the memory of page and server before and after the drags. First comes how much
of the server's processor time [ms] passes from a value to its verdict, and to its whole answer, on the map.
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
import psutil

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


IS_THERE = {
    "verdict": "() => !document.querySelector('#verdict .word').inert",
    "whole answer": "() => window.now().answers.has('check')",
}


SET = """(value) => {
  const slider = document.querySelector('[data-path="controller.crossover"] input[type=range]');
  slider.value = value;
  for (const name of ["input", "change"]) slider.dispatchEvent(new Event(name));
}"""


DRAG = """async (steps) => {
  const slider = document.querySelector('[data-path="controller.crossover"] input[type=range]');
  const times = [];
  for (let k = 0; k < steps; k += 1) {
    times.push(await new Promise(requestAnimationFrame));
    slider.value = 480 + (k % 80);
    slider.dispatchEvent(new Event("input"));
  }
  slider.dispatchEvent(new Event("change"));
  return times;
}"""


def main() -> None:
    """Measure, and print a table."""
    from playwright.sync_api import sync_playwright

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=100, help="steps of the slider")
    parser.add_argument("--drags", type=int, default=1000, help="steps of the drag with every frame")
    chosen = parser.parse_args()
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
        page.wait_for_selector("#picture .note", timeout=600_000)  # the map is whole, and nothing is at work
        _spent(page, psutil.Process(server.pid), 5)
        page.click("#tab-run")
        page.wait_for_selector(".plot .main-svg")
        page.evaluate(WATCH)
        _report("picture of a dragged slider", _steps(page, ".plots", chosen.steps))
        page.evaluate("""document.querySelector('[data-path="controller.crossover"] input[type=range]')
            .dispatchEvent(new Event("change"))""")
        page.wait_for_timeout(1000)
        _report("map: first picture", _times(page, "map", ".heatmaplayer image", 5))
        _report("Bode plots", _times(page, "bode", ".plot .main-svg", 5))
        page.click("#tab-run")
        page.wait_for_selector(".plot .main-svg")
        _drag(page, server.pid, chosen.drags)
        browser.close()
        server.terminate()


def _steps(page: Any, place: str, count: int) -> list[float]:
    """Return the times [ms] from an input event of the slider to the picture."""
    return [page.evaluate(STEP, [place, 480 + k % 80]) for k in range(count)]


def _spent(page: Any, server: psutil.Process, count: int) -> None:
    """Print the processor time [ms] of the server from a value to what is said of it."""
    page.evaluate("async () => { window.now = (await import('/shown.js')).now; }")
    times: dict[str, list[float]] = {what: [] for what in IS_THERE}
    for k in range(count):
        begun = sum(server.cpu_times()[:2])
        page.evaluate(SET, 520 + k)
        for what, is_there in IS_THERE.items():
            page.wait_for_function(is_there, timeout=120_000)
            times[what].append(1000 * (sum(server.cpu_times()[:2]) - begun))
        page.wait_for_timeout(5000)  # tracks and map
    for what, spent in times.items():
        _report(f"processor time to the {what}", spent)


def _times(page: Any, tab: str, painted: str, count: int) -> list[float]:
    """Return the times [ms] from a click on a tab to its picture.

    Each click is for another machine, because answers are kept.
    """
    wait = """async ([tab, painted]) => { const begun = performance.now();
      document.getElementById(`tab-${tab}`).click();
      while (!document.querySelector(painted)) await new Promise(requestAnimationFrame);
      return performance.now() - begun; }"""
    times = []
    for k in range(count):
        page.click("#tab-run")
        page.evaluate(SET, 500 + k)
        page.wait_for_selector(".plot .main-svg")
        page.wait_for_timeout(500)
        times.append(page.evaluate(wait, [tab, painted]))
    return times


def _drag(page: Any, server: int, count: int) -> None:
    """Print what a drag of `count` steps does to frames and memory.

    A tenth of the steps comes first, so that everything is loaded.
    """
    tool = page.context.new_cdp_session(page)

    def megabytes() -> tuple[float, float]:
        tool.send("HeapProfiler.collectGarbage")
        return tool.send("Runtime.getHeapUsage")["usedSize"] / 1e6, psutil.Process(server).memory_info().rss / 1e6

    page.evaluate(DRAG, count // 10)
    before = megabytes()
    times = page.evaluate(DRAG, count)
    page.wait_for_timeout(3000)
    after = megabytes()
    _report("between frames while dragging", [*np.diff(times)])
    for place, first, last in zip(("page", "server"), before, after, strict=True):
        print(f"memory of the {place:<16} before {first:6.1f} MB   after {last:6.1f} MB   of {count} drags")


def _report(what: str, times: list[float]) -> None:
    print(f"{what:<30} median {np.median(times):6.0f} ms   p95 {np.percentile(times, 95):6.0f} ms   of {len(times)}")


if __name__ == "__main__":
    main()
