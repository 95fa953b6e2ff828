"""The figures of README and docs: `python docs/figures.py [NAME...]` makes them anew, all of them or those named.

`docs/figures.json` keeps of what each was made; a test says when that has changed since.
"""

from __future__ import annotations

import hashlib
import inspect
import json
import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path

import friso
from friso.interface.answer import Answer
from friso.shown.drawing.figure import BLUE, GREEN, VERMILLION, Axis, Figure, Panel, Series
from friso.shown.drawing.matplotlib_renderer import image
from friso.stage import Stage

DOCS = Path(__file__).parent
MADE = DOCS / "figures.json"


@cache
def rig() -> Stage:
    """The thesis rig."""
    return friso.load(friso.example("thesis_rig"))


def hunting() -> bytes:
    """The error of the rig after its move, joint locked and free: one swings on and on, the other settles."""
    cases = (("joint locked: hunts", True, VERMILLION), ("joint free: settles", False, BLUE))
    lines = []
    for label, locked, colour in cases:
        run = friso.simulate(rig().replace({"joint.locked": locked}), sample_time="5 ms").data
        error = run["position"] - run["reference"]
        lines.append(Series(run["time"].values, error.values, label, colour))
    panel = Panel("", Axis("Time", "s", (5, 20)), Axis("Error", "m", (-8e-4, 8e-4)), tuple(lines))
    return image(Figure("hunting", "Locked, it never stops; free, it stands still after seconds", "", (panel,)), "png")


def thesis_rig() -> bytes:
    """The verdict: joint locked beside joint free."""
    return _first(friso.check(rig()))


def thesis_cycles() -> bytes:
    """All hunting cycles of the locked rig over the crossover."""
    ranges = {"controller" + ".crossover": "1 Hz..40 Hz"}
    return _first(friso.boundary(rig(), ranges, set={"joint.locked": True}))


def thesis_loops() -> bytes:
    """The open loop at prescribed speeds of the cart."""
    drive = {"drive.sample_time": "50 us", "drive.delay": "100 us"}
    figures = friso.bode(rig(), set=drive).figures()
    return image(next(figure for figure in figures if "speeds" in figure.name), "png")


def return_map() -> bytes:
    """The return map of the rig, joint locked and free, with the rig's own swings."""
    figures = friso.check(rig()).figures()
    return image(next(figure for figure in figures if figure.name == "return-map"), "png")


def limit_cycle() -> bytes:
    """Releases of the locked rig: two end in the cycle; the shortest sticks outside its basin and ends at rest."""
    starts = (("7 mm", VERMILLION), ("2 mm", BLUE), ("1.5 mm", GREEN))
    tables = rig().replace({"joint.locked": True}).as_written()
    runs = {}
    for start, _ in starts:
        motion = {"kind": "release", "displacement": start, "duration": "30 s"}
        runs[start] = friso.simulate(Stage(**{**tables, "motion": motion}), sample_time="2 ms").data

    def lines(across: str, up: str, span: slice) -> tuple[Series, ...]:
        return tuple(
            Series(runs[start][across].values[span], runs[start][up].values[span], f"let go at {start}", colour)
            for start, colour in starts
        )

    position = Axis("Position", "m", (-9e-4, 9e-4))
    panels = (
        Panel("The first 12 s", Axis("Time", "s", (0, 12)), position, lines("time", "position", slice(6000))),
        Panel("The last 2 s", position, Axis("Velocity", "m/s"), lines("position", "velocity", slice(-1000, None))),
    )
    return image(
        Figure("limit-cycle", "A limit cycle, and starts within and outside its basin", "", panels, columns=2), "png"
    )


def branch() -> bytes:
    """The symmetric hunting cycle of the locked rig over the crossover: amplitude and multiplier, flip and fold."""
    ranges = {"controller" + ".crossover": "4 Hz..18 Hz"}
    (figure, *_) = friso.boundary(rig(), ranges, set={"joint.locked": True}).figures()
    panels = [
        replace(
            panel,
            series=tuple(line for line in panel.series if line.colour != BLUE),
            markers=tuple(points for points in panel.markers if points.colour != BLUE),
        )
        for panel in figure.panels
    ]
    title = "The multiplier passes −1 in a flip and 1 in a fold"
    return image(replace(figure, title=title, panels=(panels[0], panels[2]), note=""), "png")


def thesis_map() -> bytes:
    """Where the locked rig hunts, over the speed of its controller and its friction."""
    ranges = {"speed": "0.4..2.5:41:log", "friction": "0.3..3:41:log"}
    return _first(friso.sweep(rig(), ranges, set={"joint.locked": True}))


def compare() -> bytes:
    """Isolator or firmware, on machines drawn at random."""
    return _first(friso.compare(rig()))


def _first(answer: Answer) -> bytes:
    return image(answer.figures()[0], "png")


FIGURES: Mapping[str, Callable[[], bytes]] = {
    "hunting.png": hunting,
    "thesis_rig.png": thesis_rig,
    "thesis_cycles.png": thesis_cycles,
    "thesis_loops.png": thesis_loops,
    "return_map.png": return_map,
    "limit_cycle.png": limit_cycle,
    "branch.png": branch,
    "thesis_map.png": thesis_map,
    "compare.png": compare,
}


def source_of(name: str) -> str:
    """A digest of what makes a figure: its function, and the stage that it shows."""
    text = inspect.getsource(FIGURES[name]) + friso.example("thesis_rig").read_text(encoding="utf-8")
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def main(names: list[str]) -> None:
    """Make the figures of these names; all without any."""
    made = json.loads(MADE.read_text(encoding="utf-8")) if MADE.exists() else {}
    for name in names or FIGURES:
        (DOCS / name).write_bytes(FIGURES[name]())
        made[name] = source_of(name)
        print(f"wrote {DOCS / name}")
    MADE.write_text(json.dumps(made, indent=1, sort_keys=True) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
