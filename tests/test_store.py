"""Studies on disk: killed and resumed they are what an uninterrupted one is, bit for bit; nothing else is touched."""

import errno
import json
import os
import pickle
import random
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
import zarr
from patience import wait_until
from refusals import refused
from systems import posix

import friso as friso_api
from benchmarks.trust.damage import exchange, flip
from friso.errors import InputError, StoreError
from friso.stage import Stage
from friso.studies.store import LARGEST_STORED_BLOCK, SURVEYED_BLOCK, Store, _sum_at, read_store
from friso.studies.study import Request, Study, study_of
from friso.studies.sweep import local_crew, run_in_store, sweep

EXAMPLES = Path(__file__).parent.parent / "examples"
AXES = {"controller.crossover": "2 Hz..16 Hz:12", "joint.stroke": "0.1 mm..1 mm:16"}


def study_on(rig: Stage) -> Study:
    return Request(rig, AXES).study()


@pytest.fixture(scope="module")
def whole(rig: Stage) -> xr.Dataset:
    """The study in memory."""
    return sweep(rig, AXES)


def same(stored: xr.Dataset, whole: xr.Dataset) -> None:
    """Equal to the last bit, coordinates and attributes included."""
    loaded = stored.load()
    for name in ("outcome", "status"):
        loaded[name] = loaded[name].astype(object)
    xr.testing.assert_identical(loaded, whole)


@pytest.mark.slow
def test_a_store_holds_what_the_sweep_in_memory_gives_and_is_not_run_again(
    rig: Stage, whole: xr.Dataset, tmp_path: Path
) -> None:
    same(sweep(rig, AXES, store=tmp_path / "a.zarr"), whole)
    same(xr.open_zarr(tmp_path / "a.zarr")[[*whole.data_vars]], whole)
    with Store.opened(tmp_path / "a.zarr", study_on(rig)) as store:
        assert list(store.missing()) == []


RUN = """
import sys
import friso
from friso.studies.sweep import sweep
sweep(friso.load(sys.argv[1]), {AXES!r}, store=sys.argv[2], threads=1, rtol=1e-9)
"""


def killed_and_resumed(folder: Path) -> tuple[xr.Dataset, int]:
    """The study run in processes that are killed once they have written some files; how many were killed."""
    script = folder / "run.py"
    script.write_text(RUN.replace("{AXES!r}", repr(AXES)))
    path = folder / "killed.zarr"
    command = [sys.executable, str(script), str(EXAMPLES / "thesis_rig.toml"), str(path)]
    random.seed(3)
    kills = 0

    def written() -> int:
        return len([*path.rglob("*")])

    for _ in range(6):
        with subprocess.Popen(command) as process:
            enough = len([*path.rglob("*")]) + random.randint(1, 12)
            wait_until(
                lambda process=process, enough=enough: process.poll() is not None or len([*path.rglob("*")]) >= enough
            )
            kills += process.poll() is None
            process.kill()
    subprocess.run(command, check=True)
    return read_store(path), kills


@pytest.mark.thorough
def test_a_study_killed_several_times_is_as_if_it_never_was(rig: Stage, tmp_path: Path) -> None:
    resumed, kills = killed_and_resumed(tmp_path)
    assert kills >= 2
    same(resumed, sweep(rig, AXES, rtol=1e-9))


