"""Judge the thesis's claims about the edge of hunting, by the sweeps and the rig."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from friso.quantities import percent
from friso_thesis.studies.guideline.edges import ABOVE, BELOW, KINDS
from friso_thesis.studies.guideline.edges import UNKNOWN as NOT_TOLD
from friso_thesis.studies.guideline.worked import CLAIMED_AT, STUDIED, ThesisCase, Worked
from friso_thesis.studies.thesis.reading import OWN, about

HOLDS, IN_PART, DIFFERS, UNKNOWN = "holds", "holds in part", "differs", "unknown"

FREE_EDGE, LOCKED_EDGES = (5.0, 5.5), (15.0, 14.3)
"""Crossovers [Hz] above which the thesis's rig no longer hunts: two values with the joint free, and two with it
locked."""

NEAR_EDGE = 1.1
"""Ratio within which the free edge may miss its range, and a short stroke's edge may exceed a long one's."""

ABOUT_ONE_NEWTON = (0.5, 2.0)
"""Range of gaps [N] that counts as "about 1 N"."""

JOINT_STIFFNESSES = (1000, 2400)
"""Stiffnesses of the softer and of the stiffer joint [N/m]."""

JOINT_STROKES = (0.3, 1.0, 2.0)
"""Strokes [mm]: the one claimed to be enough, a long one, and the longest."""

SAME_EDGE = 0.02
"""Largest relative change of an edge that "no longer changes"."""


@dataclass(frozen=True)
class GuidelineClaim:
    """A claim of the thesis about the edge of hunting, with its judgement.

    Fields are the claim's place and words, the `result` found, and the `rule` by which it is judged. The `judgement`
    says in words that the claim holds, holds in part or differs, or that an edge is unknown.
    """

    where: str
    text: str
    result: str
    rule: str
    judgement: str


def judged_claims(worked: Worked) -> tuple[GuidelineClaim, ...]:
    """Judge the claims of the thesis that the edge decides.

    Computed edges decide, not the laws.
    """
    return _gap(worked), _share_below_limit(worked), _mass(worked), _stiffness(worked), _stroke(worked), _edges(worked)


def _gap(worked: Worked) -> GuidelineClaim:
    """Judge the claim that hunting needs a friction gap F_s - F_c of about 1 N."""
    cases = worked.studies["gap"]
    forces = sorted({case.changes["friction.static"] for case in cases})
    gaps = [least_gap(cases, force) for force in forces]
    words = ", ".join(f"{gap.words} at F_s = {force:g} N" for force, gap in zip(forces, gaps, strict=True))
    return GuidelineClaim(
        "Sec. 4.3.3",
        "hunting needs a friction gap of about 1 N",
        f"locked, at {CLAIMED_AT:g} Hz a cycle attracts from a gap of {words}; by the law this gap grows with the "
        "force and the crossover",
        f"{ABOUT_ONE_NEWTON[0]:g} to {ABOUT_ONE_NEWTON[1]:g} N at each static friction",
        _judgement([gap.within(*ABOUT_ONE_NEWTON) for gap in gaps]),
    )


def _share_below_limit(worked: Worked) -> GuidelineClaim:
    """Judge the claim that the ratio of cart and stage mass does not affect the isolator."""
    cases = worked.studies["share"]
    edges = _computed(cases)
    at = [STUDIED["share"](case.changes) for case in cases]
    spread = (
        f", a spread by a factor of {edges.max() / edges.min():.2g}" if np.all(np.isfinite(edges) & (edges > 0)) else ""
    )
    ends = ", ".join(f"{_edge(case)} at {percent(share)}" for share, case in zip(at, cases, strict=True))
    return GuidelineClaim(
        "Fig. 15A",
        "the mass ratio does not affect the isolator",
        f"edge by the share of the stage in the mass: {ends}{spread}",
        f"an edge below {CLAIMED_AT:g} Hz, where the thesis evaluates its isolator, for all shares tried",
        _judgement([_verdict(edge < CLAIMED_AT, edge) for edge in edges]),
    )


def _mass(worked: Worked) -> GuidelineClaim:
    """Judge the claim that more mass ends hunting at a lower crossover."""
    cases = worked.studies["mass"]
    edges = _computed(cases)
    at = [STUDIED["mass"](case.changes) for case in cases]
    text = (
        f"locked, tuned for its mass: edge {_edge(cases[0])} at {at[0]:.2g} kg, {_edge(cases[-1])} at {at[-1]:.2g} kg"
    )
    falls = [_verdict(after < before, before, after) for before, after in pairwise(edges)]
    falls = falls if None in falls else [all(falls)]
    return GuidelineClaim("Fig. 11B", "more mass helps", text, "the edge falls monotonically", _judgement(falls))


def _stiffness(worked: Worked) -> GuidelineClaim:
    cases = {round(STUDIED["stiffness"](case.changes)): case for case in worked.studies["stiffness"]}
    soft, stiff = (cases[stiffness] for stiffness in JOINT_STIFFNESSES)
    lower = _verdict(soft.ranked < stiff.ranked, soft.ranked, stiff.ranked)
    text = (
        f"edge {_edge(soft)} at {JOINT_STIFFNESSES[0] / 1e3:g} N/mm, {_edge(stiff)} at {JOINT_STIFFNESSES[1] / 1e3:g} "
        "N/mm"
    )
    return GuidelineClaim("Fig. 16B", "a softer joint lowers the limit", text, "it is lower", _judgement([lower]))


def _stroke(worked: Worked) -> GuidelineClaim:
    """Judge the claim that a small stroke is enough, and that a longer one changes nothing."""
    cases = {round(1e3 * STUDIED["stroke"](case.changes), 6): case for case in worked.studies["stroke"]}
    words = ", ".join(f"{_edge(case)} at {stroke:g} mm" for stroke, case in cases.items())
    short, long, longest = (cases[stroke].ranked for stroke in JOINT_STROKES)
    same = abs(long - longest) < SAME_EDGE * longest
    return GuidelineClaim(
        "Sec. 4.1, 4.3.3",
        "a stroke of 0.3 mm is enough; above some stroke the limit no longer changes",
        f"edge {words}",
        f"at {JOINT_STROKES[0]:g} mm below {CLAIMED_AT:g} Hz and within {percent(NEAR_EDGE - 1)} of that at "
        f"{JOINT_STROKES[2]:g} mm; at "
        f"{JOINT_STROKES[1]:g} mm within {percent(SAME_EDGE)} of it",
        _judgement(
            [
                _verdict(short < CLAIMED_AT, short),
                _verdict(short < NEAR_EDGE * longest, short, longest),
                _verdict(same, long, longest),
            ]
        ),
    )


def _edges(worked: Worked) -> GuidelineClaim:
    """Judge the edges that the thesis gives for the free and the locked joint."""
    _, locked, free = (machine.computed for machine in worked.machines)
    worst = worked.worst
    text = (
        f"free {_hertz(free)}, locked {_hertz(locked)} with the friction of Table 2; locked at most {_edge(worst)} "
        "over the measured friction range, both as computed"
    )
    ends = [FREE_EDGE[0] / NEAR_EDGE, FREE_EDGE[1] * NEAR_EDGE]
    near = [_verdict(ends[0] <= free <= ends[1], free)]
    near += [_verdict(about(worst.ranked, edge), worst.ranked) for edge in LOCKED_EDGES]
    return GuidelineClaim(
        "Sec. 4.3.3, 6",
        "the isolator works from 5 to 5.5 Hz, the locked rig needs about 15 Hz (hunting was gone at 14.3 Hz)",
        text,
        f"free within {percent(NEAR_EDGE - 1)} of the range, the highest locked edge within a factor of {OWN.about:g} "
        "of "
        "both numbers",
        _judgement(near),
    )


def _verdict(holds: bool, *edges: float) -> bool | None:
    """Return whether a statement about `edges` holds; None if one of the edges is unknown."""
    return None if np.isnan(edges).any() else bool(holds)


def _judgement(parts: Sequence[bool | None]) -> str:
    if not parts or None in parts:
        return UNKNOWN
    return HOLDS if all(parts) else IN_PART if any(parts) else DIFFERS


def _computed(cases: Sequence[ThesisCase]) -> np.ndarray:
    return np.array([case.ranked for case in cases])


def _edge(case: ThesisCase) -> str:
    """Return a computed edge in words, or why there is none."""
    if np.isfinite(case.computed):
        return _hertz(case.computed)
    return case.kind if case.kind in (BELOW, ABOVE) else f"unknown ({KINDS[NOT_TOLD]})"


def _hertz(edge: float) -> str:
    return f"{edge:.2f} Hz" if np.isfinite(edge) else "unknown (no edge found within a factor of ten)"


@dataclass(frozen=True)
class LeastGap:
    """Least friction gap [N] with which a stage hunts, between `low` and `high`.

    NaN stands for an unknown edge.
    """

    low: float
    high: float

    @property
    def words(self) -> str:
        if np.isnan(self.low):
            return f"unknown size ({KINDS[NOT_TOLD]})"
        if self.low == 0:
            return f"at most {self.high:.2g} N, the least tried,"
        return f"{self.low:.2g} N" if np.isfinite(self.high) else f"more than {self.low:.2g} N, the largest tried,"

    def within(self, least: float, most: float) -> bool | None:
        """Tell whether the gap lies from `least` to `most` [N]; None if that is unknown."""
        if self.high < least or self.low > most:
            return False
        return True if least <= self.low and self.high <= most else None


def least_gap(cases: Sequence[ThesisCase], static: float) -> LeastGap:
    """Return the smallest friction gap F_s - F_c [N] with which the rig hunts, at one crossover.

    The crossover is `CLAIMED_AT` [Hz]. The gap holds for a `static` friction [N]. It is interpolated linearly, in
    logarithms, between the points of the edge.
    """
    at_force = [case for case in cases if case.changes["friction.static"] == static]
    x, y = np.array([STUDIED["gap"](case.changes) for case in at_force]), _computed(at_force)
    above = np.flatnonzero(y >= CLAIMED_AT)
    if np.isnan(y).any():
        return LeastGap(np.nan, np.nan)
    if not above.size:
        return LeastGap(float(x[-1]), np.inf)
    k = int(above[0])
    if k == 0:
        return LeastGap(0.0, float(x[0]))
    if y[k - 1] == 0 or np.isinf(y[k]):
        return LeastGap(float(x[k - 1]), float(x[k]))
    at = float(np.exp(np.interp(np.log(CLAIMED_AT), np.log([y[k - 1], y[k]]), np.log([x[k - 1], x[k]]))))
    return LeastGap(at, at)
