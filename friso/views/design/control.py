"""The controller of a design and its simulated moves in words."""

from __future__ import annotations

from friso.design.method import Design
from friso.design.verification import Outcome
from friso.frequency.crossover import WANTED
from friso.views.design.window import Bound, comfortable, lower, upper
from friso.views.design.words import (
    Step,
    hertz,
    hunting,
    percent,
    plain,
    probability,
    seconds,
    settling,
)
from friso.views.drawing.prefixes import listed

ROUNDED = 0.01
"""Share by which a crossover may stay below its bound without a word: it has three digits."""

LITTLE = 0.1
"""Share by which more joint damping has to raise the modulus margin to be worth its trouble."""


def controller_step(found: Design) -> Step:
    """The crossover, why it is no other, and the gains."""
    it = found.controller
    gains = f"Gains of a PID (kp, ki, kd): {_parallel(found)} of {plain(it.gains.tau_p, 's')}."
    faster = [_faster(found)] if found.damped else []
    said = (_not_higher(found), *faster, _not_lower(found), gains, _margin(found), _damping(found))
    figures = ("design_window", "design_damping")
    return Step(f"Controller: crossover {hertz(it.crossover)}", said, _gains(found), figures)


def _gains(found: Design) -> tuple[tuple[str, str], ...]:
    it, gains, flat = found.controller, found.controller.gains, found.stage.flat()
    window = " to ".join(map(hertz, comfortable(found)))
    return (
        ("Crossover", hertz(it.crossover)),
        (
            "Tuned for",
            f"{plain(flat['controller.tuned_mass'], 'kg')}, α = {flat['controller.alpha']:g}, "
            f"β = {flat['controller.beta']:g}",
        ),
        ("k_p", plain(gains.k_p, "N/m")),
        ("τ_z, τ_i, τ_p", ", ".join(plain(each, "s") for each in (gains.tau_z, gains.tau_i, gains.tau_p))),
        ("As gains of a PID: kp, ki, kd", _parallel(found)),
        ("Least modulus margin, as designed", f"{it.margin:.3g}"),
        ("The same over the corners", f"{it.corners.min():.3g}"),
        (f"Modulus margin above {WANTED:g}", window),
    )


def _faster(found: Design) -> str:
    """What would let the crossover be higher."""
    assert found.damped
    return (
        f"With {plain(found.damped.needed, 'N*s/m')} of joint damping instead of "
        f"{plain(found.damped.value, 'N*s/m')} it could be {hertz(found.faster)}: --set joint.damping tries it."
    )


def _parallel(found: Design) -> str:
    """The gains of Eq. 6 that act on the error low-passed with tau_p."""
    kp, ki, kd = parallel_gains(found)
    return f"{plain(kp, 'N/m')}, {plain(ki, 'N/(m*s)')}, {plain(kd, 'N*s/m')}, behind a low-pass of τ_p"


def parallel_gains(found: Design) -> tuple[float, float, float]:
    """Proportional [N/m], integral [N/(m s)] and derivative gain [N s/m] on the error behind the low-pass of tau_p."""
    it = found.controller.gains
    return it.k_p * (1 + it.tau_z / it.tau_i), it.k_p / it.tau_i, it.k_p * it.tau_z


def _not_higher(found: Design) -> str:
    bounds, crossover = upper(found), found.controller.crossover
    said = f"Not higher: it is bounded by {_listed(bounds)}."
    short = 1 - crossover / bounds[0].value
    if short < ROUNDED:
        return said
    return (
        f"{said} It stays {percent(short)} below the first of these: sizes in whole tenths of a millimetre, and "
        "their confirmation by beams take that."
    )


def _not_lower(found: Design) -> str:
    bounds = lower(found)
    if not bounds:
        return "Nothing bounds it from below, but the higher, the faster."
    return f"Not lower: from below it is bounded by {_listed(bounds)}; above these, the higher the faster."


def _listed(bounds: list[Bound]) -> str:
    return listed([f"{hertz(each.value)} ({each.reason})" for each in bounds], "and")


def _margin(found: Design) -> str:
    it = found.controller
    return (
        f"The least modulus margin of the settled states is {it.margin:.3g} as designed and {it.corners.min():.3g} "
        f"over the corners ({WANTED:g} is wanted)."
    )


def _damping(found: Design) -> str:
    it = found.controller.damping
    own, best, worth = float(it.margins[0]), float(it.margins.max()), it.worth
    now = f"with its own damping of {plain(it.tried[0], 'N*s/m')} the least modulus margin is {own:.3g}"
    if worth == 0 or best < (1 + LITTLE) * own:
        return (
            f"More damping in the joint is not worth adding: {now}, and none up to {plain(it.tried[-1], 'N*s/m')} "
            f"makes more of it than {best:.3g}."
        )
    return (
        f"Damping in the joint is worth adding: {now}, with {plain(it.tried[worth], 'N*s/m')} it is "
        f"{it.margins[worth]:.3g}; more brings little."
    )


def moves_step(found: Design) -> Step:
    """What the simulated moves show."""
    free, locked = found.verification.free, found.verification.locked
    said = [f"Of {free.tried} moves over all ranges and tolerances {hunting(free)}: {probability(free)}."]
    other = settling(locked)
    said.append(f"{settling(free)}. With the joint locked: {other[0].lower()}{other[1:]}, and {hunting(locked)}.")
    broken = len(free.completed) - free.tried
    if broken:
        said.append(f"{broken} moves could not be simulated to their end and do not count.")
    said += [_met(found), f"{_worst(free)}: worst.toml"]
    facts = (
        *(row for name, outcome in (("free", free), ("locked", locked)) for row in _outcome(name, outcome)),
        ("In position", f"within ±{plain(found.spec.position.window, 'm')} of the reference"),
    )
    title = f"Verification: {free.tried} moves, {hunting(free)}"
    return Step(title, tuple(each for each in said if each), facts, ("design_settling",))


def _met(found: Design) -> str:
    wanted, time = found.spec.position.settling_time, found.verification.free.slower_than(0.05)
    if wanted is None:
        return ""
    return f"Specified for 95 % of the moves: {seconds(float(wanted))}; that is {'' if time <= wanted else 'NOT '}met."


def _worst(outcome: Outcome) -> str:
    k = outcome.worst
    if outcome.hunts[k]:
        return f"The worst one, which swings over {plain(outcome.swing[k], 'm')}"
    return f"The worst one, which takes {seconds(float(outcome.settling[k]))} to settle"


def _outcome(name: str, it: Outcome) -> tuple[tuple[str, str], ...]:
    """The rows of one state of the joint."""
    low, high = it.interval
    return (
        (f"Joint {name}: hunting", f"{it.hunting} of {it.tried}, {percent(low)} to {percent(high)}"),
        (
            f"Joint {name}: settling, median and 95 %",
            f"{seconds(it.slower_than(0.5))}, {seconds(it.slower_than(0.05))}",
        ),
    )
