"""Test `friso boundary` as a user runs it: what it finds, says, draws and refuses."""

import json
import subprocess
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from inside import friso_inside
from snapshots import Snapshots

from friso.hunting import (
    Bifurcation,
    Branch,
    Cycles,
    Diagram,
    Ensemble,
    KeyRange,
    LocatedPoint,
    Plane,
    Point,
    Space,
    find_cycles,
    plane,
)
from friso.questions.boundary.figures import boundary_figure
from friso.questions.boundary.question import boundary_document
from friso.questions.boundary.words import (
    ShownKey,
    conclusion,
    sentences,
)
from friso.shown.drawing import plotly_renderer
from friso.stage import Stage
from friso.studies.boundary import corner_verdicts, end_verdicts, lines, plane_edge

EXAMPLES = Path(__file__).parent.parent / "examples"
RIG, STICK_SLIP = EXAMPLES / "thesis_rig.toml", EXAMPLES / "lugre_stick_slip.toml"
LOCKED = ("--set", "joint.locked=true")
CROSSOVER = ("--x", "controller.crossover=6 Hz..15 Hz")


def boundary(folder: Path, *arguments: str, stage: Path = RIG) -> subprocess.CompletedProcess[str]:
    """Run the command in a folder."""
    return friso_inside(folder, "boundary", stage, *arguments)


@pytest.fixture(scope="module")
def single(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict, Path]:
    """The document of the locked rig over its crossover, and the folder of its files."""
    folder = tmp_path_factory.mktemp("single")
    done = boundary(folder, *LOCKED, *CROSSOVER, "--json", "--out", "edge")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout), folder / "edge"


@pytest.mark.slow
def test_the_locked_rig_flips_at_9_75_hz(single: tuple[dict, Path]) -> None:
    document, folder = single
    (flip,) = (point for point in document["points"] if (point["kind"], point["cycle"]) == ("flip", "symmetric"))
    assert flip["value"] == pytest.approx(9.75, abs=0.001)
    assert 0 < flip["error"] < 1e-4
    assert flip["amplitude_m"] == pytest.approx(0.361e-3, rel=0.01)
    assert flip["period_s"] == pytest.approx(1.36, rel=0.01)
    assert document.keys() == {"conclusion", "key", "unit", "points", "ends", "branches", "files", "plug_ins"}
    assert (document["key"], document["unit"]) == ("controller.crossover", "Hz")
    assert document["ends"] == {"low": "attracting cycle", "high": "no attracting cycle"}
    values = [point["value"] for point in document["points"]]
    assert values == sorted(values)
    for point in document["points"]:
        assert point.keys() == {"value", "kind", "error", "cycle", "amplitude_m", "period_s"}
    assert {branch["cycle"] for branch in document["branches"]} == {"symmetric", "asymmetric"}
    for branch in document["branches"]:
        measures = ("values", "amplitude_m", "period_s", "multiplier", "attracts")
        assert {len(branch[name]) for name in measures} == {len(branch["values"])}
        assert branch["attracts"] == [abs(multiplier) < 1 for multiplier in branch["multiplier"]]
        assert len(branch["ends"]) == 2
    names = {f"thesis_rig_boundary.{ending}" for ending in ("html", "png", "svg", "pdf", "csv")}
    assert {path.name for path in folder.iterdir()} == {*names}
    table = pd.read_csv(folder / "thesis_rig_boundary.csv")
    special = table[table.kind.notna()].sort_values("controller.crossover [Hz]")
    assert list(special.kind) == [point["kind"] for point in document["points"]]
    assert list(special["controller.crossover [Hz]"]) == pytest.approx(values)
    assert table["error of controller.crossover [Hz]"].notna().sum() == len(special)


@pytest.mark.thorough
def test_values_are_told_in_the_unit_of_the_command_line(tmp_path: Path) -> None:
    """The rig stops hunting as its cart gets lighter than 661 g; only its files are in kg."""
    done = boundary(tmp_path, *LOCKED, "--x", "masses.cart=640 g..2000 g", "--json")
    document = json.loads(done.stdout)
    assert document["unit"] == "g"
    (flip,) = (point for point in document["points"] if point["cycle"] == "symmetric")
    assert flip["value"] == pytest.approx(661.3, abs=0.5)
    assert document["ends"] == {"low": "no attracting cycle", "high": "attracting cycle"}
    assert all("compiling" in line for line in done.stderr.splitlines())


