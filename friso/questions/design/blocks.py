"""Explain a design step by step: what was decided, with which numbers, and why.

`friso design` has one block, and writes stage files.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from friso.design_method.method import SLOW_SHARE, Design, NoDesign, UnfinishedDesign
from friso.design_method.requirements import Candidate, Confirmed, RelaxableKey, Relaxation, Requirement
from friso.design_method.spec import Geometry
from friso.design_method.verification import Corners, MachineOutcomes
from friso.equations.controllers.pid import ALPHA, BETA, CROSSOVER, TUNED_MASS
from friso.frequency.bode import COMFORTABLE_MARGIN
from friso.quantities import percent, plain_factor
from friso.questions.design import words
from friso.questions.design.figures import design_figures
from friso.questions.design.words import (
    CrossoverBound,
    DesignStep,
    comfortable,
    hertz,
    lower,
    need_words,
    refusal,
    seconds,
    size,
    so_far,
    trimmed,
    upper,
    verdicts,
)
from friso.questions.flexure.words import assumptions, megapascals, newtons_per
from friso.shown.blocks import AnswerBlock, Content
from friso.shown.documents import entries, plain_json, unit_suffix
from friso.shown.text import listed, unknown_condition
from friso.stage import Stage


def steps(design: Design) -> tuple[DesignStep, ...]:
    """Return all steps of the design method in order, each with its result and reasons."""
    return isolator_step(design), joint_step(design), leaves_step(design), controller_step(design), moves_step(design)


def isolator_step(design: Design) -> DesignStep:
    """Return the step that decides whether an isolator is needed."""
    corners, flat = design.without, design.original.flat()
    sentences = [f"Without an isolator the machine {words.edge(corners)}.", *_worst(corners, design)]
    if not design.needed:
        sentences.append(words.brings(design))
    losses = words.gaps(corners, flat)
    lost = [] if losses is None else [("Static less Coulomb friction", f"{losses.min():.3g} to {losses.max():.3g} N")]
    searched = ("Crossovers searched", " to ".join(map(hertz, corners.searched)))
    facts = [("Corners of friction and masses", str(corners.population.count)), searched, *lost]
    answer = "yes" if design.needed else "no"
    return DesignStep(f"Is an isolator needed: {answer}", tuple(sentences), tuple(facts), ())


def joint_step(design: Design) -> DesignStep:
    """Return the step that chooses stiffness and stroke of the joint."""
    task, beams, safety = design.fitted.task, design.fitted.choice.beams, design.spec.safety
    allowed = task.friction / safety.breakaway / (1 + safety.stiffness_tolerance)
    stiffness, force = newtons_per(beams.drive[0], "mm"), trimmed(beams.forces[-1], "N")
    held = (
        f"At full stroke the joint exerts {force}. The cart breaks away at no less than "
        f"{trimmed(task.friction, 'N')}; with the safety factor of {safety.breakaway:g} and a stiffness error of "
        f"{percent(safety.stiffness_tolerance)} that allows {allowed:.3g} N, so that it stays stuck inside the stroke."
    )
    sentences = [
        held,
        _stroke(design),
        f"With this joint the machine {words.edge(design.edges)}.",
        *_worst(design.edges, design),
    ]
    joint = design.stage.flat()
    facts = (
        ("Deviation from linear over the stroke", f"{percent(beams.nonlinearity)}"),
        (
            "Limiter, beside the joint when touched",
            f"{trimmed(joint['joint.limiter_stiffness'], 'N/m')}, "
            f"{trimmed(joint['joint.limiter_damping'], 'N*s/m')} (as given)",
        ),
    )
    return DesignStep(f"Joint: {stiffness}, stroke {size(task.stroke)} mm", tuple(sentences), facts, ("design_map",))


def _stroke(design: Design) -> str:
    """Say why the joint has this stroke: because of the specification or of the leaf springs."""
    stroke, allowed = design.fitted.task.stroke, design.spec.leaves.stroke
    if allowed.low == allowed.high:
        return f"The stroke of {size(stroke)} mm is as specified."
    if stroke == allowed.high:
        return (
            f"The stroke is the largest specified, {size(stroke)} mm: the larger it is, the less often the limiter is "
            "touched."
        )
    return (
        f"The stroke is {size(stroke)} mm, of {size(allowed.low)} to {size(allowed.high)} mm: with a larger one the "
        "leaves would have to be so soft that they allow only a lower crossover, or no leaves would do."
    )


def _worst(corners: Corners, design: Design) -> list[str]:
    """Name the worst corner of friction and masses, and how many corners have an uncertain edge."""
    sentences = []
    if corners.hunts:
        count = corners.population.count
        sentences.append(f"Worst of {count} corners: {words.corner(corners, design.stage.flat(), corners.worst)}.")
    if corners.unknown:
        sentences.append(
            f"In {corners.unknown} of {corners.population.count} corners the edge is not certain: simulations below it "
            "failed or had not settled when they were stopped, which counts as hunting, or something may attract above "
            "it that no simulation starts from."
        )
    return sentences


BINDING_SHARE = 0.95
"""Fraction of a requirement's bound from which the requirement is called binding."""


