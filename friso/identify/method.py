"""From logs of several experiments to one stage: each analysed in its way, and what they agree on."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from friso.errors import InputError
from friso.identify.combine import Correlated, combined, correlations
from friso.identify.errors import Errors
from friso.identify.estimate import Estimate
from friso.identify.experiments.at_bearing import Between, Mode
from friso.identify.experiments.break_away import BreakAway, static_from_ramps
from friso.identify.experiments.friction_position import FrictionPosition, friction_position
from friso.identify.experiments.friction_velocity import FrictionVelocity, friction_velocity
from friso.identify.experiments.presliding import Presliding, bristles_from_presliding
from friso.identify.experiments.slow_sliding import Known, SlowSliding, stribeck_from_slow_sliding
from friso.identify.experiments.steps import StepStiffness, stiffness_from_steps
from friso.identify.experiments.stick_slip import StickSlip, static_from_stick_slip
from friso.identify.inverse_model import inverse_model
from friso.identify.logs.frequency_text import MeasuredResponse
from friso.identify.logs.log import Log
from friso.identify.moves import Moves, identify_moves
from friso.identify.moves import predict as predict_moves
from friso.identify.output_error.problem import Simulated, why_continuous
from friso.identify.response.analysis import Bench, analyse, predicted
from friso.identify.response.two_mass import TwoMass
from friso.identify.stage_file import identified, made_up
from friso.identify.stage_keys import Fitting, fitting
from friso.stage import Stage
from friso.stage.correlations import Correlations

MOVES, FREQUENCY, STEPS, STICK_SLIP, BREAK_AWAY, CONSTANT, PRESLIDING, SLOW_SLIDING = KINDS = (
    "moves",
    "frequency",
    "steps",
    "stick-slip",
    "break-away",
    "constant-speed",
    "presliding",
    "slow-sliding",
)
"""Kinds of experiment, in words of the command line; they are analysed in the order of `ORDER`, since the later ones
use what the earlier ones found."""

ORDER = (FREQUENCY, STEPS, MOVES, CONSTANT, STICK_SLIP, BREAK_AWAY, PRESLIDING, SLOW_SLIDING)

FAR_BELOW = 0.1
"""Share of the limiter's stiffness up to which a stiffness is the joint's."""


@dataclass(frozen=True)
class ConstantSpeed:
    """Friction against velocity and against position, of one log."""

    velocity: FrictionVelocity
    position: FrictionPosition


Source = Log | MeasuredResponse
"""What a file may hold: signals over time, or a frequency response as somebody measured it."""

Result = Moves | Bench | StepStiffness | StickSlip | BreakAway | ConstantSpeed | Presliding | SlowSliding


@dataclass(frozen=True)
class Experiment:
    """A kind of experiment with its logs, what was found, and the estimates of keys of the stage file."""

    kind: str
    logs: tuple[Source, ...]
    result: Result
    estimates: tuple[Estimate, ...]


@dataclass(frozen=True)
class Options:
    """What the user chose: bandwidth of the moves [Hz] for the inverse model, band [Hz] and period [s] of frequency
    responses; None where friso is to find them."""

    bandwidth: float | None = None
    band: tuple[float, float] | None = None
    period: float | None = None


@dataclass(frozen=True)
class Identification:
    """The stage with its uncertain keys (None: neither a stage was given, nor moves, around which one could be made
    up), the correlations of these, the experiments behind it, the `estimates` that went into it (one per key), and what
    the engineer should know (`warnings`)."""

    stage: Stage | None
    correlations: Correlations
    experiments: tuple[Experiment, ...]
    estimates: tuple[Estimate, ...]
    warnings: tuple[str, ...]


def identify(
    logs: Sequence[tuple[Source, str]],
    base: Stage | None = None,
    options: Options = Options(),
    progress: Callable[[str, int, int], None] = lambda what, done, total: None,
) -> Identification:
    """The stage behind logs, each with its kind of experiment, and what is known of it beforehand, `base`.

    With a base whose controller is the machine's, moves with a reference are simulated in closed loop. Raises
    InputError for logs that cannot be used.
    """
    groups = _groups(logs)
    stage = base or _around(logs)
    found: list[Experiment] = []
    for number, (kind, group) in enumerate(groups):
        progress(f"{kind}: {', '.join(log.name for log in group)}", number, len(groups))
        known = combined([found_one for each in found for found_one in each.estimates])[0]
        result = _analysed(kind, group, stage, base is not None, known, options)
        found.append(Experiment(kind, group, result, _estimates(result, stage)))
    every, warnings = combined([one for each in found for one in each.estimates])
    if stage is None:
        return Identification(None, Correlations(), tuple(found), tuple(every), tuple(warnings))
    warnings += _continuous(found, base)
    warnings += [FOLLOWED] if any(isinstance(each.result, Moves) and each.result.loop is None for each in found) else []
    fits = fitting(stage, every)
    whole = identified(stage, fits.kept, [log.name for log, _ in logs])
    return Identification(
        whole, _correlations(found, every, fits, whole), tuple(found), tuple(every), (*warnings, *fits.said)
    )


def _continuous(found: Sequence[Experiment], base: Stage | None) -> list[str]:
    """Where the drive that was given is not the one simulated."""
    if base is None:
        return []
    moves = [each.result for each in found if isinstance(each.result, Moves) and each.result.loop]
    said = (why_continuous(base.flat(), each.log.sample_time) for each in moves)
    return [sentence for sentence in dict.fromkeys(said) if sentence]


FOLLOWED = (
    "without the machine's own controller the intervals of friction are too narrow: of machines drawn at random "
    "(benchmarks/identify.py) they held the truth less often than not; give the controller with --stage"
)


@dataclass(frozen=True)
class Prediction:
    """Another log predicted by what was found: by moves, the samples used, the simulated record and its `errors`; by
    frequency responses, the relative errors of the outputs over the band, the driven mass's first."""

    log: Log
    part: slice | None = None
    simulated: Simulated | None = None
    errors: Errors | None = None
    response_errors: tuple[float, ...] = ()


