"""Test README, docs and package: links lead somewhere, generated pages are complete and not stale."""

import ast
import importlib.util
import inspect
import io
import json
import operator
import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Iterator, Mapping
from importlib.metadata import version
from pathlib import Path
from types import ModuleType
from typing import Any

import matplotlib.image
import pytest

import friso
from friso.shown.pages import Glossary

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *DOCS.rglob("*.md")]


NEEDED = 77
"""The setuptools that build the package (pyproject.toml)."""


def module(name: str) -> ModuleType:
    """A script of the docs."""
    spec = importlib.util.spec_from_file_location(name, DOCS / f"{name}.py")
    loaded = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(loaded)
    return loaded


@pytest.mark.cases(first=65)
@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page: Path) -> None:
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    places = re.findall(r"\]\((?!https?:|#)([^)#\s]+)", text)
    examples = re.findall(r"\bexamples/[\w./]*\w", page.read_text(encoding="utf-8"))  # the wheel contains all of them
    named = [page.parent / place for place in places] + [ROOT / name for name in examples]
    assert [str(path) for path in named if not path.exists()] == []


def test_figures_are_of_what_makes_them_and_small() -> None:
    figures = module("figures")
    made = json.loads((DOCS / "figures.json").read_text(encoding="utf-8"))
    stale = [name for name in figures.FIGURES if made.get(name) != figures.source_of(name)]
    assert stale == [], "run python docs/figures.py with these names"
    assert [path.name for path in DOCS.glob("*.[ps][nv]g") if path.stat().st_size > 300_000] == []


PLACED = re.compile(r"!\[[^]]*\]\((?:docs/)?([\w./]+)\)")
RECORDED = {"identify_friction.png"}
"""Pictures of published records, which are not in the repository."""


@pytest.mark.parametrize("page", [ROOT / "README.md", *DOCS.glob("*.md")], ids=lambda page: page.name)
def test_every_picture_of_the_docs_has_a_function_that_makes_it(page: Path) -> None:
    pictures = {name for name in PLACED.findall(page.read_text(encoding="utf-8")) if "/" not in name}
    drawn = {name for name in pictures if name.endswith(".svg")}  # by hand
    assert pictures - drawn - RECORDED <= set(module("figures").FIGURES)


@pytest.mark.thorough
@pytest.mark.parametrize(
    "name", ["hunting.png", "thesis_rig.png", "thesis_map.png", "thesis_cycles.png", "compare.png"]
)
def test_a_picture_of_the_docs_is_made_as_it_is_there(name: str) -> None:
    made = matplotlib.image.imread(io.BytesIO(module("figures").FIGURES[name]()))
    assert made.shape == matplotlib.image.imread(DOCS / name).shape


STORIES = {"robot_wrist": friso.bode, "telescope": friso.check, "ball_screw_table": friso.check}


@pytest.mark.slow
@pytest.mark.parametrize("name", STORIES)
def test_a_story_says_what_the_command_answers(name: str) -> None:
    """Every number of the answer stands in the story."""
    story = (DOCS / "stories.md").read_text(encoding="utf-8")
    for sentence in STORIES[name](friso.example(name)).sentences():
        assert sentence in story


def keys_of(node: Mapping[str, Any]) -> Iterator[str]:
    """Yield all keys of a schema."""
    for key, value in node.get("properties", {}).items():
        yield key
        yield from keys_of(value)
    for inner in (*node.get("anyOf", ()), *([node["items"]] if "items" in node else ())):
        yield from keys_of(inner)


@pytest.mark.parametrize("of", ["stage", "specification"])
def test_every_key_has_an_entry_in_the_reference(of: str) -> None:
    page, schema = module("generate").schema_page(of), friso.schema(of)
    keys = {*keys_of(schema)}
    assert len(keys) > 20
    assert {key for key in keys if f"`{key}`" not in page and f"{key}]" not in page} == set()


def test_every_command_is_on_its_page() -> None:
    from friso.cli.app import COMMANDS

    page = module("generate").commands_page()
    assert [name for name in COMMANDS if f"### friso {name}\n" not in page] == []


def calls(page: Path) -> Iterator[tuple[str, ast.Call]]:
    """The calls in code cells and examples in Python of a page, with the dotted names of what they call."""
    for code in re.findall(
        r"^```(?:\{code-cell\} ipython3|python)\n(.*?)^```", page.read_text("utf-8"), re.DOTALL | re.MULTILINE
    ):
        for call in ast.walk(ast.parse(code)):
            if isinstance(call, ast.Call):
                yield ast.unparse(call.func), call


