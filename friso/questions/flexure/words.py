"""Describe leaf springs: their properties, the crossover and stroke they allow, and dangers.

The table names each quantity, and has its text for each model. `friso flexure` has one block, with the drawing of the
leaf springs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

from friso.leaf_springs.beams import BothModels
from friso.leaf_springs.mechanism import AXES, STANDARD_GRAVITY, Evaluation, Mode
from friso.quantities import percent
from friso.questions.flexure.figures import COLOURS, flexure_figures
from friso.shown.blocks import AnswerBlock
from friso.shown.documents import entries, plain_json
from friso.shown.drawing.figure import GREEN, VERMILLION, Category
from friso.shown.text import NOTHING, listed, with_unit
from friso.stage import Stage

INTERFERES = "interferes"
"""Label of a mode that disturbs control: both actuator and sensor couple to it."""

UNKNOWN = "unknown"
"""Text in place of an unknown property of the material."""


def rows(flexure: BothModels) -> list[tuple[str, list[str]]]:
    """Return the rows: stiffnesses, eigenfrequencies, and the loads that the leaves can bear."""
    models = list(flexure.models.values())
    above, below = (
        [(name, [text(evaluation) for evaluation in models]) for name, text in part.items()]
        for part in (_STIFF, _BORNE)
    )
    return [*above, *_modes(flexure), *below]


def newtons_per(value: float, length: str) -> str:
    """Write a stiffness [N/m] per `length`: "mm" for drives or "µm" for supports, as is usual."""
    return f"{_plain(value / {'mm': 1e3, 'µm': 1e6}[length])} N/{length}"


def megapascals(value: float) -> str:
    """Write a stress [Pa] in MPa."""
    return f"{_plain(value / 1e6)} MPa" if math.isfinite(value) else UNKNOWN


def margin_factor(value: float) -> str:
    """Write a margin as a factor: "2.5 times"; unknown if it is not finite."""
    return f"{_plain(value)} times" if math.isfinite(value) else UNKNOWN


def _plain(value: float) -> str:
    """Write a number to three digits without a unit."""
    return with_unit(value, "").strip()


def _modes(flexure: BothModels) -> list[tuple[str, list[str]]]:
    """Return a row for each mode that a model knows, in the order of frequency.

    The drive mode comes first: the stage moves along the direction in which it is driven.
    """
    named = [(evaluation, evaluation.named_modes) for evaluation in flexure.models.values()]
    frequencies: dict[str, float] = {}
    for _, modes in named:
        frequencies = {name: mode.frequency for name, mode in modes.items()} | frequencies
    drive = next(iter(named[0][1]))
    names = [drive, *sorted(frequencies.keys() - {drive}, key=frequencies.__getitem__)]
    return [(f"Mode: {name}", [_mode(evaluation, modes.get(name)) for evaluation, modes in named]) for name in names]


def _mode(evaluation: Evaluation, mode: Mode | None) -> str:
    """Write the frequency of a mode, and whether it interferes with control."""
    if mode is None:
        return NOTHING
    return with_unit(mode.frequency, "Hz") + (f" ({INTERFERES})" if evaluation.interferes(mode) else "")


_STIFF: dict[str, Callable[[Evaluation], str]] = {
    "Drive stiffness": lambda evaluation: newtons_per(evaluation.drive[0], "mm"),
    "Drive stiffness under the load": lambda evaluation: newtons_per(evaluation.loaded_drive, "mm"),
    "Deviation from linear over the stroke": lambda evaluation: percent(evaluation.nonlinearity),
    "Support stiffness x, straight": lambda evaluation: newtons_per(evaluation.support_x[0], "µm"),
    "Support stiffness x, at full stroke": lambda evaluation: newtons_per(evaluation.support_x[-1], "µm"),
    "Support stiffness y, straight": lambda evaluation: newtons_per(evaluation.support_y[0], "µm"),
    "Support stiffness y, at full stroke": lambda evaluation: newtons_per(evaluation.support_y[-1], "µm"),
}
_BORNE: dict[str, Callable[[Evaluation], str]] = {
    "Largest stress at full stroke": lambda evaluation: megapascals(evaluation.stress),
    "Concentration factor at the clamp": lambda evaluation: f"{evaluation.mechanism.stress_concentration:g}",
    "Stress at the clamp": lambda evaluation: megapascals(evaluation.clamp_stress),
    "Margin to yield": lambda evaluation: margin_factor(evaluation.yield_margin),
    "Margin to fatigue": lambda evaluation: margin_factor(evaluation.fatigue_margin),
    "Shortening at full stroke": lambda evaluation: with_unit(evaluation.shortening, "m"),
    "Buckling load": lambda evaluation: with_unit(evaluation.buckling, "N"),
    "Buckling load over the load": lambda evaluation: margin_factor(evaluation.buckling_margin),
}


CROSSOVER_RULE = 0.1
"""Highest crossover, relative to the first interfering frequency (thesis, Section 5)."""

MODELS_AGREE = 0.1
"""Relative difference of the models above which it is mentioned."""


def sentences(flexure: BothModels) -> list[str]:
    """Return all sentences on the leaf springs: what they can do, warnings, and assumptions."""
    joint, *further = findings(flexure)
    return [joint, *warnings(flexure), *further, *assumptions(flexure.stage)]


def findings(flexure: BothModels) -> list[str]:
    """Describe the joint, the crossover that it allows, and the stroke that fatigue allows."""
    return [_joint(flexure.best), _control(flexure.best), _endurance(flexure.best)]


def warnings(flexure: BothModels) -> list[str]:
    """Return warnings on everything that is wrong with the leaf springs."""
    failed = f"The beam model found no solution: {flexure.failure.rstrip('.')}. All results are from the closed forms."
    return [
        *([failed] if flexure.beams is None else []),
        *_borne(flexure.best),
        *_loaded(flexure.best),
        *_breaks_away(flexure),
        *_against(flexure.best),
        *_differences(flexure),
    ]


def assumptions(stage: Stage) -> list[str]:
    """Say what is assumed for keys that the stage file leaves out; empty if it leaves out none."""
    flat = stage.flat()
    parts = []
    if "flexure.centre_x" not in flat:
        parts.append("centre of mass in the middle of the leaf ends")
    if not all(f"flexure.inertia_{axis}" in flat for axis in AXES):
        block = f"an aluminium block of {flat['masses.stage']:g} kg"
        parts.append(f"moments of inertia of {block} that reaches from leaf to leaf")
    points = []
    for point, place in (("actuation", "the centre of mass of the stage"), ("sensor", "the point of actuation")):
        if f"flexure.{point}_x" not in flat:
            partly = any(f"flexure.{point}_{axis}" in flat for axis in AXES)
            points.append(f"{point}{' along x' if partly else ''} at {place}")
    parts += [", ".join(points)] if points else []
    if "flexure.load" not in flat:
        parts.append("no load on the leaves, except the weight of the stage for the buckling margin")
    return [f"Assumed, since [flexure] does not say: {'; '.join(parts)}."] if parts else []


def _joint(evaluation: Evaluation) -> str:
    """Describe the leaves: their sizes, drive stiffness, and force at full stroke.

    The drive direction is that of the motion. Also given are the stage's frequency with the cart held, and how far the
    force deviates from linear.
    """
    mechanism, drive = evaluation.mechanism, evaluation.modes[0]
    return (
        f"The joint: {mechanism.leaves:g} leaves of {_size(mechanism.length)} x {_size(mechanism.width)} x "
        f"{_size(mechanism.thickness)} mm, {newtons_per(evaluation.drive[0], 'mm')}; with the cart held the stage of "
        f"{mechanism.body.mass:g} kg swings at {with_unit(drive.frequency, 'Hz')}. Over {_stroke(evaluation)} the "
        f"force deviates from linear by {percent(evaluation.nonlinearity)} and takes "
        f"{with_unit(evaluation.forces[-1], 'N')} at its end."
    )


def _control(evaluation: Evaluation) -> str:
    """Name the first mode that interferes with control, and the crossover that it allows."""
    first = evaluation.interfering
    if first is None:
        return (
            f"None of the {len(evaluation.modes) - 1} known modes above the drive mode is seen by both "
            f"actuator and sensor (highest: {with_unit(evaluation.modes[-1].frequency, 'Hz')}); the leaves set no "
            "limit to the crossover."
        )
    return (
        f"The first mode that interferes with control is {first.name}, at {with_unit(first.frequency, 'Hz')}: by the "
        "thesis's rule (ten times the crossover) the crossover may be up to "
        f"{with_unit(CROSSOVER_RULE * first.frequency, 'Hz')}."
    )


def _endurance(evaluation: Evaluation) -> str:
    """Write the stress at the clamp, and the stroke that fatigue allows."""
    bent = f"The stress at the clamp is {megapascals(evaluation.clamp_stress)} at full stroke"
    if math.isnan(evaluation.fatigue_margin):
        return f"{bent}; the fatigue limit is not known (flexure.fatigue), so neither is the largest stroke."
    largest = with_unit(evaluation.stroke * evaluation.fatigue_margin, "m")
    half = with_unit(evaluation.mechanism.length / 2, "m")
    bounds = f" A stroke of more than half the length, {half}, is beyond both models."
    beyond = bounds if evaluation.stroke * evaluation.fatigue_margin > evaluation.mechanism.length / 2 else ""
    return (
        f"{bent}, and the fatigue limit is {megapascals(evaluation.mechanism.fatigue)}: "
        f"fatigue allows a stroke of about {largest}.{beyond}"
    )


def _borne(evaluation: Evaluation) -> list[str]:
    """Warn of stresses and loads beyond what the leaves bear."""
    lines, mechanism = [], evaluation.mechanism
    if evaluation.yield_margin < 1:
        lines.append(
            f"The leaves yield: {megapascals(evaluation.clamp_stress)} at the clamp at {_stroke(evaluation)}, but the "
            f"material bears {megapascals(mechanism.yield_strength)}. Longer or thinner leaves, or a smaller stroke, "
            "would remedy this."
        )
    elif evaluation.fatigue_margin < 1:
        lines.append(
            f"The leaves fail by fatigue: {megapascals(evaluation.clamp_stress)} at the clamp at "
            f"{_stroke(evaluation)}, above the fatigue limit of {megapascals(mechanism.fatigue)}. Longer or thinner "
            "leaves, or a smaller stroke, would remedy this."
        )
    if evaluation.buckling_margin < 1:
        lines.append(
            f"A stage standing on its leaves would buckle them: it weighs {with_unit(mechanism.weight, 'N')} "
            f"(g = {STANDARD_GRAVITY} m/s²), they bear {with_unit(evaluation.buckling, 'N')} along their length."
        )
    return lines


def _loaded(evaluation: Evaluation) -> Iterator[str]:
    """Yield how a load along the leaves changes stiffness and frequency in the drive direction.

    Nothing is yielded without a load.
    """
    load = float(evaluation.mechanism.load)
    if not load:
        return
    first = evaluation.modes[0].frequency * math.sqrt(max(evaluation.loaded_drive / evaluation.drive[0], 0.0))
    close = f" That is {evaluation.buckling_margin:.2g} times below buckling, so the stiffness depends on it strongly."
    yield (
        f"Under the load of {with_unit(load, 'N')} along the leaves the drive stiffness is "
        f"{newtons_per(evaluation.loaded_drive, 'mm')} and the drive mode at {with_unit(first, 'Hz')}; all other "
        f"results are without it.{close if load > 0 else ''}"
    )


def _breaks_away(flexure: BothModels) -> Iterator[str]:
    """Yield that the cart breaks away inside the stroke, because the leaves push too hard.

    Nothing is yielded if static friction holds the cart, or is not known.
    """
    static, force = flexure.stage.flat().get("friction.static"), float(flexure.best.forces[-1])
    if static is not None and force > static:
        yield (
            f"The cart breaks away inside the stroke: the leaves push with {with_unit(force, 'N')} at "
            f"{_stroke(flexure.best)}, static friction holds {with_unit(static, 'N')}. The joint can use its stroke "
            f"only up to about {with_unit(flexure.best.stroke * static / force, 'm')}."
        )


def _against(evaluation: Evaluation) -> Iterator[str]:
    """Yield modes in which the sensor moves opposite to the actuator, if there are any."""
    modes = [mode for mode in evaluation.modes if evaluation.interferes(mode) and mode.actuator * mode.sensor < 0]
    named = listed([f"{mode.name} ({with_unit(mode.frequency, 'Hz')})" for mode in modes], "and")
    if modes:
        yield (
            f"In {named} actuator and sensor move in opposite directions. A controller cannot damp that by phase, and "
            "[parasitic], which describes only the size of a mode, makes the loop look better than it is: actuate and "
            "measure at the same point."
        )


def _differences(flexure: BothModels) -> Iterator[str]:
    """Yield where the two models differ so much that the closed forms do not apply.

    Nothing is yielded if they agree, or if the beam model found no solution.
    """
    beams = flexure.beams or flexure.closed
    shares = {name: get(flexure.closed) / get(beams) - 1 for name, get in _COMPARED.items()}
    far = [f"{name} by {percent(share, signed=True)}" for name, share in shares.items() if abs(share) > MODELS_AGREE]
    if far:
        yield (
            f"The closed forms differ from the beam model in {listed(far, 'and')}: there the leaves are outside the "
            "range of the closed forms, and the beam model applies."
        )


_COMPARED: Mapping[str, Callable[[Evaluation], float]] = {
    "drive stiffness": lambda evaluation: float(evaluation.drive[0]),
    "force at full stroke": lambda evaluation: float(evaluation.forces[-1]),
    "support stiffness x": lambda evaluation: float(evaluation.support_x[0]),
    "support stiffness x at full stroke": lambda evaluation: float(evaluation.support_x[-1]),
    "support stiffness y": lambda evaluation: float(evaluation.support_y[0]),
    "support stiffness y at full stroke": lambda evaluation: float(evaluation.support_y[-1]),
    "drive frequency": lambda evaluation: evaluation.modes[0].frequency,
    "first interfering frequency": lambda evaluation: (
        evaluation.interfering.frequency if evaluation.interfering else math.nan
    ),
    "stress": lambda evaluation: evaluation.stress,
    "buckling load": lambda evaluation: evaluation.buckling,
}


def _stroke(evaluation: Evaluation) -> str:
    """Write the stroke with its unit: "a stroke of 1 mm"."""
    return f"a stroke of {with_unit(evaluation.stroke, 'm')}"


def _size(length: float) -> str:
    """Write a length [m] in mm as it stands on a drawing."""
    return f"{1e3 * length:.4g}"


def basis(flexure: BothModels) -> str:
    """Say by which models the leaf springs were evaluated."""
    return (
        ": geometrically exact beams, corrected for what clamps do to a wide leaf, and closed forms (Soemers, Design "
        "Principles for Precision Mechanisms; Awtar, Slocum and Sevincer, doi:10.1115/1.2717231). Modes with the cart "
        "held and the leaves straight; a mode interferes with control where actuator and sensor both see it. The "
        "drawing is no substitute for one with tolerances"
    )


def blocks(flexure: BothModels) -> list[AnswerBlock]:
    """Return the block of the answer; what the joint can do is green, and warnings are red."""
    block = AnswerBlock(
        title=flexure.stage.name,
        sentences=sentences(flexure),
        colours=[GREEN, *(VERMILLION for _ in warnings(flexure))],
        columns=[Category(name, COLOURS[name]) for name in flexure.models],
        rows=rows(flexure),
        draw=partial(flexure_figures, flexure),
        numbers=partial(flexure_document, flexure),
    )
    return [block]


def flexure_document(flexure: BothModels) -> dict[str, Any]:
    """Return the results of the best model, and of the closed forms for comparison."""
    head = {"conclusion": sentences(flexure)[0], "stage": flexure.stage.name, "failure": flexure.failure or None}
    return {**head, **_evaluation(flexure.best), "closed_forms": _evaluation(flexure.closed)}


def _evaluation(evaluation: Evaluation) -> dict[str, Any]:
    """Return stiffness, modes, stresses and margins by one model."""
    first = evaluation.interfering
    plain = {
        **entries(evaluation, "model", "stroke_m", "nonlinearity"),
        "drive_stiffness_n_per_m": evaluation.drive[0],
        "drive_stiffness_under_load_n_per_m": evaluation.loaded_drive,
        "drive_stiffness_at_stroke_n_per_m": evaluation.drive[-1],
        "support_stiffness_n_per_m": {
            axis: {"zero": support[0], "full": support[-1]}
            for axis, support in (("x", evaluation.support_x), ("y", evaluation.support_y))
        },
        "eigenfrequencies_hz": [mode.frequency for mode in evaluation.modes],
        "names": [mode.name for mode in evaluation.modes],
        "interferes": [evaluation.interferes(mode) for mode in evaluation.modes],
        "first_interfering_hz": None if first is None else first.frequency,
        "max_stress_pa": evaluation.stress,
        "stress_concentration": evaluation.mechanism.stress_concentration,
        **entries(evaluation, "yield_margin", "fatigue_margin", "shortening_m", "buckling_margin"),
        "buckling_load_n": evaluation.buckling,
        "buckling_load_per_leaf_n": evaluation.buckling / evaluation.mechanism.leaves,
        "stiffness_zero": evaluation.stiffness[0],
        "stiffness_full": evaluation.stiffness[1],
        **entries(evaluation, "clamp_stress_pa", "deflections_m", "forces_n"),
    }
    return {key: plain_json(value) for key, value in plain.items()}