def predict(found: Identification, log: Log, options: Options) -> Prediction:
    """Another log of the same machine, predicted by the first experiment that can: the stage as its log alone shows it,
    not as combined, so that the errors are those of one record on another. Raises InputError where none can."""
    results = [each.result for each in found.experiments]
    for result in results:
        if isinstance(result, Moves) and "reference" in log:
            return Prediction(log, *predict_moves(result, log))
    for result in results:
        if isinstance(result, Bench):
            return Prediction(log, response_errors=predicted(result, log, options.period))
    expected = "a log with a reference beside moves, or one of the bench beside frequency responses"
    raise InputError("--predict", f"a log with {', '.join(log.signals)}", expected, "--map reference=SetPos", log.name)


def _groups(logs: Sequence[tuple[Source, str]]) -> list[tuple[str, tuple[Source, ...]]]:
    """The logs by kind, in the order of analysis; responses of one bench are realisations of one experiment."""
    groups: list[tuple[str, tuple[Source, ...]]] = []
    for kind in ORDER:
        own = tuple(log for log, each in logs if each == kind)
        times = tuple(log for log in own if isinstance(log, Log))
        groups += [(kind, times)] if kind == FREQUENCY and times else [(kind, (log,)) for log in times]
        groups += [(FREQUENCY, (log,)) for log in own if isinstance(log, MeasuredResponse)]
    return groups


def _around(logs: Sequence[tuple[Source, str]]) -> Stage | None:
    """A stage around the first log of moves; None without moves, which alone tell enough of a machine."""
    moves = next((log for log, kind in logs if kind == MOVES and isinstance(log, Log)), None)
    return None if moves is None else made_up(moves, inverse_model(moves))


