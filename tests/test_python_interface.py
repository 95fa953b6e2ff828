"""What a user meets who calls friso from Python: results, errors and progress."""

import inspect
import pickle
import tomllib
from pathlib import Path
from typing import Any, cast

import pytest

import friso
from friso.progress import silent

FUNCTIONS: list[Any] = [getattr(friso, name) for name in friso.__all__ if inspect.isfunction(getattr(friso, name))]


def test_a_function_of_a_stage_takes_its_file_and_its_tables() -> None:
    path, linear = friso.example("thesis_rig"), cast(Any, friso.linear)
    names = linear(friso.load(path)).state_labels
    for stage in (path, str(path), tomllib.loads(path.read_text())):
        assert linear(stage).state_labels == names
    with pytest.raises(friso.StageError, match="no such file"):
        linear("missing.toml")


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda function: function.__name__)
def test_a_keyword_that_is_not_known_names_function_and_keywords(function: Any) -> None:
    name = next(reversed(inspect.signature(function).parameters))
    with pytest.raises(TypeError, match=rf"{function.__name__}\(\) has no keyword '{name}e'.*{name}"):
        function(**{f"{name}e": 1})


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda function: function.__name__)
def test_a_signature_shows_no_addresses(function: Any) -> None:
    assert " at 0x" not in str(inspect.signature(function))


def test_progress_that_is_not_shown_is_the_same_everywhere() -> None:
    assert pickle.loads(pickle.dumps(silent)) is silent


def test_a_name_that_friso_lacks_suggests_one() -> None:
    with pytest.raises(AttributeError, match="did you mean 'check'"):
        friso.__getattr__("chek")


def test_completion_of_an_answer_shows_nothing_private(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("time [s],position [m]\n" + "".join(f"{k / 100},{k}\n" for k in range(100)))
    shown = dir(friso.logs(tmp_path / "a.csv"))
    assert {"plot", "report", "to_dict"} <= {*shown}
    assert not [name for name in shown if name.startswith("_") and not name.startswith("__")]


@pytest.mark.parametrize("given", [[{"joint.locked": True}], []], ids=["by place", "by keyword"])
def test_changes_given_to_load_are_answered_with_the_way_to_set_keys(given: list[dict[str, bool]]) -> None:
    with pytest.raises(TypeError, match=r"load\(\).*friso\.load\(path\)\.replace\({"):
        friso.load(friso.example("thesis_rig"), *given, **({} if given else {"set": {"joint.locked": True}}))  # type: ignore[call-arg]
