"""What the thesis claims about the edge of hunting, beside what the sweeps and the rig show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from friso.studies.guideline.rig import Case
from friso.studies.guideline.worked import CLAIMED_AT, STUDIED, Worked

HOLDS, IN_PART, DIFFERS = "holds", "holds in part", "differs"


@dataclass(frozen=True)
class Claim:
    """What the thesis says, where, what was found, and whether the claim holds by the rule given."""

    where: str
    text: str
    found: str
    rule: str
    judgement: str


def claims(worked: Worked) -> tuple[Claim, ...]:
    """The claims of the thesis that the edge decides, judged by computed edges, not by the laws."""
    return _gap(worked), _share(worked), _mass(worked), _stiffness(worked), _stroke(worked), _edges(worked)


def _gap(worked: Worked) -> Claim:
    found = worked.studies["gap"]
    forces = sorted({case.changes["friction.static"] for case in found})
    gaps = [(force, least_gap(found, force)) for force in forces]
    words = ", ".join(f"{gap:.2g} N at F_s = {force:g} N" for force, gap in gaps if np.isfinite(gap))
    near = [0.5 <= gap <= 2 for _, gap in gaps if np.isfinite(gap)]
    return Claim(
        "Sec. 4.3.3",
        "hunting needs a friction gap of about 1 N",
        f"locked, at {CLAIMED_AT:g} Hz a cycle attracts from a gap of {words or 'no size tried'}; by the law that gap "
        "grows with the force and the crossover",
        "0.5 to 2 N at each static friction",
        _judged(near),
    )


def _share(worked: Worked) -> Claim:
    edges = _computed(worked.studies["share"])
    spread = float(np.nanmax(edges) / np.nanmin(edges))
    at = [STUDIED["share"](case.changes) for case in worked.studies["share"]]
    ends = f"{np.nanmin(edges):.2f} to {np.nanmax(edges):.2f} Hz"
    found = f"edge {ends} for stages of {min(at):.0%} to {max(at):.0%} of the mass"
    return Claim("Fig. 15A", "the mass ratio hardly matters", found, "a spread below 20 %", _judged([spread < 1.2]))


def _mass(worked: Worked) -> Claim:
    edges = _computed(worked.studies["mass"])
    at = [STUDIED["mass"](case.changes) for case in worked.studies["mass"]]
    found = (
        f"locked, tuned for its mass: edge {edges[0]:.1f} Hz at {at[0]:.2g} kg, {edges[-1]:.1f} Hz at {at[-1]:.2g} kg"
    )
    return Claim(
        "Fig. 11B", "more mass helps", found, "the edge falls all the way", _judged([bool(np.all(np.diff(edges) < 0))])
    )


def _stiffness(worked: Worked) -> Claim:
    edges = dict(
        zip(
            (STUDIED["stiffness"](c.changes) for c in worked.studies["stiffness"]),
            _computed(worked.studies["stiffness"]),
            strict=True,
        )
    )
    found = f"edge {edges[1000.0]:.2f} Hz at 1 N/mm, {edges[2400.0]:.2f} Hz at 2.4 N/mm"
    return Claim(
        "Fig. 16B", "a softer joint lowers the limit", found, "it is lower", _judged([edges[1000.0] < edges[2400.0]])
    )


def _stroke(worked: Worked) -> Claim:
    cases = worked.studies["stroke"]
    edges = dict(zip((1e3 * STUDIED["stroke"](case.changes) for case in cases), _computed(cases), strict=True))
    words = ", ".join(f"{edge:.2f} Hz at {stroke:g} mm" for stroke, edge in edges.items())
    return Claim(
        "Sec. 4.1, 4.3.3",
        "a stroke of 0.3 mm is enough; above some stroke the limit no longer changes",
        f"edge {words}",
        f"at 0.3 mm below {CLAIMED_AT:g} Hz and within 10 % of that at 2 mm; at 1 mm within 2 % of it",
        _judged([edges[0.3] < CLAIMED_AT, edges[0.3] < 1.1 * edges[2.0], abs(edges[1.0] / edges[2.0] - 1) < 0.02]),
    )


def _edges(worked: Worked) -> Claim:
    _, locked, free = (machine.computed for machine in worked.machines)
    found = (
        f"free {free:.2f} Hz, locked {locked:.2f} Hz with the friction of Table 2; the law gives at most "
        f"{worked.bound:.1f} Hz at any friction force"
    )
    near = [5 <= free <= 1.1 * 5.5, 15 / 1.2 <= worked.bound <= 15 * 1.2]
    rule = "free within 10 % of the range, the highest locked edge within 20 %"
    return Claim(
        "Sec. 4.3.3, 6",
        "the isolator works from 5 to 5.5 Hz, the locked rig needs about 15 Hz",
        found,
        rule,
        _judged(near),
    )


def _judged(parts: Sequence[bool]) -> str:
    return HOLDS if parts and all(parts) else IN_PART if any(parts) else DIFFERS


def _computed(cases: Sequence[Case]) -> np.ndarray:
    return np.array([case.computed for case in cases])


def least_gap(found: Sequence[Case], static: float, crossover: float = CLAIMED_AT) -> float:
    """The friction gap F_s - F_c [N] from which on the rig of a static friction [N] hunts at a crossover [Hz] (NaN: at
    all that were tried, or at none)."""
    own = [case for case in found if case.changes["friction.static"] == static]
    return _reaching(np.array([STUDIED["gap"](case.changes) for case in own]), _computed(own), crossover)


def _reaching(x: np.ndarray, y: np.ndarray, level: float) -> float:
    """Where a rising curve reaches a level, straight between its points in logarithms; NaN if it does not."""
    above = np.flatnonzero(y >= level)
    if not above.size or above[0] == 0:
        return np.nan
    k = int(above[0])
    return float(np.exp(np.interp(np.log(level), np.log([y[k - 1], y[k]]), np.log([x[k - 1], x[k]]))))
