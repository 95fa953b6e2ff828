"""Judge what the thesis says about its controller (Sec. 3.2.4, 3.4.2, 4.2.1).

It concerns two forms of the controller, where its crossover may lie, and the motor constant.
"""

from __future__ import annotations

from functools import cache, lru_cache

import numpy as np
import sympy as sp

from friso.equations.controllers.van_dijk import CROSSOVER, TUNED_MASS, as_gains, numbers
from friso.frequency.crossover import WANTED, settled_margin
from friso.frequency.family import loops
from friso.frequency.members import member
from friso.quantities import percent
from friso.stage import loads
from friso_thesis.studies.thesis.claims import Evidence, Finding, Part, judges
from friso_thesis.studies.thesis.judges.identified_responses import CONSTANTS
from friso_thesis.studies.thesis.linear import PLANT
from friso_thesis.studies.thesis.maps import trend, trend_text, verdict_table
from friso_thesis.studies.thesis.reading import reading
from friso_thesis.studies.thesis.settings import settings

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
    return Finding(
        (
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
    )


def _written(expression: sp.Expr) -> str:
    """Write a SymPy expression in a readable form, as text."""
    return str(sp.factor(expression)).replace("**", "^").replace("*", " ")


@lru_cache(maxsize=256)
def margins_over_crossover(stage_file: str, first: float) -> dict[float, float]:
    """Return the least modulus margin with the joint free, by crossover; 0 if not stable.

    Crossovers are relative to the `first` eigenfrequency [Hz]. The margin is that of the limit cases, and of all states
    stuck under a bias force.
    """
    flat = {**loads(stage_file).flat(), "joint.locked": False}
    reach = 2 * settings.far_crossover_factor
    ratios = np.geomspace(1 / reach, reach, 25)
    return {float(ratio): settled_margin({**flat, CROSSOVER: float(ratio) * first}) for ratio in ratios}


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
    return judged_crossovers(margins_over_crossover(evidence.rig.to_toml(), first), first, *trends)


def judged_crossovers(margins: dict[float, float], first: float, force: float, settling: float) -> Finding:
    """Judge where the crossover may lie beside the first eigenfrequency `first` [Hz].

    `margins` has the least modulus margin by crossover, in first eigenfrequencies. `force` and `settling` are the rank
    correlations of force and settling time with the crossover.
    """
    words, far = reading(), settings.far_crossover_factor
    near = {ratio: margin for ratio, margin in margins.items() if 1 / far < ratio < far}
    worst = min(near, key=lambda ratio: near[ratio])
    apart = min(margin for ratio, margin in margins.items() if ratio not in near)
    return Finding(
        (
            Part(
                f"a crossover within a factor of {far:g} of the first eigenfrequency is not stable somewhere, and "
                "farther from it every one is",
                near[worst] <= 0 < apart,
                f"first eigenfrequency {first:.3g} Hz; least modulus margin {near[worst]:.2g} within, at "
                f"{worst * first:.3g} Hz, {apart:.2g} farther off ({WANTED:g} is comfortable)",
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
    return Finding(
        (
            Part(
                "the open loop is the one of the true mass, if the controller is tuned for the mass that a wrong motor "
                "constant shows, with that motor",
                max(changes) <= settings.exact_share,
                f"it differs by at most {percent(max(changes), 2)} with motors of "
                f"{' and '.join(f'{1 / factor:.2g}' for factor in CONSTANTS)} of the force assumed, as Fig. 17 and 18 "
                "ask for",
                why="The loop changes.",
            ),
        )
    )
