"""Frequency responses of the plant, locked at ten places and free, and of open loops.

All are measured by closed-loop excitation (thesis, Fig. 17, 18, 22, 23, 29). The open loops are measured at several
crossovers.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from friso.identification.estimate import Estimate
from friso.identification.response.analysis import crossovers
from friso.identification.response.mass_line import mass_lines
from friso.identification.response.records import FrequencyResponse
from friso.progress import Progress
from friso.shown.drawing.figure import (
    BLUE,
    GREEN,
    INK,
    LIGHT,
    ORANGE,
    PINK,
    SKY,
    VERMILLION,
    Array,
    Axis,
    Figure,
    Limit,
    Panel,
    Series,
    phases,
)
from friso.shown.text import listed, pretty, with_unit
from friso.stage import Stage
from friso.virtual_rig.run import run
from friso.virtual_rig.task import standing
from friso_thesis.studies.rig.experiments import RigExperiment
from friso_thesis.studies.rig.outcome import (
    WIDE_STROKE,
    Outcome,
    RigLog,
    estimate_plant,
    excite,
    freed,
    interval,
    jointed,
    locked_stage,
    loop,
    pace,
    quicker,
    rig_log,
    travel,
)

LOCKED_PLACES, FREE_PLACES = 10, 3
"""Places along the travel at which the plant is identified, locked (Fig. 29) and free (the thesis shows one)."""

CROSSOVER_SETTINGS = (1.0, 1.5, 2.0, 3.0, 4.0, 6.0)
"""Crossovers of the open loops over the stage's own: 8 to 48 Hz (Fig. 22)."""

MOTOR_CONSTANT_RATIOS = (1.0, 0.68, 1.47)
"""Ratios of true to assumed motor constant that are compared: 1.7 kg weighed over 2.5 kg seen, and its inverse."""

BESIDE_MODES = 3.0
"""Factor in frequency between the free joint's mass line and the modes on both sides of it."""

TRIED_FACTOR, TRIED_STEPS = 1.1, 33
"""Factor between successive crossovers that are tried for stability, and their number.

They begin at a third of the highest of `CROSSOVER_SETTINGS`.
"""

RELEASE_DISTANCE, RELEASE_DURATION = 0.01, 8.0
"""Distance of the free stage from its reference at release, in strokes, and run duration.

The duration is in periods of the stage's crossover. A loop with a larger error in the last quarter is not stable.
"""


@dataclass(frozen=True)
class Plant:
    """The plant as identified from several logs: one response each, and their average.

    `first_mode` [Hz] is the frequency of the first mode of a free joint (NaN: locked). `mass` is that of the mass line
    (where force over acceleration is constant), and `band` its frequency range [Hz].
    """

    single: tuple[FrequencyResponse, ...]
    averaged: FrequencyResponse
    first_mode: float
    mass: Estimate
    band: tuple[float, float]


@dataclass(frozen=True)
class MeasuredLoop:
    """A measured open loop, with the crossover [Hz] it was tuned to and its 0 dB crossings.

    The response has no frequencies if the closed loop was not stable.
    """

    tuned: float
    response: FrequencyResponse
    crossings: tuple[Estimate, ...]

    @property
    def measured(self) -> bool:
        """Tell whether there is a response, which means that the closed loop was stable."""
        return len(self.response.frequency) > 0


@dataclass(frozen=True)
class Frf:
    """Results of the frequency-response experiment.

    Fields are the plants, and the open loops, locked at several crossovers and free. `apparent` [kg], shape (2,
    ratios), are the masses that the locked and the free plant show for the motor constants of `MOTOR_CONSTANT_RATIOS`.
    `settings` [Hz], shape (TRIED_STEPS,), are crossovers tried with the free joint, and `stable` says which of them
    were stable.
    """

    locked: Plant
    free: Plant
    loops: tuple[MeasuredLoop, ...]
    free_loop: MeasuredLoop
    apparent: np.ndarray
    settings: np.ndarray
    stable: np.ndarray

    @property
    def highest_stable(self) -> float:
        """Return the highest crossover [Hz] below the first unstable one, joint free; NaN for none."""
        return highest_stable(self.settings, self.stable)