def _analysed(
    kind: str, logs: tuple[Source, ...], stage: Stage | None, own: bool, known: Sequence[Estimate], options: Options
) -> Result:
    """The analysis of one experiment, with what is known of the machine by now."""
    log = logs[0]
    if isinstance(log, MeasuredResponse):
        return analyse((), options.band, measured=log)
    flat = _as_set_up(stage, log) if stage else {}
    times = [each for each in logs if isinstance(each, Log)]
    best = {each.name: each for each in known if each.shown}
    masses = {name: _value(best, flat, f"masses.{name}") for name in ("cart", "stage")}
    if kind == FREQUENCY:
        return analyse(times, options.band, options.period)
    if kind == STEPS:
        return stiffness_from_steps(log)
    if kind == MOVES:
        start = {**flat, **{name: each.value for name, each in best.items() if name in flat}}
        return identify_moves(log, start, own and "reference" in log, options.bandwidth)
    if kind in (PRESLIDING, SLOW_SLIDING):
        believed = _believed(flat, best)
        if kind == PRESLIDING:
            return bristles_from_presliding(log, believed)
        return stribeck_from_slow_sliding(log, believed, _known(flat, best))
    if kind == STICK_SLIP:
        return _stick_slip(log, best.get("joint.stiffness"), flat, masses["stage"])
    mass = sum(masses.values())
    if kind == BREAK_AWAY:
        return static_from_ramps(log, mass)
    return ConstantSpeed(friction_velocity(log, mass), friction_position(log, mass, flat.get("controller.crossover")))


def _as_set_up(stage: Stage, log: Log) -> dict[str, Any]:
    """The flat keys of the stage as it was set up for a log; what the stage does not have is left out. Raises
    InputError."""
    given = stage.flat()
    try:
        return stage.replace({key: text for key, text in log.setup.items() if key in given}).flat()
    except InputError as error:
        raise error.found_in(f"{log.name}, [setup]") from None


def _stick_slip(log: Log, stiffness: Estimate | None, flat: Mapping[str, Any], stage_mass: float) -> StickSlip:
    """Slow motion, with the joint's stiffness as other experiments show it; else as this log does; else as the stage
    file has it."""
    stroke = flat.get("joint.stroke", np.inf)
    found = static_from_stick_slip(log, stiffness or flat.get("joint.stiffness"), stage_mass, stroke)
    if stiffness is None and found.stiffness.shown:
        return static_from_stick_slip(log, found.stiffness, stage_mass, stroke)
    return found


def _believed(flat: Mapping[str, Any], best: Mapping[str, Estimate]) -> Between:
    """What lies between force and bearing, as other experiments show it or else the stage file has it, which tells no
    viscous friction better than to its whole size."""
    found = between({**flat, **{key: each.value for key, each in best.items()}})
    viscous = best.get("friction.viscous")
    return replace(found, viscous=(found.viscous[0], viscous.half_width if viscous else found.viscous[0]))


def _known(flat: Mapping[str, Any], best: Mapping[str, Estimate]) -> Known | None:
    """The mass and the bristles that other experiments show; None where they do not."""
    masses = [key for key in flat if key.startswith("masses.")]
    bristles = ["friction.bristle_stiffness", "friction.bristle_damping"]
    if not masses or not all(key in best for key in (*masses, *bristles)):
        return None
    mass = sum(best[key].value for key in masses), sum(best[key].half_width for key in masses)
    stiffness, damping = ((best[key].value, best[key].half_width) for key in bristles)
    return Known(mass, stiffness, damping, flat.get("friction.stribeck_exponent", 2.0))


