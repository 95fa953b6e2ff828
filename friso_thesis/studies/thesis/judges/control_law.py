"""Judge what the thesis says about its controller (Sec. 3.2.4, 3.4.2, 4.2.1), and Eq. 1, 2.

It concerns two forms of the controller, where its crossover may lie, and the motor constant. Eq. 1 and 2 are joint and
pre-sliding friction as springs in series: their stiffness is derived and differentiated, and Eq. 1 is compared with the
plant.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np
import sympy as sp

from friso.equations.controllers.pid import CROSSOVER, TUNED_MASS, as_gains, numbers
from friso.frequency.bode import COMFORTABLE_MARGIN, settled_margin
from friso.frequency.margins import loops, margins
from friso.frequency.system import in_series, limit_cases, member
from friso.quantities import percent
from friso.stage import loads
from friso_thesis.studies.thesis.claims import Evidence, Finding, Part, judges
from friso_thesis.studies.thesis.judges.identified_in_time import CONSTANTS
from friso_thesis.studies.thesis.linear import PLANT
from friso_thesis.studies.thesis.linear.plants import Springs
from friso_thesis.studies.thesis.maps import trend, trend_text, verdict_table
from friso_thesis.studies.thesis.reading import about, words

K_F, K_J = sp.symbols("k_f k_j", positive=True)

PRINTED_STIFFNESS = in_series(K_F, K_J)
"""Eq. 1 as printed."""

PRINTED_SENSITIVITY = (K_J / K_F / (1 + K_J / K_F)) ** 2
"""Eq. 2 as printed, with eta = K_J/K_F. It gives the change of the series stiffness with the stiffness of the
friction."""


@judges("E1", figure="Eq. 1, 2", needs=(PLANT,))
def printed_formulas(evidence: Evidence) -> Finding:
    """Judge both printed formulas against the balance of forces, and Eq. 1 against the plant."""
    return Finding.of(
        *judged_formulas(PRINTED_STIFFNESS, PRINTED_SENSITIVITY),
        in_the_plant(PRINTED_STIFFNESS, evidence.analysis.springs),
    )


@cache
def judged_formulas(stiffness: sp.Expr, slope_printed: sp.Expr) -> tuple[Part, Part, Part]:
    """Judge the given formulas, in K_F and K_J, against two springs that carry one force."""
    force, middle, end = sp.symbols("F u x")
    balance = sp.solve([K_F * middle - force, K_J * (end - middle) - force], [middle, end], dict=True)[0]
    derived = sp.simplify(force / balance[end])
    slope = sp.diff(derived, K_F)
    limits = [sp.limit(slope_printed, *to) for to in ((K_J, 0), (K_F, sp.oo))]
    relative = sp.simplify(slope * K_F / derived)
    return (
        Part(
            "Eq. 1 equals force over displacement of two springs in series",
            sp.simplify(derived - stiffness) == 0,
            f"k_e = {_text(derived)}",
        ),
        Part(
            "Eq. 2 equals the derivative of that stiffness with respect to k_f, for all k_f and k_j",
            sp.simplify(slope - slope_printed) == 0,
            f"d k_e / d k_f = {_text(sp.factor(slope))}; minus Eq. 2 as printed: "
            f"{_text(sp.simplify(slope - slope_printed))}",
        ),
        Part(
            "Eq. 2 vanishes with eta = k_j/k_f, whether k_j goes to 0 or k_f to infinity",
            all(limit == 0 for limit in limits),
            f"limits {limits[0]} and {limits[1]}; the relative sensitivity, (k_f/k_e) d k_e / d k_f = "
            f"{_text(relative)}, vanishes too, but with eta instead of its square",
        ),
    )


def _text(expression: sp.Basic) -> str:
    """Write a SymPy expression in a readable form, as text."""
    return str(expression).replace("**", "^").replace("*", " ")


EXACT_SHARE = 1e-9
"""Largest relative difference between numbers that follow from one equation. Rounding is far smaller."""


def in_the_plant(stiffness: sp.Expr, springs: Springs) -> Part:
    """Judge a stiffness formula in K_F and K_J against the plant of the declared equations."""
    eta = springs.joint / springs.bristles
    expected = float(stiffness.subs({K_F: springs.bristles, K_J: springs.joint}))
    return Part(
        "Eq. 1 with k_f = sigma_0 is the force over displacement at rest of the plant linearised with a stuck cart, "
        "its limiter free",
        abs(springs.both / expected - 1) <= EXACT_SHARE,
        f"plant {springs.both:.6g} N/m, Eq. 1 {expected:.6g} N/m; eta {eta:.3g}: an error of 1 % in k_f changes k_e by "
        f"{eta / (1 + eta):.2g} %",
    )


S, K_P, TAU_Z, TAU_I, TAU_P = sp.symbols("s k_p tau_z tau_i tau_p", positive=True)

LAW_OF_RULES = K_P * (1 + TAU_Z / TAU_I + 1 / (TAU_I * S) + TAU_Z * S) / (TAU_P * S + 1)
"""Eq. 7 as printed."""


def law_of_gains(gains: tuple[sp.Expr, sp.Expr, sp.Expr]) -> sp.Expr:
    """Return the transfer function of the PID controller of Eq. 6, from gains K_p, K_i and K_d.

    The derivative term is filtered with the time constant of Eq. 7.
    """
    proportional, integral, derivative = gains
    return proportional + integral / S + derivative * S / (S * TAU_P + 1)


@cache
def rewritten() -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    """Return the gains K_p, K_i and K_d for which Eq. 6 equals Eq. 7, by partial fractions."""
    integral = K_P / TAU_I
    proportional = K_P * (1 + TAU_Z / TAU_I) - integral * TAU_P
    return proportional, integral, K_P * TAU_Z - proportional * TAU_P


@judges("E6", figure="Eq. 6 to 8")
def two_forms_of_the_controller(evidence: Evidence) -> Finding:
    """Judge whether Eq. 7 can take the form of Eq. 6, and its gains by Eq. 8."""
    return judged_forms(rewritten(), numbers(evidence.rig.flat()))


def judged_forms(gains: tuple[sp.Expr, sp.Expr, sp.Expr], tuned: dict[str, float]) -> Finding:
    """Judge whether Eq. 6 with some gains equals Eq. 7, and whether the gains are positive.

    `gains` are K_p, K_i and K_d as formulas. `tuned` has the numbers that Eq. 8 gives for a rig, by symbol.
    """
    values = [float(gain.subs({symbol: tuned[str(symbol)] for symbol in gain.free_symbols})) for gain in gains]
    plain = as_gains(**tuned)
    kp, ki, kd = values
    return Finding.of(
        Part(
            "Eq. 6 with some gains, and the time constant of Eq. 7, is Eq. 7 for every s",
            sp.simplify(law_of_gains(gains) - LAW_OF_RULES) == 0,
            f"K_p = {_written(gains[0])}, K_i = {_written(gains[1])}, K_d = {_written(gains[2])}",
            why="The two laws differ.",
        ),
        Part(
            "by Eq. 8 these gains are positive",
            min(values) > 0,
            f"K_p {kp:.4g} N/m, K_i {ki:.4g} N/(m s), K_d {kd:.4g} N s/m; the coefficients of Eq. 7 itself are "
            f"{plain['kp']:.4g}, {plain['ki']:.4g} and {plain['kd']:.4g}: its low-pass acts on all three terms, "
            "that of Eq. 6 on the derivative alone",
            why="A gain is negative.",
        ),
    )


def _written(expression: sp.Expr) -> str:
    """Write a SymPy expression in a readable form, as text."""
    return str(sp.factor(expression)).replace("**", "^").replace("*", " ")


@dataclass(frozen=True)
class TunedLoop:
    """A loop with the joint free: tuned crossover, and where it crosses 0 dB, both in first eigenfrequencies.

    `margin` is the least modulus margin of the limit cases, and of all states stuck under a bias force; 0 if not
    stable.
    """

    tuned: float
    crossing: float
    margin: float


FAR_CROSSOVER_FACTOR = 3.0
"""Factor of “significantly larger” or “smaller” for a tuned crossover: half a decade, as “far” in all claims. It is
the other reading of Sec. 3.4.2, whose own 8 Hz then lie too near, though their loop crosses 0 dB at 24 Hz."""

LOWEST_CROSSOVER_RATIO = 0.03
"""Lowest crossover tried over the first eigenfrequency: 0.3 Hz, low enough that the resonance stays below 0 dB
while the cart slides. From 0.8 Hz on it reaches 0 dB, and the loop crosses there."""

CROSSOVERS_TRIED = 21
"""Number of crossovers tried beside the first eigenfrequency, 30 % apart, finer than “about”."""


@lru_cache(maxsize=256)
def loops_over_crossover(stage_file: str, first: float) -> tuple[TunedLoop, ...]:
    """Return the loops with the joint free, tuned to crossovers on both sides of the `first` eigenfrequency [Hz].

    A loop crosses 0 dB, the cart sliding, at the last crossing below the parasitic mode.
    """
    flat = {**loads(stage_file).flat(), "joint.locked": False}
    highest = 2 * FAR_CROSSOVER_FACTOR
    tried = []
    for ratio in np.geomspace(LOWEST_CROSSOVER_RATIO, highest, CROSSOVERS_TRIED):
        tuned = {**flat, CROSSOVER: float(ratio) * first}
        crossings = margins(tuned, limit_cases(tuned)["sliding"]).crossovers
        last = max((f for f in crossings if f < (1 - words.close) * flat["parasitic.frequency"]), default=np.nan)
        tried.append(TunedLoop(float(ratio), last / first, settled_margin(tuned)))
    return tuple(tried)


@judges("S342F", figure="Sec. 3.4.2, crossover and first mode", needs=(PLANT, "isolator-crossover"), of_runs=True)
def crossover_beside_the_first_mode(evidence: Evidence) -> Finding:
    """Judge where the crossover may lie beside the free joint's first mode.

    Margin, force and settling time over the crossover decide.
    """
    first = evidence.analysis.plants["stuck"].first
    runs = evidence.maps["isolator-crossover"]
    crossover, _, moving, valid = verdict_table(runs, CROSSOVER, "joint.stroke")
    settled = valid & ~moving
    trends = []
    for name in ("largest_force", "settling_time_10um"):
        values = np.where(settled, runs[name].transpose(CROSSOVER, "joint.stroke").values, np.nan)
        by_stroke = np.array([trend(crossover, column) for column in values.T])
        trends.append(float(np.nanmean(by_stroke)) if np.isfinite(by_stroke).any() else np.nan)
    return judged_crossovers(loops_over_crossover(evidence.rig.to_toml(), first), first, *trends)


def judged_crossovers(tried: tuple[TunedLoop, ...], first: float, force: float, settling: float) -> Finding:
    """Judge where the crossover may lie beside the first eigenfrequency `first` [Hz].

    `tried` are loops tuned to several crossovers. `force` and `settling` are the rank correlations of force and
    settling time with the crossover.
    """
    far = FAR_CROSSOVER_FACTOR
    near = [loop for loop in tried if about(loop.crossing, 1.0)]
    apart = [loop.margin for loop in tried if loop not in near]
    tuned_near = [loop.margin for loop in tried if 1 / far < loop.tuned < far]
    worst = min(near, key=lambda loop: loop.margin, default=None)
    return Finding.of(
        Part(
            f"a loop that crosses 0 dB about the first eigenfrequency (within a factor of {words.about:g}) is not "
            "stable somewhere, and every one that crosses farther from it is",
            bool(worst and worst.margin <= 0 < min(apart, default=0.0)),
            f"first eigenfrequency {first:.3g} Hz; "
            + (
                f"least modulus margin {worst.margin:.2g} about it, tuned to {worst.tuned * first:.3g} Hz, "
                if worst
                else "no loop crosses about it, "
            )
            + f"{min(apart, default=np.nan):.2g} farther off ({COMFORTABLE_MARGIN:g} is comfortable); of all loops "
            f"tuned within a factor of {far:g} of it, the other reading, {min(tuned_near, default=np.nan):.2g}",
            why="The lead of the controller keeps the loop stable there too.",
        ),
        Part(
            f"a lower crossover needs less force (mean rank correlation at least {words.trend:g} over the strokes)",
            force >= words.trend,
            f"rank correlation {trend_text(force)}",
            why="The largest force is that of the prescribed acceleration, whatever the crossover.",
        ),
        Part(
            f"settling times fall with the crossover (mean rank correlation at most {-words.trend:g})",
            settling <= -words.trend,
            f"rank correlation {trend_text(settling)} of the time into 10 um, over the runs that come to rest",
            why="Among these runs the time does not fall.",
        ),
    )


@judges("S421", figure="Sec. 4.2.1, motor constant")
def motor_constant_cancels(evidence: Evidence) -> Finding:
    """Judge whether a wrong motor constant leaves the open loop unchanged.

    The controller is tuned for the mass that such a motor appears to move.
    """
    flat = evidence.rig.flat()
    omega = 2 * np.pi * np.geomspace(0.1, 1e3, 100)
    own = loops(flat, member(1.0), omega)
    changes = []
    for factor in CONSTANTS:
        shown = {**flat, TUNED_MASS: factor * flat[TUNED_MASS]}
        changes.append(float(np.abs(loops(shown, member(1.0), omega) / factor / own - 1).max()))
    return Finding.of(
        Part(
            "the open loop is the one of the true mass, if the controller is tuned for the mass that a wrong motor "
            "constant shows, with that motor",
            max(changes) <= EXACT_SHARE,
            f"it differs by at most {percent(max(changes), 2)} with motors of "
            f"{' and '.join(f'{1 / factor:.2g}' for factor in CONSTANTS)} of the force assumed, as Fig. 17 and 18 "
            "ask for",
            why="The loop changes.",
        )
    )
