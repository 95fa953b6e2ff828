"""Judge the arguments that the thesis gives in words, and its steps (Sec. 4.1).

The arguments concern forces at full stroke, the mass to tune for, what mass and crossover do to the overshoot, and what
counted peaks mean. The steps explain mass, friction gap and alpha.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from friso.equations.controllers.pid import CROSSOVER, TUNED_MASS
from friso.frequency.bode import settled_margin
from friso.hunting.criteria import COUNTED_AFTER, FAILED, SWINGS
from friso.quantities import percent
from friso.stage import loads
from friso_thesis.studies.thesis.claims import (
    NOTHING_TO_COMPARE,
    Evidence,
    Finding,
    FindingTable,
    Part,
    Response,
    judges,
)
from friso_thesis.studies.thesis.judges.shares import NARROW, WIDE, Sticking, seconds, slow_spells, sticking
from friso_thesis.studies.thesis.linear import FREE
from friso_thesis.studies.thesis.maps import overlap, trend, trend_text, verdict_table
from friso_thesis.studies.thesis.reading import about, words
from friso_thesis.studies.thesis.studies import STUDIES

if TYPE_CHECKING:
    import xarray as xr

LIGHT, HEAVY = "1.7 kg", "2.5 kg"
"""Names of the responses of the locked rig with the weighed mass and with the identified mass (Sec. 4.2.1)."""

MEASURED_FRICTION = 1.0, 2.5
"""Range of static friction [N] in Fig. 20."""

_PEAK_FORCE, PRESCRIBED_ACCELERATION, ROUND_GRAVITY, TENFOLD_GRAVITY = 200.0, 100.0, 9.81, 10.0
"""Peak force of the actuator [N] and accelerations [m/s^2, g] (Sec. 3.5, 4.3.2)."""

BOTH_MASSES = 1.7, 2.5
"""Weighed mass, and identified mass [kg]."""

AFTER_BREAK_AWAY = 0.02
"""Time [s] after break-away at which the acceleration is read."""


@judges("S341", figure="Sec. 3.4.1, force at full stroke", needs=("isolator-stiffness",))
def force_at_full_stroke(evidence: Evidence) -> Finding:
    """Judge the rule for the force at full stroke, at the thesis's own values and over the map."""
    flat = evidence.rig.flat()
    force, static = flat["joint.stiffness"] * flat["joint.stroke"], flat["friction.static"]
    stiffness, stroke, moving, valid = verdict_table(
        evidence.maps["isolator-stiffness"], "joint.stiffness", "joint.stroke"
    )
    rule = stiffness[:, None] * stroke[None, :] < static
    some = valid & (stroke > 0)[None, :]
    kept = overlap(moving, rule & some)
    return Finding.of(
        Part("k_j S_j is below the static friction of Table 2", force < static, f"{force:.3g} N of {static:.3g} N"),
        Part(
            f"k_j S_j is below the static friction that was measured ({MEASURED_FRICTION[0]:g} to "
            f"{MEASURED_FRICTION[1]:g} N)",
            force < MEASURED_FRICTION[0],
            f"{force:.3g} N: {force / MEASURED_FRICTION[0]:.2g} times the least and {force / MEASURED_FRICTION[1]:.2g} "
            "times the largest value measured",
            why="The thesis's own rig breaks its rule where friction is lowest.",
        ),
        Part(
            "over the map of stiffness and stroke, the stage comes to rest where k_j S_j is below the static "
            f"friction, but for few cells (at most {percent(words.few)})",
            kept <= words.few,
            f"{percent(kept)} keep moving where the rule is kept, {percent(overlap(moving, ~rule & some))} where "
            "it is broken",
            why="The force at full stroke does not decide alone.",
        ),
    )


TUNED_MASSES = 9
"""Number of masses for which the controller is tuned, from the stage's to the whole mass. More show the same
maximum."""


