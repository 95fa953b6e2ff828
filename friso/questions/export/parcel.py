"""Put together what leaves friso with a controller: its equations, a test, and the verdict on its stage."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from hashlib import sha256
from typing import Any

import numpy as np

from friso.drives.gains import output_of
from friso.drives.languages import carried_out
from friso.drives.machine import machine_of, machine_run
from friso.drives.program import MEANINGS, OUTPUT, PER_NEWTON, linear_controller, program_of
from friso.drives.settings import settings
from friso.drives.target import CodeTarget, Parcel
from friso.errors import InputError
from friso.progress import Progress
from friso.questions.check.question import CheckAnswer, checked_stage
from friso.questions.export.controller_words import header
from friso.questions.export.replay import replayed
from friso.stage import Stage
from friso.stage.correlations import Correlations
from friso.stage.rig import LOOPS
from friso.virtual_rig.run import as_built_keys


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
    few, held = settings.machine_samples, vector.start[str(OUTPUT)]
    run = machine_run(machine, flat, vector.output[:few], vector.true_position[:few], held)
    return replace(parcel, machine=run)


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
    parcel = packed(stage, target, name, user_values, settings.vector_samples, plant)
    check = checked_stage(stage, correlations, progress=progress)
    return replace(parcel, header=header(parcel, check)), check