def between(flat: Mapping[str, Any]) -> Between:
    """What lies between the commanded force and the bearing of a stage given as flat keys, a joint being held by its
    limiter.

    The frequency of the parasitic mode is that of both parts of the stage's mass against each other; with the other one
    held, that of the part on the spring is lower.
    """
    drive, joint, mode = (
        {key.removeprefix(name): value for key, value in flat.items() if key.startswith(name)}
        for name in ("drive.", "joint.", "parasitic.")
    )
    cart, held = (flat.get(f"masses.{name}", 0.0) for name in ("cart", "stage"))
    lower = np.sqrt(1 - mode["mass"] / held) if mode else 1.0
    return Between(
        delay=drive.get("delay", 0.0) + drive["sample_time"] / 2 if "sample_time" in drive else None,
        bandwidth=drive.get("current_bandwidth", np.inf),
        mass=cart + held,
        beyond=held / (cart + held) if joint and held else 0.0,
        contact=joint.get("limiter_stiffness", np.inf),
        joint=joint.get("stiffness", 0.0),
        mode=Mode(mode["mass"] / (cart + held), *(lower * mode[key] for key in ("frequency", "damping_ratio")))
        if mode
        else None,
        viscous=(flat.get("friction.viscous", 0.0), 0.0),
    )


def _value(best: Mapping[str, Estimate], flat: Mapping[str, Any], key: str) -> float:
    return best[key].value if key in best else float(flat.get(key, 0.0))


def _estimates(result: Result, stage: Stage | None) -> tuple[Estimate, ...]:
    """What an experiment tells of the keys of the stage file."""
    if isinstance(result, Moves):
        return result.estimates
    if isinstance(result, Bench):
        return _of_bench(result, stage)
    if isinstance(result, StepStiffness):
        return (_named(result.stiffness, "joint.stiffness"),) if stage is None or stage.joint else ()
    if isinstance(result, ConstantSpeed):
        both = result.velocity.both
        pairs = {"coulomb": both.coulomb, "viscous": both.viscous, "static": both.static}
        pairs["stribeck_velocity"] = both.stribeck_velocity
        return tuple(_named(each, f"friction.{name}") for name, each in pairs.items())
    if isinstance(result, Presliding):
        masses = _shared(result.mass, stage) if stage is not None and result.mass.shown else ()
        return (result.stiffness, result.damping, *masses)
    if isinstance(result, SlowSliding):
        return result.estimates
    if isinstance(result, StickSlip):
        return (result.static, *([result.stiffness] if _of_joint(result.stiffness, stage) else ()))
    return (_named(result.static, "friction.static"),)


def _of_joint(stiffness: Estimate, stage: Stage | None) -> bool:
    """Whether a stiffness is that of the stage's joint, and not of the limiter that holds it."""
    if stage is None or stage.joint is None or not stiffness.shown:
        return False
    return bool(stiffness.value < FAR_BELOW * stage.flat()["joint.limiter_stiffness"])


def _of_bench(bench: Bench, stage: Stage | None) -> tuple[Estimate, ...]:
    """Masses and joint from a two-mass model in newtons and metres; a mass line alone is the whole mass."""
    units = (bench.driven.channels.input_unit, bench.driven.channels.output_unit)
    if units != ("N", "m"):
        return ()
    model = bench.two_masses
    if model is not None and stage is not None and (mode := _parasitic(model, stage)):
        why = f"the resonance at {mode:.3g} Hz is nearer the parasitic mode than the joint's: try --band below it"
        return (Estimate.unknown("joint.stiffness", "N/m", model["joint stiffness"].method, why, 0.0),)
    if model is not None and (stage is None or stage.joint) and bench.modes is not None and bench.modes.shape.modes:
        pairs = {"masses.stage": "driven mass", "masses.cart": "other mass"}
        pairs |= {"joint.stiffness": "joint stiffness", "joint.damping": "joint damping"}
        return tuple(_named(model[name], key) for key, name in pairs.items())
    if not bench.lines or stage is None:
        return ()
    line = bench.lines[0].value
    return (_named(line, "masses.stage"),) if _of_stage_alone(line.value, stage) else _shared(line, stage)


