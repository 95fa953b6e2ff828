"""The Python interface: a function per command, its options as keywords, and answers that people and programs read."""

import doctest
import inspect
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import matplotlib as mpl
import pytest
import typer
import xarray as xr
from inside import friso_inside
from refusals import refused
from typer.core import TyperGroup

import friso
from friso.axis import unit_of_key
from friso.cli.app import command_line
from friso.interface.answer import Answer
from friso.interface.question import TOPICS
from friso.stage import Stage

EXAMPLES = Path(__file__).parents[1] / "examples"
STICK_SLIP, LEAVES = EXAMPLES / "lugre_stick_slip.toml", EXAMPLES / "thesis_leaves.toml"

OF_THE_SHELL = {"--out", "--overwrite", "--json", "--details", "--help"}
"""Options that say where an answer goes: `report` and `to_dict` of the answer in Python."""

FUNCTIONS = {"map": "sweep"}
"""Commands whose function has another name."""


def commands() -> dict[str, Any]:
    group = typer.main.get_command(command_line())
    assert isinstance(group, TyperGroup)
    return group.commands


def function_of(command: str) -> Any:
    return getattr(friso, FUNCTIONS.get(command, command))


@pytest.mark.cases(first=3)
@pytest.mark.parametrize("command", [name for name in commands() if name != "app"])  # which answers in a browser
def test_a_command_has_a_function_and_its_options_are_keywords(command: str) -> None:
    keywords = {name.strip("_") for name in inspect.signature(function_of(command)).parameters}
    options = {option for parameter in commands()[command].params for option in parameter.opts if option[:2] == "--"}
    missing = {option for option in options - OF_THE_SHELL if option[2:].replace("-", "_") not in keywords}
    assert missing == set()


def test_dir_is_the_public_list() -> None:
    """`dir` includes the functions of installed packages, here those of the thesis."""
    assert dir(friso) == sorted([*friso.__all__, "guideline", "reproduce", "rig"])
    assert [name for name in dir(friso) if inspect.ismodule(getattr(friso, name))] == []


@pytest.mark.cases(first=8)
@pytest.mark.parametrize("name", [name for name in dir(friso) if callable(getattr(friso, name))])
def test_a_public_name_is_documented_with_an_example_that_runs(name: str) -> None:
    """Examples that take long are skipped, but have to be there."""
    text = inspect.getdoc(getattr(friso, name)) or ""
    assert "Examples\n--------" in text
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
    example = doctest.DocTestParser().get_doctest(text, {}, name, None, 0)
    assert example.examples
    assert runner.run(example).failed == 0


def imported(code: str, *modules: str) -> str:
    """What is printed by code that tells at its end which of these modules it has imported."""
    code = f"import sys\ntry:\n    {code}\nfinally:\n    print([m for m in {modules} if m in sys.modules])"
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip()


@pytest.mark.slow
def test_importing_friso_imports_neither_arrays_nor_units() -> None:
    """Views that quote a word or a limit import the interface of friso.hunting."""
    assert imported("import friso", "numpy", "pydantic", "pint", "xarray", "sympy") == "[]"
    assert imported("import friso.hunting", "sympy", "xarray", "scipy") == "[]"


def test_the_help_imports_no_stage_and_lists_every_command_once() -> None:
    code = "import friso.cli.app as app; sys.argv = ['friso', '--help']; app.main()"
    text = imported(code, "numpy", "pydantic", "pint")
    assert text.splitlines()[-1] == "[]"
    listed = [line.split()[0] for line in text.splitlines() if line[:2] == "  " and line[2:3].isalpha()]
    assert set(commands()) <= set(listed)
    assert [question for question in TOPICS if question not in text] == []
    assert "..." not in text.partition("Does it hunt?")[2]


@pytest.fixture(scope="module")
def response() -> Answer:
    return friso.simulate(STICK_SLIP, sample_time="10 ms")


@pytest.fixture(scope="module")
def leaves() -> Answer:
    return friso.flexure(LEAVES)


