"""Response to a multisine, noise or a sweep: masses, stiffness and damping of the joint."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from friso.identification.combine import Correlated, determined
from friso.identification.doubt import words_of
from friso.identification.estimate import Estimate
from friso.identification.kind import AnalysisSettings, ExperimentKind, Predictor, Prior, Source, independent
from friso.identification.logs.log import Log
from friso.identification.readings.course import Course
from friso.identification.response.analysis import Bench, analyse, predicted
from friso.identification.response.two_mass import TwoMass
from friso.identification.settings import experiment_settings
from friso.identification.stage_keys import shared_masses
from friso.stage import Stage


def _analyse(logs: Sequence[Source], prior: Prior, settings: AnalysisSettings) -> Bench:
    """Analyse logs of one machine together, or a frequency response from another instrument."""
    (first, *_) = logs
    if not isinstance(first, Log):
        return analyse((), settings.band, measured=first)
    return analyse([log for log in logs if isinstance(log, Log)], settings.band, settings.period)


def _claims(course: Course) -> str | None:
    """Return why a log shows a periodic excitation of a stage whose reference stands, or None.

    The motion of such a log hardly rests, contains many frequencies, and turns often.
    """
    repetition = None if course.reference_moves else course.repetition
    if repetition is None or repetition.rests > experiment_settings.rests_of_moves:
        return None
    if repetition.harmonics < experiment_settings.harmonics_of_an_excitation or repetition.turns < repetition.harmonics:
        return None
    return f"{course.repeats}, with about {repetition.harmonics:.0f} harmonics"


def _estimates(bench: Bench, stage: Stage | None) -> tuple[Estimate, ...]:
    """Return estimates of masses and joint from responses in newtons and metres.

    Estimates come from the two-mass model, if it was fitted. If only a mass line shows, where the response falls as of
    one mass, this mass is the stage's or the total, whichever is nearer. A resonance nearer to the parasitic mode than
    to the joint's mode leaves the joint's stiffness undetermined. The result is empty for other units.
    """
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
        return tuple(replace(model[name], name=key) for key, name in pairs.items())
    if not bench.lines or stage is None:
        return ()
    line = bench.lines[0].value
    return (replace(line, name="masses.stage"),) if _of_stage_alone(line.value, stage) else shared_masses(line, stage)


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


def _correlated(result: Bench, estimates: Sequence[Estimate]) -> Correlated:
    """Return the estimates that have a value, with their correlations.

    Masses that are parts of one sum are fully correlated.
    """
    certain = determined(estimates)
    if all(estimate.name.startswith("masses.") for estimate in estimates):
        return certain, np.ones((len(certain), len(certain)))
    return independent(result, estimates)


def _predict(result: Bench, log: Log, prior: Prior, settings: AnalysisSettings) -> tuple[float, ...]:
    """Return the relative prediction errors of another log's outputs, the driven mass first."""
    return predicted(result, log, settings.period)


KIND = ExperimentKind[Bench](
    _analyse,
    _estimates,
    _correlated,
    si=False,
    together=True,
    responses=True,
    claims=_claims,
    doubts=lambda bench: words_of("response", bench),
    predictor=Predictor("one of the bench beside frequency responses", _predict),
)