@pytest.mark.slow
def test_ctrl_c_keeps_what_is_done_and_repeats_the_rest(
    rig: Stage, whole: xr.Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    study, path = study_on(rig), tmp_path / "a.zarr"
    written: list[int] = []
    write = Store.write

    def interrupted(self: Store, block: tuple[slice, ...], results: dict[str, np.ndarray]) -> None:
        if len(written) == 3:
            raise KeyboardInterrupt
        written.append(1)
        write(self, block, results)

    monkeypatch.setattr(Store, "write", interrupted)
    with pytest.raises(KeyboardInterrupt), local_crew(2) as crew:
        run_in_store(study, path, crew)
    monkeypatch.undo()
    with Store.opened(path, study) as store:
        blocks = len(list(study.blocks(store.blocks)))
        assert len(list(store.missing())) == blocks - 3
    same(sweep(rig, AXES, store=path), whole)


@pytest.mark.slow
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

    path, study = tmp_path / "a.zarr", study_on(rig)
    with Store.opened(path, study):
        pass
    monkeypatch.setattr(local, "_put", full)
    with pytest.raises(OSError, match="No space left"), local_crew(2) as crew:
        run_in_store(study, path, crew)
    with pytest.raises(StoreError, match=r"No space left on device; \d+ of 192 cells are stored\n"):
        friso_api.sweep(rig, AXES, metric="outcome", out=path)
    monkeypatch.undo()
    with Store.opened(path, study) as store:
        assert 0 < len(list(store.missing())) < len(list(study.blocks(store.blocks)))
    same(sweep(rig, AXES, store=path), whole)


SAMPLES = {"masses.stage": "0.5 kg..1 kg"}
FOLLOW = {"friction.static": "3 * friction.coulomb", "friction.coulomb": "0.9 * friction.coulomb"}
LISTS = {"joint.stroke": ["0.1 mm", "1 mm"], "controller.alpha": [0.1, 0.2]}


@pytest.mark.cases(first=1)
@pytest.mark.parametrize(
    ("first", "second"),
    [
        ({}, {"stage": {"controller.alpha": 0.2}}),
        ({}, {"axes": {**AXES, "joint.stroke": "0.1 mm..1 mm:17"}}),
        ({}, {"axes": {"controller.crossover": "2 Hz..16 Hz:12"}}),
        ({}, {"rtol": 1e-5}),
        ({}, {"metrics": ["peaks"]}),
        ({}, {"links": {"friction.static": "3 * friction.coulomb"}}),
        # sampled keys of equal values, fewer keys, or links in another order
        (
            {"samples": friso_api.Samples(SAMPLES, 8)},
            {"samples": friso_api.Samples({"masses.cart": "0.5 kg..1 kg"}, 8)},
        ),
        (
            {"samples": friso_api.Samples(LISTS)},
            {"samples": friso_api.Samples({"joint.stroke": LISTS["joint.stroke"]})},
        ),
        ({"axes": AXES, "links": FOLLOW}, {"axes": AXES, "links": dict(reversed(FOLLOW.items()))}),
    ],
)
def test_a_store_of_another_study_is_refused(rig: Stage, tmp_path: Path, first: dict, second: dict) -> None:
    path, axes = tmp_path / "a.zarr", {} if first else AXES
    with Store.opened(path, Request(rig, **{"axes": axes, **first}).study()):
        pass
    before = sorted((file, file.read_bytes()) for file in path.rglob("*") if file.is_file())
    stage = rig.replace(second.get("stage", {}))
    with refused(kind=StoreError):
        sweep(**{"axes": axes, **second, "stage": stage, "store": path})
    assert before == sorted((file, file.read_bytes()) for file in path.rglob("*") if file.is_file())


def test_a_store_of_other_equations_is_refused(rig: Stage, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("friso.studies.study.code_digest", lambda *folders: "another digest")
    with Store.opened(tmp_path / "a.zarr", study_on(rig)):
        pass
    monkeypatch.undo()
    with refused(kind=StoreError):
        sweep(rig, AXES, store=tmp_path / "a.zarr")


def test_anything_else_is_refused(rig: Stage, tmp_path: Path) -> None:
    """A file, folders of others, and a store of an earlier friso."""
    folder, file = tmp_path / "folder", tmp_path / "file"
    folder.mkdir()
    (folder / "thesis.txt").write_text("precious")
    file.write_text("precious")
    foreign = xr.Dataset({"verdict": ("x", np.zeros(3))})
    foreign.to_zarr(tmp_path / "foreign.zarr", zarr_format=2)
    foreign.assign_attrs(equations="0.3.0 (123)", friso="0.3.0").to_zarr(tmp_path / "old.zarr", zarr_format=2)
    for path in (folder, file, tmp_path / "foreign.zarr"):
        with refused(kind=StoreError):
            sweep(rig, AXES, store=path)
    assert (folder / "thesis.txt").read_text() == file.read_text() == "precious"
    with refused("--out"):
        sweep(rig, AXES, store=file / "below.zarr")
    with refused(kind=StoreError):
        read_store(tmp_path / "absent.zarr")
    for use in (read_store, lambda path: sweep(rig, AXES, store=path)):
        with pytest.raises(StoreError, match=r"friso 0.3 or earlier[\s\S]*under a new name[\s\S]*friso map"):
            use(tmp_path / "old.zarr")
    with Store.opened(tmp_path / "old.zarr", study_on(rig), overwrite=True) as store:  # no files of others are in it
        assert store.read()["peaks"].isnull().all()


HOLD = """
import sys, time
from pathlib import Path
import friso
from friso.studies.store_files import LOCK
from friso.studies.study import Request
from friso.studies.store import Store

with Store.opened(Path(sys.argv[2]), Request(friso.load(sys.argv[1]), {AXES!r}).study()):
    print("open", flush=True)
    time.sleep(1e6)
"""


@pytest.mark.slow
def test_two_processes_on_one_store_are_refused(rig: Stage, tmp_path: Path) -> None:
    path = tmp_path / "a.zarr"
    command = [sys.executable, "-c", HOLD.replace("{AXES!r}", repr(AXES)), str(EXAMPLES / "thesis_rig.toml"), str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
        process.stdout.readline()
        with refused(kind=StoreError):
            sweep(rig, AXES, store=path)
        process.kill()
    with Store.opened(path, study_on(rig)):  # the lock went with its process
        pass


def test_a_store_is_there_whole_or_not_at_all(rig: Stage, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(zarr, "create_group", fails)
    with refused(), Store.opened(tmp_path / "a.zarr", study_on(rig)):
        pass
    assert list(tmp_path.iterdir()) == []


def test_a_large_study_takes_no_room_before_it_is_run(rig: Stage, tmp_path: Path) -> None:
    """A large store also opens quickly, and it is continued only on purpose, since it may come from others."""
    path, axes = tmp_path / "large.zarr", {**AXES, "masses.stage": "0.4 kg..0.5 kg:2"}
    study = Request(rig, {key: f"{ends.split(':')[0]}:20000" for key, ends in axes.items()}).study()
    store = Store(path, study)
    assert np.prod(store.blocks) <= LARGEST_STORED_BLOCK
    with Store.opened(path, study):
        size = sum(file.stat().st_size for file in path.rglob("*") if file.is_file())
    assert size < 3e6  # the axes themselves
    with pytest.raises(InputError, match=r"yes[\s\S]*8e\+12 cells"):
        friso_api.sweep(path)


def test_other_programs_get_a_study_as_netcdf(rig: Stage, tmp_path: Path) -> None:
    runs = friso_api.sweep(rig, {"joint.stroke": "0.2 mm, 1 mm", "joint.locked": [True, False]}, metric="outcome")
    runs.data.to_netcdf(tmp_path / "map.nc")
    with xr.open_dataset(tmp_path / "map.nc") as exported:
        assert np.array_equal(exported.peaks, runs.data.peaks, equal_nan=True)
        assert exported.attrs["stage"] == rig.to_toml()
        assert exported.outcome.astype(str).values.tolist() == runs.data.outcome.values.tolist()


# damage


@pytest.fixture(scope="module")
def finished(rig: Stage, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store of the study, which is done."""
    path = tmp_path_factory.mktemp("finished") / "a.zarr"
    sweep(rig, AXES, store=path)
    return path


@pytest.fixture
def stored(finished: Path, tmp_path: Path) -> Path:
    """A copy of the finished store."""
    return Path(shutil.copytree(finished, tmp_path / "a.zarr"))


def unfinished(path: Path) -> list[str]:
    """Return the blocks of a store that a resumed study would run, as Zarr numbers them."""
    store = Store(path, study_of(read_store(path)))
    return [store._number(block) for block in store.missing()]


def file_of(store: Path, name: object, number: str) -> Path:
    """Return the chunk of a variable in a block, or the block's record (".friso")."""
    return store / str(name) / (number if name == ".friso" else f"c.{number}")


def exchanged(*names: str) -> Callable[[Path], object]:
    """Exchange intact chunks of two blocks, of some variables or of all that there are."""

    def damage(store: Path) -> None:
        for name in names or [*read_store(store).data_vars, ".friso"]:
            exchange(file_of(store, name, "0.0"), file_of(store, name, "1.0"))

    return damage


def emptied(store: Path) -> None:
    """As a power cut may leave files."""
    (store / "peaks" / "c.0.0").unlink()
    (store / "outcome" / "c.1.0").write_bytes(b"")


DAMAGES: dict[str, tuple[Callable[[Path], object], list[str]]] = {
    "numbers": (lambda store: flip(store / "peaks" / "c.1.0", 0.2), ["1.0"]),
    "not numbers": (lambda store: flip(store / "period" / "c.1.0", 0.6), ["1.0"]),
    "texts": (lambda store: flip(store / "status" / "c.1.0", 0.99), ["1.0"]),
    "emptied": (emptied, ["0.0", "1.0"]),
    "numbers exchanged": (exchanged("peaks"), ["0.0", "1.0"]),
    "texts exchanged": (exchanged("outcome"), ["0.0", "1.0"]),
    "numbers exchanged with their record": (exchanged("peaks", ".friso"), ["0.0", "1.0"]),
    "blocks exchanged": (exchanged(), ["0.0", "1.0"]),
}


@pytest.mark.parametrize("name", DAMAGES)
def test_damaged_blocks_are_run_again(
    stored: Path, finished: Path, rig: Stage, name: str, caplog: pytest.LogCaptureFixture
) -> None:
    """Results of a block with a flipped bit, or of other cells, are never used, by friso or by other programs."""
    damage, numbers = DAMAGES[name]
    assert unfinished(stored) == []
    damage(stored)
    assert unfinished(stored) == numbers
    if name in ("numbers", "not numbers", "texts"):
        variable = {"numbers": "peaks", "not numbers": "period", "texts": "status"}[name]
        with pytest.raises(StoreError, match=rf"{variable}/c\.1\.0"):
            read_store(stored)[variable].load()
        with pytest.raises(ValueError, match="checksum"):
            xr.open_zarr(stored)[variable].load()
    sweep(rig, AXES, store=stored)
    assert name == "emptied" or f"block {numbers[0]}" in caplog.text
    xr.testing.assert_identical(read_store(stored).load(), read_store(finished).load())


WRITTEN_ONCE = ("zarr.json", ".friso/zarr.json", "peaks/zarr.json", "joint.stroke/zarr.json", "joint.stroke/c.0")
"""Files of a store that are not run again."""


@pytest.mark.slow
@pytest.mark.parametrize("place", np.linspace(0.01, 0.99, 9))
@pytest.mark.parametrize("name", WRITTEN_ONCE)
def test_damage_to_what_is_written_once_is_refused(stored: Path, name: str, place: float) -> None:
    before = read_store(stored).load()
    flip(stored / name, place)
    with suppress(StoreError):
        xr.testing.assert_identical(read_store(stored).load(), before)  # blank space


CUT = b"cut"


@pytest.mark.slow
@pytest.mark.parametrize(
    "content", [CUT, b"", b"{}", b"[1]", b"null", b'{"attributes": 3}', b"\xff\x00", b"[" * 100_000]
)
@pytest.mark.parametrize("name", WRITTEN_ONCE)
def test_any_other_content_or_none_is_refused(stored: Path, rig: Stage, name: str, content: bytes) -> None:
    """The refusal names a way out, which works."""
    file, other = stored / name, Request(rig, {"controller.crossover": "2 Hz..3 Hz:2"}).study()
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2] if content == CUT else content)
    for use in (read_store, lambda path: sweep(rig, AXES, store=path)):
        with pytest.raises(StoreError, match="--overwrite"):
            use(stored)
    file.unlink()
    with pytest.raises(StoreError, match="--overwrite"):
        read_store(stored)
    with Store.opened(stored, other, overwrite=True) as store:
        assert store.read()["outcome"].shape == (2,)


def test_a_checked_store_pickles_and_shows_its_study_alone(stored: Path, rig: Stage) -> None:
    """What is put in its place later is not mixed with it."""
    runs = read_store(stored)
    other = pickle.loads(pickle.dumps(runs))
    assert other.encoding["source"] == str(stored)
    assert float(other["peaks"][0, 0]) == float(runs["peaks"][0, 0])
    with Store.opened(stored, replace(study_on(rig), rtol=1e-4), overwrite=True):
        pass
    with local_crew(2) as crew:
        run_in_store(replace(study_on(rig), rtol=1e-4), stored, crew)
    with pytest.raises(StoreError, match=r"peaks/c\.0\.0"):
        other["peaks"][0].load()


@pytest.mark.slow
@posix
@pytest.mark.parametrize("name", [*WRITTEN_ONCE, ".friso/0.0", "peaks/c.0.0"])
@pytest.mark.parametrize("kind", ["pipe", "device", "link", "huge"])
def test_what_is_no_file_of_a_store_is_not_read(stored: Path, name: str, kind: str, tmp_path: Path) -> None:
    file = stored / name
    content = file.read_bytes()
    file.unlink()
    if kind == "pipe":
        os.mkfifo(file)
    elif kind == "device":
        file.symlink_to("/dev/zero")
    elif kind == "link":
        (tmp_path / "elsewhere").write_bytes(content)
        file.symlink_to(tmp_path / "elsewhere")
    else:
        with file.open("wb") as stream:
            stream.truncate(1 << 40)
    with pytest.raises(StoreError):
        read_store(stored)["peaks"].load()


@pytest.mark.parametrize("name", ["peaks/zarr.json", ".friso/0.0", "peaks/c.0.0", "peaks", "joint.stroke"])
def test_what_is_mine_in_place_of_a_file_or_a_folder_stays(stored: Path, finished: Path, rig: Stage, name: str) -> None:
    """Reading, continuing and replacing the store all refuse it."""
    path, aside = stored / name, stored.with_name("aside")
    path.rename(aside)
    mine = path / "mine" if aside.is_file() else path
    mine.parent.mkdir(exist_ok=True)
    mine.write_text("mine")
    uses = (
        lambda: read_store(stored)["peaks"].load(),
        lambda: friso_api.sweep(rig, AXES, metric="outcome", out=stored),
        lambda: Store.opened(stored, Request(rig, AXES).study(rtol=1e-4), overwrite=True).__enter__(),
    )
    for use in uses:
        with pytest.raises(StoreError):
            use()
    assert mine.read_text() == "mine"
    shutil.rmtree(path) if mine != path else path.unlink()
    aside.rename(path)
    sweep(rig, AXES, store=stored)
    xr.testing.assert_identical(read_store(stored).load(), read_store(finished).load())


@posix
@pytest.mark.parametrize("name", [".friso", "peaks", "joint.stroke"])
def test_nothing_is_written_where_a_link_in_a_store_leads(stored: Path, rig: Stage, name: str, tmp_path: Path) -> None:
    (stored / name).rename(tmp_path / "elsewhere")
    (stored / name).symlink_to(tmp_path / "elsewhere")
    for file in (tmp_path / "elsewhere").iterdir():
        file.write_bytes(b"mine")
    with pytest.raises(StoreError, match=re.escape(name)):
        sweep(rig, AXES, store=stored)
    assert all(file.read_bytes() == b"mine" for file in (tmp_path / "elsewhere").iterdir())


def change_in(document: dict[str, Any], change: dict[str, Any]) -> None:
    """Change a JSON document in some of its places."""
    for key, value in change.items():
        if isinstance(value, dict) and isinstance(document.get(key), dict):
            change_in(document[key], value)
        else:
            document[key] = value


def change_file(file: Path, change: dict[str, Any]) -> None:
    document = json.loads(file.read_text())
    change_in(document, change)
    file.write_text(json.dumps(document))


PLAIN = [{"name": "bytes", "configuration": {"endian": "little"}}]


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("zarr.json", {"attributes": {"rtol": 1e300}}),
        ("zarr.json", {"consolidated_metadata": {"metadata": {"../mine": {"shape": [1]}}}}),
        ("peaks/zarr.json", {"chunk_grid": {"configuration": {"chunk_shape": [1, 1]}}}),
        ("peaks/zarr.json", {"chunk_grid": {"configuration": {"chunk_shape": [10**12, 10**12]}}}),
        ("peaks/zarr.json", {"chunk_grid": {"configuration": {"chunk_shape": [-1, 16]}}}),
        ("peaks/zarr.json", {"shape": [10**12, 16]}),
        ("peaks/zarr.json", {"data_type": {"name": "raw_bytes", "configuration": {"length_bytes": 10**12}}}),
        ("peaks/zarr.json", {"codecs": [*PLAIN, {"name": "pickle"}]}),
        ("joint.stroke/zarr.json", {"codecs": [*PLAIN, {"name": "pickle"}]}),
        ("joint.stroke/zarr.json", {"shape": [10**11]}),  # an axis is not longer than what is there of it
        ("joint.stroke/zarr.json", {"chunk_grid": {"configuration": {"chunk_shape": [10**12]}}, "shape": [10**6]}),
    ],
)
def test_what_a_store_states_is_such_as_friso_states(stored: Path, name: str, change: dict[str, Any]) -> None:
    """Arrays that friso does not write are not decoded, and no file outside the store is named."""
    array, _, _ = name.rpartition("/")
    change_file(stored / name, change)
    if array:
        change_file(stored / "zarr.json", {"consolidated_metadata": {"metadata": {array: change}}})
    with suppress(OSError, ValueError):  # as someone who knows friso could forge it
        change_file(stored / ".friso/zarr.json", {"attributes": {"checksum": _sum_at(stored, "outcome")}})
    with pytest.raises(StoreError):
        read_store(stored)["peaks"].load()


def test_a_store_of_another_version_says_so(stored: Path) -> None:
    change_file(stored / ".friso/zarr.json", {"attributes": {"format": 4}})
    with pytest.raises(StoreError, match=r"another friso[\s\S]*run again"):
        read_store(stored)


@pytest.mark.slow
@pytest.mark.parametrize("damaged", [(), ("zarr.json",)])
def test_a_store_of_another_study_or_a_damaged_one_is_replaced_when_told(
    stored: Path, rig: Stage, damaged: tuple[str, ...]
) -> None:
    other = Request(rig, {"controller.crossover": "2 Hz..3 Hz:2"}).study()
    for name in damaged:
        flip(stored / name, 0.5)
    with pytest.raises(StoreError), Store.opened(stored, other):
        pass
    with Store.opened(stored, other, overwrite=True) as store:
        assert store.read()["outcome"].shape == (2,)
    with Store.opened(stored, other, overwrite=True) as store:  # the same goes on
        assert list(stored.parent.iterdir()) == [stored]


@pytest.mark.slow
def test_a_store_at_the_end_of_a_link_is_replaced_there(stored: Path, rig: Stage, tmp_path: Path) -> None:
    link, study = tmp_path / "links" / "b.zarr", Request(rig, {"controller.crossover": "2 Hz..3 Hz:2"}).study()
    link.parent.mkdir()
    link.symlink_to(stored)
    with Store.opened(link, study, overwrite=True):
        pass
    assert (read_store(stored)["outcome"].shape, [*link.parent.iterdir()], link.is_symlink()) == ((2,), [link], True)
    stored.rename(stored.with_name(f".a.zarr.{'c' * 32}.old"))  # killed between the two renames
    with Store.opened(link, study):
        pass
    stored.rename(tmp_path / "elsewhere")
    with pytest.raises(StoreError, match="a link to"), Store.opened(link, study):
        pass
    assert not stored.exists()


@pytest.mark.slow
def test_what_is_no_store_is_not_replaced_even_when_told(stored: Path, rig: Stage, tmp_path: Path) -> None:
    """Files of others in a store do not go with it, nor a folder whose metadata mention equations, but not friso."""
    other = Request(rig, {**AXES, "masses.stage": "0.4 kg..0.5 kg:2"}).study()
    for name in ("notes.txt", "mine/thesis.txt", "peaks/notes"):
        (stored / name).parent.mkdir(exist_ok=True)
        (stored / name).write_text("precious")
        with pytest.raises(StoreError, match=name), Store.opened(stored, other, overwrite=True):
            pass
        assert (stored / name).read_text() == "precious"
        (stored / name).unlink()
    (stored / "mine").rmdir()
    with Store.opened(stored, other, overwrite=True) as store:
        assert [*store.missing()]
    foreign = tmp_path / "flow.zarr"
    (foreign / "data").mkdir(parents=True)
    for attributes in (None, '{"equations": "Navier-Stokes"}'):
        if attributes:
            (foreign / ".zattrs").write_text(attributes)
        with pytest.raises(StoreError), Store.opened(foreign, other, overwrite=True):
            pass
        assert (foreign / "data").exists()


@pytest.mark.cases(first=1)
@pytest.mark.parametrize("damage", ["exchanged", "missing", "foreign", "record", "unreadable"])
def test_damaged_cells_are_not_handed_out(stored: Path, damage: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The error names the chunk; the others are read."""
    runs, first = read_store(stored), slice(0, Store(stored, study_of(read_store(stored))).blocks[0])
    chunk = stored / "peaks" / "c.0.0"
    if damage == "exchanged":
        exchange(chunk, stored / "peaks" / "c.1.0")
    elif damage == "missing":
        chunk.unlink()
    elif damage == "foreign":
        chunk.write_bytes(b"mine")
    elif damage == "record":
        (stored / ".friso" / "0.0").write_bytes(b"{}")
    else:

        def may_not(*_: object) -> None:
            raise PermissionError(errno.EACCES, "Permission denied")

        monkeypatch.setattr("friso.studies.store_files.stored", may_not)
    with pytest.raises(StoreError, match=r"peaks/c\.0\.0[\s\S]*friso map"):
        runs["peaks"][first].load()
    if damage in ("missing", "foreign"):
        assert runs["steps"][first].notnull().all()


@pytest.mark.slow
def test_blocks_that_are_not_done_are_read_as_empty(stored: Path) -> None:
    (stored / ".friso" / "0.0").unlink()
    peaks = read_store(stored)["peaks"]
    assert peaks[0].isnull().all()
    assert peaks[-1].notnull().all()


def test_exchanged_axes_are_refused(rig: Stage, tmp_path: Path) -> None:
    axes = {"friction.static": "2 N..3 N:5", "friction.stribeck_velocity": "1 mm/s..2 mm/s:5"}
    with Store.opened(tmp_path / "a.zarr", Request(rig, axes).study()):
        pass
    exchange(*(tmp_path / "a.zarr" / axis / "c.0" for axis in axes))
    with refused(kind=StoreError):
        read_store(tmp_path / "a.zarr")


@pytest.mark.slow
def test_blocks_of_another_study_are_run_again(stored: Path, rig: Stage, tmp_path: Path) -> None:
    """The other study has the same shape, but another tolerance."""
    other = sweep(rig, AXES, store=tmp_path / "b.zarr", rtol=1e-4)
    for name in [*other.data_vars, ".friso"]:
        exchange(file_of(tmp_path / "b.zarr", name, "1.0"), file_of(stored, name, "1.0"))
    assert unfinished(stored) == ["1.0"]


@posix
def test_a_store_is_open_to_whom_the_user_lets_read_files(rig: Stage, tmp_path: Path) -> None:
    before = os.umask(0o027)
    try:
        sweep(rig, {"controller.crossover": "2 Hz, 3 Hz"}, store=tmp_path / "a.zarr")
    finally:
        os.umask(before)
    modes = {file.stat().st_mode & 0o777 for file in (tmp_path / "a.zarr").rglob("*") if file.name != "lock"}
    assert modes == {0o640, 0o750}


@pytest.mark.slow
def test_files_that_were_being_written_go_but_no_others(stored: Path, rig: Stage) -> None:
    left = [stored / "peaks" / f"c.1.{'a' * 32}.partial", stored / ".friso" / f"0.1.{'b' * 32}.partial"]
    for file in (*left, stored / "notes.partial"):
        file.write_text("half")
    with Store.opened(stored, study_on(rig)):
        assert not any(file.exists() for file in left)
    assert (stored / "notes.partial").exists()


@pytest.mark.slow
def test_a_store_stays_where_the_one_in_its_place_cannot_be_made(
    stored: Path, finished: Path, rig: Stage, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The store also stays if the process is killed between the two renames: the next command puts it back."""
    other = Request(rig, {"controller.crossover": "2 Hz..3 Hz:2"}).study()

    def full(*arguments: object, **named: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr(zarr, "create_group", full)
        with pytest.raises(StoreError, match="No space left"), Store.opened(stored, other, overwrite=True):
            pass
    xr.testing.assert_identical(read_store(stored).load(), read_store(finished).load())
    stored.rename(stored.with_name(f".a.zarr.{'c' * 32}.old"))
    with pytest.raises(StoreError, match="another study"), Store.opened(stored, other):
        pass
    xr.testing.assert_identical(read_store(stored).load(), read_store(finished).load())
    assert [path.name for path in stored.parent.iterdir()] == ["a.zarr"]


def test_where_what_attracts_is_surveyed_blocks_are_small(rig: Stage, tmp_path: Path) -> None:
    axes = {"controller.crossover": "4 Hz..16 Hz:41", "joint.stroke": "0 m..1 mm:41"}
    store = Store(tmp_path / "a.zarr", Request(rig, axes).study(["verdict"]))
    assert np.prod(store.blocks) <= SURVEYED_BLOCK


def test_a_store_of_samples_has_their_values_as_coordinates(rig: Stage, tmp_path: Path) -> None:
    samples = friso_api.Samples({"controller.crossover": "4 Hz..12 Hz", "joint.stroke": "0.1 mm..1 mm"}, 4)
    stored = sweep(rig, {}, samples, store=tmp_path / "a.zarr")
    assert {"controller.crossover", "joint.stroke"} <= set(stored.coords)
    same(stored, sweep(rig, {}, samples))