@lru_cache(maxsize=256)
def _margins(stage_file: str) -> dict[float, float]:
    """Return the least modulus margin of a rig, by the mass [kg] that its controller assumes.

    Margins in the limit cases count, and those of all states stuck under a bias force. The margin is 0 if one of them
    is unstable.
    """
    flat = {**loads(stage_file).flat(), "joint.locked": False}
    whole = flat["masses.cart"] + flat["masses.stage"]
    masses = np.geomspace(flat["masses.stage"], whole, TUNED_MASSES)
    return {float(mass): settled_margin({**flat, TUNED_MASS: float(mass)}) for mass in masses}


@judges("S342", figure="Sec. 3.4.2, mass the controller is tuned for", needs=(FREE,))
def the_mass_to_tune_for(evidence: Evidence) -> Finding:
    """Judge for which mass the controller should be tuned, by the modulus margin that follows."""
    margins = _margins(evidence.rig.to_toml())
    (small, of_small), *_, (_, whole) = margins.items()
    best = max(margins, key=lambda mass: margins[mass])
    return Finding.of(
        Part(
            "tuned for the whole mass all settled states are stable",
            whole > 0,
            f"modulus margin {whole:.2g}" if whole > 0 else "not stable",
        ),
        Part(
            "of all masses between that of the stage and the whole, the whole gives the largest modulus margin of "
            "these states",
            whole >= margins[best],
            f"{whole:.2g} tuned for the whole, {of_small:.2g} for the {small:.2g} kg of the stage (0: not stable); "
            f"largest {margins[best]:.2g}, tuned for {best:.2g} kg",
            why="The free joint's loop crosses higher than tuned, and nearer to the parasitic mode.",
        ),
    )


@judges("S352", figure="Sec. 3.5, acceleration")
def close_to_ten_g(evidence: Evidence) -> Finding:
    """Judge whether the peak force accelerates the masses weighed and identified by about 10 g."""
    reached = [_PEAK_FORCE / mass / ROUND_GRAVITY for mass in BOTH_MASSES]
    rows = tuple(
        (f"{mass:g} kg", f"{PRESCRIBED_ACCELERATION * mass:g} N", f"{_PEAK_FORCE:g} N") for mass in BOTH_MASSES
    )
    return Finding.of(
        Part(
            f"{_PEAK_FORCE:g} N reach about {TENFOLD_GRAVITY:g} g (within a factor of 1.5) with the mass weighed and "
            "with "
            "that identified",
            all(about(g, TENFOLD_GRAVITY) for g in reached),
            ", ".join(f"{g:.2g} g with {mass:g} kg" for g, mass in zip(reached, BOTH_MASSES, strict=True)),
            printed=TENFOLD_GRAVITY,
            read=reached[1],
        ),
        table=FindingTable(
            ("mass", f"force for the {PRESCRIBED_ACCELERATION:g} m/s^2 of Sec. 4.3.2", "peak force"), rows
        ),
    )


@judges("S41", figure="Sec. 4.1, why mass helps", needs=(LIGHT, HEAVY))
def why_mass_helps(evidence: Evidence) -> Finding:
    """Judge why mass helps, by the first slip across the reference after the return move.

    A light and a heavy stage with the same crossover are compared.
    """
    light, heavy = (_overshooting_slip(evidence.responses[name]) for name in (LIGHT, HEAVY))
    names = LIGHT, HEAVY
    over = np.nan_to_num([light[1], heavy[1]])  # no slip across the reference is no overshoot
    nothing = "" if over.any() else "Neither overshoots: there is nothing to compare."
    undecided = "" if over.all() else "One of the two does not overshoot: there is no acceleration to compare."
    return Finding.of(
        Part(
            "where it first slips across the reference the heavier cart accelerates less after break-away",
            heavy[0] < light[0],
            _compared(light[0], heavy[0], "m/s^2", names, "no overshoot"),
            undecided=undecided,
        ),
        Part(
            "it then overshoots the reference less",
            bool(over[1] < over[0]),
            _compared(1e3 * light[1], 1e3 * heavy[1], "mm", names, "no overshoot"),
            undecided=nothing,
        ),
    )


