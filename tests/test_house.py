"""The house: what stands where, so that the fifth example of a pattern goes where the first four are."""

import ast
import re
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path
from statistics import median

import grimp
import pytest

import friso
import friso_thesis
from benchmarks.code import count

PACKAGE, THESIS = (Path(str(package.__file__)).parent for package in (friso, friso_thesis))
ROOT = Path(__file__).parents[1]

KNOW_CONTROLLERS = (
    *("equations/controllers/", "drives/formats/", "stage/stage.py", "stage/controllers.py", "templates/"),
    *("identification/state_space_controller.py", "drives/drive.py", "drives/program.py"),
)
"""Where keys of a controller may be named: its own files (one that reads logs stands beside their readers), the schema
of the stage file, its template, and drives' parameter files and code, which are friso's controllers."""

ABOUT_TUNING = (
    *(
        "design_method/",
        "questions/design/",
        "friso_thesis/",
    ),
    *("frequency/margins.py", "identification/stage_file.py", "identification/output_error/problem.py"),
)
"""Modules that import a form of the PID controller: the design method, the thesis and the guideline are about van
Dijk's rules (Eq. 7, 8); identify makes controllers of its own, and compare one with an observer."""


MODULES = {
    ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__")
    for package in (PACKAGE, THESIS)
    for path in package.rglob("*.py")
}

OFFERED = {"friso.hunting.criteria", "friso.hunting.measures"}
"""Modules within a room that belong to what it offers."""


LEFT = 38
"""Width of the column of names in the drawing of docs/architecture.md."""


def sources() -> dict[str, str]:
    """Return modules by their path in friso; the thesis's with the name of their package."""
    places = {path: path.relative_to(PACKAGE) for path in PACKAGE.rglob("*.py")}
    places |= {path: path.relative_to(THESIS.parent) for path in THESIS.rglob("*.py")}
    return {place.as_posix(): path.read_text(encoding="utf-8") for path, place in places.items()}


def texts(source: str) -> Iterator[str]:
    """The texts in a module; {} stands for the values in one."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.JoinedStr):
            parts = (part.value if isinstance(part, ast.Constant) else "{}" for part in node.values)
            yield "".join(map(str, parts))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value


@pytest.mark.slow
def test_keys_of_a_controller_are_known_to_controllers_alone() -> None:
    knowing = {
        name for name, source in sources().items() for text in texts(source) if re.match(r"controller\.[\w{]", text)
    }
    assert [name for name in sorted(knowing) if not name.startswith(KNOW_CONTROLLERS)] == []


def test_keys_are_imported_where_the_rules_of_tuning_are_the_subject() -> None:
    importing = [name for name, text in sources().items() if "from friso.equations.controllers." in text]
    assert [name for name in importing if not name.startswith((*KNOW_CONTROLLERS, *ABOUT_TUNING))] == []


def test_the_drawing_of_the_house_is_of_what_there_is() -> None:
    """The first column of the drawing, a block of code: packages and modules."""
    drawing = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8").split("```")[1]
    drawn = set(re.findall(r"[a-z_]+", " ".join(line[:LEFT] for line in drawing.splitlines())))
    folders = {path.name for path in PACKAGE.iterdir() if (path / "__init__.py").exists()}
    modules = {path.stem for path in PACKAGE.glob("[a-z]*.py")}
    assert folders | modules == drawn


def test_tests_and_benchmarks_import_what_rooms_offer() -> None:
    """They import `friso` and its rooms, `friso.hunting` and the like, so that the inside of a room may change.

    Modules further inside, of the engine's plain twins and of what no room offers yet, are listed: none is added, and
    those that nothing imports any more leave the list.
    """
    paths = [path for folder in ("tests", "benchmarks") for path in (ROOT / folder).rglob("*.py")]
    used = {name for path in paths for name in inner_modules(path)}
    listed = (ROOT / "tests" / "inner_modules.txt").read_text(encoding="utf-8").split()
    assert sorted(used) == listed


def inner_modules(path: Path) -> Iterator[str]:
    """The modules inside of rooms that a file imports, or patches by their names."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names: list[str] = []
        if isinstance(node, ast.ImportFrom) and not node.level:
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            names = [node.value]
        for parts in (name.split(".") for name in names if name.startswith(("friso.", "friso_thesis."))):
            module = next(".".join(parts[:n]) for n in range(len(parts), 0, -1) if ".".join(parts[:n]) in MODULES)
            if module.count(".") > 1 and module not in OFFERED:
                yield module


@pytest.mark.slow
def test_a_module_is_a_room() -> None:
    """Half of the modules with code have 120 lines of it or more, and imports are a tenth of all (9 % are wanted)."""
    modules = {name: text for name, text in sources().items() if not name.startswith("friso_thesis")}
    sizes = [count(text).code for text in modules.values()]
    imports = sum(
        (node.end_lineno or node.lineno) - node.lineno + 1
        for text in modules.values()
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Import | ast.ImportFrom)
    )
    assert median(size for size in sizes if size) >= 120
    assert imports / sum(sizes) < 0.102


@pytest.mark.slow
def test_a_number_that_nobody_changes_is_a_constant() -> None:
    """A setting is given another value by a test, a benchmark or a command; other numbers stand above their use."""
    users = [path for folder in ("tests", "benchmarks") for path in (ROOT / folder).rglob("*.py")]
    calls = [
        (ast.unparse(node.func).split(".")[-1], {keyword.arg for keyword in node.keywords})
        for text in (*sources().values(), *(path.read_text(encoding="utf-8") for path in users))
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Call)
    ]
    wrong = []
    for name, text in sources().items():
        for node in ast.parse(text).body:
            if isinstance(node, ast.ClassDef) and "Settings" in map(ast.unparse, node.bases):
                changed = set().union(*(given for called, given in calls if called in (node.name, "replace")))
                names = [ast.unparse(item.target) for item in node.body if isinstance(item, ast.AnnAssign)]
                wrong += [f"{name}: {setting}" for setting in names if setting not in changed]
    assert wrong == []


def test_no_modules_import_each_other_in_a_circle() -> None:
    """A circle of imports, also one of types alone, is one module in several files."""
    graph = grimp.build_graph("friso", "friso_thesis", cache_dir=None)
    sorter = TopologicalSorter({name: graph.find_modules_directly_imported_by(name) for name in graph.modules})
    sorter.prepare()  # raises CycleError
    assert sorter.is_active()


@pytest.mark.slow
def test_every_command_has_a_price_and_every_feature_begins_somewhere() -> None:
    from benchmarks import price
    from friso.cli.app import COMMANDS

    places = [place.partition(":") for those in price.features().values() for place in those]
    assert [name for name, _, own in places if own not in {"", *price.modules()[name].definitions}] == []
    assert {f"command {name}" for name in COMMANDS} <= {*price.features()}
