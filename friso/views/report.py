"""The report of `friso check`: one page that opens offline, prints, and is the same bytes on every run."""

from __future__ import annotations

import base64
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from friso.version import VERSION
from friso.views import matplotlib_renderer, plotly_renderer
from friso.views.cases import BANDS, Shown, shown_cases
from friso.views.check_figures import check_figures
from friso.views.figure import Figure
from friso.views.prefixes import with_unit

if TYPE_CHECKING:
    from friso.hunting import Case

_MICRON, _TEN_MICRON = BANDS


def write_report(cases: Mapping[str, Case], path: Path) -> None:
    """Write `report_html(cases)` to `path` (OSError where that is impossible)."""
    path.write_text(report_html(cases), encoding="utf-8", newline="\n")


def report_html(cases: Mapping[str, Case]) -> str:
    """The whole page for the cases "given" and, with a joint, "locked" and "free"; traces may be missing."""
    shown = shown_cases(cases)
    stage = shown[0].case.stage if "given" not in cases else cases["given"].stage
    figures = check_figures(cases)
    environment = Environment(
        loader=PackageLoader("friso.views"), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    return environment.get_template("report.html").render(
        name=stage.name or "Unnamed stage",
        source=stage.source,
        shown=shown,
        sentences=[(item, verdict_sentence(item)) for item in shown],
        conclusion=conclusion(cases),
        rows=_rows(shown),
        figures=[
            (figure, Markup(plotly_renderer.fragment(figure)), _print_image(figure)) for figure in figures
        ],
        plotly=Markup(plotly_renderer.script()) if figures else None,
        stage_file=stage.to_toml(),
        version=VERSION,
        rtol=", ".join(sorted({f"{item.case.solver.rtol:g}" for item in shown})),
    )


def verdict_sentence(item: Shown) -> str:
    """What the case does, in a sentence for the engineer who decides."""
    case = item.case
    size = f"{_amplitude(case)} peak to peak"
    if case.verdict == "hunts":
        every = f" every {with_unit(case.period, 's')}" if case.period and math.isfinite(case.period) else ""
        counted = f" ({case.peaks} peaks counted)" if case.peaks else ""
        return f"hunts, {size}{every}{counted}."
    if case.verdict == "bistable":
        return "settles after this move, but another move or a push can start hunting."
    if case.verdict == "transient":
        return f"does not keep hunting, but is not settled at the end of the run (still {size})."
    if case.verdict == "settles":
        return _settling(item, size)
    return f"{case.verdict} (solver: {case.solver.status})."


def conclusion(cases: Mapping[str, Case]) -> str | None:
    """What the joint does to the hunting, where both of its cases were run to a known verdict."""
    hunts = {key: cases[key].verdict == "hunts" for key in ("locked", "free") if key in cases}
    known = all(cases[key].verdict in ("hunts", "settles", "bistable", "transient") for key in hunts)
    if len(hunts) < 2 or not known:
        return None
    if hunts["locked"]:
        return (
            "The free joint does not stop the hunting."
            if hunts["free"]
            else "The free joint stops the hunting."
        )
    return "The stage hunts only with its joint free." if hunts["free"] else None


def _settling(item: Shown, size: str) -> str:
    times = item.case.settling_time
    fine, coarse = times.get(_MICRON), times.get(_TEN_MICRON)
    if fine is not None:
        return f"settles to within {BANDS[_MICRON]} in {with_unit(fine, 's')}."
    if coarse is not None:
        within = f"settles to within {BANDS[_TEN_MICRON]} in {with_unit(coarse, 's')}"
        return f"{within}, but does not stay within {BANDS[_MICRON]}."
    return f"settles by the peak count, but does not stay within {BANDS[_TEN_MICRON]} ({size} at the end)."


def _rows(shown: tuple[Shown, ...]) -> list[tuple[str, list[str]]]:
    """The table: what is named, and its text for each case."""
    columns: dict[str, Callable[[Case], str]] = {
        "Verdict": lambda case: case.verdict,
        "Counted peaks": lambda case: str(case.peaks),
        "Peak to peak, last quarter": _amplitude,
        "Period, last quarter": lambda case: with_unit(case.period, "s"),
        **{f"Settling time into {text}": _settled_within(band) for band, text in BANDS.items()},
        "Largest actuator force": lambda case: with_unit(case.largest_force, "N"),
        "Solver status": lambda case: case.solver.status,
        "Steps (rejected)": lambda case: f"{case.solver.steps} ({case.solver.rejected})",
    }
    return [(name, [text(item.case) for item in shown]) for name, text in columns.items()]


def _amplitude(case: Case) -> str:
    """Peak to peak; below a nanometre the digits would be those of the solver, not of the stage."""
    return "< 1 nm" if case.peak_to_peak < 1e-9 else with_unit(case.peak_to_peak, "m")


def _settled_within(band: float) -> Callable[[Case], str]:
    def text(case: Case) -> str:
        time = case.settling_time.get(band)
        return "never" if time is None else with_unit(time, "s")

    return text


def _print_image(figure: Figure) -> str:
    """The figure as an SVG data address: what is printed, and what is seen without scripts."""
    svg = matplotlib_renderer.image(replace(figure, title="", subject=""), "svg")
    return "data:image/svg+xml;base64," + base64.b64encode(svg).decode("ascii")
