"""Studies on disk: killed and resumed they are what an uninterrupted one is, bit for bit; nothing else is touched."""

import errno
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from refusals import Refused

import friso
from friso.errors import StoreError
from friso.stage import Stage
from friso.studies import refine
from friso.studies import store as storing
from friso.studies.execute import local_crew
from friso.studies.request import Request
from friso.studies.samples import Samples
from friso.studies.store import Store, read_store
from friso.studies.sweep import run_in_store

EXAMPLES = Path(__file__).parent.parent / "examples"
AXES = {"controller.crossover": "2 Hz..16 Hz:12", "joint.stroke": "0.1 mm..1 mm:16"}

pytestmark = pytest.mark.xdist_group("rig")


@pytest.fixture(scope="module")
def whole(rig: Stage) -> xr.Dataset:
    """The study in memory."""
    return friso.sweep(rig, AXES)


def same(stored: xr.Dataset, whole: xr.Dataset) -> None:
    """Equal to the last bit, coordinates and attributes included."""
    loaded = stored.load()
    for name in ("outcome", "status"):
        loaded[name] = loaded[name].astype(object)
    xr.testing.assert_identical(loaded, whole)


def test_a_store_holds_what_the_sweep_in_memory_gives(rig: Stage, whole: xr.Dataset, tmp_path: Path) -> None:
    same(friso.sweep(rig, AXES, store=tmp_path / "a.zarr"), whole)
    same(xr.open_zarr(tmp_path / "a.zarr"), whole)


def test_a_finished_store_is_not_run_again(rig: Stage, tmp_path: Path) -> None:
    friso.sweep(rig, AXES, store=tmp_path / "a.zarr")
    with Store.opened(tmp_path / "a.zarr", Request(rig, AXES).study()) as store:
        assert list(store.missing()) == []


RUN = """
import sys
import friso
friso.sweep(friso.load(sys.argv[1]), {AXES!r}, store=sys.argv[2], refine=len(sys.argv) > 3, threads=1, rtol=1e-9)
"""


def killed_and_resumed(folder: Path, *options: str) -> tuple[xr.Dataset, int]:
    """The study run in processes that are killed at random moments until one is let finish; how many were killed."""
    script = folder / "run.py"
    script.write_text(RUN.replace("{AXES!r}", repr(AXES)))
    path = folder / "killed.zarr"
    command = [sys.executable, str(script), str(EXAMPLES / "thesis_rig.toml"), str(path), *options]
    random.seed(3)
    kills = 0
    for _ in range(6):
        with subprocess.Popen(command) as process:
            while not path.exists() and process.poll() is None:
                time.sleep(0.01)
            time.sleep(random.uniform(0.0, 0.6))
            kills += process.poll() is None
            process.kill()
    subprocess.run(command, check=True)
    return read_store(path), kills


def test_a_study_killed_several_times_is_as_if_it_never_was(rig: Stage, tmp_path: Path) -> None:
    found, kills = killed_and_resumed(tmp_path)
    assert kills >= 2
    same(found, friso.sweep(rig, AXES, rtol=1e-9))


def test_a_refined_study_too(rig: Stage, tmp_path: Path) -> None:
    found, kills = killed_and_resumed(tmp_path, "--refine")
    assert kills >= 2
    same(found, friso.sweep(rig, AXES, rtol=1e-9, refine=True))
    assert not (tmp_path / "killed.zarr" / ".answers").exists()


