"""Response to a multisine, noise or a sweep: masses, stiffness and damping of the joint."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from friso.identification.combine import Correlated, determined
from friso.identification.doubt import words_of
from friso.identification.estimate import Estimate, digits, name_of, unit_of, with_interval
from friso.identification.estimate_documents import estimate_document, estimates_document
from friso.identification.kind import (
    AREA,
    AnalysisSettings,
    ExperimentKind,
    Facts,
    Prior,
    Source,
)
from friso.identification.logs.log import Log
from friso.identification.readings.course import HARMONICS_OF_AN_EXCITATION, RESTS_OF_MOVES, Course
from friso.identification.response.analysis import Bench, analyse, predicted
from friso.identification.response.mass_line import StraightLine
from friso.identification.response.masses import TwoMass
from friso.identification.response.records import FrequencyResponse
from friso.identification.stage_file import shared_masses
from friso.quantities import percent
from friso.shown.documents import entries
from friso.shown.drawing.figure import (
    BLUE,
    GREY,
    INK,
    ORANGE,
    VERMILLION,
    Array,
    Axis,
    Band,
    Dash,
    Figure,
    Limit,
    Panel,
    Series,
    phases,
)
from friso.shown.text import range_with_unit
from friso.stage import Stage


def _of_stage_alone(mass: float, stage: Stage) -> bool:
    """Tell whether a measured mass [kg] is that of the stage alone, not of all moving masses.

    Above the mode of a free joint the stage moves alone. The nearer of the stage's assumed mass and the total decides.
    False if the joint is locked, or if there is none.
    """
    flat = stage.flat()
    if stage.joint is None or flat["joint.locked"]:
        return False
    stage_mass, moving_mass = flat["masses.stage"], flat["masses.cart"] + flat["masses.stage"]
    return bool(abs(np.log(mass / stage_mass)) < abs(np.log(mass / moving_mass)))


def _parasitic(model: TwoMass, stage: Stage) -> float | None:
    """Return the model's resonance [Hz] if nearer to the parasitic mode than to the joint's.

    Returns None otherwise, and for a stage without a joint or a parasitic mode.
    """
    flat = stage.flat()
    if "parasitic.frequency" not in flat or "joint.stiffness" not in flat:
        return None
    masses = (flat["masses.cart"], flat["masses.stage"])
    joint = np.sqrt(flat["joint.stiffness"] * sum(masses) / np.prod(masses)) / (2 * np.pi)
    resonance = model["resonance frequency"].value
    away = [abs(np.log(resonance / frequency)) for frequency in (joint, flat["parasitic.frequency"])]
    return resonance if away[1] < away[0] else None


WIDEST_PHASE = 60.0  # [deg]
"""Largest half width of a band of the phase that is drawn. A wider one hides the others."""


def _bode(bench: Bench, name: str) -> Figure:
    """Draw magnitudes above phases, with a column for each output."""
    outputs = [response for response in (bench.driven, bench.other) if response is not None]
    columns = [_column(bench, response, number == 0) for number, response in enumerate(outputs)]
    panels = tuple(column[row] for row in range(2) for column in columns)
    caption = "Measured with its 95 % band; fits drawn over the band in which they were fitted."
    if bench.lines:
        caption += f" Mass line: {' and '.join(with_interval(line.value) for line in bench.lines)}."
    bands = [response.band() for response in outputs]
    if any(np.any(band.phase_high - band.phase_low > 2 * np.radians(WIDEST_PHASE)) for band in bands):
        caption += f" Bands of the phase are cut at {WIDEST_PHASE:g}° to either side."
    if bench.departs is not None and bench.departs.frequency.determined:
        caption += " Below their band the response departs from the linear model."
    return Figure(f"{name}_bode", "Frequency response", caption, panels, columns=len(outputs))


def _column(bench: Bench, response: FrequencyResponse, driven: bool) -> tuple[Panel, Panel]:
    """Draw magnitude and phase of one output; `driven` is true for the driven mass."""
    hertz = response.frequency
    inside = hertz[(hertz >= bench.band[0]) & (hertz <= bench.band[1])]
    fine = np.geomspace(inside[0], inside[-1], 400)
    curves: list[tuple[str, str, Dash, Array]] = []
    if bench.two_masses is not None:
        curves.append(("two masses", BLUE, "solid", bench.two_masses.predict(fine, driven)))
    if driven and bench.modes is not None:
        curves.append(("modes", ORANGE, "dashed", bench.modes.predict(fine)))
    (angle,) = phases([response.response])
    aligned = [_phase_turns(hertz, angle, fine, np.degrees(np.unwrap(np.angle(curve[3])))) for curve in curves]
    band = response.band()
    half = np.degrees((band.phase_high - band.phase_low) / 2)
    lowest = 0.3 * float(np.abs(response.response).min())
    area = Band(hertz, np.maximum(band.magnitude_low, lowest), band.magnitude_high, "", AREA)
    measured = Series(hertz, np.abs(response.response), "measured", GREY, width=1.1)
    lines = tuple(Series(fine, np.abs(values), label, colour, dash, 1.5) for label, colour, dash, values in curves)
    masses = tuple(_mass_line(line, hertz, i == 0) for i, line in enumerate(bench.lines)) if driven else ()
    frequency = Axis.of_frequency(hertz)
    gain = Axis("Magnitude", _unit(response), log=True, prefixed=False)
    above = Panel(_title(response), frequency, gain, (measured, *lines, *masses), bands=(area,))
    phase = Series(hertz, angle, "", GREY, width=1.1)
    fits = tuple(
        Series(fine, values, "", colour, dash, 1.5)
        for (_, colour, dash, _), values in zip(curves, aligned, strict=True)
    )
    bounded = np.clip(half, 0, WIDEST_PHASE)
    shade = Band(hertz, angle - bounded, angle + bounded, "", AREA)
    below = Panel("", frequency, Axis("Phase", "°", step=90.0), (phase, *fits), bands=(shade,))
    return above, below


def _phase_turns(hertz: Array, measured: Array, fine: Array, fitted: Array) -> Array:
    """Return phases of a fit [deg], shifted by whole turns to lie near the measured phases.

    The fit is given at frequencies `fine`, the measurement at `hertz`.
    """
    off = np.interp(fine, hertz, measured) - fitted
    return fitted + 360 * np.round(np.median(off) / 360)


def _mass_line(line: StraightLine, hertz: Array, named: bool) -> Series:
    """Draw a mass line over its band and an octave to each side; the legend names it if `named`."""
    reach = np.array([max(line.low / 2, hertz[0]), min(line.high * 2, hertz[-1])])
    label = line.kind if named else ""
    return Series(reach, line.level.value / (2 * np.pi * reach) ** 2, label, INK, "dotted", 1.6)


def _unit(response: FrequencyResponse, power: str = "") -> str:
    """Return the unit of a response: output per input, times `power`, such as "/s^2"."""
    return unit_of(f"{response.channels.output_unit}{power}/{response.channels.input_unit}")


def _title(response: FrequencyResponse) -> str:
    """Write which output over which input a response is."""
    return f"{response.channels.output} over {response.channels.input}".replace("_", " ")


def _around(*several: Array) -> tuple[float, float]:
    """Return limits of a logarithmic axis a little beyond all values above 0."""
    values = np.concatenate([estimate[np.isfinite(estimate) & (estimate > 0)] for estimate in several])
    return float(values.min()) / 1.2, float(values.max()) * 1.2


def _levels(bench: Bench, name: str) -> list[Figure]:
    """Draw response, noise and distortion, if the record shows noise or distortion."""
    outputs = [response for response in (bench.driven, bench.other) if response is not None]
    panels = tuple(_level_panel(response) for response in outputs)
    if min(len(panel.series) for panel in panels) < 2:
        return []
    caption = (
        "Standard deviations of the mean response. Noise differs from period to period; nonlinear distortion, such as "
        "that of friction, from realisation to realisation."
    )
    return [Figure(f"{name}_levels", "Noise and distortion", caption, panels, columns=len(panels))]


def _level_panel(response: FrequencyResponse) -> Panel:
    """Draw the magnitudes of response, noise and distortion of one output."""
    rows = [("response", GREY, np.abs(response.response)), ("noise", BLUE, response.noise)]
    rows.append(("nonlinear distortion", VERMILLION, response.distortion))
    if not np.isfinite(response.noise).any():
        rows.append(("deviation", INK, response.deviation))
    lines = tuple(
        Series(response.frequency, np.where(values > 0, values, np.nan), label, colour, width=1.2)
        for label, colour, values in rows
        if np.nan_to_num(values).max() > 0
    )
    gain = Axis("Magnitude", _unit(response), log=True, prefixed=False)
    return Panel(_title(response), Axis.of_frequency(response.frequency), gain, lines)


def _departure(bench: Bench, name: str) -> Figure:
    """Draw the ratio of measured to modelled response, and where it departs from 1."""
    departs = bench.departs
    assert departs is not None
    limits = _around(departs.excess)
    line, bands = Series(departs.lines, departs.excess, "", GREY), ()
    if departs.frequency.determined:
        ends = np.array([departs.frequency.low, departs.frequency.high])
        bands = (Band(ends, np.full(2, limits[0]), np.full(2, limits[1]), "", AREA),)
    ratio = Axis("|G / G model|", "", limits, log=True)
    panel = Panel("", Axis.of_frequency(departs.lines), ratio, (line,), limits=(Limit((1.0,), "", INK),), bands=bands)
    text = with_interval(departs.frequency)
    caption = f"The driven mass's response over that of the two-mass model; departure: {text}."
    if departs.differ:
        caption += " Below, realisations differ by more than noise: the machine is nonlinear there."
    return Figure(f"{name}_departure", "Departure from the linear model", caption, (panel,))


def _place(line: StraightLine) -> str:
    """Write the kind of a mass line and the band of frequencies that it covers."""
    return f"{line.kind}, {range_with_unit(line.low, line.high, 'Hz')}"


def _without_units(force: str, motion: str) -> str:
    """Say that masses and stiffness enter the stage file only with a force in N and motion in m.

    A unit "1" means that the log states none.
    """
    wanted = "masses and stiffness need N and m to enter the stage file"
    silent = " and the ".join(name for name, unit in (("force", force), ("motion", motion)) if unit == "1")
    if silent:
        return f"The log states no unit for the {silent}: {wanted} (--unit, --scale)."
    return f"The force is in {force} and the motion in {motion}: {wanted} (--scale)."


def _outputs(errors: Sequence[float]) -> str:
    """Write the relative errors of a predicted response: of the driven mass, then of the other."""
    names = ("driven mass", "other mass")
    return ", ".join(f"{percent(error, 3)} ({name})" for name, error in zip(names, errors, strict=False))


def _line_numbers(line: StraightLine) -> dict[str, Any]:
    """Return a straight line fitted to a frequency response, for the document."""
    band = {"low_hz": line.low, "high_hz": line.high, **estimates_document(line, "level", "value")}
    return band | entries(line, "kind", "sign")


class FrequencyKind(ExperimentKind[Bench]):
    """Frequency responses, which show masses and joint."""

    title = "Frequency response"
    si = False
    together = True
    responses = True
    longest = True
    predicts = "one of the bench beside frequency responses"

    def analyse(self, logs: Sequence[Source], prior: Prior, settings: AnalysisSettings) -> Bench:
        """Analyse logs of one machine together, or a frequency response from another instrument."""
        (first, *_) = logs
        if not isinstance(first, Log):
            return analyse((), measured=first)
        return analyse([log for log in logs if isinstance(log, Log)])

    def estimates(self, result: Bench, stage: Stage | None) -> tuple[Estimate, ...]:
        """Return estimates of masses and joint from responses in newtons and metres.

        Estimates come from the two-mass model, if it was fitted. If only a mass line shows, where the response falls as
        of one mass, this mass is the stage's or the total, whichever is nearer. A resonance nearer to the parasitic
        mode than to the joint's mode leaves the joint's stiffness undetermined. The result is empty for other units.
        """
        units = (result.driven.channels.input_unit, result.driven.channels.output_unit)
        if units != ("N", "m"):
            return ()
        model = result.two_masses
        if model is not None and stage is not None and (mode := _parasitic(model, stage)):
            why = f"the resonance at {mode:.3g} Hz is nearer the parasitic mode than the joint's: excite below it"
            return (Estimate.unknown("joint.stiffness", "N/m", model["joint stiffness"].method, why, 0.0),)
        if (
            model is not None
            and (stage is None or stage.joint)
            and result.modes is not None
            and result.modes.shape.modes
        ):
            pairs = {"masses.stage": "driven mass", "masses.cart": "other mass"}
            pairs |= {"joint.stiffness": "joint stiffness", "joint.damping": "joint damping"}
            return tuple(replace(model[name], name=key) for key, name in pairs.items())
        if not result.lines or stage is None:
            return ()
        line = result.lines[0].value
        return (
            (replace(line, name="masses.stage"),) if _of_stage_alone(line.value, stage) else shared_masses(line, stage)
        )

    def correlated(self, result: Bench, estimates: Sequence[Estimate]) -> Correlated:
        """Return the estimates that have a value, with their correlations.

        Masses that are parts of one sum are fully correlated.
        """
        certain = determined(estimates)
        if all(estimate.name.startswith("masses.") for estimate in estimates):
            return certain, np.ones((len(certain), len(certain)))
        return super().correlated(result, estimates)

    def claims(self, course: Course) -> str | None:
        """Return why a log shows a periodic excitation of a stage whose reference stands, or None.

        The motion of such a log hardly rests, contains many frequencies, and turns often.
        """
        repetition = None if course.reference_moves else course.repetition
        if repetition is None or repetition.rests > RESTS_OF_MOVES:
            return None
        if repetition.harmonics < HARMONICS_OF_AN_EXCITATION or repetition.turns < repetition.harmonics:
            return None
        return f"{course.repeats}, with about {repetition.harmonics:.0f} harmonics"

    def predict(self, result: Bench, log: Log, prior: Prior, settings: AnalysisSettings) -> tuple[float, ...]:
        """Return the relative prediction errors of another log's outputs, the driven mass first."""
        return predicted(result, log)

    def facts(self, result: Bench) -> Facts:
        """List mass lines, modes, masses and joint, friction, and how one log predicts the other."""
        facts = [("Band of the models", range_with_unit(*result.band, "Hz"))]
        for line in result.lines:
            place = _place(line)
            facts.append(
                (place[0].upper() + place[1:], f"{with_interval(line.value)}; level {with_interval(line.level)}")
            )
        facts += [
            (name_of(estimate.name), with_interval(estimate))
            for estimate in (result.modes.estimates if result.modes else ())
        ]
        facts += [
            (f"Two masses: {estimate.name}", with_interval(estimate))
            for estimate in (result.two_masses.estimates if result.two_masses else ())
        ]
        if result.departs is not None:
            facts.append(("Departs from the linear model below", with_interval(result.departs.frequency)))
        facts += [(f"{log}, predicted by another log", _outputs(errors)) for log, errors in result.aside]
        return tuple(facts)

    def sentences(self, result: Bench) -> tuple[str, ...]:
        """Say what the response shows, and where it is not linear."""
        sentences = [f"{text[0].upper()}{text[1:]}." for text in (result.seen.words[-1:] if result.seen else ())]
        if result.departs is not None and result.departs.frequency.determined:
            below = digits(result.departs.frequency.value, "Hz")
            sentences.append(f"Below about {below} the response departs from the linear model.")
        return tuple(sentences)

    def headline(self, result: Bench) -> str:
        """Say which masses and modes a response shows, and which units the stage file still needs."""
        sentences = []
        names = ("total mass", "antiresonance frequency", "resonance frequency")
        if result.two_masses is not None:
            sentences = [f"{name} {with_interval(result.two_masses[name])}" for name in names]
        else:
            sentences = [f"{_place(line)} {with_interval(line.value)}" for line in result.lines]
            modes = result.modes.estimates if result.modes is not None else ()
            sentences += [f"{estimate.name} {with_interval(estimate)}" for estimate in modes if estimate.unit == "Hz"]
        units = result.driven.channels.input_unit, result.driven.channels.output_unit
        seen = f"Frequency response: {'; '.join(sentences)}." if sentences else ""
        if units == ("N", "m"):
            return seen
        return f"{seen} {_without_units(*units)}".strip()

    def numbers(self, result: Bench) -> dict[str, Any]:
        """Return the results of an analysed frequency response for the JSON document."""
        channels = result.driven.channels
        return {
            "input": {"name": channels.input, "unit": channels.input_unit},
            "output": {"name": channels.output, "unit": channels.output_unit},
            "estimator": result.driven.kind,
            "lines": len(result.driven.frequency),
            "band_hz": list(result.band),
            "mass_lines": [_line_numbers(line) for line in result.lines],
            "modes": [estimate_document(estimate) for estimate in result.modes.estimates] if result.modes else [],
            "two_masses": [estimate_document(estimate) for estimate in result.two_masses.estimates]
            if result.two_masses
            else [],
            "case": result.seen.case or None if result.seen else None,
            "seen": list(result.seen.words) if result.seen else [],
            "departure": estimate_document(result.departs.frequency) if result.departs else None,
            "realisations_differ": result.departs.differ if result.departs else None,
            "aside": [{"log": name, "errors": list(errors)} for name, errors in result.aside],
            "warnings": list(result.warnings),
        }

    def figures(self, result: Bench, logs: Sequence[Source], name: str) -> list[Figure]:
        """Return all figures of one bench; their names begin with `name`."""
        figures = [_bode(result, name), *_levels(result, name)]
        if result.departs is not None:
            figures.append(_departure(result, name))
        return figures

    def doubts(self, result: Bench) -> Sequence[str]:
        """List the doubts about the responses in words."""
        return words_of("response", result)

    def prediction_error(self, prediction: tuple[float, ...]) -> float:
        """Return the largest relative error of the outputs."""
        return max(prediction, default=np.nan)

    def prediction_sentence(self, prediction: tuple[float, ...]) -> str:
        """Say how well the responses of another log are predicted."""
        return f"relative error of the response {_outputs(prediction)}."

    def prediction_numbers(self, prediction: tuple[float, ...]) -> dict[str, Any]:
        """Return the relative errors of the outputs, for the document."""
        return {"response_errors": list(prediction)}


KIND = FrequencyKind()
