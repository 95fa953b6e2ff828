"""Compare friso's cycles, multipliers and bifurcations with those of SciPy (`orbits.py`)."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from benchmarks.oracles import orbits
from benchmarks.oracles.oracle import Finding, Oracle, lugre, number
from friso.hunting import CYCLE_RTOL, Cycles, Diagram, Ensemble, KeyRange, LocatedPoint, Space, diagram, find_cycles
from friso.stage import Stage

CROSSOVERS = 4.0, 8.0
"""Crossovers [Hz] at which cycles are compared."""

RANGE = KeyRange("controller.crossover", 7.0, 18.0, unit="Hz")

POINTS = (("flip", -1.0, 9.76995), ("fold", -1.0, 16.2239), ("fold", 1.0, 8.47086), ("flip", 1.0, 8.47178))
"""Bifurcations in section 5 of references.md: kind, sign of the orbit (-1: symmetric) and crossover [Hz]."""

STATES = ("position", "velocity", "bristle_deflection", "filtered_error", "integral")
"""Friso's names of the states of `orbits.rates`."""


def stage(crossover: float) -> Stage:
    """Return the mass of `orbits.py` as a stage."""
    return Stage(
        name="rigid mass of 1.7 kg",
        masses={"cart": "1.2 kg", "stage": f"{orbits.MASS - 1.2:.1f} kg"},
        friction=lugre(
            orbits.STATIC, orbits.COULOMB, orbits.STRIBECK, orbits.SIGMA_0, float(orbits.SIGMA_1), orbits.SIGMA_2
        ),
        controller={"kind": "pid", "crossover": f"{crossover} Hz", "alpha": orbits.ALPHA, "beta": orbits.BETA},
        motion={"kind": "release", "displacement": "2 mm", "duration": "20 s"},
    )


def multipliers() -> Iterator[Finding]:
    for crossover in CROSSOVERS:
        stages = Ensemble.held(stage(crossover).flat(), 1)
        cycles = find_cycles(stages)
        orbit = orbits.first_orbit(crossover)
        at = f"at {crossover:g} Hz"
        yield number(f"period {at}", float(cycles.period[0]), orbit.period, rtol=1e-7, unit="s", digits=9)
        yield number(f"amplitude {at}", float(cycles.amplitude[0]), orbit.amplitude(), rtol=1e-6, unit="m", digits=8)
        yield number(
            f"multiplier of half a period {at}", float(cycles.multiplier[0]), orbit.multiplier, atol=1e-5, digits=8
        )
        others, own = np.abs(orbit.multipliers[1:]).max(), np.abs(cycles.local[0][1:]).max()
        words = f"{own:.1g}", f"{others:.1g}"
        yield Finding(f"its largest other multiplier {at} (0 but for rounding)", *words, bool(max(own, others) < 1e-3))


def bifurcations() -> Iterator[Finding]:
    over = diagram(Space.of(stage(8.0), [RANGE]))
    for kind, sign, crossover in POINTS:
        point = nearest(over, kind, sign, crossover)
        cycle = "symmetric cycle" if sign < 0 else "asymmetric cycle"
        own = float(over.value(point.point.place))
        exact = orbits.located(beginning(point, own), -1.0 if kind == "flip" else 1.0)
        what = f"{kind} of the {cycle} (references.md: {crossover:g} Hz)"
        yield number(what, own, exact.crossover, rtol=1e-5, unit="Hz", digits=8)


def nearest(over: Diagram, kind: str, sign: float, crossover: float) -> LocatedPoint:
    """Return the special point of a kind nearest to a crossover."""
    points = [
        point
        for branch, own in zip(over.branches, over.special, strict=True)
        for point in own
        if branch.sign == sign and point.kind == kind
    ]
    return min(points, key=lambda point: abs(float(over.value(point.point.place)) - crossover))


def beginning(point: LocatedPoint, crossover: float) -> orbits.Orbit:
    """Return friso's own orbit, taken to where it passes the reference.

    The search of `orbits.located` begins there.
    """
    cycle: Cycles = point.point.cycle
    names: list[Any] = [*Ensemble.held(stage(crossover).flat(), 1).kernel.states]
    state = np.array([cycle.states[0][names.index(name)] for name in STATES])
    return orbits.passing(crossover, state, float(cycle.orbits.times[0]), cycle.sign)


ORACLES = (
    Oracle(
        "multipliers",
        "The cycle of a rigid mass of 1.7 kg has the period, amplitude and multipliers that SciPy's shooting and "
        "finite differences give.",
        "references.md, section 2 (T 3.15031069 s, 2.0166608 mm, -0.8172509 at 4 Hz); here: SciPy LSODA at 1e-13",
        f"Friso closes orbits at {CYCLE_RTOL:g}: periods agree to 1e-7, amplitudes to 1e-6, multipliers to 1e-5, which "
        "is what differences leave.",
        multipliers,
    ),
    Oracle(
        "bifurcations",
        "Flips and folds of a rigid mass's cycles lie where Newton's method on the closed orbit and its multiplier, by "
        "finite differences of SciPy's flow, has them.",
        "Method: mappy-ds, BifurcationKit.jl; values: references.md, section 5. Hensen and others see a "
        "fold where hunting ends as gains rise; here a flip comes first",
        "Crossovers agree to 1e-5: friso states errors of 3e-6 at most, and differences leave as much again. "
        "Newton's method begins at friso's orbit; "
        "whether there are other points is not asked.",
        bifurcations,
    ),
)
