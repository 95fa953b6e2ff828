"""Describe the controller of a design and its simulated moves in words."""

from __future__ import annotations

from friso.design_method.method import Design
from friso.design_method.verification import MachineOutcomes
from friso.equations.controllers.van_dijk import ALPHA, BETA, TUNED_MASS
from friso.frequency.crossover import WANTED
from friso.quantities import percent
from friso.questions.design.window import CrossoverBound, comfortable, lower, upper
from friso.questions.design.words import (
    DesignStep,
    hertz,
    probability,
    restless,
    seconds,
    settling,
    trimmed,
)
from friso.shown.drawing.prefixes import listed

ROUNDED = 0.01
"""Relative distance of a crossover from its bound that is rounding, since crossovers have three digits."""

LITTLE = 0.1
"""Least relative gain of modulus margin for which more joint damping is recommended."""


def controller_step(design: Design) -> DesignStep:
    """Return the step that chooses the crossover and the gains, with reasons."""
    controller = design.controller
    gains = f"Gains of a PID (kp, ki, kd): {_parallel(design)}."
    faster = [_faster(design)] if design.damped else []
    sentences = (_not_higher(design), *faster, _not_lower(design), gains, _margin(design), _damping(design))
    figures = ("design_window", "design_damping")
    return DesignStep(f"Controller: crossover {hertz(controller.crossover)}", sentences, _gains(design), figures)


def _gains(design: Design) -> tuple[tuple[str, str], ...]:
    """Return the numbers of the controller by name."""
    controller, gains, flat = design.controller, design.controller.gains, design.stage.flat()
    window = " to ".join(map(hertz, comfortable(design)))
    return (
        ("Crossover", hertz(controller.crossover)),
        ("Tuned for", f"{trimmed(flat[TUNED_MASS], 'kg')}, α = {flat[ALPHA]:g}, β = {flat[BETA]:g}"),
        ("k_p", trimmed(gains.k_p, "N/m")),
        ("τ_z, τ_i, τ_p", ", ".join(trimmed(time, "s") for time in (gains.tau_z, gains.tau_i, gains.tau_p))),
        ("As gains of a PID: kp, ki, kd", _parallel(design)),
        ("Least modulus margin, as designed", f"{controller.margin:.3g}"),
        ("The same over the corners", f"{controller.corners.min():.3g}"),
        (f"Modulus margin above {WANTED:g}", window),
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
    if short < ROUNDED:
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


def _margin(design: Design) -> str:
    """Write the least modulus margin, as designed and at the extremes of friction and masses."""
    controller = design.controller
    return (
        f"The smallest modulus margin of the settled states is {controller.margin:.3g} as designed and "
        f"{controller.corners.min():.3g} over the corners ({WANTED:g} is required)."
    )


def _damping(design: Design) -> str:
    """Say whether damping is worth adding in the joint, to raise the least modulus margin."""
    damping = design.controller.damping
    as_designed, best, worth = float(damping.margins[0]), float(damping.margins.max()), damping.worth
    now = f"with its own damping of {trimmed(damping.tried[0], 'N*s/m')} the least modulus margin is {as_designed:.3g}"
    if worth == 0 or best < (1 + LITTLE) * as_designed:
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
    sentences = [f"Of {free.tried} moves over all ranges and tolerances {restless(free)}: {probability(free)}."]
    other = settling(locked)
    held = f"{other[0].lower()}{other[1:]}, and {restless(locked)}"
    sentences.append(f"{settling(free)}. Of {locked.tried} with the joint locked: {held}.")
    broken = len(free.completed) - free.tried
    if broken:
        sentences.append(f"{broken} moves could not be simulated to the end and do not count.")
    sentences += [_met(design), f"{_worst(free)}: worst.toml"]
    facts = (
        *(row for name, outcome in (("free", free), ("locked", locked)) for row in _outcome(name, outcome)),
        ("In position", f"within ±{trimmed(design.spec.position.window, 'm')} of the reference"),
    )
    title = f"Verification: {free.tried} moves, {restless(free)}"
    return DesignStep(title, tuple(sentence for sentence in sentences if sentence), facts, ("design_settling",))


def _met(design: Design) -> str:
    """Say whether the settling time meets the specification; empty if none is specified."""
    limit, time = design.spec.position.settling_time, design.verification.free.slower_than(0.05)
    if limit is None:
        return ""
    return f"Required for 95 % of the moves: {seconds(float(limit))}. {'Met' if time <= limit else 'Not met'}."


def _worst(outcome: MachineOutcomes) -> str:
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