def leaves_step(design: Design) -> DesignStep:
    """Return the step that chooses the leaf springs, with reasons."""
    sentences = (_interfering(design), _strength(design), _why(design), _confirmed(design), *assumptions(design.stage))
    figures = ("design_front", "design_drawing", "design_modes")
    return DesignStep(f"Leaf springs: {words.leaves(design)}", sentences, _numbers(design), figures)


def requirement_rows(design: Design) -> list[tuple[str, str, str, str]]:
    """Return a row for each requirement: its name, the keys that relax it, and their values.

    The last text of a row is the fraction of the requirement that the leaves use up.
    """
    choice = design.fitted.choice
    return [
        (
            requirement.name,
            _keys(requirement, lambda relaxable: relaxable.key),
            _keys(requirement, lambda relaxable: trimmed(relaxable.value, relaxable.unit)),
            f"{percent(share, 3)}{', binds' if share > BINDING_SHARE else ''}",
        )
        for requirement, share in zip(choice.requirements, choice.excess, strict=True)
    ]


def _keys(requirement: Requirement, text: Callable[[RelaxableKey], str]) -> str:
    """Describe by `text` each key whose change relaxes a requirement, and join the descriptions."""
    return ", ".join(map(text, requirement.keys))


def _numbers(design: Design) -> tuple[tuple[str, str], ...]:
    """Return load, support stiffness and shortening of the leaf springs by name."""
    beams = design.fitted.choice.beams
    support = f"{newtons_per(beams.support_x[-1], 'µm')}, {newtons_per(beams.support_y[-1], 'µm')}"
    return (
        ("Load along the leaves, weight included", f"{design.fitted.task.load:.3g} N"),
        ("Support stiffness at full stroke, x and y", support),
        ("Shortening at full stroke", trimmed(beams.shortening, "m")),
    )


def _interfering(design: Design) -> str:
    """Name the first mode that interferes with control, and its distance from the crossover."""
    choice, multiple = design.fitted.choice, design.spec.safety.parasitic
    mode = choice.beams.interfering
    if mode is None:
        return f"None of the modes considered interferes with control ({multiple:g} times the crossover is required)."
    return (
        f"The first mode that interferes with control is {mode.name}, at {hertz(mode.frequency)}: "
        f"{plain_factor(mode.frequency / design.controller.crossover)} times the crossover ({multiple:g} required)."
    )


def _strength(design: Design) -> str:
    """Write stress, strength margins and buckling load, with what is required."""
    beams, load, safety = design.fitted.choice.beams, design.fitted.task.load, design.spec.safety
    margin = beams.buckling / load
    numbers = {
        "stress": megapascals(beams.clamp_stress),
        "yield": f"{beams.yield_margin:.3g}",
        "strength": f"{safety.strength:g}",
        "fatigue": _factor(beams.fatigue_margin),
        "endurance": f"{safety.fatigue:g}",
        "load": trimmed(beams.buckling, "N"),
        "margin": plain_factor(margin),
        "carried": f"{load:.3g}",
        "buckling": f"{safety.buckling:g}{', met by the closed forms' if margin < safety.buckling else ''}",
    }
    return _STRENGTH[math.isnan(beams.fatigue_margin)].format_map(numbers)


