"""The verdict on the thesis rig and other stages, through the Python interface."""

import logging
from pathlib import Path

import numpy as np
import pytest
from snapshots import alike
from variants import VARIANTS

import friso
from friso.hunting import check_given
from friso.hunting.measures import measured_run
from friso.questions.check.question import CheckAnswer
from friso.stage import Stage
from friso.studies.sweep import sweep

EXAMPLES = Path(__file__).parent.parent / "examples"


@pytest.fixture(scope="module")
def checked(rig: Stage) -> CheckAnswer:
    return friso.check(rig)


@pytest.mark.usefixtures("own_bandwidth")
@pytest.mark.parametrize("rtol", [1e-6, 1e-8])
def test_the_thesis_rig_hunts_locked_and_settles_free(checked: CheckAnswer, rig: Stage, rtol: float) -> None:
    """Issue 2 and references.md, section 2: 6 peaks, amplitude about 0.52 mm; none with the free joint."""
    cases = checked if rtol == 1e-6 else friso.check(rig, rtol=rtol)
    assert list(cases) == ["given", "locked", "free"]
    locked, free = cases["locked"], cases["free"]
    assert (locked.verdict, locked.peaks) == ("hunts", 6)
    assert locked.peak_to_peak / 2 == pytest.approx(0.52e-3, rel=0.02)
    assert locked.settling_time == {1e-6: None, 1e-5: None}
    assert (free.verdict, free.peaks, free.period) == ("settles", 0, None)
    assert free.settling_time[1e-5] < free.settling_time[1e-6] < 5  # type: ignore[operator]
    assert cases["given"] is not locked
    assert cases["given"].solver == free.solver


def test_the_readme_shows_what_its_first_line_prints(checked: CheckAnswer) -> None:
    """Numbers agree as far as processors do, as the limiter scatters."""
    readme = (EXAMPLES.parent / "README.md").read_text(encoding="utf-8")
    printed = readme.partition("```text\n")[2].partition("\n```")[0].splitlines()
    assert all(map(alike, checked.sentences(), printed)), [*checked.sentences()]
    assert len([*checked.sentences()]) == len(printed)


@pytest.mark.slow
@pytest.mark.usefixtures("own_bandwidth")
def test_verdicts_are_mentioned_before_kicks_and_other_bandwidths(rig: Stage, caplog: pytest.LogCaptureFixture) -> None:
    seen: list[str] = []
    with caplog.at_level(logging.INFO, "friso"):
        friso.check(rig, progress=lambda done, total, label: seen.extend([caplog.text] * (done < total)))
    assert any("Locked: hunts" in text and "Free (as given): does not hunt" in text for text in seen)


@pytest.mark.slow
@pytest.mark.usefixtures("own_bandwidth")
def test_measures_agree_with_the_trace(rig: Stage) -> None:
    """The statistics gathered in the kernel against the samples of the dense output."""
    for case in friso.check(rig).traced.values():
        trace = case.trace
        off = np.abs(trace.position - trace.reference).values
        time, late = trace.time.values, trace.time.values >= 15
        deviation = (trace.position - trace.reference).values[late]
        assert case.peak_to_peak == pytest.approx(np.ptp(deviation), rel=1e-4, abs=1e-12)
        assert case.largest_force == pytest.approx(np.abs(trace.force).max().item(), rel=1e-3)
        for band, settled in case.settling_time.items():
            last = time[off > band].max()
            if settled is None:
                assert last == time[-1]
            else:
                assert settled == pytest.approx(last - 5.06, abs=2e-3)


@pytest.mark.slow
@pytest.mark.usefixtures("own_bandwidth")
def test_locked_without_stiffness_has_no_free_case(rig: Stage) -> None:
    held = {"joint.locked": True, "joint.stiffness": None, "joint.damping": None, "joint.stroke": None}
    assert list(friso.check(rig.replace(held))) == ["given", "locked"]


