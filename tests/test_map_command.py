"""`friso map`, `friso simulate --cell` and `friso reproduce` as a user runs them."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import NoReturn

import pytest
import xarray as xr
from filelock import FileLock
from inside import friso_inside
from refusals import rows_of
from systems import posix

import friso as friso_api
from friso.shown.pages import Report

RIG = Path(__file__).parent.parent / "examples" / "thesis_rig.toml"
SMALL = ("--x", "controller.crossover=4 Hz..12 Hz:5", "--y", "joint.stroke=0 m..1 mm:4")


def friso(folder: Path, *arguments: object) -> subprocess.CompletedProcess[str]:
    """Run the command line in a folder."""
    command = [sys.executable, "-m", "friso", *map(str, arguments)]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300)


@pytest.fixture(scope="module")
def mapped(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict]:
    """Return a folder with a map, and the document that its command printed."""
    folder = tmp_path_factory.mktemp("map")
    done = friso_inside(folder, "map", RIG, *SMALL, "--out", "a.zarr", "--json")
    assert done.returncode == 0, done.stderr
    return folder, json.loads(done.stdout)


@pytest.mark.slow
def test_files_and_document(mapped: tuple[Path, dict]) -> None:
    folder, document = mapped
    assert {Path(file).name for file in document["files"]} == {f"a.{form}" for form in ("png", "svg", "pdf", "html")}
    assert all((folder / file).stat().st_size > 1000 for file in document["files"])
    runs = xr.open_zarr(folder / "a.zarr")
    assert runs.peaks.dims == ("controller.crossover", "joint.stroke")
    assert document["cells"] == 20
    assert document["outcomes"]["swings"] == int((runs.outcome == "swings").sum())
    assert document["axes"]["joint.stroke"] == {"points": 4, "unit": "m", "first": 0.0, "last": 1e-3}
    done = friso_inside(folder, "map", "a.zarr", "--metric", "peaks", "--json", "--overwrite")  # from its store alone
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["outcomes"] == document["outcomes"]


@pytest.mark.slow
@pytest.mark.usefixtures("own_bandwidth")
def test_a_cell_is_run_again_alone(mapped: tuple[Path, dict]) -> None:
    folder, _ = mapped
    done = friso_inside(folder, "simulate", "--cell", "a.zarr", 2, 1, "--json")
    assert done.returncode == 0, done.stderr
    runs = xr.open_zarr(folder / "a.zarr")
    assert json.loads(done.stdout)["solver"]["steps"] == runs.steps.values[2, 1]
    assert "a_cell_2_1.toml" in done.stdout
    again = friso_inside(folder, "check", "response/a_cell_2_1.toml", "--rtol", "1e-6", "--json")
    case = json.loads(again.stdout)["cases"]["given"]
    assert (case["peaks"], case["peak_to_peak_m"]) == (runs.peaks.values[2, 1], runs.peak_to_peak.values[2, 1])


def test_files_of_the_user_are_not_overwritten(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_text("precious")
    done = friso_inside(tmp_path, "map", RIG, *SMALL, "--out", "a.zarr")
    assert done.returncode == 2
    assert "nothing was overwritten" in done.stderr
    assert (tmp_path / "a.png").read_text() == "precious"
    assert [path.name for path in tmp_path.iterdir()] == ["a.png"]


OF_ANOTHER_STUDY = (("--metric", "loudness"), ("--rtol", "1e-4"), ("--samples", "8"))


@pytest.mark.slow
@pytest.mark.parametrize("options", [*OF_ANOTHER_STUDY, ("--set", "controller.alpha=0.2")])
def test_a_store_takes_nothing_that_makes_another_study(mapped: tuple[Path, dict], options: tuple[str, ...]) -> None:
    done = friso_inside(mapped[0], "map", "a.zarr", *options)
    assert done.returncode == 2
    assert rows_of(done.stderr)


@posix
def test_ctrl_c_says_how_to_go_on(tmp_path: Path) -> None:
    """Interrupted on a terminal in the middle of its bar; resumed by the store alone."""
    import pty

    command = [sys.executable, "-m", "friso", "map", str(RIG), "--x", "controller.crossover=4 Hz..12 Hz:600"]
    command += ["--y", "joint.stroke=0.1 mm..1 mm:200", "--rtol", "1e-4", "--metric", "outcome", "--out", "a.zarr"]
    terminal, other = pty.openpty()
    with subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=other, text=True, preexec_fn=_interruptible
    ) as process:
        os.close(other)
        seen = b""
        while b"/120000" not in seen.replace(b" ", b"") or b"/s" not in seen:
            seen += os.read(terminal, 65536)
        process.send_signal(signal.SIGINT)
        try:
            while chunk := os.read(terminal, 65536):
                seen += chunk
        except OSError:  # the terminal ends with its process
            pass
        assert process.wait(300) == 130
    assert b"to resume: friso map a.zarr" in seen
    with xr.open_zarr(tmp_path / "a.zarr") as stored:
        kept = int((stored.outcome != "").sum())
    assert 0 < kept < 120000


def _interruptible() -> None:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.mark.slow
@pytest.mark.parametrize("numbers", [("5", "0"), ("0",), ("a", "b"), ("-1", "0")])
def test_a_cell_that_is_not_there(mapped: tuple[Path, dict], numbers: tuple[str, ...]) -> None:
    done = friso_inside(mapped[0], "simulate", "--cell", "a.zarr", "--out", "new", "--", *numbers)
    assert done.returncode == 2
    ranges = [("controller.crossover", "0", "4"), ("joint.stroke", "0", "3")]
    assert re.findall(r"([a-z]+\.[a-z]+) (\d+) to (\d+)", done.stderr) == ranges


def test_an_invalid_cell_gives_its_reason(tmp_path: Path) -> None:
    axes = ("--x", "friction.coulomb=1 N, 4 N", "--out", "a.zarr")
    assert friso_inside(tmp_path, "map", RIG, *axes).returncode == 0
    done = friso_inside(tmp_path, "simulate", "--cell", "a.zarr", 1)
    assert done.returncode == 2
    assert '"4 N"' in rows_of(done.stderr)["given"]


@pytest.mark.thorough
def test_samples_and_a_local_cluster(tmp_path: Path) -> None:
    options = ("--x", "masses.cart=0.7 kg..2.1 kg", "--y", "controller.crossover=4 Hz..12 Hz", "--samples", "16")
    done = friso(tmp_path, "map", RIG, *options, "--workers", "2", "--out", "a.zarr", "--json")
    assert done.returncode == 0, done.stderr
    with xr.open_zarr(tmp_path / "a.zarr") as stored:
        assert stored["masses.cart"].dims == ("sample",)
        assert stored.outcome.shape == (16,)
    again = friso_inside(tmp_path, "map", RIG, *options, "--out", "b.zarr", "--json")
    assert json.loads(again.stdout)["outcomes"] == json.loads(done.stdout)["outcomes"]


def test_a_damaged_block_is_noticed_and_run_again(tmp_path: Path, undrawn: None) -> None:
    crossovers = {"controller.crossover": "4 Hz..12 Hz:5"}
    friso_api.sweep(RIG, crossovers, metric="peaks", out=tmp_path / "a.zarr")
    for name, hint in (("a.zarr", "or friso map a.zarr"), ("b.zarr", "or a store made by friso map")):
        assert hint in " ".join(friso_inside(tmp_path, "check", name).stderr.split())
    (chunk, *_) = (tmp_path / "a.zarr" / "peaks").glob("c.*")
    content = chunk.read_bytes()
    chunk.write_bytes(content[:-1] + bytes([content[-1] ^ 1]))
    done = friso_inside(tmp_path, "map", "a.zarr")
    assert (done.returncode, "is damaged and is run again" in done.stderr) == (0, True)
    assert chunk.read_bytes() == content
    (tmp_path / "a.zarr" / "peaks" / "zarr.json").write_text("{}")
    done = friso_inside(tmp_path, "map", "a.zarr")
    assert (done.returncode, "--overwrite" in done.stderr) == (2, True)


@pytest.mark.slow
def test_a_figure_beside_a_store_that_it_has_not_made_stays(
    mapped: tuple[Path, dict], tmp_path: Path, undrawn: None
) -> None:
    shutil.copytree(mapped[0] / "a.zarr", tmp_path / "a.zarr")
    (tmp_path / "a.zarr").rename(tmp_path / "b.zarr")
    (tmp_path / "b.png").write_text("precious")
    done = friso_inside(tmp_path, "map", "b.zarr")
    assert done.returncode == 2
    assert "--overwrite" in done.stderr
    assert (tmp_path / "b.png").read_text() == "precious"
    assert "--out b-2.zarr" in friso_inside(tmp_path, "map", RIG, *SMALL, "--out", "b.zarr").stderr
    assert friso_inside(tmp_path, "map", "b.zarr", "--overwrite").returncode == 0
    (tmp_path / "b.html").write_text("mine, under a name that was friso's")
    done = friso_inside(tmp_path, "map", "b.zarr")
    assert (done.returncode, "--out figures" in done.stderr) == (2, True)
    assert friso_inside(tmp_path, "map", "b.zarr", "--out", "figures").returncode == 0
    assert (tmp_path / "b.html").read_text() == "mine, under a name that was friso's"


@pytest.mark.slow
def test_a_file_beside_a_store_that_appears_while_it_runs_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, undrawn: None
) -> None:
    """A file that a user puts beside a store filled from Python is not replaced either."""
    small = {"joint.stroke": "0.2 mm, 1 mm"}
    friso_api.sweep(RIG, small, out=tmp_path / "a.zarr")
    (tmp_path / "a.html").write_text("precious")
    assert friso_inside(tmp_path, "map", "a.zarr").returncode == 2
    (tmp_path / "a.html").unlink()

    def appears(page: Report) -> str:
        (tmp_path / "a.html").write_text("precious")
        return ""

    monkeypatch.setattr(Report, "html", appears)
    done = friso_inside(tmp_path, "map", "a.zarr")
    assert (done.returncode, "the runs are in a.zarr" in done.stderr) == (1, True)
    assert (tmp_path / "a.html").read_text() == "precious"
    assert not [*tmp_path.glob(".*")]


@pytest.mark.slow
def test_a_store_is_drawn_elsewhere_also_where_nothing_can_be_written_into_it(
    mapped: tuple[Path, dict], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, undrawn: None
) -> None:
    shutil.copytree(mapped[0] / "a.zarr", tmp_path / "a.zarr")
    (tmp_path / "a.png").write_text("precious")
    kept = {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()}

    class Denied(FileLock):
        def acquire(self, *arguments: object, **options: object) -> NoReturn:
            raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("friso.studies.store_files.FileLock", Denied)
    done = friso_inside(tmp_path, "map", "a.zarr", "--out", "figures")
    assert done.returncode == 0, done.stderr
    assert {file.name for file in (tmp_path / "figures").iterdir()} > {"map.png", "map.html"}
    assert "wrote figures/map.html" in done.stdout
    assert {file: file.read_bytes() for file in kept} == kept
    for out in ("a.zarr", "figures/map.png", "a.zarr/figures"):
        assert friso_inside(tmp_path, "map", "a.zarr", "--out", out, "--overwrite").returncode == 2
    done = friso_inside(
        tmp_path, "map", RIG, "--x", "controller.crossover=7 Hz, 8 Hz", "--out", "a.zarr", "--overwrite"
    )
    assert (done.returncode, "cannot be written to" in done.stderr) == (2, True)  # not the runs of the other study
    assert {file.name for file in tmp_path.iterdir()} == {"a.zarr", "a.png", "figures"}


@pytest.mark.slow
def test_a_map_is_drawn_again_as_what_it_was_made_for(mapped: tuple[Path, dict], tmp_path: Path) -> None:
    made = ("map", RIG, "--x", "controller.crossover=4 Hz, 5 Hz", "--metric", "peaks", "--out", "a.zarr")
    assert friso_inside(tmp_path, *made).returncode == 0
    first = (tmp_path / "a.svg").read_bytes()
    for again in (("map", "a.zarr"), made):
        (tmp_path / "a.svg").unlink()
        assert friso_inside(tmp_path, *again, "--overwrite").returncode == 0
        assert (tmp_path / "a.svg").read_bytes() == first
    assert friso_inside(tmp_path, "map", "a.zarr", "--metric", "outcome", "--overwrite").returncode == 0
    assert (tmp_path / "a.svg").read_bytes() != first


@pytest.mark.slow
def test_what_a_store_holds_is_drawn_and_what_it_lacks_is_named(mapped: tuple[Path, dict], tmp_path: Path) -> None:
    """Asked of the stage or of the store."""
    shutil.copytree(mapped[0] / "a.zarr", tmp_path / "a.zarr")
    for arguments in (("map", "a.zarr"), ("map", RIG, *SMALL, "--out", "a.zarr")):
        done = friso_inside(tmp_path, *arguments, "--metric", "amplitude")
        assert done.returncode == 2
        assert "amplitude" in rows_of(done.stderr)["given"]
        assert "('" not in done.stderr


def test_a_map_says_that_it_leaves_out_a_drive_that_makes_the_loop_unstable() -> None:
    """A wrist that buzzes by its delay settles on a map, which knows of no delay."""
    axes = {"speed": [0.9, 1.1], "friction": [0.9, 1.1]}
    for name, said in (("robot_wrist", True), ("thesis_drive", False)):
        answer = friso_api.sweep(friso_api.example(name), axes)
        assert answer.sentences()[0].startswith("Without the samples and delays of its drive") == said
        assert ("condition" in answer.document()) == said
