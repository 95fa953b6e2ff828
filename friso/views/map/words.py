"""What the axes, variables and cells of a map are called, and what is said about the whole of it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Iterable
from typing import TYPE_CHECKING

import numpy as np

from friso.stage.controllers import CONTROLLER, CONTROLLERS, FORCE_LIMIT
from friso.views.drawing.figure import GREY, INK, ORANGE, PINK, VERMILLION, Kind

if TYPE_CHECKING:
    import xarray as xr

AT_ONCE = 1_000_000
"""Texts that are counted at a time."""

_QUANTITIES = {
    FORCE_LIMIT: "Force limit",
    "friction.bristle_damping": "Bristle damping",
    "friction.bristle_stiffness": "Bristle stiffness",
    "friction.coulomb": "Coulomb friction",
    "friction.static": "Static friction",
    "friction.stribeck_exponent": "Stribeck exponent",
    "friction.stribeck_velocity": "Stribeck velocity",
    "friction.viscous": "Viscous friction",
    "joint.limiter_damping": "Limiter damping",
    "joint.limiter_stiffness": "Limiter stiffness",
    "joint.locked": "Joint",
    "masses.cart": "Cart mass",
    "masses.stage": "Stage mass",
    "motion.acceleration": "Acceleration",
    "motion.acceleration_time": "Acceleration time",
}
_VARIABLES = {
    "peaks": "Counted peaks",
    "verdict": "Verdict",
    "status": "Status",
    "peak_to_peak": "Peak to peak, last quarter",
    "period": "Period",
    "settling_time": "Settling time into 1 µm",
    "settling_time_10um": "Settling time into 10 µm",
    "largest_force": "Largest actuator force",
    "multiplier": "Hunting multiplier",
    "amplitude": "Amplitude of the hunting cycle",
    "cycle_period": "Period of the hunting cycle",
    "steps": "Solver steps",
    "rejected": "Rejected solver steps",
}

QUIET = "#d3e6f3"  # no hunting: a pale blue, far from every colour of hunting and from white and grey
INVALID = Kind("invalid", "#b4b4b4")
FAILED = Kind("failed", INK)
NOT_RUN = Kind("not run", "#ffffff")
VERDICTS = {
    "hunts": Kind("hunts", VERMILLION),
    "bistable": Kind("bistable", PINK),
    "transient": Kind("transient", ORANGE),
    "settles": Kind("settles", QUIET),
    "failed": FAILED,
    "invalid": INVALID,
    "": NOT_RUN,
}
"""The verdicts a cell can have, the worst first, in the colours of every map."""
# Cells without numbers of their own: paler than the verdict they are said to have, so that both can stand in a map.
INFERRED = {
    "hunts": Kind("hunts (inferred)", "#f3c39e"),
    "bistable": Kind("bistable (inferred)", "#ecd3e0"),
    "transient": Kind("transient (inferred)", "#f7dfa8"),
    "settles": Kind("settles (inferred)", "#e4efe0"),
}
_NO_NUMBER = "#e8dcc6"


def quantity(key: Hashable) -> str:
    """An axis in words: "joint.stroke" is "Joint stroke", a free name is itself."""
    name = str(key)
    known = _QUANTITIES | CONTROLLERS.words
    if name in known:
        return known[name]
    words = name.removeprefix(f"{CONTROLLER}.").removeprefix("motion.").replace("_", " ").replace(".", " ")
    return words[:1].upper() + words[1:]


def variable(name: Hashable) -> str:
    """A variable in words: "period" is "Period"."""
    return _VARIABLES.get(str(name)) or quantity(name)


def verdict_kind(word: str) -> Kind:
    """Label and colour of a verdict; one that is not known here is grey, under its own name."""
    return VERDICTS.get(word) or Kind(word, GREY)


def no_number(name: str) -> Kind:
    """What it means that a run that was completed has no such number."""
    if name.startswith("settling_time"):
        band = variable(name).removeprefix("Settling time into ")
        return Kind(f"never settles into {band}", _NO_NUMBER)
    if name in ("multiplier", "amplitude", "cycle_period"):
        return Kind("no cycle found", _NO_NUMBER)
    return Kind("no period" if name == "period" else "no value", _NO_NUMBER)


def grouped(number: int) -> str:
    """A count in groups of three digits: 1 000 000."""
    return f"{number:,}".replace(",", " ")


def in_order(kinds: Iterable[Kind]) -> tuple[Kind, ...]:
    """Each kind once, in the order of every legend: verdicts, the worst first, then what has no verdict."""
    order = [*VERDICTS.values(), *INFERRED.values()]
    return tuple(sorted(dict.fromkeys(kinds), key=lambda kind: order.index(kind) if kind in order else len(order)))


def unit_of(array: xr.DataArray) -> str:
    """SI unit of a variable or coordinate; none for counts and words."""
    unit = str(array.attrs.get("units", ""))
    return "" if unit == "1" else unit


def words_of(runs: xr.Dataset, name: str) -> tuple[np.ndarray, list[str]]:
    """The texts of a variable: their numbers, of its shape, and each text once (by its first place)."""
    import pandas as pd

    values = runs[name].values
    codes, words = pd.factorize(values.astype(object).ravel())
    return codes.reshape(values.shape), [str(word) for word in words]


def counts(runs: xr.Dataset, name: str) -> dict[str, int]:
    """How many cells have each text of a variable, the most frequent first; none where there is no such variable."""
    if name not in runs:
        return {}
    found: Counter[str] = Counter()
    along, shape = str(runs[name].dims[0]), runs[name].shape
    rows = max(1, AT_ONCE // max(1, int(np.prod(shape[1:]))))
    for first in range(0, shape[0], rows):  # a large store is never read whole
        codes, words = words_of(runs.isel({along: slice(first, first + rows)}), name)
        found.update(dict(zip(words, np.bincount(codes.ravel(), minlength=len(words)).tolist(), strict=True)))
    return dict(found.most_common())


def failures(runs: xr.Dataset) -> dict[str, int]:
    """How many cells have no result, by the reason in their status."""
    return {
        reason: number
        for reason, number in counts(runs, "status").items()
        if reason != "done" and not reason.startswith("inferred")
    }


def verdict_counts(runs: xr.Dataset) -> dict[str, int]:
    """How many cells have each verdict, in the order of the legend."""
    found = {verdict_kind(word): number for word, number in counts(runs, "verdict").items()}
    return {kind.label: found[kind] for kind in in_order(found)}


def verification(runs: xr.Dataset) -> str:
    """How many of the verdicts checked survive a tighter tolerance, with Wilson's 95 % confidence interval."""
    checked = int(runs.attrs.get("verified_cells", 0))
    if not checked:
        return "Not verified: no verdict was checked at a tighter tolerance."
    from scipy.stats import binomtest

    surviving = int(runs.attrs["verified_surviving"])
    interval = binomtest(surviving, checked).proportion_ci(0.95, method="wilson")
    rtol = float(runs.attrs["verified_rtol"])
    text = (
        f"{100 * surviving / checked:.1f} % of {grouped(checked)} verdicts checked survive rtol {rtol:g} "
        f"(95 % confidence: {100 * interval.low:.1f} to {100 * interval.high:.1f} %)."
    )
    if inferred := int(runs.attrs.get("inferred_checked", 0)):
        confirmed = int(runs.attrs["inferred_confirmed"])
        text += f" Of {grouped(inferred)} inferred verdicts {100 * confirmed / inferred:.1f} % are confirmed by a run."
    return text


