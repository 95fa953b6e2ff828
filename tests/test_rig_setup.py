"""The setup that the rig states for `friso identify` beside its logs, and the logs that it refuses."""

from pathlib import Path

import pytest
from refusals import refused

from friso.identification.kind import as_set_up
from friso.identification.logs.roles import Mapping, load_mapping, mapping_text, sidecar
from friso.identification.sources import read_all
from friso.progress import silent
from friso.stage import Stage
from friso_thesis.questions.rig.blocks import write_csv
from friso_thesis.studies.rig.experiments import constant_speed, presliding, stiction
from friso_thesis.studies.rig.experiments.stiffness import steps


@pytest.mark.slow
def test_how_the_stage_was_set_up_goes_with_the_log(built: Stage, tmp_path: Path) -> None:
    """For the analysis of that log alone: the stage file keeps its own stroke."""
    log, path = steps(built, 1), tmp_path / "steps.csv"
    write_csv(path, log.interval, log.logged, "")
    sidecar(path).write_text(
        mapping_text(Mapping(experiment="steps", setup={"joint.stroke": "8 mm", "cable.drag": "1 N*s/m"}))
    )
    assert load_mapping(path) == Mapping(experiment="steps", setup={"joint.stroke": "8 mm", "cable.drag": "1 N*s/m"})
    (inputs,) = read_all([path], Mapping(), tmp_path)
    flat = as_set_up(built, inputs.source)
    assert flat["joint.stroke"] == pytest.approx(8e-3)
    assert built.flat()["joint.stroke"] == pytest.approx(1e-3)
    sidecar(path).write_text(mapping_text(Mapping(experiment="steps", setup={"joint.stroke": "8 volts"})))
    (wrong,) = read_all([path], Mapping(), tmp_path)
    with refused("joint.stroke"):
        as_set_up(built, wrong.source)


def test_friction_without_what_is_looked_for_is_refused(built: Stage) -> None:
    bare = {f"friction.{key}": None for key in built.as_written()["friction"]}
    bare |= {"rail": None}
    none = built.replace({**bare, "friction.model": "none"})
    with refused("friction.model"):
        stiction.EXPERIMENT.run(none, 1, silent)
    with refused("friction.model"):
        presliding.EXPERIMENT.run(none, 1, silent)


@pytest.mark.thorough
def test_a_loop_that_swings_between_its_limits_is_told(built: Stage) -> None:
    """Logs that end at once show no passes: their page is written all the same."""
    outcome = constant_speed.EXPERIMENT.run(built.replace({"controller.crossover": "500 Hz"}), 1, silent)
    assert all(log.failure for log in outcome.logs)
