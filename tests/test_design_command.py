"""Test `friso design` as a user runs it: what it writes, says, draws and refuses."""

import json
import re
import shutil
import sys
from collections.abc import Iterator
from contextlib import redirect_stdout
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
from inside import command_of
from pages import Page
from patched import patched
from refusals import refused
from snapshots import Snapshots

import friso
from friso.cli.app import main
from friso.design_method import controller, method
from friso.design_method.geometry import Geometry, Sheet
from friso.design_method.method import Design, NoDesign
from friso.design_method.population import Corners
from friso.design_method.requirements import Relaxation
from friso.design_method.settings import DesignSettings
from friso.design_method.spec import Position, Spec, load_spec
from friso.interface.output_folder import OutputFolder
from friso.progress import Progress
from friso.quantities import outwards
from friso.questions.design.blocks import design_document, refused_document
from friso.questions.design.figures import design_figures
from friso.questions.design.steps import (
    controller_step,
    isolator_step,
    joint_step,
    leaves_step,
    moves_step,
    requirement_rows,
    steps,
)
from friso.questions.design.window import lower, stiffest, upper
from friso.questions.design.words import brings, edge, hertz, refusal, settling, verdicts
from friso.shown import files
from friso.shown.drawing import matplotlib_renderer
from friso.shown.drawing.figure import Figure
from friso.stage import Stage

command = command_of("design")
DESIGN = method.design

EXAMPLES = Path(__file__).parent.parent / "examples"
RIG, SPEC = EXAMPLES / "thesis_rig.toml", EXAMPLES / "specs" / "thesis.toml"
FIGURES = (
    "design_map",
    "design_front",
    "design_drawing",
    "design_modes",
    "design_window",
    "design_damping",
    "design_settling",
)
SMALL = DesignSettings(
    front_population=40,
    front_generations=25,
    confirmed_candidates=3,
    edge_bisections=1,
    edge_steps=6,
    corner_levels=(0.0, 1.0),
    map_crossovers=4,
    map_strokes=3,
    verified_moves=64,
)
"""Sizes with which a design takes seconds."""

LEAVES = Geometry(0.07, 0.02, 0.045, Sheet(2, 3e-4, "stainless 1.4310"))
RELAXED = (
    Relaxation("first interfering frequency", "safety.parasitic", 10.0, 8.123, "", LEAVES),
    Relaxation("length of the leaves, at most", "leaves.length", 0.07, 0.07421, "m", LEAVES),
    Relaxation("crossover above the edge of hunting", "joint.damping", 0.5, 3.2, "N*s/m"),
)


