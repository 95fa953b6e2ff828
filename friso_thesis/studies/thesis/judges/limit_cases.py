"""Judge Fig. 7: the plant in the four limit cases of Table 1."""

from __future__ import annotations

from collections.abc import Mapping

from friso_thesis.studies.thesis.claims import Evidence, Finding, FindingTable, Part, judges
from friso_thesis.studies.thesis.linear import PARASITIC, PLANT, LimitCase
from friso_thesis.studies.thesis.reading import about, reading

_FIRST = 10.0
"""Eigenfrequency of the free joint [Hz] in the thesis (Sec. 3.4.2)."""

_FREE, _TOUCHED = ("stuck", "sliding"), ("stuck-touched", "sliding-touched")


@judges("F7", figure="7", needs=(PLANT,))
def four_limit_cases(evidence: Evidence) -> Finding:
    """Judge resonances, antiresonances and mass lines of the plant in the four limit cases."""
    plants = evidence.analysis.plants
    return Finding(
        (*_joint_modes(plants), *_high_modes(plants), _mass_lines(plants, _masses(evidence))), _table(plants)
    )


def _table(plants: Mapping[str, LimitCase]) -> FindingTable:
    """Return a table with modes and mass line of the plant in each limit case."""
    rows = []
    for name in (*_FREE, *_TOUCHED):
        case = plants[name]
        pair = case.pair_above
        above = f"{pair[0]:.4g} and {pair[1]:.4g} Hz" if pair else "none"
        below = ", ".join(f"{f:.3g} Hz" for f in case.antiresonances if f < case.first) or "none"
        rows.append((name, below, f"{case.first:.4g} Hz", f"{case.parasitic:.4g} Hz", above, f"{case.mass:.3g} kg"))
    columns = ("limit case", "antiresonance below", "first resonance", "parasitic mode", "pair above it", "mass line")
    return FindingTable(columns, tuple(rows))


def _joint_modes(plants: Mapping[str, LimitCase]) -> tuple[Part, Part]:
    """Judge the free joint's first resonance, and whether an antiresonance lies below it.

    There should be one if the cart slides, and none if it is stuck.
    """
    words = reading()
    low = {name: [f for f in plants[name].antiresonances if f < plants[name].first] for name in _FREE}
    pair = f"antiresonance {low['sliding'][-1]:.3g} Hz, resonance" if low["sliding"] else "no antiresonance below"
    return (
        Part(
            f"with the limiter free, the first resonance is about {_FIRST:g} Hz (from {_FIRST / words.about:.3g} to "
            f"{_FIRST * words.about:.3g} Hz), stuck and sliding",
            all(about(plants[name].first, _FIRST) for name in _FREE),
            ", ".join(f"{name} {plants[name].first:.3g} Hz" for name in _FREE),
        ),
        Part(
            "an antiresonance lies below that resonance where the cart slides, and none where it is stuck",
            bool(low["sliding"] and not low["stuck"]),
            f"sliding: {pair} {plants['sliding'].first:.3g} Hz; stuck: {len(low['stuck'])} antiresonances below it",
        ),
    )


def _high_modes(plants: Mapping[str, LimitCase]) -> tuple[Part, Part, Part]:
    """Judge the parasitic mode, and the two modes above it if the limiter is touched."""
    words = reading()
    names = (*_FREE, *_TOUCHED)
    pairs = {name: plants[name].pair_above for name in _TOUCHED}
    free = [name for name in _FREE if plants[name].pair_above]
    listed = [f"{name} {pair[0]:.4g} and {pair[1]:.4g} Hz" for name, pair in pairs.items() if pair]
    series = [f"{name} {_and(plants[f'{name}-series'])}" for name in _TOUCHED]
    ratio = max((pair[1] / plants[name].parasitic for name, pair in pairs.items() if pair), default=float("inf"))
    above = all(pairs.values())
    return (
        Part(
            f"in all four cases a resonance is about {PARASITIC:g} Hz (from {PARASITIC / words.about:.3g} to "
            f"{PARASITIC * words.about:.3g} Hz)",
            all(about(plants[name].parasitic, PARASITIC) for name in names),
            ", ".join(f"{name} {plants[name].parasitic:.4g} Hz" for name in names),
            why="With the limiter touched the parasitic mass swings against cart and stage, not against the stage.",
        ),
        Part(
            "with the limiter touched, an antiresonance and then a resonance lie above the parasitic mode, and with it "
            "free none",
            above and not free,
            f"{', '.join(listed) or 'none'}; with the formula that Table 1 prints for a touched limiter, no more modes "
            f"than with it free: {'; '.join(series)}",
        ),
        Part(
            f"that pair lies just above it: its resonance within half a decade of it (a factor of {words.order:.2g})",
            above and ratio <= words.order,
            f"a factor of {ratio:.2g}" if above else "no pair",
            why=_why_far(ratio) if above else "",
        ),
    )


def _why_far(ratio: float) -> str:
    words = reading()
    return (
        "The model idealises the pair: it is that of the cart on the limiter, and of cart and stage against "
        "each other on "
        "it, with k_l of 2e7 N/m as printed (Sec. 3.2.3). Its frequency scales roughly with the root of k_l, "
        "which would "
        "have to be "
        f"{(ratio / words.order) ** 2:.2g} times smaller, and its resonance with the part of the stage's mass that the "
        "parasitic mode leaves."
    )


def _masses(evidence: Evidence) -> dict[bool, float]:
    """Return the mass [kg] that moves above the first eigenfrequency, by the limiter's state.

    The key is True for a touched limiter, and False for a free one.
    """
    flat = evidence.rig.flat()
    return {False: flat["masses.stage"], True: flat["masses.cart"] + flat["masses.stage"]}


def _mass_lines(plants: Mapping[str, LimitCase], expected: Mapping[bool, float]) -> Part:
    words = reading()
    masses = {name: plants[name].mass for name in (*_FREE, *_TOUCHED)}
    listed = ", ".join(f"{name} {mass:.3g} kg at {plants[name].mass_at:.3g} Hz" for name, mass in masses.items())
    return Part(
        f"below the parasitic mode the magnitude follows about {expected[False]:.3g} kg (within a factor of "
        f"{words.about:g}) "
        f"with the limiter free and about {expected[True]:.3g} kg with it touched",
        all(about(mass, expected[name in _TOUCHED]) for name, mass in masses.items()),
        f"{listed}; it is the limiter that distinguishes them, not, as Sec. 3.4.2 says, sticking and slipping",
    )


def _and(case: LimitCase) -> str:
    return " and ".join(f"{f:.4g}" for f in case.resonances) + " Hz"
