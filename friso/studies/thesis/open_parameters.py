"""Parameters that the thesis leaves open, over their plausible ranges, and other assumptions a judgement may depend
on."""

from __future__ import annotations

from collections.abc import Mapping, Set
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

from friso.equations.controllers.van_dijk import ALPHA, BETA
from friso.studies.thesis.studies import NOTHING, ThesisStudy

if TYPE_CHECKING:
    from friso.studies.thesis.linear import PartNeeded

Kind = Literal["unknown parameter", "solver tolerance", "metric"]

RTOL = 1e-4
"""The thesis's relative tolerance (Sec. 3.2.3)."""

LONG_RUN = "60 s"
"""Three times the thesis's run: a transient that is counted as hunting has died out before its last quarter."""

_OPEN_JOINT_KEYS = frozenset({"joint.damping"})


@dataclass(frozen=True)
class Variant:
    """One change against the baseline: `parameter` and its `value` in words, and why that value is plausible.

    `rtol` None is the tolerance of the reproduction. Of the kind "metric" a run is as long as `changes` say, and what
    it does at its end counts instead of peaks.
    """

    parameter: str
    value: str
    reason: str
    changes: Mapping[str, Any] = field(default_factory=lambda: NOTHING)
    rtol: float | None = None
    kind: Kind = "unknown parameter"

    def touches(self, study: ThesisStudy) -> bool:
        """Whether the study's map can be another than the baseline's."""
        return self.changes_more_than(study.sets, bool(study.changes.get("joint.locked")))

    def changes_more_than(self, fixed: Set[str], locked: bool) -> bool:
        """Whether it matters to what decides on the keys `fixed` itself; a locked joint has no damping of its own."""
        decided = fixed | _OPEN_JOINT_KEYS if locked else fixed
        return self.kind != "unknown parameter" or not self.changes.keys() <= decided

    def touches_part(self, need: PartNeeded) -> bool:
        """Whether that part of the linear analysis, or that experiment, can be another: the former knows no solver, the
        latter keeps its own tolerance, and neither counts peaks."""
        outside = {key for key in self.changes if key.startswith(need.outside)}
        return self.kind == "unknown parameter" and self.changes_more_than(outside, need.locked)


def _variants(parameter: str, reason: str, values: Mapping[str, Mapping[str, Any]]) -> tuple[Variant, ...]:
    return tuple(Variant(parameter, value, reason, MappingProxyType(dict(values[value]))) for value in values)


def _of_key(parameter: str, key: str, values: tuple[Any, ...], reason: str) -> tuple[Variant, ...]:
    return _variants(parameter, reason, {str(value): {key: value} for value in values})


def _path(acceleration: str, time: str) -> dict[str, str]:
    return {"motion.acceleration": acceleration, "motion.acceleration_time": time}


OPEN: tuple[Variant, ...] = (
    *_of_key("alpha", ALPHA, (0.2, 0.3), "Sec. 3.2.4: often chosen between 0.1 and 0.3 (baseline 0.1)"),
    *_of_key("beta", BETA, (1.0, 3.0), "Table 3: studied from 1 to 3 (baseline 2)"),
    *_of_key(
        "d_j",
        "joint.damping",
        ("0.05 N*s/m", "5 N*s/m"),
        "damping ratios of 0.07 % (bare steel leaf springs) to 7 % (cables, air) at 11 Hz (baseline 0.5 N s/m)",
    ),
    *_of_key(
        "d_l",
        "joint.limiter_damping",
        ("1 N*s/m", "1e4 N*s/m"),
        "Table 3: studied from 0.01 to 1e4 N s/m; steel on steel loses at least 0.02 % (baseline 100 N s/m)",
    ),
    *_of_key(
        "parasitic mass",
        "parasitic.mass",
        ("0.05 kg", "0.4 kg"),
        "from a tenth to most of the 0.5 kg of the stage (baseline 0.25 kg)",
    ),
    *_of_key(
        "parasitic damping",
        "parasitic.damping_ratio",
        (0.001, 0.05),
        "bare metal to bolted joints (baseline 0.01)",
    ),
    *_variants(
        "path of the marker",
        "Sec. 4.3.2 moves 100 mm at 100 m/s^2; slower starts cover the same way (baseline 90 mm at 100 m/s^2)",
        {
            "100 mm at 100 m/s^2": _path("100 m/s^2", "31.6228 ms"),
            "100 mm at 30 m/s^2": _path("30 m/s^2", "57.735 ms"),
            "100 mm at 10 m/s^2": _path("10 m/s^2", "100 ms"),
        },
    ),
)
"""One at a time, over low and high."""

METHOD: tuple[Variant, ...] = (
    Variant("relative tolerance", f"{RTOL:g}", "Sec. 3.2.3: the thesis's own", rtol=RTOL, kind="solver tolerance"),
    Variant(
        "metric",
        f"still swinging at the end of {LONG_RUN}",
        "the peak count takes a long transient for hunting, and misses a cycle longer than its window",
        MappingProxyType({"motion.duration": LONG_RUN}),
        kind="metric",
    ),
)
"""What belongs to the method, not to the rig."""