_BUCKLE = " The leaves buckle at {load}, {margin} times the {carried} N that they carry ({buckling} required)."
_STRENGTH = {
    True: (
        "With the stroke alone, the stress at the clamps is {stress}, {yield} times below yield ({strength} required)."
        f"{_BUCKLE}"
    ),
    False: (
        "With the stroke alone, the stress at the clamps is {stress}, {yield} times below yield and {fatigue} below "
        f"fatigue ({{strength}} and {{endurance}} required).{_BUCKLE}"
    ),
}
"""Sentences on the strength of the leaves: is their fatigue unknown?"""


def _why(design: Design) -> str:
    """Say which requirements led to these leaves."""
    choice = design.fitted.choice
    binding = [
        requirement.name
        for requirement, share in zip(choice.requirements, choice.excess, strict=True)
        if share > BINDING_SHARE
    ]
    chosen = "They are the softest on the front that allow this crossover"
    if not binding:
        return f"{chosen}; no requirement is binding except space and available thicknesses."
    return f"{chosen}; binding requirements (less than 5 % to spare): {listed(binding, 'and')}."


def _confirmed(design: Design) -> str:
    """Say how many leaf springs the beam model confirms, and how many softer ones it rules out."""
    confirmed = sum(not confirmation.failure for confirmation in design.confirmed)
    passed = len(design.fitted.choice.passed_over)
    text = f"The beam model confirms {confirmed} of {len(design.confirmed)} geometries tried on the front"
    return f"{text}; {passed} softer ones failed in it and were skipped." if passed else f"{text}."


def _factor(value: float) -> str:
    """Write a margin as a factor; "unknown" if it is not finite."""
    return f"{plain_factor(value)} times" if np.isfinite(value) else "unknown"


BOUND_ROUNDING = 0.01
"""Relative distance of a crossover from its bound that is rounding, since crossovers have three digits."""

LEAST_MARGIN_GAIN = 0.1
"""Least relative gain of modulus margin for which more joint damping is recommended."""


def controller_step(design: Design) -> DesignStep:
    """Return the step that chooses the crossover and the gains, with reasons."""
    controller = design.controller
    gains = f"Gains of a PID (kp, ki, kd): {_parallel(design)}."
    faster = [_faster(design)] if design.damped else []
    sentences = (_not_higher(design), *faster, _not_lower(design), gains, _damping(design))
    figures = ("design_window", "design_damping")
    return DesignStep(f"Controller: crossover {hertz(controller.crossover)}", sentences, _gains(design), figures)


def _gains(design: Design) -> tuple[tuple[str, str], ...]:
    """Return the numbers of the controller by name."""
    controller, gains, flat = design.controller, design.controller.gains, design.stage.flat()
    window = " to ".join(map(hertz, comfortable(design)))
    return (
        ("Tuned for", f"{trimmed(flat[TUNED_MASS], 'kg')}, α = {flat[ALPHA]:g}, β = {flat[BETA]:g}"),
        ("k_p", trimmed(gains.k_p, "N/m")),
        ("τ_z, τ_i, τ_p", ", ".join(trimmed(time, "s") for time in (gains.tau_z, gains.tau_i, gains.tau_p))),
        ("Least modulus margin, as designed", f"{controller.margin:.3g}"),
        ("The same over the corners", f"{controller.corners.min():.3g}"),
        (f"Modulus margin above {COMFORTABLE_MARGIN:g}", window),
    )


def _faster(design: Design) -> str:
    """Say how high the crossover could be with more joint damping, and with how much."""
    assert design.damped
    return (
        f"With {trimmed(design.damped.needed, 'N*s/m')} of joint damping instead of "
        f"{trimmed(design.damped.value, 'N*s/m')} it could be {hertz(design.faster)}: --set joint.damping tries it."
    )


def _parallel(design: Design) -> str:
    """Write the gains of Eq. 6 (thesis) in parallel form: a PID on the error, and its low-pass."""
    kp, ki, kd, tau = design.controller.gains.parallel.values()
    gains = f"{trimmed(kp, 'N/m')}, {trimmed(ki, 'N/(m*s)')}, {trimmed(kd, 'N*s/m')}"
    return f"{gains}, with a low-pass filter of time constant τ_p = {trimmed(tau, 's')}"


