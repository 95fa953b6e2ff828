"""The leaf springs that make a joint: its stiffness, what they bear, and that none interfere at a higher frequency."""

from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from snapshots import Snapshots

from friso import Stage, load, loads
from friso.design_method.prepare import leaves_for_joint, outline
from friso.design_method.spec import Sheet, mechanisms, read_spec
from friso.leaf_springs import closed_forms
from friso.leaf_springs.beams import beams
from friso.leaf_springs.closed_forms import first_interfering
from friso.leaf_springs.mechanism import Mechanism
from friso.questions.tune.blocks import further_files
from friso.questions.tune.question import TuneAnswer
from friso.questions.tune.words import explained
from friso.remedies.catalogue import remedies
from friso.remedies.machines import Goal
from friso.remedies.method import Advice, Unmade, tune
from friso.remedies.search import Budget

EXAMPLES = Path(__file__).parent.parent / "examples"
RIG = load(EXAMPLES / "thesis_rig.toml")
LEAVES = load(EXAMPLES / "thesis_leaves.toml")


def joint(stiffness: str, stroke: str) -> Stage:
    """The thesis's rig with another joint."""
    return RIG.replace({"joint.stiffness": stiffness, "joint.stroke": stroke})


@pytest.mark.cases(slow=3)
@pytest.mark.parametrize(
    ("stiffness", "stroke"),
    [("515 N/m", "2.97 mm"), ("2.4 kN/m", "1 mm"), ("20 kN/m", "0.1 mm"), ("0.3 kN/m", "3 mm"), ("4 kN/m", "0.3 mm")],
)
def test_leaves_have_the_stiffness_and_bear_the_stroke(stiffness: str, stroke: str) -> None:
    rig = joint(stiffness, stroke)
    made = leaves_for_joint(rig, rig)
    flat, wanted = made.flat(), rig.flat()["joint.stiffness"]
    by_beams = beams(Mechanism.of(flat), flat["joint.stroke"])
    assert flat["joint.stiffness"] == pytest.approx(wanted, rel=0.01)
    assert by_beams.drive[0] == pytest.approx(wanted, rel=0.015)
    assert by_beams.fatigue_margin > 1.25  # 1.3 for bending and load together
    assert by_beams.buckling_margin > 3
    assert best_of_a_grid(flat, wanted) < 1.02 * first_interfering(Mechanism.of(flat))


def best_of_a_grid(flat: dict[str, float], wanted: float) -> float:
    """The highest first interfering frequency [Hz] of leaves of the same stiffness on a grid of lengths, spacings and
    gauges that bear stroke and weight, by the closed forms; the width from 31 by interpolation."""
    best = 0.0
    widths = np.linspace(15e-3, 45e-3, 31)
    for thickness in (0.1, 0.12, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.5):
        sheet = Sheet(2, thickness * 1e-3, "stainless 1.4310")
        for length in np.linspace(30e-3, 70e-3, 41):
            sizes = np.stack(np.broadcast_arrays(length, widths, 45e-3), axis=1)
            width = np.interp(wanted, closed_forms.drive_stiffness(mechanisms(flat, sizes, [sheet] * 31)), widths)
            several = np.stack(np.broadcast_arrays(length, width, np.linspace(30e-3, 60e-3, 13)), axis=1)
            built = mechanisms(flat, several, [sheet] * 13)
            stress = built.stress_concentration * closed_forms.max_stress(built, flat["joint.stroke"])
            stress += built.stress_concentration * built.weight / built.leaves / built.area
            good = np.abs(closed_forms.drive_stiffness(built) / wanted - 1) < 1e-3
            good &= 1.015 * 1.3 * stress < built.fatigue
            good &= 1.015 * 3 * built.weight < closed_forms.buckling_load(built)
            best = max(best, float(np.max(np.where(good, first_interfering(built), 0.0))))
    return best


@pytest.mark.parametrize(
    ("changed", "present", "has"),
    [
        ({"joint.stiffness": "100 kN/m", "joint.stroke": "20 um"}, None, False),  # too stiff for the sheets
        ({"name": 'the "old" rig \\ 2'}, None, True),
        ({}, {"flexure.thickness": "2 mm", "flexure.load": "3 kN"}, False),  # no leaves stand under this load
    ],
)
def test_which_joints_have_leaves(changed: dict, present: dict | None, has: bool) -> None:
    rig = joint("2.4 kN/m", "1 mm").replace(changed)
    assert (leaves_for_joint(rig, LEAVES.replace(present) if present else rig) is not None) == has