def _compared(first: float, second: float, unit: str, names: tuple[str, str], nothing: str = "no cycle") -> str:
    texts = (f"{value:.3g} {unit}" if np.isfinite(value) else nothing for value in (first, second))
    return " against ".join(f"{text} with {name}" for text, name in zip(texts, names, strict=True))


def _end_of_motion(trace: xr.Dataset) -> float:
    """Return the time [s] from which the reference stands, or 0 if it never moves."""
    moving = np.flatnonzero(np.abs(np.diff(trace["reference"].values)) > 0)
    return float(trace["time"].values[moving[-1] + 1]) if moving.size else 0.0


def _overshooting_slip(response: Response) -> tuple[float, float]:
    """Return acceleration [m/s^2] and overshoot [m] of the first slip across the reference.

    The slip is the first after the end of the reference's motion that begins on one side of the reference and ends on
    the other; NaN without one. The acceleration is the cart's largest. The cart also slows down where its first swing
    turns, and a slip back from there crosses nothing.
    """
    trace = response.trace
    time, velocity = trace["time"].values, trace["cart_velocity"].values
    deviation = (trace["position"] - trace["reference"]).values
    spells = [spell for spell in slow_spells(trace) if time[spell[0]] > _end_of_motion(trace)]
    stops = [*(first for first, _ in spells[1:]), len(time) - 1]
    for (_, start), stop in zip(spells, stops, strict=False):
        if deviation[start] * deviation[stop] < 0:
            early = (time >= time[start]) & (time <= time[start] + AFTER_BREAK_AWAY)
            acceleration = float(np.abs(np.gradient(velocity[early], time[early])).max())
            return acceleration, float((np.sign(deviation[stop]) * deviation[start : stop + 1]).max())
    return np.nan, np.nan


def _over_crossover(evidence: Evidence, measure: str) -> tuple[float, str]:
    """Return the rank correlation of a measure of lasting cycles with the crossover, and say it in words.

    The map is that of Fig. 11B, and the correlation is the mean over its masses.
    """
    runs = evidence.maps["system"]
    crossover, mass, moving, _ = verdict_table(runs, CROSSOVER, "mass")
    values, outcome = (runs[name].transpose(CROSSOVER, "mass").values for name in (measure, "outcome"))
    lasting = moving & (outcome == SWINGS)
    trends = np.array([trend(crossover[cells], values[cells, k]) for k, cells in enumerate(lasting.T)])
    some = np.isfinite(trends)
    mean = float(trends[some].mean()) if some.any() else np.nan
    return mean, f"mean rank correlation {trend_text(mean)}, over {some.sum()} of {len(mass)} masses"


@judges("F25O", figure="25", needs=("system",), of_runs=True)
def overshoot_falls_with_crossover(evidence: Evidence) -> Finding:
    """Judge whether overshoot falls with crossover, by the final swing at every mass."""
    mean, number = _over_crossover(evidence, "peak_to_peak")
    return Finding.of(
        Part(
            "with the joint locked, over the map of Fig. 11B, the swing of the cycles that last falls as the "
            f"crossover rises (mean rank correlation over the masses at most {-words.trend:g})",
            mean <= -words.trend,
            number,
        )
    )


@judges("S5", figure="Sec. 5, peaks and cycles", needs=tuple(STUDIES))
def counted_peaks_mean_cycles(evidence: Evidence) -> Finding:
    """Judge whether counted peaks mean a cycle.

    By the peak count, the fraction of cells with peaks decides whose run still swings at its end. By attraction, it is
    the fraction of decided cells with peaks whose stage has an attracting cycle. The cells of all maps count together.
    """
    rows, counted, lasting = [], 0, 0
    for name, runs in evidence.maps.items():
        peaks = (runs["peaks"].values > 0) & (runs["outcome"].values != FAILED)
        swings = peaks & runs["lasts"].values
        counted, lasting = counted + int(peaks.sum()), lasting + int(swings.sum())
        kept = percent(swings.sum() / peaks.sum()) if peaks.any() else "none"
        rows.append((f"{STUDIES[name].panel}: {STUDIES[name].title}", percent(peaks.mean()), kept))
    held = lasting / counted if counted else np.nan
    return Finding.of(
        Part(
            f"of the cells in which peaks are counted, all but a few (at most {percent(words.few)}) still swing at the "
            "end of their run (by an attracting cycle: one attracts their stage)",
            held >= 1 - words.few,
            f"{percent(held)} over all maps" if counted else "no peaks are counted",
            why="Peaks after 10 s also count a transient that dies out by 20 s. A cycle that attracts is "
            "decided by what the stage does from any start (see Peak count and hunting cycle).",
        ),
        table=FindingTable(("map", "cells with counted peaks", "of these still swinging at the end"), tuple(rows)),
    )