def _not_higher(design: Design) -> str:
    """Say what limits the crossover from above."""
    bounds, crossover = upper(design), design.controller.crossover
    text = f"Upper limits: {_bounds(bounds)}."
    short = 1 - crossover / bounds[0].value
    if short < BOUND_ROUNDING:
        return text
    return (
        f"{text} The crossover is {percent(short)} below the first of these, because sizes are rounded to tenths of a "
        "millimetre and must be confirmed by the beam model."
    )


def _not_lower(design: Design) -> str:
    """Say what limits the crossover from below."""
    bounds = lower(design)
    if not bounds:
        return "Nothing limits it from below, but a higher crossover settles faster."
    return f"Lower limits: {_bounds(bounds)}; above these, a higher crossover settles faster."


def _bounds(bounds: list[CrossoverBound]) -> str:
    """List bounds of the crossover [Hz], each with its reason."""
    return listed([f"{hertz(bound.value)} ({bound.reason})" for bound in bounds], "and")


def _damping(design: Design) -> str:
    """Say whether damping is worth adding in the joint, to raise the least modulus margin."""
    damping = design.controller.damping
    as_designed, best, worth = float(damping.margins[0]), float(damping.margins.max()), damping.worth
    now = f"with its own damping of {trimmed(damping.tried[0], 'N*s/m')} the least modulus margin is {as_designed:.3g}"
    if worth == 0 or best < (1 + LEAST_MARGIN_GAIN) * as_designed:
        return (
            f"More damping in the joint is not worth adding: {now}, and none up to "
            f"{trimmed(damping.tried[-1], 'N*s/m')} raises it above {best:.3g}."
        )
    return (
        f"Damping in the joint is worth adding: {now}, with {trimmed(damping.tried[worth], 'N*s/m')} it is "
        f"{damping.margins[worth]:.3g}; more damping adds little."
    )


def moves_step(design: Design) -> DesignStep:
    """Return the step that verifies the design in simulated moves."""
    free, locked = design.verification.free, design.verification.locked
    sentences = [
        f"Of {free.tried} moves over all ranges and tolerances {words.restless(free)}: {words.probability(free)}."
    ]
    held = f"{words.lower_first(words.settling(locked))}, and {words.restless(locked)}"
    sentences.append(f"{words.settling(free)}. Of {locked.tried} with the joint locked: {held}.")
    broken = len(free.completed) - free.tried
    if broken:
        sentences.append(f"{broken} moves could not be simulated to the end and do not count.")
    sentences += [_met(design), f"{_worst_move(free)}: worst.toml"]
    facts = (
        *(row for name, outcome in (("free", free), ("locked", locked)) for row in _outcome(name, outcome)),
        ("In position", f"within ±{trimmed(design.spec.position.window, 'm')} of the reference"),
    )
    title = f"Verification: {free.tried} moves, {words.restless(free)}"
    return DesignStep(title, tuple(sentence for sentence in sentences if sentence), facts, ("design_settling",))


def _met(design: Design) -> str:
    """Say whether the settling time meets the specification; empty if none is specified."""
    limit, time = design.spec.position.settling_time, design.verification.free.slower_than(0.05)
    if limit is None:
        return ""
    return f"Required for 95 % of the moves: {seconds(float(limit))}. {'Met' if time <= limit else 'Not met'}."


def _worst_move(outcome: MachineOutcomes) -> str:
    """Describe the worst simulated move: how far it swings or creeps, or how late it settles."""
    k = outcome.worst
    if outcome.restless[k]:
        return f"The worst move, which {outcome.words[k]} over {trimmed(outcome.swing[k], 'm')}"
    return f"The worst move, which takes {seconds(float(outcome.settling[k]))} to settle"


def _outcome(name: str, outcome: MachineOutcomes) -> tuple[tuple[str, str], ...]:
    """Return the rows on the moves with the joint in one state."""
    low, high = outcome.interval
    return (
        (
            f"Joint {name}: not at rest in position",
            f"{outcome.missed} of {outcome.tried}, {percent(low)} to {percent(high)}",
        ),
        (
            f"Joint {name}: settling, median and 95 %",
            f"{seconds(outcome.slower_than(0.5))}, {seconds(outcome.slower_than(0.05))}",
        ),
    )


LEAVES_STEP = 2
"""Number of the step that shows the drawing and the requirements."""