def _of_stage_alone(mass: float, stage: Stage) -> bool:
    """Whether a mass line [kg] is rather that of the stage above the mode of a free joint than that of all masses:
    which of the two it is nearer to as they are believed to be."""
    flat = stage.flat()
    if stage.joint is None or flat["joint.locked"]:
        return False
    alone, whole = flat["masses.stage"], flat["masses.cart"] + flat["masses.stage"]
    return bool(abs(np.log(mass / alone)) < abs(np.log(mass / whole)))


def _parasitic(model: TwoMass, stage: Stage) -> float | None:
    """The resonance [Hz] of a two-mass model that is rather the stage's parasitic mode than its joint's; else None."""
    flat = stage.flat()
    if "parasitic.frequency" not in flat or "joint.stiffness" not in flat:
        return None
    masses = (flat["masses.cart"], flat["masses.stage"])
    joint = np.sqrt(flat["joint.stiffness"] * sum(masses) / np.prod(masses)) / (2 * np.pi)
    found = model["resonance frequency"].value
    away = [abs(np.log(found / each)) for each in (joint, flat["parasitic.frequency"])]
    return found if away[1] < away[0] else None


def _shared(total: Estimate, stage: Stage) -> tuple[Estimate, ...]:
    """The whole mass, shared among the masses as in the stage."""
    given = {f"masses.{name}": value for name, value in stage.masses if value is not None}
    method, sizes = f"{total.method}, shared as in the stage file", ("value", "low", "high", "systematic")
    shares = {key: value / sum(given.values()) for key, value in given.items()}
    return tuple(
        replace(total, name=key, unit="kg", method=method, **{size: getattr(total, size) * share for size in sizes})
        for key, share in shares.items()
    )


def _named(found: Estimate, key: str) -> Estimate:
    return replace(found, name=key)


def _correlated(result: Result, estimates: Sequence[Estimate]) -> Correlated:
    """What an experiment shows of keys that hang together, and their correlations."""
    own = [each for each in estimates if each.shown and each.half_width > 0]
    if isinstance(result, Moves):
        return result.correlated, result.correlation
    if isinstance(result, ConstantSpeed) and result.velocity.both.covariance.size:
        covariance = result.velocity.both.covariance
        places = [i for i, each in enumerate(estimates[: len(covariance)]) if each.shown and each.half_width > 0]
        size = np.sqrt(np.diag(covariance))
        return [estimates[i] for i in places], (covariance / np.outer(size, size))[np.ix_(places, places)]
    if isinstance(result, SlowSliding):
        places = [result.estimates.index(each) for each in own]
        return own, result.correlation[np.ix_(places, places)]
    if isinstance(result, Presliding):
        places = [result.order(each.name) for each in own]
        return own, result.correlation[np.ix_(places, places)]
    if isinstance(result, Bench) and all(each.name.startswith("masses.") for each in estimates):
        return own, np.ones((len(own), len(own)))  # shared out of one
    return own, np.eye(len(own))


def _correlations(found: Sequence[Experiment], every: Sequence[Estimate], fits: Fitting, stage: Stage) -> Correlations:
    """Those of the keys that the stage file has as they were found, and of what moves along with one of these."""
    keys, matrix = correlations(
        [one for each in found for one in each.estimates], [_correlated(each.result, each.estimates) for each in found]
    )
    uncertain = stage.uncertain()
    leads = {one.name: one.name for one in fits.kept if one.name in keys and one in every} | {**fits.follows}
    kept = [key for key, lead in leads.items() if key in uncertain and lead in keys]
    places = [keys.index(leads[key]) for key in kept]
    part = matrix[np.ix_(places, places)]
    alone = np.abs(part - np.eye(len(kept))).max(axis=1, initial=0.0) == 0
    return Correlations(tuple(kept), part).among([key for key, single in zip(kept, alone, strict=True) if not single])
