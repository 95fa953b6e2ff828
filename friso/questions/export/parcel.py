"""Put together what leaves friso with a controller: its equations, a test, and the verdict on its stage.

The test is a run of the stage as built, which keeps what the controller read and commanded at each sample.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from hashlib import sha256
from typing import Any

import numpy as np
import sympy as sp

from friso.drives.gains import output_of
from friso.drives.languages import carried_out
from friso.drives.machine import machine_of, machine_run
from friso.drives.program import (
    ACCELERATION,
    DIRECTION,
    JERK,
    MEANINGS,
    MOTOR_POSITION,
    OUTPUT,
    PER_NEWTON,
    POSITION,
    REFERENCE,
    VELOCITY,
    Program,
    linear_controller,
    program_of,
)
from friso.drives.target import TARGETS, CodeTarget, Parcel, Vector
from friso.engine.simd_math import gaussian, quantised, sine
from friso.equations.as_built import VELOCITY_SEED_OFFSET
from friso.equations.component import TIME
from friso.equations.motion import declared
from friso.errors import InputError
from friso.hunting.criteria import ATTRACTED, UNDECIDED
from friso.interface.answer import Answer
from friso.progress import Progress
from friso.questions.check.built_words import does_as_built
from friso.questions.check.question import CheckAnswer, checked_stage
from friso.questions.check.words import IN_SHORT
from friso.shown.blocks import AnswerBlock, Files
from friso.shown.documents import plain_json
from friso.shown.text import unknown_condition, with_unit
from friso.stage import Stage
from friso.stage.correlations import Correlations
from friso.stage.rig import LOOPS
from friso.version import VERSION
from friso.virtual_rig.run import as_built_keys, failures, run_flat
from friso.virtual_rig.task import MoveTask, own_motion


class ControllerAnswer(Answer):
    """A controller as code or equations; `result` is a `Parcel`, and `check` the answer of friso check."""

    stage: Stage
    check: CheckAnswer
    to: str

    @property
    def target_files(self) -> Mapping[str, Any]:
        """Return the files of the target by name: texts, and archives as bytes."""
        return TARGETS[self.to].files(self.result)

    @property
    def system(self) -> Any:
        """Return the controller for small motions as a system of python-control, with its sample time dt [s]."""
        return self.result.linear.as_system()

    def blocks(self) -> list[AnswerBlock]:
        """Return the parts of the answer: what is written, with which verdict, and the files."""
        return controller_blocks(self)

    def files(self) -> Files:
        """Return the files of the target; a page is not among them."""
        return {**self.target_files}


def verdict_words(check: CheckAnswer) -> tuple[str, bool]:
    """Say what the check found, and whether it is a sure verdict that the stage does not hunt."""
    case = check.result["given"]
    hunting, verdict = case.judgement.hunting, case.verdict
    if not check.stage.states_friction:
        return "there is no verdict: the stage file states no friction", False
    if check.failure or verdict == "failed":
        return f"there is no verdict: {check.failure or 'the run was not completed'}", False
    if verdict == "none":
        return "there is no verdict: the reference keeps moving", False
    if built := check.as_built:
        return f"as built, the stage {does_as_built(built)}", built.certain and built.verdict in ("settles", "toggles")
    if verdict in UNDECIDED or not hunting.certain:
        leaning = f"; it {IN_SHORT[verdict]}, as far as was seen" if verdict in IN_SHORT else ""
        return f"the verdict is uncertain ({hunting.reason or 'where its motion ends'}){leaning}", False
    return f"the stage {IN_SHORT[verdict]}", verdict not in ATTRACTED


def verdict_line(check: CheckAnswer) -> str:
    """Write the verdict as a line, as a warning unless it is surely that the stage does not hunt."""
    words, fine = verdict_words(check)
    condition = unknown_condition(check.stage, check.varied)
    return f"{'' if fine else 'WARNING: '}{condition}{words} (friso check)."


def header(parcel: Parcel, check: CheckAnswer) -> list[str]:
    """Write the lines that stand at the head of every file: what this is, and for what it holds."""
    stage, program = check.stage, parcel.program
    flat = stage.flat()
    motion = stage.as_written().get("motion", {})
    moves = ", ".join(f"{key} = {value}" for key, value in motion.items())
    late = flat.get("drive.delay", 0.0)
    waits = (
        [f"The drive adds its delay of {with_unit(late, 's')} after each sample; it is not part of the controller."]
        if late
        else []
    )
    uncertain = [*stage.uncertain()]
    centres = [f"At the centres of uncertain keys: {', '.join(uncertain)}."] if uncertain else []
    lines = [
        f"Controller of {' '.join(stage.name.split()) or 'a stage'}, sampled every {with_unit(program.period, 's')}.",
        f"Exported by friso {VERSION}; SHA-256 of the stage: {parcel.digest}.",
        f"Verdict: {verdict_line(check)}",
        f"Judged for the motion: {' '.join(moves.split())}.",
        "The verdict is on this controller in continuous time; samples and delays count where they make it unstable.",
        *centres,
        *waits,
    ]
    shown = ("".join(filter(str.isprintable, line)) for line in lines)
    return [line.replace("µ", "u") for line in shown]  # editors of PLCs differ in what they make of it


def controller_blocks(answer: ControllerAnswer) -> list[AnswerBlock]:
    """Return the blocks: the verdict, what was written, and the files."""
    parcel, files = answer.result, answer.target_files
    program, title = parcel.program, TARGETS[answer.to].title
    words, fine = verdict_words(answer.check)
    verdict = f"{words[0].upper()}{words[1:]} (friso check)." if fine else verdict_line(answer.check)
    what = (
        f"Its controller as {title}, sampled every {with_unit(program.period, 's')}: {program.operations} operations "
        f"and {len(program.memories)} numbers kept a sample, output in {parcel.unit}."
    )
    test = f"Its test compares {len(parcel.vector.output)} samples with friso's own run as built."
    contents = {name: content.encode() if isinstance(content, str) else content for name, content in files.items()}
    rows = [(name, [f"{len(content) / 1e3:.1f} kB"]) for name, content in contents.items()]
    remark = TARGETS[answer.to].remark()
    return [
        AnswerBlock(
            sentences=[verdict, what, test, *([remark] if remark else [])], numbers=partial(controller_document, answer)
        ),
        AnswerBlock(title="Files, with --out", columns=("Size",), rows=rows),
    ]


def controller_document(answer: ControllerAnswer) -> dict[str, Any]:
    """Return the verdict, the sizes, and the names of the files."""
    parcel = answer.result
    words, fine = verdict_words(answer.check)
    return plain_json(
        {
            "stage": answer.stage.name,
            "verdict": answer.check.verdict,
            "sure_not_to_hunt": fine,
            "conclusion": words,
            "sample_time_s": parcel.program.period,
            "output_unit": parcel.unit,
            "operations": parcel.program.operations,
            "memories": len(parcel.program.memories),
            "stage_sha256": parcel.digest,
            "files": [*answer.target_files],
        }
    )


def replayed(stage: Stage, flat: Mapping[str, Any], program: Program, samples: int) -> Vector:
    """Return the first samples of a stage's own motion as its drive runs it.

    `flat` has the stage with a complete drive. Raises InputError for a run that fails.
    """
    task, period = own_motion(stage), program.period
    duration = min(task.duration, samples * period)
    begun = task.pieces[:, 0] < duration
    task = replace(task, pieces=task.pieces[begun], duration=duration)
    (recorded,) = run_flat({**flat}, stage.floor, task, [0], period, outputs=True)
    if failed := failures(recorded):
        raise InputError("STAGE", f"a run as built that fails ({failed[0][1]})", "a stage that friso simulate can run")
    assert recorded.outputs is not None
    time = recorded.time
    rows = task.pieces[np.searchsorted(task.pieces[:, 0], time * (1 + 1e-12), side="right") - 1]
    true, motor = recorded.true["position"][0], recorded.true["position"][0]
    seen: dict[Any, np.ndarray] = {**_reference(task, rows, time), POSITION: recorded.logged["position"][0]}
    if MOTOR_POSITION in program.inputs:
        motor = recorded.outputs[f"{flat['encoder.velocity']}_position"][0]
        seen[MOTOR_POSITION] = _read(flat, motor)
    place, per_newton = float(task.pieces[0, 1]), flat[str(PER_NEWTON)]
    begun_at = {REFERENCE: place, POSITION: float(true[0]), MOTOR_POSITION: float(motor[0])}
    start = {str(one): begun_at.get(one, 0.0) for one in program.inputs}
    start["output"] = float(recorded.begun[0]) * per_newton + 0.0
    inputs = {str(one): seen[one] + 0.0 for one in program.inputs}
    return Vector(start, inputs, recorded.logged["force"][0] * per_newton + 0.0, true)


def _read(flat: Mapping[str, Any], positions: np.ndarray) -> np.ndarray:
    """Return what the encoder of the velocity reads at positions [m], shape (n,), with its noise and digits."""
    digit = np.float64(flat["drive.encoder_resolution"])
    with np.errstate(all="ignore"):  # whole numbers overflow on purpose, and without digits there is a division by 0
        noise = [gaussian(float(VELOCITY_SEED_OFFSET), float(k)) for k in range(len(positions))]
        noisy = positions + flat["drive.encoder_noise"] * np.array(noise)
        return np.array([quantised(one, digit) for one in noisy])


def _reference(task: MoveTask, rows: np.ndarray, time: np.ndarray) -> dict[sp.Symbol, np.ndarray]:
    """Return the reference and its derivatives at times [s], shape (n,), within its pieces, `rows`, by input.

    They are computed as the engine does, which has a sine of its own.
    """
    course = declared(task.form)
    wanted = {
        REFERENCE: course.position,
        VELOCITY: course.velocity,
        ACCELERATION: course.acceleration,
        JERK: course.jerk,
        DIRECTION: course.direction,
    }
    computed = sp.lambdify([TIME, *course.inputs], [*wanted.values()], [{"sine": sine}, "numpy"])
    values = computed(time - rows[:, 0], *rows[:, 1:].T)
    return {one: np.broadcast_to(value, time.shape) for one, value in zip(wanted, values, strict=True)}


MACHINE_SAMPLES = 200
"""Samples over which a machine as a plant is compared with friso. Behind the first impacts of a limiter runs that
begin a rounding apart differ by the stroke."""


def packed(
    stage: Stage, target: CodeTarget, name: str, user_values: Mapping[str, Any], samples: int, plant: bool = False
) -> Parcel:
    """Return a controller with a test of so many samples, and without a header; as a `plant`, with its machine.

    What the target cannot hold is refused before anything is run. Raises InputError for that, for a stage that is not
    usable, and for `user_values` that nothing asks for.
    """
    unit, per_newton = output_of(stage, user_values)
    flat = {**as_built_keys(stage), str(PER_NEWTON): per_newton}
    program, axis, fields = program_of(flat), stage.axis_kind, stage.numeric_keys()
    target.check_names(name, program)
    machine = machine_of(flat) if plant else None
    of_keys = {
        str(key): getattr(fields.get(str(key)), "unit", "")
        for key in (*program.parameters, *(machine.parameters if machine else ()))
    }
    of_inputs = {str(one): meaning[0] for one, meaning in MEANINGS.items()}
    units = {key: axis.unit(one) for key, one in (of_keys | of_inputs).items()}
    force = axis.unit("N")
    units[str(PER_NEWTON)] = f"{unit}/({force})" if "*" in force else f"{unit}/{force}"
    slow = [flat[key] for loop in LOOPS if (key := f"drive.{loop}_sample_time") in flat]
    linear = linear_controller(flat, round(max(slow, default=program.period) / program.period))
    digest = sha256(stage.to_toml().encode()).hexdigest()
    vector = replayed(stage, flat, program, samples)
    parcel = Parcel(name, (), program, linear, vector, units, unit, digest)
    off = float(np.abs(carried_out(program, vector.start, vector.inputs) - vector.output).max())
    if not off <= parcel.tolerance:
        text = f"equations that differ by {off:.3g} {unit} from friso's own run as built"
        raise InputError(
            "controller", text, f"equations that reproduce it to {parcel.tolerance:.3g} {unit}: a fault of friso"
        )
    if machine is None:
        return parcel
    few, held = MACHINE_SAMPLES, vector.start[str(OUTPUT)]
    run = machine_run(machine, flat, vector.output[:few], vector.true_position[:few], held)
    return replace(parcel, machine=run)


VECTOR_SAMPLES = 4000
"""Samples of a test vector. Of most drives they last through a move; ten times as many make files of megabytes."""


def parcel_of(
    stage: Stage,
    correlations: Correlations,
    target: CodeTarget,
    name: str,
    user_values: Mapping[str, Any],
    plant: bool,
    progress: Progress,
) -> tuple[Parcel, CheckAnswer]:
    """Return a controller with all that belongs to it, and the check of its stage.

    Raises InputError for what `packed` refuses.
    """
    parcel = packed(stage, target, name, user_values, VECTOR_SAMPLES, plant)
    check = checked_stage(stage, correlations, progress=progress)
    return replace(parcel, header=header(parcel, check)), check