def highest_stable(settings: np.ndarray, stable: np.ndarray) -> float:
    """Return the last of rising `settings` (n,) before the first unstable one.

    `stable` (n,) says which are stable. The result is NaN if the first one is unstable.
    """
    first = len(stable) if stable.all() else int(np.argmin(stable))
    return float(settings[first - 1]) if first else np.nan


def crossing_near_target(loop: MeasuredLoop) -> float:
    """Return the 0 dB crossing [Hz] of a loop nearest to its tuned crossover; NaN for none."""
    crossed = [crossing.value for crossing in loop.crossings]
    return min(crossed, key=lambda f: abs(np.log(f / loop.tuned)), default=np.nan)


NOTES = (
    "give friso identify one bench at a time: locked_*.csv, free_*.csv, or one loop_*.csv",
    "the drive logs the commanded force: the effect of the current loop and the delay is part of the plant",
)


def plant_log(stage: Stage, name: str, place: float, seed: int) -> RigLog:
    """Return the log of one excitation of the closed loop at a place [m]."""
    return rig_log(excite(stage, place, seed), 0, name, "frequency", stage, seed)


def open_loops(
    stage: Stage, place: float, seed: int, settings: tuple[float, ...]
) -> tuple[tuple[RigLog, ...], tuple[MeasuredLoop, ...]]:
    """Return logs of one excitation at several crossovers of the controller, and their loops.

    The stage stands at a `place` [m]. `settings` are the crossovers over the stage's own.
    """
    factors = np.array(settings)
    recorded = excite(stage, place, seed, len(factors), quicker(stage, factors))
    rows = []
    for row, factor in enumerate(settings):
        quick = stage.with_numbers(quicker(stage, factor))
        name = f"loop_{factor * pace(stage):.3g}_Hz".replace(".", "_")
        rows.append(rig_log(recorded, row, name, "frequency", quick, seed))
    loops = (measured_loop(log, factor * pace(stage)) for log, factor in zip(rows, settings, strict=True))
    return tuple(rows), tuple(loops)


def measured_loop(log: RigLog, tuned: float) -> MeasuredLoop:
    """Return the open loop of a log, tuned to a crossover [Hz]; without response if unstable."""
    if log.failure:
        none = np.zeros(0)
        return MeasuredLoop(tuned, FrequencyResponse.undivided(none, none + 0j, none, 0.0, kind="multisine"), ())
    response = loop(log)
    return MeasuredLoop(tuned, response, crossovers(response))


def locked_plant(logs: list[RigLog]) -> Plant:
    """Return the plant with its joint locked, from logs: averaged response and lowest mass line.

    The mass is unknown if the response shows no mass line.
    """
    averaged = estimate_plant(logs)
    lines = mass_lines(averaged)
    nothing = Estimate.unknown("mass", "kg", "mass line", "the response shows no mass line")
    mass, band = (lines[0].value, (lines[0].low, lines[0].high)) if lines else (nothing, (np.nan, np.nan))
    return Plant(tuple(estimate_plant([log]) for log in logs), averaged, np.nan, mass, band)


def free_plant(logs: list[RigLog]) -> Plant:
    """Return the plant with its joint free, from logs: response, first mode and mass line.

    The first mode is where acceleration over force is largest, below the parasitic mode.
    """
    averaged, flat = estimate_plant(logs), logs[0].stage.flat()
    above = flat.get("parasitic.frequency", float(averaged.frequency[-1]))
    level = np.abs(averaged.accelerations().response)
    low = averaged.frequency < above / BESIDE_MODES
    first = float(averaged.frequency[low][np.argmax(level[low])])
    band = (BESIDE_MODES * first, above / BESIDE_MODES)
    return Plant(tuple(estimate_plant([log]) for log in logs), averaged, first, mass_between(averaged, *band), band)


