"""The deviation that counts as in position: of the user, of the stage, and never finer than the machine."""

from pathlib import Path

import numpy as np
import pytest
from inside import friso_inside
from variants import MEASURED, gains, lugre, release, stage

import friso
from friso.hunting.measures import BANDS, bands_of
from friso.questions.tune.question import _goal
from friso.stage import Stage


@pytest.fixture(scope="module")
def resting() -> Stage:
    """A stage that rests 125 um off its reference, where its controller exerts no force."""
    control = gains(2000.0, 8000.0, 80.0, extra=MEASURED)
    return stage(release("2 mm", "2 s"), "stage", lugre(2), controller=control).replace(
        {"controller.freeze_window": "150 um", "controller.freeze_window_exit": "400 um"}
    )


@pytest.mark.parametrize(
    ("changed", "bands"),
    [
        ({}, BANDS),
        ({"tolerance.within": "100 nm"}, (1e-7, 1e-5)),
        ({"tolerance.within": "50 um"}, (5e-5, 5e-5)),
        ({"drive.encoder_resolution": "5 um"}, (5e-6, 1e-5)),
        ({"drive.encoder_resolution": "20 um", "tolerance.within": "3 um"}, (2e-5, 2e-5)),
        ({"controller.error_deadband": "30 um"}, (3e-5, 3e-5)),
        ({"controller.error_deadband": "2 um", "controller.error_deadband_exit": "6 um"}, (6e-6, 1e-5)),
    ],
)
def test_the_bands_are_never_finer_than_the_machine(changed: dict[str, str], bands: tuple[float, float]) -> None:
    plain = stage(release("2 mm", "2 s"), "stage", lugre(2), controller=gains(2000.0, 8000.0, 80.0, extra=MEASURED))
    assert bands_of(plain.replace(changed).flat()) == pytest.approx(bands)


def test_a_stage_that_rests_in_its_dead_zone_settles_there(resting: Stage) -> None:
    """Its settling time is that of the trace into the error at which the controller is engaged again."""
    case = friso.check(resting).result["given"]
    trace = friso.simulate(resting, 1e-9, 1e-4)
    outside = np.abs(trace["position"].values) > 4e-4
    entered = trace["time"].values[np.flatnonzero(outside)[-1] + 1]
    assert (case.verdict, case.bands) == ("settles", (4e-4, 4e-4))
    assert case.settling_time[4e-4] == pytest.approx(entered, abs=2e-4)


@pytest.mark.slow
def test_check_judges_within_what_the_user_says(resting: Stage) -> None:
    plain = resting.replace({"controller.freeze_window": None, "controller.freeze_window_exit": None})
    by_option, by_file = (friso.check(plain, within="50 um"), friso.check(plain.replace({"tolerance.within": "50 um"})))
    times = [answer.result["given"].settling_time for answer in (by_option, by_file)]
    assert times[0] == times[1]
    assert [*times[0]] == [5e-5]
    assert by_option.to_dict()["cases"]["given"]["bands_m"] == pytest.approx([5e-5, 5e-5])


@pytest.mark.parametrize("within", [None, "1 um"])
def test_compare_and_tune_judge_within_the_tolerance_of_the_machine(
    resting: Stage, within: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its controller exerts no force within 400 um, so a finer wish does not count."""
    asked: list[float] = []
    monkeypatch.setattr("friso.remedies.comparison.compare", lambda *options: asked.append(options[3]))
    friso.compare([resting, resting], within=within)
    goal = _goal(resting, within, *7 * [None])
    assert [*asked, goal.within] == pytest.approx([4e-4, 4e-4])


def test_no_sentence_is_finer_than_the_encoder(tmp_path: Path, resting: Stage) -> None:
    """At the end the stage moves by picometres; its encoder has steps of 10 um."""
    file = tmp_path / "stage.toml"
    file.write_text(resting.replace({"drive.encoder_resolution": "10 um"}).to_toml())
    said = friso_inside(tmp_path, "check", str(file)).stdout
    assert "nm" not in said
    assert "10" in said