def statement(runs: xr.Dataset) -> str:
    """What stands on every figure of a map: its verification, its tolerance and its number of runs."""
    return "\n".join([verification(runs), _extent(runs), *([" ".join(found)] if (found := caveats(runs)) else [])])


MEANINGS = {
    "hunts": "has counted peaks: late (after 10 s), tall (above 0.1 mm) and apart (0.5 s); one alone is no cycle",
    "transient": "has none, but still swings by more than 0.1 mm at the end and is not within 10 µm",
    "settles": "has none, and swings no more than 0.1 mm at the end",
    "failed": "the run was not completed",
    "invalid": "no stage may have these values",
}
"""What the verdicts of a map mean."""


def caveats(runs: xr.Dataset) -> list[str]:
    """What the peak count alone does not tell: settled cells that do not stay in their band, hunting that has ended."""
    if not {"settling_time_10um", "verdict", "status"} <= set(runs.data_vars):
        return []
    verdict, never = runs["verdict"].values, np.isnan(runs["settling_time_10um"].values)
    codes, words = words_of(runs, "status")
    ran = np.array([not word.startswith("inferred") for word in words])[codes]
    off, over = int(((verdict == "settles") & never & ran).sum()), int(((verdict == "hunts") & ~never & ran).sum())
    found = [f"{grouped(off)} of the cells that settle do not stay within 10 µm of the reference."] if off else []
    return found + ([f"{grouped(over)} of those that hunt have settled by the end of the run."] if over else [])


def _extent(runs: xr.Dataset) -> str:
    cells = int(np.prod(list(runs.sizes.values())))
    status = counts(runs, "status")
    inferred = sum(number for reason, number in status.items() if reason.startswith("inferred"))
    verdicts = verdict_counts(runs)
    idle = sum(verdicts.get(kind.label, 0) for kind in (INVALID, NOT_RUN))
    runs_text = f"{grouped(cells - idle - inferred)} runs at rtol {float(runs.attrs['rtol']):g}"
    if inferred:
        runs_text += f", {grouped(inferred)} cells inferred from their neighbours"
    listed = ", ".join(f"{label} {grouped(number)}" for label, number in verdicts.items())
    return f"{runs_text}: {listed}." if listed else f"{runs_text}."