@pytest.fixture(params=["response", "leaves"])
def answer(request: pytest.FixtureRequest) -> Answer:
    return request.getfixturevalue(request.param)


def test_an_answer_is_read_by_people(answer: Answer) -> None:
    assert "\n" not in repr(answer)
    assert len(repr(answer)) < 400
    page = answer._repr_html_()
    assert answer.sentences()[0].split()[0] in page
    assert "array(" not in page
    assert len(page) < 10_000


def test_an_answer_is_drawn_on_axes_given_or_made(response: Answer) -> None:
    mpl.use("agg")
    from matplotlib import pyplot

    panels = len(response.figures()[0].panels)
    _, axes = pyplot.subplots(panels, squeeze=False)
    assert response.plot([*axes[:, 0]]) == [*axes[:, 0]]
    assert len(response.plot()) == panels
    with pytest.raises(friso.InputError, match="one per panel"):
        response.plot([])
    with pytest.raises(friso.InputError, match="figure"):
        response.plot(figure=7)
    pyplot.close("all")


@pytest.mark.cases(first=1)
@pytest.mark.parametrize(("command", "path"), [("flexure", LEAVES), ("simulate", STICK_SLIP)])
def test_an_answer_as_a_dictionary_is_the_document(command: str, path: Path, tmp_path: Path) -> None:
    document = json.loads(friso_inside(tmp_path, command, path, "--json").stdout)
    answer = function_of(command)(path)
    assert {key: value for key, value in document.items() if key not in ("files", "plug_ins")} == answer.to_dict()


def test_an_answer_writes_its_files(leaves: Answer, tmp_path: Path, undrawn: None) -> None:
    (page,) = leaves.report(tmp_path / "leaves.html")
    assert page.read_text(encoding="utf-8").startswith("<!")
    with pytest.raises(friso.InputError):
        leaves.report(page)
    written = leaves.report(tmp_path / "folder")
    assert {path.name for path in written} >= {"flexure.html", "flexure_drawing.svg"}


def test_data_have_units(leaves: Answer, response: Answer) -> None:
    assert isinstance(leaves.data, xr.Dataset)
    assert response.data["position"].attrs["units"] == "m"
    with_units = [name for name in leaves.data.variables if "units" in leaves.data[name].attrs]
    assert with_units


def test_stages_are_taken_in_every_form() -> None:
    """Setting a key of a stage tells how; options that are wrong are named as they were given."""
    stage = friso.load(STICK_SLIP)
    for form in (stage, STICK_SLIP, str(STICK_SLIP), stage.as_written()):
        run = friso.simulate(form, 1e-4, 0.1, set={"motion.duration": "2 s"})
        assert run.sizes["time"] == 21
    for part, name in ((stage, "name"), (stage.masses, "cart")):
        with pytest.raises(AttributeError, match=r"stage.replace"):
            setattr(part, name, "2 kg")
    with refused("sample_time"):
        friso.simulate(STICK_SLIP, sample_time="1 mm")


def test_units_of_keys() -> None:
    units = {"peak_to_peak_m": "m", "velocity_m_per_s": "m/s", "stiffness_n_per_m": "N/m", "crossover_hz": "Hz"}
    units |= {"damping_n_s_per_m": "N*s/m", "peaks": "", "cycle.amplitude_m": "m"}
    assert {key: unit_of_key(key)[1] for key in units} == units


def test_the_schema_takes_the_examples_and_has_every_key() -> None:
    """The schema is compared with the tables themselves: every key and the values it takes."""
    document = friso.schema()
    assert set(document["properties"]) == set(Stage.model_fields)
    laws = document["properties"]["friction"]["anyOf"]
    assert {"lugre", "dahl", "stribeck", "none"} <= {law["properties"]["model"]["enum"][0] for law in laws}
    cart = document["properties"]["masses"]["properties"]["cart"]
    assert (cart["examples"], cart["x-unit"]) == (["1.2 kg"], "kg")
    assert friso.schema("specification")["properties"]["machine"]
    with pytest.raises(friso.InputError):
        friso.schema("design")
