"""Judge statements about the model and its runs that no figure shows (Sec. 3.1.2 to 3.2.4, 4.1, A.1).

They concern Eq. 3 to 5 and 8, Table 2, the limit cases with a touched limiter, the time to settle, the force at
break-away, the initial response, and the noise of Fig. 29.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cache

import numpy as np
import sympy as sp

from friso.equations.controllers.pid import BETA
from friso.hunting.criteria import COUNTED_AFTER, FAILED
from friso.quantities import percent
from friso_thesis.studies.thesis.claims import Evidence, Finding, FindingTable, Part, judges
from friso_thesis.studies.thesis.experiments import LINE, RESPONSE_FREQUENCIES, LockedLine
from friso_thesis.studies.thesis.judges.arguments import HEAVIEST, LIGHT
from friso_thesis.studies.thesis.judges.identified_in_time import NOISY_RANGE
from friso_thesis.studies.thesis.reading import words
from friso_thesis.studies.thesis.studies import STUDIES, ThesisStudy, thesis_rig

V, Z = sp.symbols("v z", real=True)
SIGMA_0, SIGMA_1, SIGMA_2, STATIC, COULOMB, STRIBECK = sp.symbols("sigma_0 sigma_1 sigma_2 F_s F_c v_s", positive=True)

PRINTED_LEVEL = COULOMB + (STATIC - COULOMB) * sp.exp(-((V / STRIBECK) ** 2))
"""Eq. 4 as printed, with j = 2."""

PRINTED_RATE = V - SIGMA_0 * sp.Abs(V) / PRINTED_LEVEL * Z
"""Eq. 3 as printed."""


@judges("E3", figure="Eq. 3 to 5")
def printed_friction(evidence: Evidence) -> Finding:
    """Judge what Eq. 3 to 5 give for bristles at rest and in steady sliding."""
    return judged_friction(PRINTED_RATE, PRINTED_LEVEL)


@cache
def judged_friction(rate: sp.Expr, level: sp.Expr) -> Finding:
    """Judge the friction of Eq. 5, with Eq. 3 as `rate` and Eq. 4 as `level`, in steady sliding and about rest."""
    force = SIGMA_0 * Z + SIGMA_1 * rate + SIGMA_2 * V
    (deflection,) = sp.solve(rate.subs(sp.Abs(V), V), Z)  # sliding forwards
    steady = sp.simplify(force.subs(sp.Abs(V), V).subs(Z, deflection))
    falls = sp.limit(level, V, 0), sp.limit(level, V, sp.oo)
    stiffness = sp.simplify(sp.diff(force, Z).subs(V, 0))
    return Finding.of(
        Part(
            "in steady sliding Eq. 3 to 5 give the level of Eq. 4 and the viscous friction",
            sp.simplify(steady - level - SIGMA_2 * V) == 0,
            f"F = {_text(steady)}",
            why="Another level remains.",
        ),
        Part(
            "Eq. 4 falls from the stiction force at no speed to the Coulomb friction at a high one",
            falls == (STATIC, COULOMB),
            f"{_text(falls[0])} and {_text(falls[1])}",
            why="Its ends are others.",
        ),
        Part(
            "at no speed the bristles are the spring of Eq. 1, of stiffness sigma_0",
            stiffness == SIGMA_0,
            f"d F/d z = {_text(stiffness)}",
            why="Its stiffness is another.",
        ),
    )


def _text(expression: sp.Basic) -> str:
    """Write a SymPy expression in a readable form, as text."""
    return str(expression).replace("**", "^").replace("*", " ")


@judges("E8", figure="Eq. 8")
def least_beta(evidence: Evidence) -> Finding:
    """Judge whether beta of at least 1 is what the time constants of Eq. 8 ask for, and what is studied."""
    beta, tau_z = sp.symbols("beta tau_z", positive=True)
    (least,) = sp.solve(sp.Eq(beta * tau_z, tau_z), beta)
    lowest = min(span.low for study in STUDIES.values() for span in study.spans if span.key == BETA)
    return Finding.of(
        Part(
            "with tau_i = beta tau_z of Eq. 8, tau_i >= tau_z just where beta >= 1",
            least == 1,
            f"equal at beta = {least}",
            why="The two bounds differ.",
        ),
        Part("Table 3 studies no smaller beta", lowest >= 1, f"from {lowest:g} on", why="It studies smaller ones too."),
    )


@judges("T2", figure="Table 2")
def fixed_friction(evidence: Evidence) -> Finding:
    """Judge whether all values of the friction model are fixed in the studies of Table 3."""
    return judged_fixed(STUDIES.values())


def judged_fixed(studies: Iterable[ThesisStudy]) -> Finding:
    """Judge whether `studies` vary none of the values of Table 2."""
    varied = {study.panel: sorted(key for key in study.sets if key.startswith("friction.")) for study in studies}
    where = [f"Fig. {panel}: {' and '.join(keys)}" for panel, keys in varied.items() if keys]
    return Finding.of(
        Part(
            "no study of Table 3 varies a value of Table 2",
            not where,
            "; ".join(where) or "none does",
            why="Static and Coulomb friction are themselves studied, and differ in Fig. 13.",
        )
    )


@judges("T1", figure="Table 1")
def touched_limiters(evidence: Evidence) -> Finding:
    """Judge when the joint reaches its limiter, by the forces on a stuck cart and on an accelerated one."""
    return judged_touch(evidence.rig.flat())


def judged_touch(flat: Mapping[str, float]) -> Finding:
    """Judge when the joint of a rig reaches its limiter; `flat` has the values of its stage file."""
    force, static = flat["joint.stiffness"] * flat["joint.stroke"], flat["friction.static"]
    needed = flat["masses.cart"] * flat["motion.acceleration"] + flat["friction.coulomb"]
    return Finding.of(
        Part(
            "the force at full stroke is below the static friction: a stuck cart can be pushed by its limiter",
            force < static,
            f"{force:.3g} N of {static:.3g} N",
            why="The cart breaks away before the limiter is reached.",
        ),
        Part(
            "the prescribed acceleration of the cart needs more than the force at full stroke: its limiter pushes it",
            needed > force,
            f"{needed:.3g} N for {flat['motion.acceleration']:.3g} m/s^2, {force:.3g} N at full stroke",
            why="The joint alone accelerates the cart.",
        ),
    )


@judges("S322", figure="Sec. 3.2.2, time to settle", needs=tuple(STUDIES), of_runs=True)
def ten_seconds_suffice(evidence: Evidence) -> Finding:
    """Judge whether runs that come to rest are at rest when peaks begin to count."""
    rows, resting, late = [], 0, 0
    for name, runs in evidence.maps.items():
        rests = ~runs["lasts"].values & ~np.isin(runs["outcome"].values, ("invalid", FAILED))
        counted = rests & (runs["peaks"].values > 0)
        resting, late = resting + int(rests.sum()), late + int(counted.sum())
        share = percent(counted.sum() / rests.sum()) if rests.any() else "none"
        rows.append((f"{STUDIES[name].panel}: {STUDIES[name].title}", str(int(rests.sum())), share))
    return Finding.of(
        Part(
            f"of the runs that no longer swing at their end, few (at most {percent(words.few)}) still have counted "
            f"peaks after {COUNTED_AFTER:g} s",
            bool(resting and late <= words.few * resting),
            f"{late} of {resting} runs over all maps ({percent(late / resting)})"
            if resting
            else "no run comes to rest",
            why="Transients last longer than ten seconds.",
        ),
        table=FindingTable(("map", "runs that come to rest", "of these with counted peaks"), tuple(rows)),
    )


@judges("S41F", figure="Sec. 4.1, force at break-away")
def equal_force_at_break_away(evidence: Evidence) -> Finding:
    """Judge whether static minus Coulomb friction is equal in the study of mass, and in all studies."""
    own = {study.panel for study in STUDIES.values() if any(key.startswith("friction.") for key in study.sets)}
    flat = thesis_rig().flat()
    gap = flat["friction.static"] - flat["friction.coulomb"]
    return Finding.of(
        Part(
            "the difference of static and Coulomb friction is equal in all simulations of the parameter study",
            not own,
            f"{gap:g} N, but for Fig. {' and '.join(sorted(own))}, which vary it; by the other reading, the study of "
            f"mass in Fig. 11B alone, it {'is not' if STUDIES['system'].panel in own else 'is'} equal",
            why="It is equal where the mass is varied, for which the thesis argues; not where friction is.",
        )
    )


@judges("S41I", figure="Sec. 4.1, initial response", needs=(LIGHT, HEAVIEST))
def equal_initial_response(evidence: Evidence) -> Finding:
    """Judge whether the response to the first move is unchanged by the mass, with gains adjusted to it."""
    light, heavy = (evidence.responses[name].trace for name in (LIGHT, HEAVIEST))
    return judged_initial(*(_first_deviation(*_of(trace)) for trace in (light, heavy)))


def _of(trace: object) -> tuple[np.ndarray, np.ndarray]:
    time, position, reference = (np.asarray(trace[name]) for name in ("time", "position", "reference"))  # type: ignore[index]
    return time, position - reference


FIRST_RESPONSE = 0.3  # [s]
"""Time for which the initial response lasts, five times that of the move: its overshoot of 28 mm has turned and
come back by then, and the stage has not stuck yet."""


def _first_deviation(time: np.ndarray, deviation: np.ndarray) -> np.ndarray:
    """Return the deviation while the first move and its overshoot last."""
    return deviation[time <= FIRST_RESPONSE]


def judged_initial(light: np.ndarray, heavy: np.ndarray) -> Finding:
    """Judge whether two masses deviate alike [m] from the reference, at equal times, shape (n,)."""
    off = float(np.abs(heavy - light).max() / np.abs(light).max())
    return Finding.of(
        Part(
            f"until {FIRST_RESPONSE:g} s, in the first move and its overshoot, the deviation from the "
            f"reference is the same with {LIGHT} and {HEAVIEST} (within {percent(words.same)} of its largest)",
            off <= words.same,
            f"it differs by at most {percent(off)} of {1e3 * np.abs(light).max():.3g} mm",
            why="Friction weighs less with more mass.",
        )
    )


APPENDIX_RANGE = 10.0, 100.0
"""Range in which single identifications are noisy [Hz], by A.1; Sec. 4.2.1 has another."""


@judges("A1", figure="29", needs=(LINE,))
def noisy_range(evidence: Evidence) -> Finding:
    """Judge in which range identifications at several places scatter, by both of the ranges printed."""
    return judged_noise(evidence.experiments.locked_line)


def judged_noise(line: LockedLine) -> Finding:
    """Judge whether the scatter of a `line` lies in the range of A.1, and whether both ranges are the same."""
    rates, scatter = np.array(RESPONSE_FREQUENCIES), line.scatter
    low, high = APPENDIX_RANGE
    worst, most = float(rates[np.nanargmax(scatter)]), float(np.nanmax(scatter))
    above = float(np.nanmax(scatter[rates >= words.about * high]))
    return Finding.of(
        Part(
            f"as in Fig. 17, identifications at different places differ most between {low:g} and {high:g} Hz, by more "
            f"than {words.about:g} times as much as from {words.about * high:g} Hz",
            bool(low <= worst <= high and most > words.about * above),
            f"the phase scatters most at {worst:.3g} Hz, by {np.degrees(most):.2g} degrees, and by "
            f"{np.degrees(above):.2g} above",
            why="The scatter lies elsewhere.",
        ),
        Part(
            "A.1 and Sec. 4.2.1 name the same range",
            APPENDIX_RANGE == NOISY_RANGE,
            f"{low:g} to {high:g} Hz, and {NOISY_RANGE[0]:g} to {NOISY_RANGE[1]:g} Hz",
            why="One of them is a slip.",
        ),
    )
