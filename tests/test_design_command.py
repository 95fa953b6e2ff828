"""Test `friso design` as a user runs it: what it writes, says, draws and refuses."""

import json
from collections.abc import Callable, Iterator
from contextlib import redirect_stdout
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
from inside import command_of, strict_json
from pages import Page
from patched import patched
from refusals import refused
from snapshots import Snapshots

import friso
from friso.design_method import method, verification
from friso.design_method.method import Design, NoDesign
from friso.design_method.requirements import Relaxation
from friso.design_method.settings import DesignSettings
from friso.design_method.spec import Geometry, Position, Sheet, Spec, load_spec
from friso.design_method.verification import Corners
from friso.interface.output_folder import OutputFolder
from friso.progress import Progress
from friso.quantities import outwards
from friso.questions.design.blocks import (
    controller_step,
    design_document,
    isolator_step,
    joint_step,
    leaves_step,
    moves_step,
)
from friso.questions.design.figures import design_figures
from friso.questions.design.words import brings, edge, lower, refusal, stiffest, upper
from friso.shown import blocks
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
    with SMALL.in_use(), patched({verification: {"DAMPING_RATIOS": np.array([0.1, 0.7])}}):
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
        patch.setattr(blocks, "IMAGE_FORMATS", ("svg",))
        command(RIG, spec, out=out, details=True)
    return out, said.getvalue()


@pytest.fixture(scope="module")
def folder(written: tuple[Path, str]) -> Path:
    return written[0]


def verified(designed: Design, **moves: Any) -> Design:
    """Return the design with other moves."""
    return replace(designed, verification=replace(designed.verification, **moves))


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
def test_the_document_has_the_numbers_of_the_design(
    spec: Path, folder: Path, quick: None, designed: Design, capsys: pytest.CaptureFixture
) -> None:
    command(RIG, spec, out=folder, as_json=True, overwrite=True)
    shown = capsys.readouterr()
    document = strict_json(shown.out)
    assert shown.err == ""
    assert (document["stage"], document["feasible"], document["needed"]) == ("Thesis rig", True, False)
    assert document["files"][0] == str(folder / "design.toml")
    without, joint, leaves = document["without"], document["joint"], document["leaves"]
    assert without["corners"] == designed.without.population.count
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
def test_the_summary_and_the_page(written: tuple[Path, str], snapshots: Snapshots) -> None:
    page = Page((written[0] / "design.html").read_text(encoding="utf-8"))
    snapshots.check("design", "run", written[1])
    snapshots.check("design", "page", page.lines)
    assert all(address.startswith("data:") for address in page.loads)
    assert page.tags.count("img") == len(FIGURES)


Changed = Callable[[Design], Any]


def of_leaves(designed: Design, excess: list[float]) -> Design:
    return replace(
        designed, fitted=replace(designed.fitted, choice=replace(designed.fitted.choice, excess=np.array(excess)))
    )


def damped(designed: Design, margins: list[float]) -> Design:
    damping = replace(designed.controller.damping, margins=np.array(margins))
    return replace(designed, controller=replace(designed.controller, damping=damping))


def without_beams(designed: Design) -> Design:
    broken = replace(designed.confirmed[0], stiffness=np.nan, frequency=np.nan, failure="no equilibrium")
    return replace(designed, confirmed=(broken, *designed.confirmed[1:]))


def moved(designed: Design, joint: str, **outcomes: Any) -> Design:
    """Return the design with other outcomes of the moves with a `joint` free or locked."""
    return verified(designed, **{joint: replace(getattr(designed.verification, joint), **outcomes)})


def edged(designed: Design, *edges: float) -> str:
    return edge(Corners(designed.without.population, np.array(edges), (1.2, 144.0)))


