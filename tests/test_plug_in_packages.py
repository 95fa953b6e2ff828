"""What installed packages add to friso: found by entry points, named, and ignored where unusable."""

import json
import math
import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest
from patience import LIMIT

from friso import example
from friso.errors import InputError
from friso.stage import ControllerSection, register_controller

TESTS = Path(__file__).parent

LAW = '''
"""A friction law of another package."""

from typing import Literal

from friso.stage import FrictionSection, register_friction


@register_friction
class Mine(FrictionSection):
    model: Literal["{name}"]
'''

STAGE = """
masses.cart = "1 kg"
motion = {kind = "step", size = "1 mm", duration = "20 ms"}
[controller]
kind = "pi-d"
bandwidth = "8 Hz"
mass = "1 kg"
"""


Points = Mapping[str, str]


def package(folder: Path, name: str, **points: str | Points) -> None:
    """Write the metadata that pip installs for a package with entry points.

    `points`: for each group a module, or modules by name.
    """
    info = folder / f"{name}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    lines = []
    for group, modules in points.items():
        named = {modules: modules} if isinstance(modules, str) else modules
        lines += [f"[friso.{group}]", *(f"{name} = {module}" for name, module in named.items())]
    (info / "entry_points.txt").write_text("\n".join(lines))


def python(folder: Path, code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    paths = os.pathsep.join([str(TESTS.parent), str(folder)])
    return subprocess.run(
        [sys.executable, "-c", code, *arguments],
        cwd=folder, capture_output=True, text=True, timeout=LIMIT, env={**os.environ, "PYTHONPATH": paths},
    )  # fmt: skip


def friso_command(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return python(folder, "from friso.cli import main; main()", *arguments)


def answered(folder: Path, *arguments: str) -> str:
    """What a command prints that answers."""
    done = friso_command(folder, *arguments)
    assert done.returncode == 0, done.stderr
    return " ".join(done.stdout.split())


def asked_in_vain(folder: Path, *arguments: str) -> str:
    """What a command says that cannot answer."""
    done = friso_command(folder, *arguments)
    assert (done.returncode, done.stdout) == (2, "")
    assert "Traceback" not in done.stderr
    return done.stderr


@pytest.fixture
def installed(tmp_path: Path) -> Path:
    own = (TESTS / "own_controller.py").read_text(encoding="utf-8")
    (tmp_path / "own_controller.py").write_text(f"{own}\nprint('what a plug-in prints is no answer')\n")
    (tmp_path / "air_film.py").write_text(LAW.replace("{name}", "air"))
    package(tmp_path, "other", controllers="own_controller", friction="air_film")
    (tmp_path / "stage.toml").write_text(STAGE)
    return tmp_path


METRIC = '''
"""Largest force over static friction"""

from friso.studies.metric import Metric

METRIC = Metric(
    "Use of the force", lambda run: run.measures.largest_force / run.flat["friction.static"], unit="1"
)
'''


@pytest.mark.slow
def test_a_metric_of_a_package_is_mapped(tmp_path: Path) -> None:
    (tmp_path / "force_use.py").write_text(METRIC)
    package(tmp_path, "other", metrics={"force_use": "force_use", "peaks": "force_use"})
    shutil.copy(example("thesis_rig"), tmp_path / "rig.toml")
    small = ("rig.toml", "--x", "controller.crossover=4 Hz, 8 Hz", "--out", "a.zarr", "--json")
    done = friso_command(tmp_path, "map", *small, "--metric", "force_use")
    assert done.returncode == 0, done.stderr
    assert "friso.metrics: peaks is left out" in " ".join(done.stderr.split())
    assert "Use of the force" in (tmp_path / "a.html").read_text(encoding="utf-8")


@pytest.mark.thorough
def test_a_controller_and_a_law_are_used_and_named(installed: Path) -> None:
    """Processes that compile or compute cells import neither before they receive a stage with it."""
    listed = answered(installed, "--help")
    assert "controller pi-d (own_controller)" in listed
    assert "friction law air (air_film)" in listed
    document = json.loads(answered(installed, "bode", "stage.toml", "--json", "--out", "out"))
    (page,) = (Path(file) for file in document["files"] if file.endswith(".html"))
    assert "controller pi-d (own_controller)" in (installed / page).read_text(encoding="utf-8")
    assert "controller pi-d (own_controller)" in document["plug_ins"]
    bandwidths = "controller.bandwidth=8 Hz, 9 Hz"
    cells = answered(installed, "map", "stage.toml", "--x", bandwidths, "--workers", "2", "--out", "m", "--json")
    outcomes = json.loads(cells)["outcomes"]
    assert sum(outcomes.values()) == 2
    assert not outcomes.get("failed")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "module", "why"),
    [("lugre", "taken", '"lugre"'), ("air", "missing", "cannot be imported"), ("air", "leaves", "cannot be imported")],
)
def test_a_law_that_is_of_no_use_is_one_message(name: str, module: str, why: str, tmp_path: Path) -> None:
    """The rest is there all the same; a stage file that names it is told why it is not."""
    (tmp_path / "taken.py").write_text(LAW.replace("{name}", name))
    (tmp_path / "leaves.py").write_text("raise SystemExit(0)")
    package(tmp_path, "other", friction=module)
    done = friso_command(tmp_path, "--help")
    assert done.returncode == 0
    assert "  check " in done.stdout
    assert f"friso: friso.friction: {module}" in left_out(done)
    assert why in left_out(done)
    if module == "missing":
        (tmp_path / "stage.toml").write_text(f'{STAGE}\n[friction]\nmodel = "air"\n')
        said = asked_in_vain(tmp_path, "check", "stage.toml")
        assert "missing, which cannot be imported" in said
        assert "friction.model" in said