@pytest.fixture(scope="module")
def spec(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The thesis's with one static friction, and a settling time that all moves keep."""
    path = tmp_path_factory.mktemp("spec") / "spec.toml"
    text = SPEC.read_text().replace("# settling_time = ", "settling_time = ")
    path.write_text(text.replace('static = "1 N .. 3 N"', 'static = "1 N"'))
    return path


@pytest.fixture(scope="module")
def small() -> Iterator[None]:
    with SMALL.in_use(), patched({controller: {"DAMPING_RATIOS": np.array([0.1, 0.7])}}):
        yield


@pytest.fixture(scope="module")
def designed(rig: Stage, spec: Path, small: None) -> Design:
    """A small design, computed once, as if the searches for all edges had ended: on some processors one does not."""
    design = method.design(rig, load_spec(spec))
    return replace(design, edges=replace(design.edges, unknown=0))


@pytest.fixture(scope="module")
def finished(designed: Design) -> Iterator[list[str]]:
    """Let the command find this design; record what it reports of its progress."""
    labels: list[str] = []

    def design(stage: Stage, spec: Spec, progress: Progress, anyway: bool) -> Design:
        progress(0, 1, "leaf springs")
        labels.append(stage.name)
        return designed

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(method, "design", design)
        yield labels


@pytest.fixture(scope="module")
def written(spec: Path, finished: list[str], tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The folder of all files, written once with figures as SVG only, and the summary."""
    out = tmp_path_factory.mktemp("written") / "design"
    with redirect_stdout(StringIO()) as said, pytest.MonkeyPatch.context() as patch:
        patch.setattr(files, "IMAGE_FORMATS", ("svg",))
        command(RIG, spec, out=out, details=True)
    return out, said.getvalue()


@pytest.fixture(scope="module")
def folder(written: tuple[Path, str]) -> Path:
    return written[0]


def verified(designed: Design, **moves: Any) -> Design:
    """Return the design with other moves."""
    return replace(designed, verification=replace(designed.verification, **moves))


def lacking(text: str, *facts: str) -> list[str]:
    """Return the facts that a text does not tell."""
    return [fact for fact in facts if fact not in text]


def some(count: int, otherwise: float) -> np.ndarray:
    """Return a number for each of 64 moves, of which the first do not end."""
    return np.where(np.arange(64) < count, np.nan, otherwise)


@pytest.fixture
def quick(written: tuple[Path, str], monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures are not drawn again, and nothing is written."""
    kept = "friso.interface.output_folder.write"
    monkeypatch.setattr(kept, lambda files, *_: [path for path, content in files.items() if content is not None])
    monkeypatch.setattr("friso.questions.design.blocks.design_figures", lambda design: ())


@pytest.fixture
def no_design(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the command find no design, and what to relax."""

    def fail(stage: Stage, spec: Spec, progress: Progress, anyway: bool) -> Design:
        raise NoDesign("no leaf springs meet the specification", RELAXED)

    monkeypatch.setattr(method, "design", fail)


def _strict(text: str) -> dict[str, Any]:
    """A JSON document, in which infinite and undefined numbers have no place."""

    def refuse(name: str) -> None:
        raise AssertionError(f"{name} in the document")

    return json.loads(text, parse_constant=refuse)


def _figures(designed: Design) -> dict[str, Figure]:
    return {figure.name: figure for figure in design_figures(designed)}


# ---------------------------------------------------------------- files and document


@pytest.mark.slow
def test_all_files_are_written_and_the_stages_load(
    designed: Design, spec: Path, folder: Path, quick: None, capsys: pytest.CaptureFixture
) -> None:
    pictures = {f"{name}.svg" for name in FIGURES}
    own = {"design.toml", "worst.toml", "design.html"}
    assert {path.name for path in folder.iterdir()} == pictures | own
    stage, worst = friso.load(folder / "design.toml"), friso.load(folder / "worst.toml")
    assert stage.flat()["joint.stiffness"] == pytest.approx(designed.fitted.choice.beams.drive[0], rel=0.02)
    assert worst.flat()["friction.static"] == designed.verification.worst.flat()["friction.static"]
    command(RIG, spec, out=folder, overwrite=True)  # once more
    assert "next: friso check" in capsys.readouterr().out


@pytest.mark.slow
def test_the_document_has_the_agreed_keys(
    spec: Path, folder: Path, quick: None, designed: Design, capsys: pytest.CaptureFixture
) -> None:
    command(RIG, spec, out=folder, as_json=True, overwrite=True)
    shown = capsys.readouterr()
    document = _strict(shown.out)
    assert shown.err == ""
    asked = "conclusion stage spec feasible needed machine_limit_hz without joint leaves front controller verification"
    assert document.keys() == {*asked.split(), "files", "plug_ins", "relax"}
    assert (document["stage"], document["feasible"], document["needed"]) == ("Thesis rig", True, False)
    assert document["files"][0] == str(folder / "design.toml")
    without, joint, leaves = document["without"], document["joint"], document["leaves"]
    assert without["corners"] == designed.without.population.count
    corner = "masses_cart_kg masses_stage_kg friction_static_n friction_coulomb_n"
    assert without["worst_corner"].keys() == {*corner.split()}
    assert joint["force_at_stroke_n"] == pytest.approx(joint["stiffness_n_per_m"] * joint["stroke_m"], rel=0.01)
    assert joint["least_static_friction_n"] == 1.0
    assert joint["highest_edge_hz"] < without["highest_edge_hz"]
    assert leaves["drive_stiffness_n_per_m"] == joint["stiffness_n_per_m"]
    assert [requirement["key"] for requirement in leaves["requirements"]][-1] == "safety.parasitic"
    assert all(requirement["excess"] <= 1 for requirement in leaves["requirements"])
    asked = [item for item in document["front"] if item["beams_hz"] is not None]
    assert len(document["front"]) == len(designed.candidates)
    assert 0 < len({item["beams_hz"] for item in asked}) <= 3
    tuned = document["controller"]
    assert tuned["least_modulus_margin"] == designed.controller.corners.min()
    assert tuned["kp_n_per_m"] == pytest.approx(1.5 * tuned["k_p_n_per_m"])  # beta = 2
    parallel = designed.controller.gains.parallel
    assert (parallel["ki"], parallel["kd"]) == (tuned["ki_n_per_m_s"], tuned["kd_n_s_per_m"])
    moves = document["verification"]
    assert (moves["moves"], moves["not_at_rest"], moves["settling_time_met"]) == (64, 0, True)
    assert moves["locked"]["moves"] == 64
    settling = np.sort(designed.verification.free.settling)
    assert moves["settling_median_s"] == pytest.approx(np.median(settling), rel=0.05)
    assert moves["settling_median_s"] <= np.median(settling) * 1.05 < moves["settling_95_s"] <= settling[-1]


@pytest.mark.slow
def test_what_is_not_finite_is_null(designed: Design) -> None:
    never = replace(designed.verification.free, settling=np.full(64, np.nan), words=np.full(64, "swings"))
    nowhere = replace(designed.without, edges=np.zeros(designed.without.population.count), unknown=1)
    document = design_document(replace(verified(designed, free=never), without=nowhere))
    json.dumps(document, allow_nan=False)
    assert document["verification"]["settling_95_s"] is None
    assert (document["without"]["highest_edge_hz"], document["without"]["unknown_corners"]) == (None, 1)
    assert document["verification"]["settling_time_met"] is False


# ---------------------------------------------------------------- words


@pytest.mark.slow
def test_the_summary_tells_all_steps(written: tuple[Path, str], snapshots: Snapshots) -> None:
    folder, text = written
    snapshots.check("design", "run", text)
    snapshots.check("design", "page", Page((folder / "design.html").read_text(encoding="utf-8")).lines)
    assert text.rstrip().endswith(f"next: friso check {folder / 'design.toml'}")
    sentences = [line for line in text.split("\nwrote")[0].splitlines() if not line[:1].isdigit()]
    assert max(map(len, sentences)) <= shutil.get_terminal_size().columns


@pytest.mark.slow
def test_an_isolator_that_is_not_needed_is_weighed(designed: Design, snapshots: Snapshots) -> None:
    (_, first), *_ = verdicts(designed)
    step = isolator_step(designed)
    text = step.sentences
    assert "0.3 to 0.85 N" in dict(step.facts).values()
    snapshots.check("design", "isolator not needed", "\n".join([first, *text]))


@pytest.mark.slow
def test_an_isolator_that_is_needed_says_why(designed: Design, snapshots: Snapshots) -> None:
    needed = replace(designed, without=replace(designed.without, edges=np.full(len(designed.without.edges), 60.0)))
    (_, first), *_ = verdicts(needed)
    assert lacking(first, "72.0 Hz", "1.2 times", "48.0 Hz") == []
    step = isolator_step(needed)
    assert len(step.sentences) < len(isolator_step(designed).sentences)  # nothing to compare it with
    snapshots.check("design", "isolator needed", "\n".join([first, step.title, *step.sentences]))


@pytest.mark.slow
def test_the_joint_is_held_below_the_static_friction(designed: Design) -> None:
    text = " ".join(joint_step(designed).sentences)
    allowed = 1 / (1.1 * 1.1)  # [N]: friction over the safety factor and the stiffness error
    stated = ("no less than 1 N", "factor of 1.1", "error of 10 %", f"{allowed:.3g} N", "stroke of 1 mm")
    assert lacking(text, *stated) == []
    unknown = joint_step(replace(designed, edges=replace(designed.edges, unknown=2))).sentences
    assert "were stopped, which counts as hunting" in " ".join(unknown)
    assert "were stopped" not in text


@pytest.mark.slow
@pytest.mark.parametrize(
    ("edges", "stated"),
    [((0.0, 0.0), ("1.20 Hz", "144 Hz")), ((0.0, np.inf), ("144 Hz",)), ((0.0, 7.62), ("7.62 Hz",))],
)
def test_edges_in_words(designed: Design, edges: tuple[float, float], stated: tuple[str, ...]) -> None:
    text = edge(Corners(designed.without.population, np.array(edges), (1.2, 144.0)))
    assert lacking(text, *stated) == []


@pytest.mark.slow
def test_leaves_and_what_binds_them(designed: Design) -> None:
    excess = np.array([0.985, 0.2, 0.1, 0.6, 0.99])
    tight = replace(designed.fitted.choice, excess=excess)
    designed = replace(designed, fitted=replace(designed.fitted, choice=tight))
    text = " ".join(leaves_step(designed).sentences)
    rows = requirement_rows(designed)
    for name, *_, spare in rows:
        assert (name in text) == spare.endswith("binds")
    assert "confirms 3 of 3 geometries" in text
    broken = replace(designed.confirmed[0], stiffness=np.nan, frequency=np.nan, failure="no equilibrium")
    other = " ".join(leaves_step(replace(designed, confirmed=(broken, *designed.confirmed[1:]))).sentences)
    assert "confirms 2 of 3 geometries" in other
    assert rows[0][1:3] == ("friction.static, leaves.stroke", "1 N, 1 mm")
    assert [row[3] for row in rows] == ["98.5 %, binds", "20 %", "10 %", "60 %", "99 %, binds"]
    loose = replace(designed.fitted, choice=replace(tight, excess=excess / 2))
    spared = " ".join(leaves_step(replace(designed, fitted=loose)).sentences)
    assert [name for name, *_ in rows if name in spared] == []


@pytest.mark.slow
def test_the_window_of_the_crossover(designed: Design) -> None:
    above, below = upper(designed), lower(designed)
    assert [item.value for item in above] == sorted(item.value for item in above)
    assert {48.0, stiffest(designed)} <= {entry.value for entry in above}
    assert 1.2 * designed.edges.highest in {limit.value for limit in below}
    assert below[0].value < designed.controller.crossover <= above[0].value
    text = " ".join(controller_step(designed).sentences)
    for bound in (*above, *below):
        assert f"{hertz(bound.value)} ({bound.reason})" in text


@pytest.mark.slow
def test_damping_that_is_worth_adding_or_not(designed: Design, snapshots: Snapshots) -> None:
    texts = []
    for margins in ([0.3, 0.58, 0.6], [0.57, 0.59, 0.6]):
        damping = replace(designed.controller.damping, margins=np.array(margins))
        other = replace(designed, controller=replace(designed.controller, damping=damping))
        texts.append(controller_step(other).sentences[-1])
    assert lacking(texts[0], "0.5 N·s/m", "0.58") == []
    snapshots.check("design", "damping", "\n".join(texts))


def restless(count: int) -> np.ndarray:
    """Return the outcomes of 64 moves of which `count` do not rest: the first creeps, the others swing."""
    words = np.where(np.arange(64) < count, "swings", "rests").astype(object)
    words[0] = "creeps"
    return words


@pytest.mark.slow
def test_moves_that_swing_or_take_too_long(designed: Design, snapshots: Snapshots) -> None:
    swing = (np.arange(64) < 2) * np.arange(64) * 1e-3
    free = replace(designed.verification.free, words=restless(2), settling=some(2, 2.0), swing=swing)
    other = verified(designed, free=free)
    step = moves_step(other)
    assert lacking(step.title, "64 moves", "2 do not", "1 swing", "1 creep") == []
    assert lacking(" ".join(step.sentences), "95 %", "1.00 s", "Not met", "1 mm") == []
    snapshots.check("design", "moves that swing", "\n".join([*step.sentences, verdicts(other)[-1][1]]))
    lost = replace(free, words=np.where(np.arange(64) > 3, free.words, "failed"))
    assert "4 moves" in " ".join(moves_step(verified(designed, free=lost)).sentences)


@pytest.mark.slow
def test_moves_of_a_locked_joint_that_swings(designed: Design, snapshots: Snapshots) -> None:
    locked = replace(designed.verification.locked, words=restless(20), settling=some(20, 3.0))
    other = verified(designed, locked=locked)
    text = " ".join(moves_step(other).sentences)
    assert lacking(text, "3.00 s", "95 %", "Of 64", "20 do not") == []
    snapshots.check("design", "moves of a locked joint", "\n".join([text, verdicts(other)[-1][1]]))
    never = replace(locked, words=np.full(64, "swings"), settling=np.full(64, np.nan))
    assert not re.search(r"\d", settling(never))
    assert "never" in brings(verified(designed, locked=never))


# ---------------------------------------------------------------- figures and page


@pytest.mark.slow
def test_the_page_stands_alone_and_shows_all(designed: Design, folder: Path) -> None:
    page = Page((folder / "design.html").read_text(encoding="utf-8"))
    assert all(address.startswith("data:") for address in page.loads)
    assert page.tags.count("img") == len(FIGURES)
    for step in steps(designed):
        assert all(sentence in page.text for sentence in (step.title, *step.sentences))
    for _, sentence in verdicts(designed):
        assert sentence in page.text
    for words in ("Requirements", "safety.parasitic", "worst.toml", "[flexure]", designed.spec.name):
        assert words in page.text
    named = [name for step in steps(designed) for name in step.figures]
    assert sorted(named) == sorted(FIGURES)


@pytest.mark.slow
def test_front_with_chosen_and_failed_points(designed: Design) -> None:
    broken = replace(designed.confirmed[0], stiffness=np.nan, frequency=np.nan, failure="no equilibrium")
    other = replace(designed, confirmed=(broken, *designed.confirmed[1:]))
    (panel,) = _figures(other)["design_front"].panels
    by_label = {marker.label: marker for marker in panel.markers}
    assert [*by_label] == ["by beams", "beams failed", "chosen, by the beam model"]
    assert by_label["beams failed"].y == pytest.approx([broken.candidate.frequency])
    assert by_label["chosen, by the beam model"].x == pytest.approx(designed.fitted.choice.beams.drive[:1] / 1e3)
    assert [limit.values for limit in panel.limits] == [(10 * designed.controller.crossover,), (480.0,)]


@pytest.mark.slow
def test_map_with_the_chosen_point_and_cells_of_all_kinds(designed: Design) -> None:
    share = np.zeros_like(designed.map.share)
    share[0, 0], share[1, 1] = 0.5, np.nan
    figure = _figures(replace(designed, map=replace(designed.map, share=share)))["design_map"]
    (panel,) = figure.panels
    (field,) = panel.maps
    assert field.z[0, 0] == 50.0
    assert field.codes is not None
    assert (field.codes[1, 1], field.codes[2, 2]) == (1.0, 0.0)
    assert np.isnan(field.codes[0, 0])
    assert (panel.markers[0].x[0], panel.markers[0].y[0]) == (designed.controller.crossover, 1.0)
    assert [line.label.split(":")[0] for line in panel.series] == ["edge of hunting at 1 mm", "the machine's limit"]


@pytest.mark.slow
def test_window_with_edges_beyond_the_search(designed: Design) -> None:
    endless = replace(designed.without, edges=np.where(np.arange(len(designed.without.edges)) == 0, np.inf, 5.0))
    (panel,) = _figures(replace(designed, without=endless))["design_window"].panels
    assert panel.y.words == ("without", "isolator", "margin", "leaves", "machine")
    assert panel.x.limits is not None
    reach = [band.x.max() for band in panel.bands if band.low[0] < 0]
    assert reach == [panel.x.limits[1]]
    assert panel.series[0].x == pytest.approx([designed.controller.crossover] * 2)


@pytest.mark.slow
def test_settling_ends_where_moves_do_not_rest(designed: Design) -> None:
    free = replace(designed.verification.free, words=restless(16), settling=some(16, 0.2))
    figure = _figures(verified(designed, free=free, locked=replace(free, settling=some(64, 0.0))))["design_settling"]
    (panel,) = figure.panels
    assert panel.series[0].y.max() == 75.0
    assert [line.label for line in panel.series] == ["joint free", "joint locked", "specified"]
    assert matplotlib_renderer.image(figure, "svg")


# ---------------------------------------------------------------- what is refused


@pytest.mark.parametrize("as_json", [False, True])
def test_no_design_says_what_to_relax(tmp_path: Path, capsys: Any, no_design: None, as_json: bool) -> None:
    with pytest.raises(typer.Exit) as left:
        command(RIG, SPEC, out=tmp_path / "out", as_json=as_json)
    shown = capsys.readouterr()
    assert left.value.exit_code == 2
    assert lacking(shown.err, "from 10 to 8.12", "leaves.length", "no leaf springs meet the specification") == []
    assert not (tmp_path / "out").exists()
    if not as_json:
        assert shown.out == ""
        return
    document = _strict(shown.out)
    assert document.keys() == {"conclusion", "stage", "spec", "feasible", "reason", "relax", "files", "plug_ins"}
    assert document["feasible"] is False
    length = {"key": "leaves.length", "from": 0.07, "to": 0.07421, "unit": "m"}
    assert document["relax"][1].items() >= length.items()


def test_no_single_relaxation() -> None:
    assert "too tight" in refusal(NoDesign("too tight"))
    assert len(refusal(NoDesign("too tight", RELAXED * 3)).splitlines()) == 7
    assert refused_document(friso.load(RIG), "spec", NoDesign("too tight"))["relax"] == []


@pytest.mark.parametrize(
    ("value", "larger", "expected"),
    [
        *((0.07421, True, 0.0743), (8.127, False, 8.12), (1.2, True, 1.2), (300.0, False, 300.0), (0.0, False, 0.0)),
        *((2 * 1e-5, True, 2e-5), (3 * 0.1, True, 0.3), (0.57, False, 0.57), (9.999, True, 10.0), (2.0001, True, 2.01)),
    ],
)
def test_relaxations_are_rounded_to_be_enough(value: float, larger: bool, expected: float) -> None:
    assert outwards(value, larger) == expected


@pytest.mark.slow
@pytest.mark.parametrize("name", ["design.toml", "worst.toml", "."])
def test_files_of_no_design_are_not_overwritten(finished: list[str], folder: Path, tmp_path: Path, name: str) -> None:
    """Nor is the stage that is read, and a folder may be no file."""
    taken = tmp_path / name if name != "." else tmp_path / "taken"
    taken.write_text("mine")
    with refused("--out"):
        command(RIG, SPEC, out=tmp_path if name != "." else taken)
    assert taken.read_text() == "mine"
    with refused("--out"):
        command(folder / "design.toml", SPEC, out=folder)


@pytest.mark.slow
def test_overrides_are_of_the_stage(finished: list[str], folder: Path, quick: None, spec: Path, caplog: Any) -> None:
    command(RIG, spec, set=['name="Another"', 'drive.delay="1 ms"'], out=folder, overwrite=True)
    assert finished[-1] == "Another"
    assert "[drive]" in caplog.text
    with refused("controller.crosover"):
        command(RIG, spec, set=['controller.crosover="8 Hz"'], out=folder, overwrite=True)


@pytest.mark.parametrize(
    ("arguments", "status", "message"),
    [((RIG, "bad.toml"), 2, "expected"), ((RIG, SPEC), 130, "interrupted"), ((), 2, "Missing argument")],
)
def test_exit_status(
    arguments: tuple, status: int, message: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: Any
) -> None:
    def interrupt(stage: Stage, spec: Spec, progress: Progress, anyway: bool) -> Design:
        raise KeyboardInterrupt

    monkeypatch.setattr(method, "design", interrupt)
    monkeypatch.chdir(tmp_path)
    Path("bad.toml").write_text(SPEC.read_text().replace("stainless 1.4310", "stainles"))
    monkeypatch.setattr(sys, "argv", ["friso", "design", *map(str, arguments), "--out", "out"])
    with pytest.raises(SystemExit) as left:
        main()
    shown = capsys.readouterr()
    assert (left.value.code, shown.out) == (status, "")
    assert message in shown.err
    assert "Traceback" not in shown.err
    assert not Path("out").exists()


@pytest.mark.slow
def test_a_specification_that_is_not_met_is_told(
    spec: Path, folder: Path, quick: None, designed: Design, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    """What exists is written all the same; the status is 2, and the message says what would be met."""
    hurried = Position(window="1 um", settling_time="1 ms")  # type: ignore[arg-type]
    less = replace(designed, spec=designed.spec.model_copy(update={"position": hurried}))
    monkeypatch.setattr(method, "design", lambda stage, spec, progress, anyway: less)
    with pytest.raises(typer.Exit) as left:
        command(RIG, spec, out=folder, as_json=True, overwrite=True)
    assert left.value.exit_code == 2
    shown = capsys.readouterr()
    document = _strict(shown.out)
    assert document["feasible"] is False
    (relax,) = document["relax"]
    assert relax["key"] == "position.settling_time"
    assert relax["to"] > relax["from"] == 1e-3
    assert "position.settling_time" in shown.err


@pytest.mark.cases(slow=1)
@pytest.mark.parametrize("during", ["hunting_map", "verification"])
def test_ctrl_c_keeps_the_leaves_and_the_crossover(
    rig: Stage, spec: Path, small: None, tmp_path: Path, during: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The answer contains what is known of hunting by then; without leaves there is no answer."""

    def interrupted(*_: Any, **__: Any) -> Any:
        raise KeyboardInterrupt

    monkeypatch.setattr(method, "design", DESIGN)
    monkeypatch.setattr(method, during, interrupted)
    answer = friso.design(rig, spec, anyway=True)
    assert answer.interrupted
    assert not answer.failure
    assert not answer.meets
    said = answer.sentences()
    assert said[0].startswith("Interrupted: this is the answer so far. The isolator was not tried in moves, and ")
    assert ("is not known" in said[0]) is (during == "hunting_map")
    assert answer.document()["interrupted"]
    (file,) = answer.report(tmp_path / "design")
    assert file.name == "design-not-verified.toml"
    assert friso.load(file).flat()["joint.stroke"] == answer.stage.flat()["joint.stroke"]
    assert [*answer.figures(), *answer.details()] == []
    monkeypatch.setattr(method, "leaves", interrupted)
    with pytest.raises(KeyboardInterrupt) as nothing:
        method.design(rig, load_spec(spec))
    assert not isinstance(nothing.value, method.DesignInterrupted)


def test_a_design_ends_where_no_isolator_is_needed(
    rig: Stage, spec: Path, small: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: Any
) -> None:
    """Its leaf springs are not tried."""
    monkeypatch.setattr(method, "design", DESIGN)
    monkeypatch.setattr(method, "hunting_map", lambda *_, **__: pytest.fail("the design went on"))
    answer = friso.design(rig, spec)
    assert not answer.result.need.isolator
    assert (answer.interrupted, answer.failure) == (False, "")
    assert not answer.document()["interrupted"]
    OutputFolder("design", tmp_path / "design", False).write(answer.files())
    assert friso.load(tmp_path / "design" / "design-not-verified.toml") == answer.stage
