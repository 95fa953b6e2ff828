"""When the drive of the stage is the one that is simulated, and when not, which has to be said."""

from pathlib import Path

from friso import load
from friso.identification.output_error.problem import why_continuous

EMPS = Path(__file__).parents[1] / "examples" / "emps_axis.toml"


def axis(**changes: str | float | None) -> dict:
    return load(EMPS).replace({"drive.sample_time": "1 ms", **changes}).flat()


def test_the_log_of_the_drive_itself_is_simulated_sampled() -> None:
    assert why_continuous(axis(), 0.99998e-3) == ""


def test_a_log_at_another_rate_is_not_and_says_so() -> None:
    wording(why_continuous(axis(), 2e-3))


def test_a_stage_without_sample_time_has_nothing_to_say() -> None:
    assert why_continuous(load(EMPS).flat(), 1e-3) == ""
