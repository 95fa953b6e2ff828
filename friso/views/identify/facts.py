"""What each experiment showed, in words: a title, sentences, and its numbers by name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from friso.identify.estimate import Estimate
from friso.identify.experiments.break_away import BreakAway
from friso.identify.experiments.friction_velocity import Direction
from friso.identify.experiments.presliding import Presliding
from friso.identify.experiments.slow_sliding import SlowSliding
from friso.identify.experiments.steps import StepStiffness
from friso.identify.experiments.stick_slip import StickSlip
from friso.identify.inverse_model import InverseModel
from friso.identify.logs.log import Log
from friso.identify.method import ConstantSpeed, Experiment
from friso.identify.moves import Moves
from friso.identify.response.analysis import Bench
from friso.views.drawing.prefixes import range_with_unit
from friso.views.identify.numbers import digits, name_of, percent, with_interval, within

Facts = tuple[tuple[str, str], ...]

TITLES = {
    "moves": "Moves",
    "frequency": "Frequency response",
    "steps": "Position steps",
    "stick-slip": "Stick-slip",
    "break-away": "Break-away ramps",
    "constant-speed": "Constant speed",
    "presliding": "Motion before sliding",
    "slow-sliding": "Slow sliding",
}


@dataclass(frozen=True)
class Part:
    """An experiment: `label`, of which the names of its figures begin, title, sentences, numbers by name, warnings."""

    label: str
    title: str
    sentences: tuple[str, ...]
    facts: Facts
    warnings: tuple[str, ...]


def part_of(it: Experiment, label: str) -> Part:
    """An experiment in words."""
    title = f"{TITLES[it.kind]}: {', '.join(log.name for log in it.logs)}"
    sentences, facts, warnings = _told(it.result)
    return Part(label, title, sentences, (*facts, *_used(it)), warnings)


def _used(it: Experiment) -> Facts:
    """How much is used of logs with gaps, where an analysis takes the longest stretch without any."""
    gapped = [each for each in it.logs if isinstance(each, Log) and len(each.segments) > 1]
    if not isinstance(it.result, Moves | Bench) or not gapped:
        return ()
    longest = [max(part.stop - part.start for part in each.segments) for each in gapped]
    texts = [f"{most} of {len(each.time)}" for most, each in zip(longest, gapped, strict=True)]
    return (("Samples used (longest stretch without gaps)", ", ".join(texts)),)


def _told(result: object) -> tuple[tuple[str, ...], Facts, tuple[str, ...]]:
    """Sentences, numbers by name, warnings."""
    if isinstance(result, Moves):
        return moves_sentences(result), moves_facts(result), ()
    if isinstance(result, Bench):
        return bench_sentences(result), bench_facts(result), result.warnings
    if isinstance(result, StepStiffness):
        return _steps(result)
    if isinstance(result, StickSlip):
        return _stick_slip(result)
    if isinstance(result, BreakAway):
        return _break_away(result)
    if isinstance(result, Presliding):
        return _presliding(result)
    if isinstance(result, SlowSliding):
        return _slow_sliding(result)
    assert isinstance(result, ConstantSpeed)
    return _constant(result)


def moves_sentences(it: Moves) -> tuple[str, ...]:
    """How it was fitted, and what the motion covers."""
    low, high = it.covered.gap
    along = "the machine was simulated along the position of the log: what is compared is the force that it takes."
    if it.fit.problem.closed:
        how = "The machine was simulated in its own loop, on the reference of the log."
    elif it.loop is not None:
        how = f"In its own loop the simulated machine gets out of step with the log. For the fit, {along}"
    else:
        how = f"{along[0].upper()}{along[1:]}"
    if not it.covered.steady.size:
        return how, "The motion is nowhere steady for long enough to show friction at a speed."
    gap = range_with_unit(low, high, "m/s")
    return (
        how,
        f"The widest range of speeds without steady motion is {gap}: of friction there, the record says nothing.",
    )


def moves_facts(it: Moves) -> Facts:
    """Both fits of the inverse model, the errors of the output-error fit, and what is left."""
    left = it.residual
    alike = (
        "neighbouring samples do not resemble each other"
        if left.white
        else (f"alike over {digits(left.correlation_time, 's')}")
    )
    return (
        ("Inverse model", _inverse(it.inverse)),
        ("Inverse model, per direction", _inverse(it.by_direction)),
        ("Bandwidth of the motion", digits(it.inverse.bandwidth, "Hz")),
        ("Relative errors of the simulation", moves_errors(it)),
        ("Force left unexplained", f"{digits(left.rms, 'N')} (root mean square), {alike}"),
        ("Of its power, the mean explains", f"{percent(left.by_position)} over places along the rail, "
         f"{percent(left.by_velocity)} over speeds"),
    )  # fmt: skip


def moves_errors(it: Moves) -> str:
    """The relative errors of the simulated record; along the log's position, that of the force alone says anything."""
    errors = it.errors
    if it.loop is None:
        return f"force {percent(errors.force)}"
    return (
        f"position {percent(errors.position)}, velocity {percent(errors.velocity)}, acceleration "
        f"{percent(errors.acceleration)}, force {percent(errors.force)}"
    )