def test_code_on_pages_calls_public_functions_as_they_are() -> None:
    """The site executes all of it, which takes too long for every change (`.ci/thorough tutorials`)."""
    found, wrong = 0, []
    for page in PAGES:
        for name, call in calls(page):
            if not re.fullmatch(r"friso(\.\w+)+", name):
                continue
            found += 1
            try:
                function = operator.attrgetter(name.removeprefix("friso."))(friso)
                named = {one.arg: None for one in call.keywords if one.arg}
                several = any(isinstance(one, ast.Starred) for one in call.args) or len(named) < len(call.keywords)
                signature = inspect.signature(function)
                (signature.bind_partial if several else signature.bind)(*call.args, **named)
            except (AttributeError, TypeError) as error:
                wrong.append((str(page.relative_to(ROOT)), ast.unparse(call), str(error)))
    assert found > 40
    assert wrong == []


def test_every_public_name_is_on_its_page() -> None:
    page = (DOCS / "reference" / "python.md").read_text(encoding="utf-8")
    names = [name for name in dir(friso) if callable(getattr(friso, name))]
    assert [name for name in names if not re.search(rf"auto(function|class|exception):: friso\.{name}\n", page)] == []


def test_words_are_linked_where_they_first_stand_on_a_page() -> None:
    glossary = Glossary()
    text = glossary.linked("Folds & multipliers; a fold, <b>")
    assert [entry.name for entry in glossary.used.values()] == ["fold", "multiplier"]
    assert text.count("<a ") == 2
    assert text.startswith('<a class="word" href="#word-fold"')
    assert text.endswith("; a fold, &lt;b&gt;")
    assert "<a " not in glossary.linked("in the 95 % band; free to shift, it does not move")


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a wheel and an sdist, built from a copy of what they are made of."""
    if int(version("setuptools").split(".")[0]) < NEEDED:
        pytest.skip(f"setuptools {NEEDED} or later, of the test extra, is not installed")
    tree, out = tmp_path_factory.mktemp("tree"), tmp_path_factory.mktemp("built")
    for name in ("friso", "friso_thesis", "examples"):
        shutil.copytree(ROOT / name, tree / name, ignore=shutil.ignore_patterns("__pycache__"))
    for path in (
        *ROOT.glob("*.md"),
        *ROOT.glob("*.cff"),
        *(ROOT / n for n in ("LICENSE", "MANIFEST.in", "setup.py", "pyproject.toml")),
    ):
        shutil.copy(path, tree)
    code = f"import setuptools.build_meta as b; b.build_sdist({str(out)!r}); b.build_wheel({str(out)!r})"
    subprocess.run([sys.executable, "-W", "ignore", "-c", code], cwd=tree, check=True, capture_output=True, text=True)
    return out


@pytest.mark.slow
def test_the_wheel_works_outside_the_repository(built: Path, tmp_path: Path) -> None:
    """The wheel contains all files that are not Python: templates, materials, examples."""
    (wheel,) = built.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(tmp_path / "installed")
    held = [path for name in ("friso", "friso_thesis") for path in (ROOT / name).rglob("*") if path.is_file()]
    data = {path.relative_to(ROOT).as_posix() for path in held}
    data = {name for name in data if not name.endswith((".py", ".pyc"))}
    examples = [path for path in (ROOT / "examples").rglob("*") if path.is_file()]
    data |= {f"friso/{path.relative_to(ROOT).as_posix()}" for path in examples}
    there = {path.relative_to(tmp_path / "installed").as_posix() for path in (tmp_path / "installed").rglob("*")}
    assert data - there == set()
    code = (
        "import friso; print(friso.__file__, friso.load(friso.example('thesis_rig')).name, friso.example('thesis_rig'))"
    )
    where = {"PYTHONPATH": str(tmp_path / "installed"), "PATH": ""}
    done = subprocess.run(
        [sys.executable, "-P", "-c", code], cwd=tmp_path, env=where, capture_output=True, text=True, check=True
    )
    assert done.stdout.count(str(tmp_path / "installed")) == 2
    assert "Thesis rig" in done.stdout


@pytest.mark.slow
def test_the_sdist_holds_what_the_wheel_is_built_from(built: Path) -> None:
    (archive,) = built.glob("*.tar.gz")
    listed = subprocess.run(["tar", "tzf", str(archive)], capture_output=True, text=True, check=True).stdout
    for name in ("CITATION.cff", "LICENSE", "CHANGELOG.md", "examples/specs/thesis.toml", "friso/py.typed", "setup.py"):
        assert f"/{name}\n" in listed


def test_the_guideline_states_the_laws_and_factors_of_its_evidence() -> None:
    guide, evidence = ((DOCS / place / "guideline.md").read_text(encoding="utf-8") for place in ("", "evidence"))
    assert guide.split("```")[1] == evidence.split("```")[1]
    rows = re.findall(r"^\| joint (locked|free)[^|]*\| (\d+) \| (\d+ %) .*\| ([\d.]+) \|$", evidence, re.MULTILINE)
    stated = re.findall(r"^\| joint (locked|free) \| (\d+) \| (\d+ %) \| ([\d.]+) \|$", guide, re.MULTILINE)
    assert len(stated) == 2
    assert {*stated} <= {*rows}