def test_ctrl_c_keeps_what_is_done_and_repeats_the_rest(
    rig: Stage, whole: xr.Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    study, path = Request(rig, AXES).study(), tmp_path / "a.zarr"
    written: list[int] = []
    write = Store.write

    def interrupted(self: Store, block: tuple[slice, ...], found: dict[str, np.ndarray]) -> None:
        if len(written) == 3:
            raise KeyboardInterrupt
        written.append(1)
        write(self, block, found)

    monkeypatch.setattr(Store, "write", interrupted)
    with pytest.raises(KeyboardInterrupt), local_crew(2) as crew:
        run_in_store(study, path, crew)
    monkeypatch.undo()
    with Store.opened(path, study) as store:
        blocks = len(list(study.blocks(store.blocks)))
        assert len(list(store.missing())) == blocks - 3
    same(friso.sweep(rig, AXES, store=path), whole)


def test_a_full_disk_stops_the_study_and_a_later_run_ends_it(
    rig: Stage, whole: xr.Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import zarr.storage._local as local

    put, count = local._put, [0]

    def full(*arguments: object, **options: object) -> object:
        count[0] += 1
        if count[0] > 25:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return put(*arguments, **options)

    path, study = tmp_path / "a.zarr", Request(rig, AXES).study()
    with Store.opened(path, study):
        pass
    monkeypatch.setattr(local, "_put", full)
    with pytest.raises(OSError, match="No space left"), local_crew(2) as crew:
        run_in_store(study, path, crew)
    monkeypatch.undo()
    with Store.opened(path, study) as store:
        assert 0 < len(list(store.missing())) < len(list(study.blocks(store.blocks)))
    same(friso.sweep(rig, AXES, store=path), whole)


@pytest.mark.parametrize(
    "change",
    [
        {"stage": {"controller.alpha": 0.2}},
        {"axes": {**AXES, "joint.stroke": "0.1 mm..1 mm:17"}},
        {"axes": {"controller.crossover": "2 Hz..16 Hz:12"}},
        {"rtol": 1e-5},
        {"metrics": ["peaks"]},
        {"links": {"friction.static": "3 * friction.coulomb"}},
        {"refine": True},
    ],
)
def test_a_store_of_another_study_is_refused(rig: Stage, tmp_path: Path, change: dict, refused: Refused) -> None:
    path = tmp_path / "a.zarr"
    with Store.opened(path, Request(rig, AXES).study()):
        pass
    before = sorted((file, file.read_bytes()) for file in path.rglob("*") if file.is_file())
    stage = rig.replace(change.pop("stage", {}))
    with refused() as error:
        friso.sweep(stage, change.pop("axes", AXES), store=path, **change)
    assert "nothing was overwritten" in str(error.value)
    assert before == sorted((file, file.read_bytes()) for file in path.rglob("*") if file.is_file())


SAMPLES = {"masses.stage": "0.5 kg..1 kg"}
FOLLOW = {"friction.static": "3 * friction.coulomb", "friction.coulomb": "0.9 * friction.coulomb"}


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ({"samples": Samples(SAMPLES, 8)}, {"samples": Samples({"masses.cart": "0.5 kg..1 kg"}, 8)}),
        (
            {"samples": Samples({"joint.stroke": ["0.1 mm", "1 mm"], "controller.alpha": [0.1, 0.2]})},
            {"samples": Samples({"joint.stroke": ["0.1 mm", "1 mm"]})},
        ),
        ({"axes": AXES, "links": FOLLOW}, {"axes": AXES, "links": dict(reversed(FOLLOW.items()))}),
    ],
)
def test_a_store_of_nearly_the_same_study_is_refused(
    rig: Stage, tmp_path: Path, first: dict, second: dict, refused: Refused
) -> None:
    """Other sampled keys with the same values, fewer of them, the same links in another order."""
    with Store.opened(tmp_path / "a.zarr", Request(rig, **{"axes": {}, **first}).study()):
        pass
    with refused():
        friso.sweep(rig, **{"axes": {}, **second}, store=tmp_path / "a.zarr")


def test_chunks_that_a_power_cut_took_are_run_again(rig: Stage, whole: xr.Dataset, tmp_path: Path) -> None:
    path = tmp_path / "a.zarr"
    friso.sweep(rig, AXES, store=path)
    chunks = [sorted((path / name).glob("[0-9]*")) for name in ("peaks", "outcome")]
    chunks[0][1].unlink()
    chunks[1][3].write_bytes(b"")
    with Store.opened(path, Request(rig, AXES).study()) as store:
        assert len(list(store.missing())) == 2
    same(friso.sweep(rig, AXES, store=path), whole)