NOT_VERIFIED = "design-not-verified.toml"
"""Name of the stage file of an unfinished design."""


def blocks(design: Design | UnfinishedDesign) -> list[AnswerBlock]:
    """Return the block of the answer: verdicts and steps, or what is decided of an unfinished design."""
    numbers = partial(design_document, design)
    if isinstance(design, UnfinishedDesign):
        return [AnswerBlock(sentences=so_far(design), numbers=numbers)]
    colours, sentences = zip(*verdicts(design), strict=True)
    titled = [f"{step.title}: {' '.join(step.sentences)}" for step in steps(design)]
    details = [f"{number}. {text}" for number, text in enumerate(titled, 1)]
    draw = partial(design_figures, design)
    return [AnswerBlock(sentences=sentences, colours=colours, details=details, draw=draw, numbers=numbers)]


def page_values(design: Design) -> dict[str, Any]:
    """Return the steps that the page shows, with how much of each requirement is used."""
    return {
        "spec": design.spec,
        "steps": steps(design),
        "leaves": LEAVES_STEP,
        "requirements": requirement_rows(design),
    }


def further_files(design: Design) -> dict[str, Content]:
    """Return the stage files: the design, and the worst machine that was tried with it."""
    return {
        NOT_VERIFIED: None,
        "design.toml": design.stage.to_toml(),
        "worst.toml": design.verification.worst.to_toml(),
    }


def design_document(design: Design | UnfinishedDesign) -> dict[str, Any]:
    """Return the whole design except its files; what an unfinished design has not decided is null."""
    if isinstance(design, UnfinishedDesign):
        return plain_json(
            {
                "conclusion": " ".join(so_far(design)),
                "interrupted": design.interrupted,
                **dict.fromkeys(("feasible", "relax", "without", "front", "verification")),
                "stage": design.original.name,
                "spec": design.spec.name,
                "needed": design.need.isolator,
                "machine_limit_hz": design.spec.limit,
                "leaves": _sizes(design.fitted.choice.geometry),
                "joint": {"stroke_m": design.fitted.task.stroke},
                "controller": {"crossover_hz": design.stage.flat()[CROSSOVER]},
            }
        )
    document = {
        "conclusion": need_words(design.need),
        "stage": design.original.name,
        "spec": design.spec.name,
        "feasible": design.meets,
        "relax": _relax(design.unmet),
        "needed": design.needed,
        "machine_limit_hz": design.spec.limit,
        "without": _corners(design.without, design),
        "joint": _joint(design),
        "leaves": _leaves(design),
        "front": _front(design),
        "controller": _controller(design),
        "verification": _verification(design),
    }
    return plain_json(document)


def refused_document(stage: Stage, spec: str, failure: NoDesign) -> dict[str, Any]:
    """Return the reason why no design meets the specification, and what to relax."""
    conclusion = unknown_condition(stage) + refusal(failure)
    document = {"conclusion": conclusion, "stage": stage.name, "spec": spec, "feasible": False}
    document["reason"] = failure.reason
    return plain_json(document | {"relax": _relax(failure.relaxed)})


def _relax(relaxed: Sequence[Relaxation]) -> list[dict[str, Any]]:
    """Return the requirements to relax, from which value to which."""
    return [
        {**entries(relaxation, "key", "requirement", "unit"), "from": relaxation.value, "to": relaxation.needed}
        for relaxation in relaxed
    ]


def _corners(corners: Corners, design: Design) -> dict[str, Any]:
    """Return the edge of hunting at the extremes of friction and masses, and the worst of them."""
    units = {key: field.unit for key, field in design.stage.numeric_keys().items()}
    worst = corners.population.of(corners.worst)
    return {
        "hunts": corners.hunts,
        "highest_edge_hz": corners.highest if corners.hunts else None,
        "corners": corners.population.count,
        "unknown_corners": corners.unknown,
        "searched_hz": list(corners.searched),
        "edges_hz": np.where(corners.edges > 0, corners.edges, np.nan),
        "worst_corner": {f"{key.replace('.', '_')}{unit_suffix(units[key])}": value for key, value in worst.items()},
    }


