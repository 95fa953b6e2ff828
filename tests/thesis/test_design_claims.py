"""The judges of the claims on the thesis's leaf springs and on its rules of design."""

from collections.abc import Mapping

import pytest
from made_maps import Cells, made

from friso_thesis.studies.thesis.claims import Evidence, Finding, registered
from friso_thesis.studies.thesis.judges import design_rules


def judged(maps: Mapping[str, Cells]) -> Finding:
    return registered()["D1"].judge(Evidence({name: made(name, hunts, points=41) for name, hunts in maps.items()}, {}))


HOLD = {
    "isolator-stiffness": lambda k, s: (s < 0.3e-3) | (k > 6e3),
    "isolator-crossover": lambda f, s: f < 5.3,
    "friction": lambda s, c: s - c > 0.95,
    "system": lambda f, m: f < 15,
}
DIFFER = {
    "isolator-stiffness": lambda k, s: (s < 0.6e-3) & (k > 0),
    "isolator-crossover": lambda f, s: f < 12,
    "friction": lambda s, c: s - c > 2,
    "system": lambda f, m: f < 5,
}


def test_rules_of_design_hold_and_differ(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(design_rules, "_needed_ratio", lambda rig: 9.0)
    assert judged(HOLD).judgement == "holds"
    monkeypatch.setattr(design_rules, "_needed_ratio", lambda rig: 17.0)
    monkeypatch.setattr(design_rules, "_margins_at_the_top", lambda rig: {"locked": 0.0, "free": 0.3})
    assert judged(DIFFER).judgement == "differs"


@pytest.mark.parametrize(("below", "holds"), [(14.0, True), (16.0, False)])
def test_the_parameter_study_against_the_experiment(below: float, holds: bool) -> None:
    """F25P: 14.3 Hz of the experiment, beside the limit of Fig. 11B at 1.7 kg."""
    system = made("system", lambda f, m: f < below, points=41)
    assert registered()["F25P"].judge(Evidence({"system": system}, {})).pattern == (holds,)


@pytest.mark.slow
def test_the_ratio_of_the_parasitic_mode_is_computed() -> None:
    """At a ratio just below the one found the margin is too small; from it on it never is."""
    from friso.frequency.bode import settled_margin
    from friso_thesis.studies.thesis.studies import thesis_rig

    ratio = design_rules._needed_ratio(thesis_rig().to_toml())
    flat = {**thesis_rig().flat(), "joint.locked": False}
    tried = design_rules.PARASITIC_RATIOS
    below = tried[tried < ratio * 0.999][-1]
    crossover = flat["controller.crossover"]
    assert settled_margin({**flat, "parasitic.frequency": ratio * crossover}) >= 0.5
    assert settled_margin({**flat, "parasitic.frequency": below * crossover}) < 0.5


def test_the_leaf_springs_of_the_thesis() -> None:
    result = registered()["S35"].judge(Evidence({}, {}))
    assert result.judgement == "holds", result
    stress = result.parts[-1].number
    assert float(stress.split(" to ")[1].split()[0]) == pytest.approx(52.2, abs=0.5)