@pytest.mark.slow
def test_a_range_without_a_boundary_says_so(tmp_path: Path, snapshots: Snapshots) -> None:
    done = boundary(tmp_path, *LOCKED, "--x", "controller.crossover=4 Hz..6 Hz", "--details")
    assert done.returncode == 0
    snapshots.check("boundary", "no boundary", done.stdout)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_the_curve_of_two_keys_separates_what_attracts(
    tmp_path: Path, rig: Stage, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Cycles found from scratch 0.5 % beside the curve attract at the lower crossover and repel at the higher one: from
    a grid of a few stages, as the range is narrow."""
    monkeypatch.setattr("friso.studies.boundary.plane", partial(plane, nodes=3))
    done = boundary(
        tmp_path, *LOCKED, "--x", "controller.crossover=9.6 Hz..9.92 Hz", "--y", "masses.cart=1190 g..1210 g", "--json"
    )
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    assert document.keys() == {"conclusion", "x", "y", "curves", "corners", "files", "plug_ins"}
    assert document["y"] == {"key": "masses.cart", "unit": "g"}
    assert document["corners"] == {
        **{"low low": "attracting cycle", "low high": "attracting cycle"},
        **{"high low": "no attracting cycle", "high high": "no attracting cycle"},
    }
    (curve,) = document["curves"]
    assert curve.keys() == {"points", "error", "kinds", "ends"}
    assert {*curve["kinds"]} == {"flip"}
    assert curve["ends"] == ["range", "range"]
    points = np.array(curve["points"])
    flat = rig.replace({"joint.locked": True}).flat(
        {
            "controller.crossover": np.concatenate([points[:, 0] * 0.995, points[:, 0] * 1.005]),
            "masses.cart": np.tile(points[:, 1] / 1000, 2),
        }
    )
    result = find_cycles(Ensemble.held(flat, 2 * len(points)))
    assert (np.split(np.abs(result.multiplier), 2)[0] < 1).all()
    assert (np.split(np.abs(result.multiplier), 2)[1] > 1).all()


def cycles(multipliers: Sequence[float], sign: float = -1.0) -> Cycles:
    """Made-up cycles of 1 mm and 2 s; NaN where there is none, infinite where the orbit could not be closed."""
    multiplier = np.array(multipliers)
    result, count = np.isfinite(multiplier), len(multiplier)
    reasons = np.where(np.isinf(multiplier), "not closed", "").astype(object)
    zero, period, amplitude = np.zeros(count), np.full(count, 2.0), np.full(count, 1e-3)
    states, local = np.zeros((count, 2)), np.zeros((count, 1), complex)
    returns = (1 if sign < 0 else 2, result, reasons, states, period, amplitude, zero, zero, local, states)
    return Cycles(sign, *returns, slope=multiplier, multiplier=multiplier)


def point(place: float, multiplier: float, distance: float = 0.0) -> Point:
    return Point(place, distance, 0.0, cycles([multiplier]))


def located(kind: Bifurcation, place: float, multiplier: float, distance: float = 0.0) -> LocatedPoint:
    return LocatedPoint(kind, point(place, multiplier, distance), 1e-6)


STROKE, GAIN = (
    KeyRange("joint.stroke", 1e-3, 2e-3, unit="m"),
    KeyRange("controller.kp", 1.0, 100.0, log=True, unit="N/m"),
)
MM = ShownKey("joint.stroke", "mm", 1e-3)
KEYS = (MM, ShownKey("controller.kp", "N/m"))


@pytest.fixture
def round_a_fold() -> Diagram:
    """A cycle that attracts from the low end, flips in the middle and turns back at a fold, attracting just before."""
    points = (point(0, -0.5), point(0.4, -0.9), point(0.6, -1.5), point(0.7, 5, 1.0), point(0.5, 8, 2.0))
    special = (located("flip", 0.45, -1), located("flip", 0.72, -1, 0.5), located("fold", 0.73, 1, 0.6))
    return Diagram(
        Space((STROKE,), dict),
        (Branch(-1.0, points, ("end of the range", "it could not be followed farther (multiplier 8)")),),
        (special,),
        np.linspace(0, 1, 3),
        cycles([-0.5, np.nan, np.inf]),
        attracts=np.array([True, False, False]),
        decided=np.array([True, True, False]),
        unstable=np.zeros(3, bool),
    )


def test_special_points_stand_in_their_place_on_the_branch(round_a_fold: Diagram) -> None:
    (line,) = lines(round_a_fold)
    assert line.kinds == ("", "", "flip", "", "flip", "fold", "", "")
    assert line.at[:, 0] == pytest.approx([1e-3, 1.4e-3, 1.45e-3, 1.6e-3, 1.72e-3, 1.73e-3, 1.7e-3, 1.5e-3])
    assert line.attracts.tolist() == [True, True, False, False, True, False, False]
    assert line.error[line.special] == pytest.approx(np.full((3, 1), 1e-9), rel=1e-3)
    assert end_verdicts(round_a_fold) == ("attracting cycle", "unknown")


def test_sentences_of_one_key_begin_with_an_unstable_loop(
    round_a_fold: Diagram, crossing: Plane, snapshots: Snapshots
) -> None:
    said = sentences(round_a_fold, (MM,))
    assert said[0] == conclusion(round_a_fold, (MM,))
    snapshots.check("boundary", "one key", "\n".join(said))
    high = replace(round_a_fold, unstable=np.array([False, True, True]))
    corner = replace(crossing, unstable=np.arange(8) == 2)
    loops = [*sentences(high, (MM,))[:1], conclusion(corner, KEYS)]
    snapshots.check("boundary", "unstable loop", "\n".join(loops))


def test_the_figure_of_one_key_is_solid_where_the_cycle_attracts(round_a_fold: Diagram) -> None:
    figure = boundary_figure(round_a_fold, (MM,), "Rig")
    dashes = [(line.dash, line.x[0], line.x[-1]) for line in figure.panels[2].series]
    assert [dash for dash, _, _ in dashes] == ["solid", "dashed", "solid", "dashed"]
    assert dashes[0][1:] == pytest.approx((1e-3, 1.45e-3))


def test_labels_of_points_have_a_third_of_the_axis_each(round_a_fold: Diagram) -> None:
    """Points that are closer share one, and none is cut at the sides: so wide are they on a page of 400 px."""
    (panel, *_) = boundary_figure(round_a_fold, (MM,), "Rig").panels
    (label,) = panel.words
    assert [line.split()[0] for line in label.text.splitlines()] == ["flip", "flip", "fold"]
    begun = replace(round_a_fold, special=((located("fold", 0.02, 1), *round_a_fold.special[0]),))
    (panel, *_) = boundary_figure(begun, (MM,), "Rig").panels
    low, high = panel.x.limits
    shares = [(one.x - low) / (high - low) for one in panel.words]
    assert len(shares) == 2
    assert shares[0] == pytest.approx(1 / 6)
    assert shares[1] - shares[0] > 1 / 3


@pytest.fixture
def crossing() -> Plane:
    """Three by three nodes: hunting ends at 1.25 mm, and at 1.3 mm at the high gain; one corner is invalid."""
    return _plane([[1, 1, 1], [0, 0, 0], [0, 0, np.nan]], [0, 1, 2, 3, 4, 5, 6, 7], {0: 0.25, 1: 0.25, 2: 0.3})


def _plane(hunts: list[list[float]], allowed: list[int], ends: dict[int, float], kind: str = "flip") -> Plane:
    """A plane of 3 x 3 nodes whose hunting ends, by the number of the gain, at places of the stroke."""
    space, told = Space((STROKE, GAIN), dict), np.ravel(hunts)[allowed]
    near, kinds = space.grid(5).reshape(5, 5, 2), np.full((5, 5), "", object)
    far = near.copy()
    for number, place in ends.items():
        near[1, 2 * number], far[1, 2 * number], kinds[1, 2 * number] = place, place + 0.01, kind
        near[1, 2 * number, 1] = far[1, 2 * number, 1] = number / 2
    unstable = np.zeros(len(allowed), bool)
    return Plane(space, 3, np.array(allowed), told == 1, np.isfinite(told), unstable, near, far, kinds)


def test_sentences_of_two_keys(crossing: Plane, snapshots: Snapshots) -> None:
    verdicts = ["attracting cycle", "attracting cycle", "no attracting cycle", "invalid"]
    assert [verdict for _, _, verdict in corner_verdicts(crossing)] == verdicts
    snapshots.check("boundary", "two keys", "\n".join(sentences(crossing, KEYS)))


def test_where_curves_end_is_told(crossing: Plane) -> None:
    """At a side of the plane, or beside a stage that is not known."""
    (curve,) = boundary_document(crossing, KEYS)["curves"]
    assert curve["ends"] == ["range", "range"]
    assert curve["points"][0] == pytest.approx([1.25, 1.0])
    assert curve["error"][0] == pytest.approx([0.01, 0.0])
    unknown = replace(crossing, decided=np.array([True, True, False, *[True] * 5]))
    (curve,) = boundary_document(unknown, KEYS)["curves"]
    assert {*curve["ends"]} == {"range", "lost"}


def test_where_hunting_ends_along_one_key_whatever_the_other_is(crossing: Plane, snapshots: Snapshots) -> None:
    """Hunting ends by a cycle or between two stages, along the first key or else the second.

    Otherwise the corners are told.
    """
    assert plane_edge(crossing) is None
    rows, ends = [[1, 1, 1], [0, 0, 0], [0, 0, 0]], {0: 0.25, 1: 0.25, 2: 0.3}
    plane = _plane(rows, [*range(9)], ends)
    edge = plane_edge(plane)
    assert (edge.along, edge.below) == (0, True)
    assert edge.low == pytest.approx([1.25e-3, 1.25e-3, 1.3e-3])
    assert edge.low.tolist() == edge.high.tolist()
    snapshots.check("boundary", "along one key", conclusion(plane, KEYS))
    seen = plane_edge(_plane(rows, [*range(9)], ends, "seen"))
    assert seen.high == pytest.approx([1.26e-3, 1.26e-3, 1.31e-3])
    along_second = plane_edge(_plane([[1, 0, 0]] * 3, [*range(9)], {}))
    assert along_second.along == 1
    for unclear in ([[1, 0, 1], [0, 0, 0], [0, 0, 1]], [[1, 1, 1], [0, 0, 0], [0, np.nan, 0]]):
        assert plane_edge(_plane(unclear, [*range(9)], ends)) is None


def test_the_figure_of_two_keys_shows_nodes_and_curves_in_one_legend(crossing: Plane) -> None:
    figure = boundary_figure(crossing, KEYS)
    (panel,) = figure.panels
    assert panel.y.log
    assert not panel.x.log
    assert any(trace.mode == "lines" for trace in plotly_renderer.render(figure).data)
