"""Whatever friso takes as a stage, all of it takes: joints of which a file tells a part, and stages drawn at random."""

import logging
import random
from collections.abc import Callable
from contextlib import suppress
from itertools import combinations, islice

import numpy as np
import pytest

import friso
from benchmarks.trust.stages import drawn_stages
from friso.app.machine import Machine, machine_on_page
from friso.design_method.prepare import isolated
from friso.engine.kernel import kernel
from friso.equations.structure import structure
from friso.interface.answer import Answer
from friso.stage import Stage
from friso.stage.plausible import idle_encoder, implausible_values
from friso.studies.laws import convert
from friso.virtual_rig.run import as_built_keys
from friso.virtual_rig.task import SAMPLE_TIME, own_motion
from friso_thesis.studies.rig.moves_on_rails import with_joint
from friso_thesis.studies.rig.outcome import freed

LIMITER = {"limiter_stiffness": "2e7 N/m", "limiter_damping": "100 N*s/m"}
FREE = {"stiffness": "2.4 N/mm", "damping": "0.5 N*s/m", "stroke": "1 mm"}
SUBSETS = [keys for count in range(len(FREE)) for keys in combinations(FREE, count)]


def locked(keys: tuple[str, ...]) -> Stage:
    """The thesis's rig with a locked joint, of which the file tells some keys."""
    joint = {"locked": True, **LIMITER, **{key: FREE[key] for key in keys}}
    return friso.load(friso.example("thesis_rig")).replace({"joint": joint, "parasitic": None})


@pytest.mark.parametrize("keys", SUBSETS)
def test_a_joint_that_cannot_be_free_is_only_locked(keys: tuple[str, ...]) -> None:
    stage = locked(keys)
    assert [*stage.variants()] == ["given", "locked"]
    for free in (freed, lambda machine: with_joint(machine, locked=False)):
        with pytest.raises(friso.InputError, match="stroke") as refused:
            free(stage)
        assert "only a joint with locked" not in refused.value.expected
    assert not isolated(stage).joint.locked  # an isolator to begin with, which the file does not tell


def test_a_joint_of_which_all_is_told_can_be_free() -> None:
    stage = locked((*FREE,))
    assert [*stage.variants()] == ["given", "locked", "free"]
    assert not freed(stage).joint.locked
    assert isolated(stage) == stage.variants()["free"]


@pytest.mark.slow
def test_commands_take_a_joint_that_cannot_be_free() -> None:
    """Messages named a joint without damping, although only a free joint needs it."""
    stage = locked(("stiffness",))
    verdict = friso.check(stage)
    assert {case.stage.joint.locked for case in verdict.result.values()} == {True}
    assert [*friso.bode(stage).result.limits] == ["locked"]


def test_a_step_of_a_drive_that_states_no_sample_time_is_that_of_the_thesis() -> None:
    stage = friso.load(friso.example("thesis_rig"))
    step = stage.replace({"motion": {"kind": "step", "size": "1 mm", "duration": "2 s"}})
    task = own_motion(step)
    assert task.pieces[1, 0] == SAMPLE_TIME
    assert task.span == (0.0, 1e-3)


def _answered(stage: Stage, ask: Callable[[Stage], Answer]) -> bool:
    """Whether a command answers; False where it says why it does not. Anything but an InputError fails."""
    try:
        return bool(ask(stage).sentences())
    except friso.InputError as error:
        return not (error.actual and error.expected)


@pytest.mark.slow
def test_what_is_drawn_from_the_schema_is_taken_as_a_whole(caplog: pytest.LogCaptureFixture) -> None:
    """The stage as a whole is valid, not only each key, and every key occurs."""
    caplog.set_level(logging.ERROR)
    for stage in islice(drawn_stages(random.Random(0)), 40):
        assert friso.loads(stage.to_toml()) == stage
        for variant in stage.variants().values():
            structure(variant.flat())
        assert friso.export(stage).document()["gains"]
        assert machine_on_page(Machine(stage.to_toml(), "drawn"))["tables"]
        assert own_motion(stage).duration > 0
        assert as_built_keys(stage)["drive.sample_time"] > 0
        assert all(isinstance(text, str) for text in (*implausible_values(stage), *idle_encoder(stage)))
        with suppress(friso.InputError):
            convert(stage, "lugre")


def test_states_have_magnitudes_without_a_gain_on_position() -> None:
    """The loop's deflection by friction, from which magnitudes follow, is infinite without stiffness."""
    stage = friso.load(friso.example("thesis_rig")).replace({"controller": {"kind": "pid", "ki": "4 N/(m*s)"}})
    shape = kernel(structure(stage.flat()))
    scales = shape.scales(shape.values({**stage.flat(), "motion.size": 0.0}, 1), 1)
    assert np.all((scales > 0) & np.isfinite(scales))


@pytest.mark.thorough
def test_what_is_drawn_from_the_schema_has_bode_plots(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.ERROR)
    assert all(_answered(stage, friso.bode) for stage in islice(drawn_stages(random.Random(1)), 40))