SPRING = """
masses.stage = "1 kg"
friction = {{ model = "lugre", static = "1e-12 N", coulomb = "1e-12 N", stribeck_velocity = "1 mm/s", \
stribeck_exponent = 2, bristle_stiffness = "1e-6 N/m", bristle_damping = "0 N*s/m", viscous = "0 N*s/m" }}
controller = {{ kind = "pid", kp = "{kp} N/m", kd = "{kd} N*s/m", derivative_on = "measurement" }}
motion = {{ kind = "step", size = "1 mm", duration = "20 s" }}
"""


@pytest.mark.cases(first=2)
@pytest.mark.parametrize(("kp", "kd"), [(1000.0, 15.0), (40.0, 3.0), (300.0, 2.0)])
def test_settling_time_of_a_damped_spring(kp: float, kd: float) -> None:
    """Closed form: the last time at which the free oscillation leaves the band, between or beyond its extrema. Its
    friction is none to speak of, in the form of the stage below."""
    case = friso.check(friso.loads(SPRING.format(kp=kp, kd=kd)), rtol=1e-9)["given"]
    decay, omega = kd / 2, np.sqrt(kp - kd**2 / 4)
    time = np.arange(0, 20, 1e-5)
    off = 1e-3 * np.exp(-decay * time) * np.abs(np.cos(omega * time) + decay / omega * np.sin(omega * time))
    for band, settled in case.settling_time.items():
        assert settled == pytest.approx(time[off > band].max(), abs=3e-5)


STUCK = """
masses.stage = "1.7 kg"
friction = { model = "lugre", static = "3 N", coulomb = "1 N", stribeck_velocity = "1.6 mm/s", stribeck_exponent = 2, \
bristle_stiffness = "1e5 N/m", bristle_damping = "316 N*s/m", viscous = "0.5 N*s/m" }
controller = { kind = "pid", kp = "2000 N/m", kd = "20 N*s/m", derivative_on = "measurement" }
motion = { kind = "release", displacement = "0.5 mm", duration = "20 s" }
"""


@pytest.mark.parametrize("rtol", [1e-4, 1e-6])
@pytest.mark.parametrize("displacement", ["0.5 mm", "1 mm", "-1 mm"])
def test_a_stage_stuck_off_its_reference_does_not_hunt(rtol: float, displacement: str) -> None:
    """Without integral action it sticks where it is; rounding noise about there is no peak."""
    stage = friso.loads(STUCK.replace("\\\n", "")).replace({"motion.displacement": displacement})
    case = friso.check(stage, rtol=rtol)["given"]
    assert (case.verdict, case.peaks) == ("settles", 0)
    assert case.settling_time[1e-5] is None


@pytest.mark.slow
@pytest.mark.usefixtures("own_bandwidth")
def test_a_run_too_short_for_the_peak_count_hunts_all_the_same(rig: Stage) -> None:
    """The cycle attracts, and the move ends in it, however short the run."""
    short = rig.replace({"motion.duration": "9.9 s", "joint.locked": True})
    case = check_given(short, 1e-6)
    assert (case.verdict, case.peaks) == ("hunts", 0)


def test_the_edge_of_hunting_of_the_thesis_rig(checked: CheckAnswer) -> None:
    """references.md, section 2: the locked rig's multiplier passes -1 near 9.7 Hz."""
    locked, free = checked["locked"].judgement, checked["free"].judgement
    assert locked.margin.crossover == pytest.approx(9.75, rel=2e-3)
    assert free.margin.crossover == pytest.approx(5.60, rel=5e-3)
    assert locked.displacement.smallest == pytest.approx(0.2e-3, rel=0.02)