def mass_between(response: FrequencyResponse, low: float, high: float) -> Estimate:
    """Return the median of force over acceleration [kg] between two frequencies [Hz].

    The range of the estimate is that of the middle half of the values. The mass is unknown if the response has no
    frequencies in between.
    """
    inside = (response.frequency >= low) & (response.frequency <= high)
    method = f"force over acceleration, {low:.3g} to {high:.3g} Hz"
    if not inside.any():
        return Estimate.unknown("mass", "kg", method, "no line between the modes")
    masses = 1 / np.abs(response.accelerations().response[inside])
    lower, middle, upper = np.percentile(masses, [25, 50, 75])
    return Estimate("mass", "kg", float(middle), float(lower), float(upper), method)


def apparent_masses(stage: Stage, place: float, seed: int) -> np.ndarray:
    """Return the masses [kg] that a stage's response shows for the motor constants of `MOTOR_CONSTANT_RATIOS`.

    The result has the shape (ratios,). The response is measured at a place [m] on the rail.
    """
    ratios = np.array(MOTOR_CONSTANT_RATIOS)
    recorded = excite(stage, place, seed, len(ratios), {"drive.motor_constant_ratio": ratios})
    logs = [rig_log(recorded, row, "", None, stage, seed) for row in range(len(ratios))]
    if stage.flat()["joint.locked"]:
        return np.array([mass_between(estimate_plant([log]), 2 * pace(stage), 10 * pace(stage)).value for log in logs])
    return np.array([free_plant([log]).mass.value for log in logs])