def _joint(design: Design) -> dict[str, Any]:
    """Return the joint's stiffness, stroke and force, and the edge of hunting with it."""
    beams = design.fitted.choice.beams
    edges = _corners(design.edges, design)
    return {
        "stiffness_n_per_m": beams.drive[0],
        "stroke_m": design.fitted.task.stroke,
        "force_at_stroke_n": beams.forces[-1],
        "least_static_friction_n": design.fitted.task.friction,
        **edges,
    }


def _leaves(design: Design) -> dict[str, Any]:
    """Return the sizes, stiffness, stresses and margins of the leaf springs."""
    choice, beams = design.fitted.choice, design.fitted.choice.beams
    requirements = [{"name": requirement.name, "key": requirement.keys[0].key} for requirement in choice.requirements]
    return {
        **_sizes(choice.geometry),
        "drive_stiffness_n_per_m": beams.drive[0],
        "first_interfering_hz": choice.frequency,
        "max_stress_pa": beams.stress,
        **entries(beams, "clamp_stress_pa", "yield_margin", "fatigue_margin"),
        "load_n": design.fitted.task.load,
        "buckling_load_n": beams.buckling,
        "requirements": [
            {**requirement, "excess": excess} for requirement, excess in zip(requirements, choice.excess, strict=True)
        ],
        "passed_over": list(choice.passed_over),
    }


def _sizes(geometry: Geometry) -> dict[str, Any]:
    """Return the dimensions and material of leaf springs."""
    sheet = {"count": int(geometry.sheet.leaves), **entries(geometry.sheet, "thickness_m", "material")}
    return {**sheet, **entries(geometry, "length_m", "width_m", "spacing_m")}


def _front(design: Design) -> list[dict[str, Any]]:
    """Return all leaf springs on the Pareto front, with the beam model's results where computed."""
    confirmed = {confirmation.candidate: confirmation for confirmation in design.confirmed}
    return [_candidate(candidate, confirmed.get(candidate)) for candidate in design.candidates]


def _candidate(candidate: Candidate, beams: Confirmed | None) -> dict[str, Any]:
    """Return one set of leaf springs by closed forms and, if computed, by the beam model."""
    return {
        **_sizes(candidate.geometry),
        "drive_stiffness_n_per_m": candidate.stiffness,
        "frequency_hz": candidate.frequency,
        "beams_n_per_m": beams.stiffness if beams else None,
        "beams_hz": beams.frequency if beams else None,
        "failure": beams.failure or None if beams else None,
    }


def _controller(design: Design) -> dict[str, Any]:
    """Return crossover, bounds, gains and modulus margins of the controller."""
    controller, gains = design.controller, design.controller.gains
    kp, ki, kd, _ = gains.parallel.values()
    return {
        "crossover_hz": controller.crossover,
        "bounds_above_hz": [entries(bound, "value", "reason") for bound in upper(design)],
        "bounds_below_hz": [entries(bound, "value", "reason") for bound in lower(design)],
        **entries(gains, "k_p_n_per_m", "tau_z_s", "tau_i_s", "tau_p_s"),
        "kp_n_per_m": kp,
        "ki_n_per_m_s": ki,
        "kd_n_s_per_m": kd,
        "modulus_margin": controller.margin,
        "least_modulus_margin": controller.corners.min(),
        "joint_dampings_n_s_per_m": controller.damping.tried,
        "modulus_margins": controller.damping.margins,
        "joint_damping_worth_n_s_per_m": controller.damping.tried[controller.damping.worth],
    }


def _verification(design: Design) -> dict[str, Any]:
    """Return the outcome of the simulated moves with the joint free and locked."""
    verification, limit = design.verification, design.spec.position.settling_time
    met = None if limit is None else verification.free.slower_than(SLOW_SHARE) <= limit
    return {
        **_outcome_document(verification.free),
        "settling_time_met": met,
        "locked": _outcome_document(verification.locked),
    }


def _outcome_document(outcome: MachineOutcomes) -> dict[str, Any]:
    """Return how many moves fail to rest, with the probability and the settling times."""
    low, high = outcome.interval
    return {
        "moves": outcome.tried,
        "not_completed": len(outcome.completed) - outcome.tried,
        "not_at_rest": outcome.missed,
        "swinging": outcome.swinging,
        "probability_low": low,
        "probability_high": high,
        "settling_median_s": outcome.slower_than(0.5),
        "settling_95_s": outcome.slower_than(0.05),
    }
