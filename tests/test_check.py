"""The verdict on the thesis rig and other stages, through the Python interface."""

from pathlib import Path

import numpy as np
import pytest

import friso
from friso.stage import Stage

EXAMPLES = Path(__file__).parent.parent / "examples"

pytestmark = pytest.mark.xdist_group("rig")


@pytest.fixture(scope="module")
def rig() -> Stage:
    return friso.load(EXAMPLES / "thesis_rig.toml")


@pytest.mark.parametrize("rtol", [1e-6, 1e-8])
def test_the_thesis_rig_hunts_locked_and_settles_free(rig: Stage, rtol: float) -> None:
    """Issue 2 and references.md, section 2: 6 peaks, amplitude about 0.52 mm; none with the free joint."""
    cases = friso.check(rig, rtol=rtol)
    assert list(cases) == ["given", "locked", "free"]
    locked, free = cases["locked"], cases["free"]
    assert (locked.verdict, locked.peaks) == ("hunts", 6)
    assert locked.peak_to_peak / 2 == pytest.approx(0.52e-3, rel=0.02)
    assert locked.settling_time == {1e-6: None, 1e-5: None}
    assert (free.verdict, free.peaks, free.period) == ("settles", 0, None)
    assert free.settling_time[1e-5] < free.settling_time[1e-6] < 5  # type: ignore[operator]
    assert cases["given"] is not locked
    assert cases["given"].solver == free.solver


def test_measures_agree_with_the_trace(rig: Stage) -> None:
    """The statistics gathered in the kernel against the samples of the dense output."""
    for case in friso.check(rig, traces=True).values():
        trace = case.trace
        assert trace is not None
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


def test_without_a_joint_there_is_one_case() -> None:
    cases = friso.check(friso.load(EXAMPLES / "lugre_stick_slip.toml"))
    assert list(cases) == ["given"]


def test_locked_without_stiffness_has_no_free_case(rig: Stage) -> None:
    held = {"joint.locked": True, "joint.stiffness": None, "joint.damping": None, "joint.stroke": None}
    assert list(friso.check(rig.replace(held))) == ["given", "locked"]


def test_unusable_tolerance(rig: Stage) -> None:
    with pytest.raises(ValueError, match=r"rtol: given 1, expected .* such as 1e-6"):
        friso.check(rig, rtol=1.0)