SWING = (np.arange(64) < 2) * np.arange(64) * 1e-3
SAID: dict[str, Changed] = {
    "isolator not needed": isolator_step,
    "isolator needed": lambda one: isolator_step(
        replace(one, without=replace(one.without, edges=np.full(len(one.without.edges), 60.0)))
    ),
    "edges given up": lambda one: joint_step(replace(one, edges=replace(one.edges, unknown=2))),
    "no edge": lambda one: edged(one, 0.0, 0.0),
    "no end": lambda one: edged(one, 0.0, np.inf),
    "an edge": lambda one: edged(one, 0.0, 7.62),
    "leaves that bind": lambda one: leaves_step(of_leaves(one, [0.985, 0.2, 0.1, 0.6, 0.99])),
    "leaves that spare": lambda one: leaves_step(of_leaves(one, [0.5, 0.1, 0.05, 0.3, 0.5])),
    "beams that failed": lambda one: leaves_step(without_beams(one)),
    "damping is worth it": lambda one: controller_step(damped(one, [0.3, 0.58, 0.6])).sentences[-1],
    "damping is not": lambda one: controller_step(damped(one, [0.57, 0.59, 0.6])).sentences[-1],
    "moves that swing": lambda one: moves_step(
        moved(one, "free", words=restless(2), settling=some(2, 2.0), swing=SWING)
    ),
    "moves that fail": lambda one: moves_step(
        moved(one, "free", words=np.where(np.arange(64) > 3, "rests", "failed").astype(object))
    ),
    "a locked joint that swings": lambda one: moves_step(
        moved(one, "locked", words=restless(20), settling=some(20, 3.0))
    ),
    "a locked joint that never rests": lambda one: brings(
        moved(one, "locked", words=np.full(64, "swings"), settling=np.full(64, np.nan))
    ),
    "nothing to relax": lambda _: refusal(NoDesign("too tight")),
    "something to relax": lambda _: refusal(NoDesign("too tight", RELAXED * 3)),
}


@pytest.mark.slow
def test_words(designed: Design, snapshots: Snapshots) -> None:
    """A case keeps what no case before it said."""
    texts, before = [], set()
    for name, changed in SAID.items():
        said = changed(designed)
        lines = [said] if isinstance(said, str) else [said.title, *said.sentences]
        texts.append(f"{name}: " + "\n".join(line for line in lines if line not in before))
        before |= {*lines}
    snapshots.check("design", "sentences", "\n".join(texts))


@pytest.mark.slow
def test_the_window_of_the_crossover(designed: Design) -> None:
    above, below = upper(designed), lower(designed)
    assert [item.value for item in above] == sorted(item.value for item in above)
    assert {48.0, stiffest(designed)} <= {entry.value for entry in above}
    assert 1.2 * designed.edges.highest in {limit.value for limit in below}
    assert below[0].value < designed.controller.crossover <= above[0].value


def restless(count: int) -> np.ndarray:
    """Return the outcomes of 64 moves of which `count` do not rest: the first creeps, the others swing."""
    words = np.where(np.arange(64) < count, "swings", "rests").astype(object)
    words[0] = "creeps"
    return words


# ---------------------------------------------------------------- figures and page


@pytest.mark.slow
def test_front_with_chosen_and_failed_points(designed: Design) -> None:
    other = without_beams(designed)
    broken = other.confirmed[0]
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
    assert (field.codes[1, 1], field.codes[2, 2]) == (1.0, 0.0)
    assert np.isnan(field.codes[0, 0])
    assert (panel.markers[0].x[0], panel.markers[0].y[0]) == (designed.controller.crossover, 1.0)


@pytest.mark.slow
def test_window_with_edges_beyond_the_search(designed: Design) -> None:
    endless = replace(designed.without, edges=np.where(np.arange(len(designed.without.edges)) == 0, np.inf, 5.0))
    (panel,) = _figures(replace(designed, without=endless))["design_window"].panels
    assert panel.y.words == ("without", "isolator", "margin", "leaves", "machine")
    reach = [band.x.max() for band in panel.bands if band.low[0] < 0]
    assert reach == [panel.x.limits[1]]
    assert panel.series[0].x == pytest.approx([designed.controller.crossover] * 2)


@pytest.mark.slow
def test_settling_ends_where_moves_do_not_rest(designed: Design) -> None:
    free = replace(designed.verification.free, words=restless(16), settling=some(16, 0.2))
    figure = _figures(verified(designed, free=free, locked=replace(free, settling=some(64, 0.0))))["design_settling"]
    (panel,) = figure.panels
    assert panel.series[0].y.max() == 75.0
    assert matplotlib_renderer.image(figure, "svg")


# ---------------------------------------------------------------- what is refused


@pytest.mark.parametrize("as_json", [False, True])
def test_no_design_says_what_to_relax(tmp_path: Path, capsys: Any, no_design: None, as_json: bool) -> None:
    with pytest.raises(typer.Exit) as left:
        command(RIG, SPEC, out=tmp_path / "out", as_json=as_json)
    shown = capsys.readouterr()
    assert left.value.exit_code == 2
    assert not (tmp_path / "out").exists()
    if not as_json:
        assert shown.out == ""
        return
    document = strict_json(shown.out)
    assert document["feasible"] is False
    length = {"key": "leaves.length", "from": 0.07, "to": 0.07421, "unit": "m"}
    assert document["relax"][1].items() >= length.items()


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
    document = strict_json(shown.out)
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