@pytest.mark.cases(slow=2)
@pytest.mark.usefixtures("own_bandwidth")
@pytest.mark.parametrize(
    ("crossover", "locked", "verdict"),
    [("10 Hz", True, "transient"), ("12 Hz", True, "settles"), ("5 Hz", False, "bistable")],
)
def test_verdicts_by_the_cycle(rig: Stage, crossover: str, locked: bool, verdict: str) -> None:
    """Just above the edge a move still swings for minutes; below the free rig's edge only a kick starts hunting."""
    stage = rig.replace({"controller.crossover": crossover, "joint.locked": locked})
    judgement = check_given(stage, 1e-6).judgement
    assert judgement.verdict == verdict
    assert judgement.cycle.attracts == (verdict == "bistable")


def test_without_a_joint_there_is_one_case_and_without_integral_action_a_reason() -> None:
    cases = friso.check(friso.load(EXAMPLES / "lugre_stick_slip.toml"))
    assert list(cases) == ["given"]
    case = cases["given"]
    assert (case.verdict, case.judgement.cycle) == ("transient", None)
    assert "no integral action" in case.judgement.hunting.reason


@pytest.mark.cases(first=3)
@pytest.mark.parametrize("share", [0.99, 0.999, 0.9999])
@pytest.mark.parametrize("rtol", [1e-4, 1e-6])
def test_a_short_touch_of_the_limiter_is_not_missed(rig: Stage, share: float, rtol: float) -> None:
    """A stroke a little less than the largest deflection: the limiter touches for a moment, however long the steps."""
    smooth = rig.replace({
        "friction": None, "parasitic": None, "controller.crossover": "4 Hz", "motion.acceleration": "10 m/s^2",
        "motion.acceleration_time": "0.1 s", "motion.duration": "5.5 s", "joint.stroke": "1 m",
    })  # fmt: skip
    largest = np.abs(friso.simulate(smooth, rtol=1e-10).joint_deflection).max().item()
    near = smooth.replace({"joint.stroke": f"{share * largest:.12f} m"})
    coarse, fine = friso.simulate(near, rtol=rtol), friso.simulate(near, rtol=1e-11)
    error = np.abs(coarse.position - fine.position)[fine.time < 1].max().item()
    assert error < 20 * rtol * 0.1


def test_a_sweep_over_the_duration_leaves_its_cells_alone(rig: Stage) -> None:
    runs = sweep(rig, {"motion.duration": ["10.5 s", "20 s", "60 s"]}, rtol=1e-6)
    alone = measured_run(rig, 1e-6)
    assert runs.settling_time.values[1] == alone.settling_time[0][0]
    assert runs.steps.values[1] == alone.steps[0]


@pytest.mark.slow
@pytest.mark.usefixtures("own_bandwidth")
@pytest.mark.parametrize(
    ("limit", "duration", "at"), [("2.5 N", "500 ms", 2.5), ("2.5 N", "20 s", 2.5), ("6 N", "20 s", None)]
)
def test_a_force_limit_that_keeps_a_stage_off_its_reference_is_named(
    limit: str, duration: str, at: float | None
) -> None:
    changes = {"controller.force_limit": limit, "motion.duration": duration}
    case = friso.check(VARIANTS["rigid, van Dijk, limit"].replace(changes))["given"]
    assert case.force_limit == at


@pytest.mark.slow
def test_a_motion_with_less_force_than_breaks_the_stage_away_leaves_it_unmoved() -> None:
    """Released at 15 um the stage creeps home; at 2 mm it breaks away."""
    settled = VARIANTS["rigid"].replace({"controller.crossover": "12 Hz", "motion.duration": "5 s"})
    cases = {d: friso.check(settled.replace({"motion.displacement": d}))["given"] for d in ("15 um", "2 mm")}
    assert [case.unmoved for case in cases.values()] == [True, False]
    assert cases["15 um"].breakaway == pytest.approx(3.0)
    run = friso.simulate(cases["15 um"].stage)
    assert np.ptp(run.position.values) < 16e-6
    last = float(run.time.values[np.abs(run.error.values) > 10e-6][-1])
    assert cases["15 um"].settling_time[1e-5] == pytest.approx(last, abs=1e-3)