def stable_settings(stage: Stage, place: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the crossovers [Hz] tried, and which of them are stable, both of shape (TRIED_STEPS,).

    The stage is released beside its reference, at a place [m]. A crossover counts as stable if the stage is not farther
    off in the last quarter of the run.
    """
    factors = CROSSOVER_SETTINGS[-1] / 3 * TRIED_FACTOR ** np.arange(TRIED_STEPS)
    off = RELEASE_DISTANCE * stage.flat()["joint.stroke"] / WIDE_STROKE
    task = replace(standing(place, RELEASE_DURATION / pace(stage)), displacement=off)
    (recorded,) = run(
        stage, task, [seed] * TRIED_STEPS, interval(stage, 1 / (125 * pace(stage))), quicker(stage, factors)
    )
    late = recorded.true["position"][:, -(recorded.true["position"].shape[1] // 4) :] - place
    worst = np.abs(late).max(axis=1, initial=0.0)
    return factors * pace(stage), worst <= off


COLOURS = (BLUE, SKY, GREEN, ORANGE, VERMILLION, PINK)


def _plant(name: str, title: str, plant: Plant, subject: str) -> Figure:
    """Draw the magnitude of a plant, and its phase below.

    Shown are all single identifications, their average and, if there is one, the mass line.
    """
    hertz, average = plant.averaged.frequency, plant.averaged.response
    singles = [single.response for single in plant.single]
    angles = [_turned(single, average) for single in singles]
    lines = [
        Series(run.frequency, np.abs(run.response), "" if n else "single identifications", LIGHT, width=0.8)
        for n, run in enumerate(plant.single)
    ]
    lines.append(Series(hertz, np.abs(average), f"average of {len(singles)}", BLUE))
    if plant.mass.determined:
        reach = np.array([max(plant.band[0] / 2, hertz[0]), min(plant.band[1] * 2, hertz[-1])])
        lines.append(
            Series(
                reach,
                1 / (plant.mass.value * (2 * np.pi * reach) ** 2),
                f"mass line, {plant.mass.value:.3g} {pretty('kg')}",
                INK,
                "dashed",
            )
        )
    below = [
        Series(single.frequency, angle, "", LIGHT, width=0.8)
        for single, angle in zip(plant.single, angles, strict=True)
    ]
    below.append(Series(hertz, phases([average])[0], "", BLUE))
    gain = Axis("Magnitude", "m/N", log=True, prefixed=False)
    panels = (
        Panel("position over commanded force", Axis.of_frequency(hertz), gain, tuple(lines)),
        Panel("", Axis.of_frequency(hertz), Axis("Phase", "°", step=90.0), tuple(below)),
    )
    caption = f"Mass line {_mass(plant.mass)}, read from {plant.band[0]:.3g} to {plant.band[1]:.3g} Hz."
    return Figure(f"rig_frf_{name}", title, caption, panels, subject=subject)


def _turned(response: Array, average: Array) -> Array:
    """Return the phase [deg] of a response, within half a turn of the average's phase."""
    angle = phases([average])[0]
    return angle + np.degrees(np.angle(response / average))


def _loops(name: str, title: str, loops: tuple[MeasuredLoop, ...], subject: str) -> Figure:
    """Draw the magnitude and phase of open loops."""
    named = [(loop, colour) for loop, colour in zip(loops, COLOURS, strict=False) if loop.measured]
    gains = tuple(
        Series(loop.response.frequency, np.abs(loop.response.response), f"tuned to {loop.tuned:.3g} Hz", colour)
        for loop, colour in named
    )
    turned = phases([loop.response.response for loop, _ in named])
    angles = tuple(
        Series(loop.response.frequency, angle, "", colour) for (loop, colour), angle in zip(named, turned, strict=True)
    )
    hertz = named[0][0].response.frequency
    panels = (
        Panel(
            "open loop",
            Axis.of_frequency(hertz),
            Axis("Magnitude", "", log=True, prefixed=False),
            gains,
            limits=(Limit((1.0,), "0 dB", INK),),
        ),
        Panel("", Axis.of_frequency(hertz), Axis("Phase", "°", step=90.0), angles, limits=(Limit((-180.0,), "", INK),)),
    )
    crossings = "; ".join(f"{loop.tuned:.3g} Hz: {_crossings(loop)}" for loop in loops)
    return Figure(f"rig_frf_{name}", title, f"Tuned to, and crossing 0 dB at: {crossings}.", panels, subject=subject)


def _crossings(loop: MeasuredLoop) -> str:
    """Write the crossovers of a loop with their intervals."""
    if not loop.measured:
        return "not stable"
    return (
        ", ".join(f"{crossing.value:.3g} ({crossing.low:.3g} to {crossing.high:.3g})" for crossing in loop.crossings)
        or "nowhere"
    )


def _mass(mass: Estimate) -> str:
    """Write an identified mass with its interval, or why there is none."""
    return (
        f"{mass.value:.3g} {pretty('kg')} ({mass.low:.3g} to {mass.high:.3g})"
        if mass.determined
        else f"nothing ({mass.reason})"
    )


def _numbers(plant: Plant) -> dict[str, Any]:
    """Return the plant with the joint in one state, for the JSON document."""
    averaged: FrequencyResponse = plant.averaged
    return {
        "mass_kg": plant.mass.value,
        "mass_interval_kg": [plant.mass.low, plant.mass.high],
        "band_hz": [*plant.band],
        "first_mode_hz": plant.first_mode,
        "frequency_hz": averaged.frequency.tolist(),
        "magnitude_m_per_n": np.abs(averaged.response).tolist(),
        "phase_rad": np.angle(averaged.response).tolist(),
    }


def _loop_numbers(loop: MeasuredLoop) -> dict[str, Any]:
    """Return the tuned crossover and the measured 0 dB crossings [Hz] of an open loop."""
    return {"tuned_hz": loop.tuned, "crossings_hz": [crossing.value for crossing in loop.crossings]}


class FrfExperiment(RigExperiment):
    """Frequency responses of plants and open loops."""

    def run(self, stage: Stage, seed: int, progress: Progress) -> Outcome:
        """Identify plants and open loops of a stage, and find the crossovers that are stable.

        Raises InputError for a stage without a joint.
        """
        fixed, free = locked_stage(jointed(stage)), freed(stage)
        places = np.linspace(*travel(stage), LOCKED_PLACES)
        progress(0, 4, f"plant, joint locked, at {LOCKED_PLACES} places")
        held = [plant_log(fixed, f"locked_{n + 1:02d}", place, seed + n) for n, place in enumerate(places)]
        progress(1, 4, f"plant, joint free, at {FREE_PLACES} places")
        loose = [plant_log(free, f"free_{n + 1:02d}", place, seed + n) for n, place in enumerate(places[:FREE_PLACES])]
        progress(2, 4, "open loops")
        logs, loops = open_loops(fixed, places[0], seed, CROSSOVER_SETTINGS[1:])
        loops = (measured_loop(held[0], pace(stage)), *loops)
        apparent = np.array([apparent_masses(machine, places[0], seed) for machine in (fixed, free)])
        progress(3, 4, "highest stable setting, joint free")
        settings, stable = stable_settings(free, places[0], seed)
        progress(4, 4, "")
        free_loop = measured_loop(loose[0], pace(stage))
        result = Frf(locked_plant(held), free_plant(loose), loops, free_loop, apparent, settings, stable)
        return Outcome("frf", stage, seed, (*held, *loose, *logs), result, NOTES)

    def sentences(self, outcome: Outcome) -> list[str]:
        """Say which masses, modes and crossovers the frequency responses show."""
        result: Frf = outcome.result
        measured = [loop for loop in result.loops if loop.measured]
        last = measured[-1]
        others = [crossing.value for crossing in last.crossings if crossing.value > 2 * last.tuned]
        tuned = listed(
            [f"{with_unit(loop.tuned, 'Hz')} at {with_unit(crossing_near_target(loop), 'Hz')}" for loop in measured],
            "and",
        )
        unmeasured = [f"{loop.tuned:.3g} Hz" for loop in result.loops if not loop.measured]
        unstable = f" Tuned to {listed(unmeasured, 'and')} the closed loop is not stable." if unmeasured else ""
        above = f"again at {with_unit(max(others), 'Hz')}" if others else "nowhere above"
        return [
            f"Joint locked: the mass line shows {_mass(result.locked.mass)} from "
            f"{with_unit(result.locked.band[0], 'Hz')} to {with_unit(result.locked.band[1], 'Hz')}.",
            f"Joint free: first mode near {with_unit(result.free.first_mode, 'Hz')}, above it a mass of "
            f"{_mass(result.free.mass)}.",
            f"With a motor that gives {MOTOR_CONSTANT_RATIOS[1]:g} times the assumed force these masses read "
            f"{result.apparent[0, 1]:.3g} and {result.apparent[1, 1]:.3g} {pretty('kg')}; with "
            f"{MOTOR_CONSTANT_RATIOS[2]:g} times the force, {result.apparent[0, 2]:.3g} and "
            f"{result.apparent[1, 2]:.3g} {pretty('kg')}: a machine that reads heavy has a motor weaker than assumed.",
            f"Joint locked, open loops cross 0 dB as follows: tuned to {tuned}; at the highest setting {above}."
            f"{unstable}",
            f"Joint free, the loop tuned to {with_unit(result.free_loop.tuned, 'Hz')} crosses at "
            f"{with_unit(result.free_loop.crossings[-1].value if result.free_loop.crossings else None, 'Hz')}; the "
            f"highest stable setting is {with_unit(result.highest_stable, 'Hz')}"
            + (", the highest tried." if result.stable.all() else "."),
        ]

    def figures(self, outcome: Outcome) -> list[Figure]:
        """Draw the plants and open loops as in Fig. 17, 29, 18, 22 and 23 of the thesis."""
        result: Frf = outcome.result
        subject = outcome.stage.name
        return [
            _plant("locked", "Plant, joint locked", result.locked, subject),
            _plant("free", "Plant, joint free", result.free, subject),
            _loops("loops", "Open loops, joint locked", result.loops, subject),
            _loops("free_loop", "Open loop, joint free", (result.free_loop,), subject),
        ]

    def numbers(self, outcome: Outcome) -> dict[str, Any]:
        """Return the results for the JSON document."""
        result: Frf = outcome.result
        plants = {"locked": result.locked, "free": result.free}
        return {
            **{name: _numbers(plant) for name, plant in plants.items()},
            "motor_constant_ratios": [*MOTOR_CONSTANT_RATIOS],
            "apparent_mass_locked_kg": result.apparent[0].tolist(),
            "apparent_mass_free_kg": result.apparent[1].tolist(),
            "loops": [_loop_numbers(loop) for loop in result.loops],
            "free_loop": _loop_numbers(result.free_loop),
            "settings_hz": result.settings.tolist(),
            "stable": result.stable.tolist(),
            "highest_stable_hz": result.highest_stable,
        }


EXPERIMENT = FrfExperiment()
