"""Show frequency responses on the rig.

The results are plants, mass lines, open loops, and the highest stable crossover.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from friso.identification.estimate import Estimate
from friso.identification.response.response import FrequencyResponse
from friso.questions.bode.figures import phases
from friso.questions.rig.outcome_view import OutcomeView
from friso.shown.drawing.figure import Array, Axis, Figure, Limit, Panel, Series
from friso.shown.drawing.palette import BLUE, GREEN, INK, LIGHT, ORANGE, PINK, SKY, VERMILLION
from friso.shown.drawing.prefixes import listed, pretty, with_unit
from friso.studies.rig.experiments.frf import MOTOR_CONSTANT_RATIOS, Frf, MeasuredLoop, Plant, crossing_near_target
from friso.studies.rig.outcome import Outcome

COLOURS = (BLUE, SKY, GREEN, ORANGE, VERMILLION, PINK)


def sentences(outcome: Outcome) -> list[str]:
    """Say which masses, modes and crossovers the frequency responses show."""
    result: Frf = outcome.result
    measured = [loop for loop in result.loops if loop.measured]
    last = measured[-1]
    others = [crossing.value for crossing in last.crossings if crossing.value > 2 * last.tuned]
    tuned = listed(
        [f"{with_unit(loop.tuned, 'Hz')} at {with_unit(crossing_near_target(loop), 'Hz')}" for loop in measured], "and"
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
        f"{result.apparent[0, 1]:.3g} "
        f"and {result.apparent[1, 1]:.3g} {pretty('kg')}; with {MOTOR_CONSTANT_RATIOS[2]:g} times the force, "
        f"{result.apparent[0, 2]:.3g} and {result.apparent[1, 2]:.3g} {pretty('kg')}: a machine that reads heavy has a "
        "motor weaker than assumed.",
        f"Joint locked, open loops cross 0 dB as follows: tuned to {tuned}; at the highest setting {above}.{unstable}",
        f"Joint free, the loop tuned to {with_unit(result.free_loop.tuned, 'Hz')} crosses at "
        f"{with_unit(result.free_loop.crossings[-1].value if result.free_loop.crossings else None, 'Hz')}; the highest "
        f"stable setting is {with_unit(result.highest_stable, 'Hz')}"
        + (", the highest tried." if result.stable.all() else "."),
    ]


def figures(outcome: Outcome) -> list[Figure]:
    """Draw the plants and open loops as in Fig. 17, 29, 18, 22 and 23 of the thesis."""
    result: Frf = outcome.result
    subject = outcome.stage.name
    return [
        _plant("locked", "Plant, joint locked", result.locked, subject),
        _plant("free", "Plant, joint free", result.free, subject),
        _loops("loops", "Open loops, joint locked", result.loops, subject),
        _loops("free_loop", "Open loop, joint free", (result.free_loop,), subject),
    ]


def _plant(name: str, title: str, plant: Plant, subject: str) -> Figure:
    """Draw the magnitude of a plant, and its phase below.

    Shown are all single identifications, their average and, if there is one, the mass line.
    """
    hertz, average = plant.averaged.frequency, plant.averaged.response
    singles = [single.response for single in plant.single]
    angles = [_turned(single, average) for single in singles]
    lines = [
        Series(run.frequency, np.abs(run.response), "single identifications" * (n == 0), LIGHT, width=0.8)
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


def numbers(outcome: Outcome) -> dict[str, Any]:
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


VIEW = OutcomeView(sentences, figures, numbers)