def test_answers_to_other_questions_are_not_taken(rig: Stage, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A refined study begun by a friso that chose other cells."""
    path, study = tmp_path / "a.zarr", refine.finer(Request(rig, AXES).study())
    asked: list[int] = []

    def stop(done: int, total: int, what: str) -> None:
        asked.append(done)
        if len(asked) == 3:
            raise KeyboardInterrupt

    monkeypatch.setattr(refine, "LATTICE", 6)
    with pytest.raises(KeyboardInterrupt), local_crew(2) as crew:
        run_in_store(study, path, crew, 0.0, stop)
    monkeypatch.undo()
    assert (path / ".answers" / "0.npz").exists()
    same(friso.sweep(rig, AXES, refine=True, store=path), friso.sweep(rig, AXES, refine=True))


def test_a_store_of_other_equations_is_refused(
    rig: Stage, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, refused: Refused
) -> None:
    monkeypatch.setattr("friso.studies.study.code_digest", lambda *folders: "another digest")
    with Store.opened(tmp_path / "a.zarr", Request(rig, AXES).study()):
        pass
    monkeypatch.undo()
    with refused():
        friso.sweep(rig, AXES, store=tmp_path / "a.zarr")


def test_anything_else_is_refused(rig: Stage, tmp_path: Path, refused: Refused) -> None:
    folder, file = tmp_path / "folder", tmp_path / "file"
    folder.mkdir()
    (folder / "thesis.txt").write_text("precious")
    file.write_text("precious")
    xr.Dataset({"verdict": ("x", np.zeros(3))}).to_zarr(tmp_path / "foreign.zarr", zarr_format=2)
    for path in (folder, file, tmp_path / "foreign.zarr"):
        with refused():
            friso.sweep(rig, AXES, store=path)
    assert (folder / "thesis.txt").read_text() == file.read_text() == "precious"
    with refused("--out"):
        friso.sweep(rig, AXES, store=file / "below.zarr")
    with refused():
        read_store(tmp_path / "absent.zarr")


HOLD = """
import sys, time
from pathlib import Path
import friso
from friso.studies.request import Request
from friso.studies.store import Store

with Store.opened(Path(sys.argv[2]), Request(friso.load(sys.argv[1]), {AXES!r}).study()):
    print("open", flush=True)
    time.sleep(60)
"""


def test_two_processes_on_one_store_are_refused(rig: Stage, tmp_path: Path, refused: Refused) -> None:
    script, path = tmp_path / "hold.py", tmp_path / "a.zarr"
    script.write_text(HOLD.replace("{AXES!r}", repr(AXES)))
    command = [sys.executable, str(script), str(EXAMPLES / "thesis_rig.toml"), str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        with refused():
            friso.sweep(rig, AXES, store=path)
        process.send_signal(signal.SIGKILL)
    with Store.opened(path, Request(rig, AXES).study()):  # the lock went with its process
        pass


def test_a_store_is_there_whole_or_not_at_all(
    rig: Stage, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, refused: Refused
) -> None:
    def fails(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(xr.Dataset, "to_zarr", fails)
    with (
        refused(),
        Store.opened(tmp_path / "a.zarr", Request(rig, AXES).study()),
    ):
        pass
    assert list(tmp_path.iterdir()) == []


def test_a_large_study_takes_no_room_before_it_is_run(rig: Stage, tmp_path: Path) -> None:
    study = Request(rig, {"controller.crossover": "1 Hz..40 Hz:100000", "joint.stroke": "0 m..1 mm:10000"}).study()
    store = Store(tmp_path / "large.zarr", study)
    assert np.prod(store.blocks) <= storing.LARGEST_BLOCK
    with Store.opened(tmp_path / "large.zarr", study):
        size = sum(file.stat().st_size for file in (tmp_path / "large.zarr").rglob("*") if file.is_file())
    assert size < 3e6  # the axes themselves


def test_export(rig: Stage, whole: xr.Dataset, tmp_path: Path) -> None:
    import pandas as pd

    from friso.studies.export import export

    export(whole, tmp_path / "map.nc")
    with xr.open_dataset(tmp_path / "map.nc") as found:
        assert np.array_equal(found.peaks, whole.peaks)
        assert found.attrs["stage"] == rig.to_toml()
        assert found.outcome.astype(str).values.tolist() == whole.outcome.values.tolist()
    export(whole, tmp_path / "map.csv")
    table = pd.read_csv(tmp_path / "map.csv")
    assert len(table) == 12 * 16
    assert table["joint.stroke [m]"].nunique() == 16
    assert np.array_equal(table["largest_force [N]"], whole.largest_force.values.ravel())
    with pytest.raises(ValueError, match=r"\.nc or \.csv"):
        export(whole, tmp_path / "map.xls")


def test_a_store_whose_verdicts_are_by_the_peak_count_is_refused(tmp_path: Path) -> None:
    """Written before outcomes: it says why, and what to do."""
    old = xr.Dataset({"verdict": ("x", ["hunts"])}, attrs={"equations": "0.1.0"})
    old.to_zarr(tmp_path / "old.zarr", zarr_format=2)
    with pytest.raises(StoreError, match=r"earlier friso, whose verdicts are by the peak count[\s\S]*under a new name"):
        read_store(tmp_path / "old.zarr")