def _inverse(it: InverseModel) -> str:
    return f"{_listed(it.estimates)}; force error {percent(it.error)}"


def _listed(several: Sequence[Estimate]) -> str:
    return ", ".join(f"{within(each.name)} {with_interval(each)}" for each in several)


def bench_sentences(it: Bench) -> tuple[str, ...]:
    """What the response shows, and whether friction explains its lower end."""
    said = [f"{text[0].upper()}{text[1:]}." for text in (it.seen.words[-1:] if it.seen else ())]
    if it.departs is not None and it.departs.frequency.shown:
        below = digits(it.departs.frequency.value, "Hz")
        said.append(f"Below about {below} the response leaves the linear model.")
        said += [_friction(it)] if it.explanation is not None else []
    return tuple(said)


def _friction(it: Bench) -> str:
    """Whether a simulation with friction explains the departure."""
    assert it.explanation is not None
    share = 1 - it.explanation.left
    verb = "explains" if share > 0.5 else "does not explain"
    accounted = percent(max(share, 0.0))
    return f"A simulated mass with Coulomb friction on a spring {verb} it: {accounted} of it is accounted for."


def bench_facts(it: Bench) -> Facts:
    """Lines, modes, masses and joint, friction, and how one log predicts the other."""
    facts = [("Band of the models", range_with_unit(*it.band, "Hz"))]
    facts += [(f"{line.kind[0].upper()}{line.kind[1:]}, {range_with_unit(line.low, line.high, 'Hz')}",
               f"{with_interval(line.value)}; level {with_interval(line.level)}") for line in it.lines]  # fmt: skip
    facts += [(name_of(each.name), with_interval(each)) for each in (it.modes.estimates if it.modes else ())]
    facts += [
        (f"Two masses: {each.name}", with_interval(each)) for each in (it.two_masses.estimates if it.two_masses else ())
    ]
    if it.departs is not None:
        facts.append(("Leaves the linear model below", with_interval(it.departs.frequency)))
    if it.drag is not None:
        facts.append(("Coulomb friction, from the departure", with_interval(it.drag.coulomb)))
        facts.append(("Spring beside it", with_interval(it.drag.stiffness)))
    names = ("driven mass", "other mass")
    for log, errors in it.aside:
        told = ", ".join(f"{percent(error)} ({name})" for name, error in zip(names, errors, strict=False))
        facts.append((f"{log}, predicted by another log", told))
    return tuple(facts)