def test_a_coulomb_friction_close_to_a_static_one_that_is_known_well_is_outlined() -> None:
    rig = RIG.replace({"friction.static": "3 N +/- 5 %", "friction.coulomb": "2.8 N"})
    friction = read_spec(outline(rig)).friction
    assert (friction.coulomb.low, friction.coulomb.high) == pytest.approx((0.7 * 2.8, 1.05 * 3))


@pytest.mark.cases(first=1)
@pytest.mark.parametrize("load", [-200.0, 20.0])
def test_other_leaves_guide_and_carry_what_those_of_the_file_do(load: float) -> None:
    carried = {"flexure.sensor_x": "110 mm", "flexure.inertia_y": "1 g*m^2", "flexure.load": f"{load} N"}
    present = LEAVES.replace(carried)
    (free,) = (remedy.stage for remedy in remedies(present, Goal(controller=False)) if remedy.name == "isolator")
    made = leaves_for_joint(free, present)
    flat = made.flat()
    assert flat["flexure.sensor_x"] - flat["flexure.length"] == pytest.approx(40e-3)
    assert (flat["flexure.inertia_y"], flat["flexure.load"]) == (1e-3, load)
    assert flat["joint.stiffness"] == pytest.approx(present.flat()["joint.stiffness"], rel=0.01)
    assert closed_forms.buckling_load(Mechanism.of(flat)) > 3 * load


@pytest.fixture(scope="module")
def tuning() -> Advice:
    rigid = RIG.replace({"joint": None, "parasitic": None})
    budget = Budget(points=4, generations=2, refined=1, machines=4, surveyed=3, fresh=20)
    return tune(rigid, Goal(controller=False), budget=budget, chosen=["isolator"])


@pytest.mark.thorough
def test_tune_sizes_the_leaves_of_an_isolator_and_verifies_them(tuning: Advice) -> None:
    isolator, made = tuning.outcomes
    assert tuning.working == (isolator,)
    assert tuning.made_of_leaves(isolator) is made
    assert made.stage.flat()["joint.stiffness"] == pytest.approx(isolator.stage.flat()["joint.stiffness"], rel=0.01)
    assert made.certainty == "works"
    assert (made.confirmation.verdict, made.confirmation.certain) == ("settles", True)
    files = further_files(tuning)
    written = loads(str(files["tuned-isolator-of-leaf-springs.toml"]))
    assert written.flat()["flexure.length"] == made.stage.flat()["flexure.length"]
    paths = [Path("tuned") / name for name in files]
    assert TuneAnswer(tuning).next_steps(paths) == [
        "friso export tuned/tuned.toml",
        "friso design tuned/tuned-isolator.toml",
        "friso flexure tuned/tuned-isolator-of-leaf-springs.toml",
    ]


@pytest.mark.thorough
def test_words_about_leaves(tuning: Advice, snapshots: Snapshots) -> None:
    """The mode of the present joint is named if the file states it as a number, not if the file has leaf springs."""
    isolator, made = tuning.outcomes
    doubted = replace(tuning, outcomes=(isolator, replace(made, doubts=("distance",))))
    told = {"sized": tuning, "not sure": doubted}
    told |= {name: replace(tuning, stage=stage) for name, stage in {"own mode": RIG, "own leaves": LEAVES}.items()}
    for why in get_args(Unmade):
        told[why] = replace(tuning, outcomes=(isolator,), unmade={isolator.remedy.name: why})
    said = {
        name: [line for line in explained(advice) if "leaf springs" in line.lower()] for name, advice in told.items()
    }
    snapshots.check("tune", "leaf springs", "\n".join(f"{name}: {' '.join(lines)}" for name, lines in said.items()))


@pytest.mark.thorough
def test_leaves_that_are_not_sure_to_work_are_not_recommended(tuning: Advice) -> None:
    isolator, made = tuning.outcomes
    doubted = replace(tuning, outcomes=(isolator, replace(made, doubts=("distance",))))
    names = [name for name in further_files(doubted) if "leaf-springs" in name]
    assert all("not-sure" in name for name in names)
    paths = [Path("tuned") / name for name in further_files(doubted)]
    steps = ["friso export tuned/tuned.toml", "friso design tuned/tuned-isolator.toml"]
    assert TuneAnswer(doubted).next_steps(paths) == steps