LOW_ALPHA, HIGH_ALPHA = "alpha 0.1", "alpha 0.2"
"""Names of the responses of the locked rig at both ends of the range of alpha in which it hunts."""

HEAVIEST = "5.1 kg"
"""Name of the response of the locked rig with the heaviest mass of Table 3, with which it no longer hunts."""

_ISOLATED = tuple(name for name in STUDIES if name.startswith("isolator"))

_COUNTED_FOR = 10.0
"""Time [s] in which peaks are counted (Sec. 3.2.2)."""


@dataclass(frozen=True)
class ArguedCycle:
    """A motion after the return, reduced to the quantities of the thesis's arguments.

    `overshoot` [m] is that of the cycle beyond the reference (NaN without a cycle). `build_up` [N/s] is the mean rate
    at which the integral action changes after the initial overshoot, until peaks are counted. `stick` describes the
    sticks that end in break-away.
    """

    overshoot: float
    build_up: float
    stick: Sticking


BUILD_UP_AFTER = 6.0  # [s]
"""Time after which the build-up of the integral action is read, one second after the return begins. By then the
initial overshoot, of up to 29 mm, is over and the bearing has stuck, at 5.2 to 5.5 s with 1.7 to 5.1 kg; from the
end of the return on, at 5.06 s, the overshoot would decide."""


def cycle_of(response: Response) -> ArguedCycle:
    """Return the cycle of a response.

    Overshoot and sticks are taken after the time from which peaks count.
    """
    trace = response.trace
    time, integral = (np.asarray(trace[name].values) for name in ("time", "force_i"))
    deviation = (trace["position"] - trace["reference"]).values
    still = (time > max(_end_of_motion(trace), BUILD_UP_AFTER)) & (time < COUNTED_AFTER)
    rate = float(np.abs(np.diff(integral[still])).sum() / np.ptp(time[still]))
    sticks = sticking(response)
    late = np.abs(deviation[time >= COUNTED_AFTER])
    return ArguedCycle(float(late.max()) if sticks.both else np.nan, rate, sticks)


@judges("S41M", figure="Sec. 4.1, mass step by step", needs=(LIGHT, HEAVIEST))
def heavier_mass_step_by_step(evidence: Evidence) -> Finding:
    """Judge whether the integral action builds up more slowly with a heavier mass.

    Also judge whether no peaks are counted with the heavy mass.
    """
    light, heavy = (cycle_of(evidence.responses[name]) for name in (LIGHT, HEAVIEST))
    counted = int(evidence.responses[HEAVIEST].cell["count"])
    return Finding.of(
        Part(
            f"after the initial overshoot, from {BUILD_UP_AFTER:g} s on until peaks count, the integral "
            "action builds up more slowly with the heavier mass",
            heavy.build_up < light.build_up,
            _compared(light.build_up, heavy.build_up, "N/s", (LIGHT, HEAVIEST)),
            why="It does not.",
        ),
        Part(
            "the heavier mass does not break away any more: no peaks are counted",
            counted == 0,
            f"{counted} peaks with {HEAVIEST}, {int(evidence.responses[LIGHT].cell['count'])} with {LIGHT}",
            why="It still breaks away.",
        ),
    )