def _steps(it: StepStiffness) -> tuple[tuple[str, ...], Facts, tuple[str, ...]]:
    fixed = {True: "The cart stood still.", False: "The cart moved.", None: ""}[it.cart_fixed]
    facts = (
        ("Joint stiffness", with_interval(it.stiffness)),
        ("Steps up", with_interval(it.up)),
        ("Steps down", with_interval(it.down)),
        ("Hysteresis", with_interval(it.hysteresis)),
        ("Settled windows", str(len(it.windows))),
    )
    return ((fixed,) if fixed else ()), facts, it.warnings


def _stick_slip(it: StickSlip) -> tuple[tuple[str, ...], Facts, tuple[str, ...]]:
    facts = [
        ("Static friction", with_interval(it.static)),
        ("Forward", with_interval(it.forward)),
        ("Backward", with_interval(it.backward)),
        ("Break-away force as measured, forward", with_interval(it.break_away_forward)),
        ("Break-away force as measured, backward", with_interval(it.break_away_backward)),
        ("Force common to both directions", with_interval(it.offset)),
        ("Stiffness of the joint", with_interval(it.stiffness)),
        ("Slips", str(len(it.times))),
    ]
    if len(it.times):
        facts.append(("Break-away forces, 5 % to 95 % of the slips", range_with_unit(*it.spread, "N")))
    return (), tuple(facts), it.warnings


def _break_away(it: BreakAway) -> tuple[tuple[str, ...], Facts, tuple[str, ...]]:
    facts = [
        ("Static friction", with_interval(it.static)),
        ("Forward", with_interval(it.forward)),
        ("Backward", with_interval(it.backward)),
        ("Ramps", str(len(it.times))),
    ]
    if len(it.rates):
        facts.append(("Force rates", range_with_unit(float(it.rates.min()), float(it.rates.max()), "N/s")))
    return (), tuple(facts), it.warnings


def _presliding(it: Presliding) -> tuple[tuple[str, ...], Facts, tuple[str, ...]]:
    facts = [
        ("Stiffness of the bristles", with_interval(it.stiffness)),
        ("Damping of the bristles", with_interval(it.damping)),
        ("Moving mass", with_interval(it.mass)),
    ]
    if len(it.time):
        facts += [("Friction left unexplained", f"{it.unexplained:.1%} of its standard deviation")]
    return (), tuple(facts), it.warnings


def _slow_sliding(it: SlowSliding) -> tuple[tuple[str, ...], Facts, tuple[str, ...]]:
    names = ("Coulomb friction", "Static friction", "Stribeck velocity")
    facts = [(name, with_interval(each)) for name, each in zip(names, it.estimates, strict=True)]
    if len(it.time):
        facts += [("Friction left unexplained", f"{it.unexplained:.1%} of its standard deviation")]
    return (), tuple(facts), it.warnings


def _constant(it: ConstantSpeed) -> tuple[tuple[str, ...], Facts, tuple[str, ...]]:
    facts = [(f"Friction {name}", _direction(each)) for name, each in it.velocity.directions.items()]
    facts += [
        ("Friction, both directions", _direction(it.velocity.both)),
        ("Constant force", with_interval(it.velocity.bias)),
        ("Repeatability along the rail", with_interval(it.position.repeatability)),
    ]
    facts += [
        (f"Along the rail at {digits(each.velocity, 'm/s')}", f"mean {with_interval(each.mean)}, standard deviation "
         f"{digits(each.spread, 'N')}; correlation length {with_interval(each.correlation_length)}")
        for each in it.position.passes
    ]  # fmt: skip
    return (it.position.verdict,), tuple(facts), (*it.velocity.warnings, *it.position.warnings)


def _direction(it: Direction) -> str:
    several = (it.coulomb, it.viscous, it.static, it.stribeck_velocity)
    shown = [each for each in several if each.shown]
    reasons = {each.reason: None for each in several if not each.shown}
    names = [within(each.name) for each in several if not each.shown]
    lost = f"not shown: {', '.join(names)} ({'; '.join(reasons)})" if names else ""
    return "; ".join(text for text in (_listed(shown), lost) if text)
