"""The thesis's identification experiments: verdicts on its rig, and on rigs changed to get other verdicts."""

import re
from dataclasses import replace

import numpy as np
import pytest

from friso_thesis.studies.rig.outcome import locked_stage
from friso_thesis.studies.thesis.as_built import rig_with_drive
from friso_thesis.studies.thesis.claims import Evidence, Finding, registered
from friso_thesis.studies.thesis.experiments import (
    SLOW_SPEEDS,
    Experiments,
    LockedLine,
    constant_speed,
    joint_steps,
    slow_motion,
)
from friso_thesis.studies.thesis.judges.identified_in_time import judged_line, judged_slips, judged_speeds, judged_steps
from friso_thesis.studies.thesis.linear import analysed
from friso_thesis.studies.thesis.linear.plants import limit_cases_of
from friso_thesis.studies.thesis.studies import thesis_rig


def judged(claim: str) -> Finding:
    """Return the judge's finding from the experiments that the claim needs, and no others."""
    stage, entry = thesis_rig(), registered()[claim]
    return entry.judge(Evidence({}, {}, analysed(stage), Experiments(stage)))


def of_plant(changes: dict[str, str]) -> Finding:
    """F18 with the limit cases of another rig, which are all that its judge looks at."""
    plants = limit_cases_of(thesis_rig().replace(changes).flat())
    return registered()["F18"].judge(Evidence({}, {}, replace(analysed(thesis_rig()), plants=plants)))


@pytest.mark.cases(first=3, slow=1)
@pytest.mark.parametrize(
    ("claim", "holds"),
    [
        ("F18", (True, None)),
        ("F19", (None,)),
        ("F20", (True, None)),
        ("F17", (True, None, True)),
        ("F21", (True, True, True)),
    ],
)
def test_what_is_found_of_the_identification(claim: str, holds: tuple[bool, ...]) -> None:
    finding = judged(claim)
    assert finding.pattern == holds, finding
    assert all(part.holds or part.why or part.open for part in finding.parts)
    assert not re.search(r"\bnan\b", " ".join(part.number + part.why for part in finding.parts))


def test_the_judges_recognise_what_holds() -> None:
    """Rigs and responses that are as the thesis says."""
    stiff = thesis_rig().replace({"joint.stiffness": "2.9 N/mm"})
    assert all(part.holds for part in judged_steps(joint_steps(stiff)).parts)
    assert all(part.holds for part in of_plant({"masses.stage": "0.75 kg", "joint.stiffness": "3.6 N/mm"}).parts)
    slippery = thesis_rig().replace({"friction.static": "2.4 N"})
    assert all(part.holds for part in judged_slips(tuple(slow_motion(slippery, speed) for speed in SLOW_SPEEDS)).parts)
    magnitude = np.full((4, 9), 1.7 / 2.5)
    magnitude[:, -1] = 0.1
    scatter = np.array([0.01, 0.1, 0.3, 0.2, 0.1, 0.1, 0.01, 0.01, 0.01])
    assert judged_line(LockedLine(magnitude, np.zeros((4, 9)), scatter), 1.7).judgement == "holds"


@pytest.mark.slow
def test_the_judges_recognise_what_does_not_hold() -> None:
    smooth = thesis_rig().replace({"friction.static": "1 N"})
    runs = tuple(slow_motion(smooth, speed) for speed in SLOW_SPEEDS)
    assert judged_slips(runs).pattern[0] is False
    varied = ("static_deviation", "coulomb_deviation", "first_harmonic", "second_harmonic")
    even = {"friction.static": "1 N", "cable.stiffness": "0 N/m", **{f"rail.{name}": 0.0 for name in varied}}
    smooth_rail = constant_speed(locked_stage(rig_with_drive(thesis_rig()).replace(even)))
    assert judged_speeds(smooth_rail, smooth_rail).pattern[:2] == (False, False)
    assert (
        judged_line(LockedLine(np.full((4, 9), 2.0), np.zeros((4, 9)), np.linspace(0.1, 0.5, 9)), 1.7).judgement
        == "differs"
    )
    few = replace(joint_steps(thesis_rig()), stiffness=5e3)
    assert not any(part.holds for part in judged_steps(few).parts)
    assert of_plant({"joint.stiffness": "24 N/mm", "parasitic.frequency": "600 Hz"}).judgement == "differs"