@judges("S41G", figure="Sec. 4.1, gap and overshoot", needs=(WIDE, NARROW))
def larger_gap_larger_overshoot(evidence: Evidence) -> Finding:
    """Judge whether a wider friction gap gives more overshoot and faster build-up.

    The gap is static minus Coulomb friction; two gaps are compared. What builds up is the integral action.
    """
    wide, narrow = (cycle_of(evidence.responses[name]) for name in (WIDE, NARROW))
    undecided = "" if wide.stick.both and narrow.stick.both else NOTHING_TO_COMPARE
    return Finding.of(
        Part(
            "the larger gap overshoots the reference more",
            wide.overshoot > narrow.overshoot,
            _compared(1e3 * wide.overshoot, 1e3 * narrow.overshoot, "mm", (WIDE, NARROW)),
            why="It overshoots less.",
            undecided=undecided,
        ),
        Part(
            "with the larger gap the integral action builds up faster after the initial overshoot, from "
            f"{BUILD_UP_AFTER:g} s on until peaks count",
            wide.build_up > narrow.build_up,
            _compared(wide.build_up, narrow.build_up, "N/s", (WIDE, NARROW)),
            why="It builds up more slowly.",
            undecided=undecided,
        ),
    )


@judges("S41A", figure="Sec. 4.1, alpha and break-away", needs=(LOW_ALPHA, HIGH_ALPHA))
def larger_alpha_breaks_away_sooner(evidence: Evidence) -> Finding:
    """Judge whether the stage sticks for a shorter time with a larger alpha.

    Both ends of the range of alpha are compared. Also judge whether the integral action then has a smaller fraction of
    the force at break-away.
    """
    low, high = (cycle_of(evidence.responses[name]).stick for name in (LOW_ALPHA, HIGH_ALPHA))
    undecided = "" if low.both and high.both else NOTHING_TO_COMPARE
    return Finding.of(
        Part(
            "with the larger alpha the stage breaks away after a shorter time",
            high.mean(high.time) < low.mean(low.time),
            f"{high.words(high.time, seconds)} with {HIGH_ALPHA}, {low.words(low.time, seconds)} with {LOW_ALPHA}",
            why="It sticks longer.",
            undecided=undecided,
        ),
        Part(
            "with the larger alpha the integral action has a smaller share of the force at break-away",
            high.mean(high.integral) < low.mean(low.integral),
            f"{high.words(high.integral, percent)} with {HIGH_ALPHA}, {low.words(low.integral, percent)} with "
            f"{LOW_ALPHA}",
            why="Its share is larger.",
            undecided=undecided,
        ),
    )


@judges("F25R", figure="25", needs=("system",), of_runs=True)
def response_time_falls_with_crossover(evidence: Evidence) -> Finding:
    """Judge whether lasting cycles become faster as the crossover rises, on average over masses."""
    mean, number = _over_crossover(evidence, "period")
    return Finding.of(
        Part(
            "with the joint locked, over the map of Fig. 11B, a cycle goes round faster as the crossover rises "
            f"(mean rank correlation of its period over the masses at most {-words.trend:g})",
            mean <= -words.trend,
            number,
            why="The period does not fall.",
        )
    )


@judges("S5P", figure="Sec. 5, peaks and cycles", needs=_ISOLATED, of_runs=True)
def more_peaks_than_cycles(evidence: Evidence) -> Finding:
    """Judge whether some isolated runs that swing to their end count more peaks than cycles."""
    swinging, more = 0, 0
    for name in _ISOLATED:
        runs = evidence.maps[name]
        lasting = (runs["outcome"].values == SWINGS) & (runs["peaks"].values > 0) & np.isfinite(runs["period"].values)
        cycles = _COUNTED_FOR / runs["period"].values
        swinging += int(lasting.sum())
        more += int((lasting & (runs["peaks"].values > cycles + 1)).sum())
    return Finding.of(
        Part(
            "in some isolated runs more peaks are counted than cycles fit into ten seconds, and one",
            more > 0,
            f"{more} of {swinging} runs that swing to their end",
            why="Peaks that count are half a second apart, and the internal mode swings by less than 0.1 mm.",
        )
    )