def left_out(done: subprocess.CompletedProcess[str]) -> str:
    """The one sentence on standard error."""
    assert done.stderr.count("\n") == 1, done.stderr
    assert "is left out" in done.stderr
    return done.stderr


@pytest.fixture(scope="module")
def resting(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which the package of tests/friso_resting is installed."""
    folder = tmp_path_factory.mktemp("resting")
    shutil.copytree(TESTS / "friso_resting", folder / "friso_resting")
    (folder / "friso_resting-1.0.dist-info").mkdir()
    (folder / "friso_resting-1.0.dist-info" / "METADATA").write_text("Name: friso-resting\nVersion: 1.0\n")
    points = (TESTS / "friso_resting" / "__init__.py").read_text(encoding="utf-8").partition("\n\n")[2]
    points = points.replace('[project.entry-points."', "[").replace('"]', "]").replace('"', "")
    (folder / "friso_resting-1.0.dist-info" / "entry_points.txt").write_text(points)
    return folder


@pytest.mark.slow
def test_a_command_and_a_function_of_a_package_are_listed_and_answer(resting: Path) -> None:
    listed = friso_command(resting, "--help")
    assert (listed.returncode, listed.stderr) == (0, "")
    rows = listed.stdout.partition("Why does it hunt?")[2].splitlines()
    names = [line.split()[0] for line in rows if line[2:3].strip()]
    assert names.index("bode") < names.index("resting") < names.index("reproduce")
    assert "Example: friso resting rig.toml" in answered(resting, "resting", "--help")
    changed = ("resting", example("thesis_rig"), "--set", "friction.static=6 N")
    document = json.loads(answered(resting, *map(str, changed), "--json", "--out", "out"))
    assert document["distance_m"] == pytest.approx(6 / (1.7 * (2 * math.pi * 8) ** 2 / 10**0.5))
    page = (resting / "out" / "resting.html").read_text(encoding="utf-8")
    assert "From another package: Friction may hold" in page
    code = "import friso; answer = friso.resting(friso.example('thesis_rig')); print(answer, 'resting' in dir(friso))"
    done = python(resting, code)
    assert done.stdout.startswith("Friction may hold the stage up to"), done.stderr
    assert done.stdout.endswith("True\n")


@pytest.mark.slow
def test_an_experiment_of_a_package_is_listed_and_runs_with_its_view(resting: Path) -> None:
    assert "at-rest Nothing moves, and the force is the seed" in answered(resting, "rig", "--help")
    assert answered(resting, "rig", "at-rest", str(example("thesis_drive")), "--out", "rig").startswith("It rests.")
    assert (resting / "rig" / "rested.csv").exists()


QUESTION = "from friso.interface.question import WHY, Question\nQUESTION = Question(__name__, {declared})"
FUNCTION = """from friso.interface.answer import question
@question
def unread(stage: Nowhere) -> None:
    'Read nothing.'
"""


@pytest.mark.cases(slow=4)
@pytest.mark.parametrize(
    ("name", "module", "why"),
    [
        ("check", "friso_resting.resting", "friso has it"),
        ("reproduce", "friso_resting.resting", "several packages give it"),
        ("missing", "missing", "cannot be imported: No module named"),
        ("empty", "empty", "whose QUESTION is missing"),
        ("wrong", "wrong", "whose QUESTION is int"),
        ("leaves", "leaves", "cannot be imported"),
        ("early", "early", "place 'early' is not a number"),
        ("lost", "lost", "topic 'Why?' is none of"),
        ("alone", "alone", "a module that can be read"),
        ("bare", "bare", "the function bare and its docstring"),
    ],
)
def test_a_question_that_is_of_no_use_is_one_sentence_and_hinders_no_other(
    name: str, module: str, why: str, tmp_path: Path
) -> None:
    texts = {"empty": "", "wrong": "QUESTION = 1", "leaves": "raise SystemExit(0)"}
    declared = {"early": "'early', WHY, ''", "lost": "1, 'Why?', ''", "alone": "1, WHY, ''"}
    texts |= {file: QUESTION.format(declared=text) for file, text in declared.items()}
    for file, text in texts.items():
        (tmp_path / f"{file}.py").write_text(text)
    write_question(tmp_path / "bare", "1, WHY, ''", "def bare(): ...")
    package(tmp_path, "other", questions={name: module}, rig_experiments={name: module})
    listed = friso_command(tmp_path, "--help")
    assert listed.returncode == 0
    assert "  check " in listed.stdout
    assert f"friso: friso.questions: {name} is left out: {module}" in left_out(listed)
    assert why in left_out(listed)
    assert "stiffness" in answered(tmp_path, "rig", "--help")
    if name not in ("check", "reproduce"):
        assert f"friso.questions: {name}" in asked_in_vain(tmp_path, name)


def write_question(folder: Path, declared: str, module: str) -> None:
    """Write the package of a question: its declaration, and the module of its function."""
    folder.mkdir()
    (folder / "__init__.py").write_text(QUESTION.format(declared=declared))
    (folder / "question.py").write_text(module)


@pytest.mark.slow
def test_a_question_that_cannot_be_read_is_told_when_it_is_asked(tmp_path: Path) -> None:
    """Its options cannot, or it lacks its decorator."""
    write_question(tmp_path / "unread", "1, WHY, 'unread rig.toml'", FUNCTION)
    plain = "def plain(stage: 'StageLike', size: 'int' = 1) -> None:\n    'Be plain.'\n"
    write_question(tmp_path / "plain", "1, WHY, 'plain rig.toml'", plain)
    package(tmp_path, "other", questions={"unread": "unread", "plain": "plain"})
    said = asked_in_vain(tmp_path, "unread", "rig.toml")
    assert "unread.question, which cannot be imported: name 'Nowhere' is not defined" in said
    said = asked_in_vain(tmp_path, "plain", "rig.toml")
    assert "friso.questions: plain" in said
    assert "a function with @question" in said


@pytest.mark.slow
def test_a_function_that_is_of_no_use_is_refused_and_leaves_the_others(tmp_path: Path) -> None:
    package(tmp_path, "other", questions={"check": "taken", "missing": "missing", "stage": "taken"})
    code = "import friso\nprint(friso.check.__module__, friso.stage.__name__)\nfriso.missing"
    done = python(tmp_path, code)
    assert done.stdout == "friso.questions.check.question friso.stage\n"
    assert "friso.questions: check is left out: taken; expected: a name that is not taken: friso has it" in done.stderr
    assert "AttributeError: friso.questions: missing" in done.stderr
    assert "which cannot be imported: No module named 'missing'" in done.stderr


def test_a_package_for_the_version_before_is_told_what_to_rename(tmp_path: Path) -> None:
    package(tmp_path, "other", commands={"old": "old.command"}, functions={"old": "old.answer"})
    done = friso_command(tmp_path, "--help")
    assert done.returncode == 0
    for group, module in (("friso.commands", "old.command"), ("friso.functions", "old.answer")):
        assert f"{group} is of friso 0.2: old ({module}) is left out" in done.stderr
    assert "friso.questions" in done.stderr


def test_a_registered_name_is_refused_in_python() -> None:
    from typing import Literal

    with pytest.raises(InputError, match="a name that is not taken"):

        @register_controller
        class Other(ControllerSection):
            kind: Literal["pid"]


def test_friso_without_packages_loads_nothing() -> None:
    code = "import friso, sys; print('importlib.metadata' in sys.modules and 'sympy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=LIMIT)
    assert done.stdout.strip() == "False"
