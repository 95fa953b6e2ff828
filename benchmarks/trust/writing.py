"""Test what friso writes in this process, under faults at every operation on files.

No command is started and nothing simulated: a case takes milliseconds.
"""

import json
import random
import shutil
import warnings
from contextlib import suppress
from functools import cache
from pathlib import Path

import numpy as np

import friso
from benchmarks.trust.damage import damaged, exchange
from benchmarks.trust.faults import struck
from benchmarks.trust.inputs import folder_until_the_end
from friso.errors import InputError
from friso.interface.output_folder import DRAFTS, OutputFolder
from friso.studies.store import Store, _sum_at, read_store
from friso.studies.study import Request, Study
from friso.studies.sweep import sweep

RIG = Path(__file__).parents[2] / "examples" / "thesis_rig.toml"
AXES = {"controller.crossover": "2 Hz..16 Hz:8", "joint.stroke": "0.1 mm..1 mm:8"}


def files(rng: random.Random, folder: Path) -> None:
    """Write the files of a command over earlier ones: each as before or as after, whatever happens.

    The next run removes what a kill leaves.
    """
    out, names = folder / "out", [rng.choice(("a.txt", "b.txt", "c/d.txt", "c/e/f.txt")) for _ in range(4)]
    if is_over := rng.random() < 0.6:
        OutputFolder("check", out, False).write({name: f"old {name}" for name in rng.sample(names, 2)})
    before = _contents(folder)
    new = {name: None if rng.random() < 0.2 else f"new {name}" * rng.randrange(1, 3000) for name in names}
    fault = struck(lambda: OutputFolder("check", out, is_over).write(new), folder, rng, 20)
    after = _contents(folder)
    changed = {f"out/{name}": content for name, content in new.items()}
    whole = {name: content for name, content in ({**before, **changed}).items() if content is not None}
    strange = {name for name, content in after.items()
               if DRAFTS not in name and content not in (before.get(name), whole.get(name))}  # fmt: skip
    assert not strange, f"{fault}: neither as before nor as after: {strange}"
    lost = {name for name in before if name in whole} - {*after}
    assert not lost, f"{fault}: lost {lost}"
    OutputFolder("check", out, True).write(new)
    assert _contents(folder) == whole, f"{fault}: left {sorted({*_contents(folder)} - {*whole})}"


def stores(rng: random.Random, folder: Path) -> None:
    """Damage a store: it must say so when it is read, and be mended or refused, never show other numbers."""
    path = Path(shutil.copytree(_undisturbed(), folder / "a.zarr"))
    what = _damage(path, rng)
    try:
        _assert_same(path, f"{what}: not noticed", unless_empty=True)
    except InputError as error:
        if "friso map" not in str(error):  # the command that makes it whole or anew
            raise
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            _write_missing(path)
    except InputError:
        if {Path(name).parent.name for name in what[1:]} <= {*_columns(), ".friso"} and not any(
            name.endswith("zarr.json") for name in what[1:]
        ):  # blocks are run again
            raise
        return
    _assert_same(path, f"{what}: not mended")


def store_faults(rng: random.Random, folder: Path) -> None:
    """Make and write a store under up to three faults: in the end it must be as without faults."""
    path, said = folder / "a.zarr", []
    for _ in range(rng.randrange(1, 4)):
        said.append(struck(lambda: _write_missing(path), folder, rng, 60))
    _write_missing(path)
    names = [item.name for item in folder.iterdir()]
    assert names == ["a.zarr"], f"{said}: left {names}"
    _assert_same(path, f"{said}: another store")


def store_exchanges(rng: random.Random, folder: Path) -> None:
    """Replace a store under a fault: one of the two must be there, complete."""
    path, said = Path(shutil.copytree(_undisturbed(), folder / "a.zarr")), []
    study = Request(friso.load(RIG), {"controller.crossover": "2 Hz, 3 Hz"}).study(["peaks"])

    def replace() -> None:
        with Store.opened(path, study, overwrite=True):
            pass

    said.append(struck(replace, folder, rng, 20))
    try:  # what a kill left is set right by whoever opens it next
        _write_missing(path)
        _assert_same(path, f"{said}: another store")
    except InputError:
        assert read_store(path)["outcome"].shape == (2,), f"{said}: neither store"
    names = [item.name for item in folder.iterdir()]
    assert names == ["a.zarr"], f"{said}: left {names}"


def store_versions(rng: random.Random, folder: Path) -> None:
    """Open an intact store of another version: it must be refused or read, not changed."""
    path = Path(shutil.copytree(_undisturbed(), folder / "a.zarr"))
    document, notes = (json.loads((path / name).read_bytes()) for name in ("zarr.json", ".friso/zarr.json"))
    attributes, own = document["attributes"], notes["attributes"]
    own["format"] = rng.choice((0, 1, 2, 3, 99, -1, "3", None, [], 2.5, 10**30))
    attributes["equations"] = rng.choice((attributes["equations"], "9.9.9 (000000000000)", 3, ""))
    names = ("axes", "links", "rtol", "stage", "machine", "friso")
    for name in rng.sample(names, rng.randrange(3)):
        attributes[name] = rng.choice((None, "", "{", 3, [], "NaN", "1e999", attributes.get(name)))
    if rng.random() < 0.5:
        del attributes[rng.choice([*attributes])]
    (path / "zarr.json").write_text(json.dumps(document))
    if rng.random() < 0.8:  # with the checksum that friso would write
        with suppress(ValueError):
            own["checksum"] = _sum_at(path, own["metric"])
    (path / ".friso/zarr.json").write_text(json.dumps(notes))
    before = _contents(path)
    for use in (read_store, _write_missing):
        try:
            use(path)
        except InputError:
            assert _contents(path) == before, "refused, but changed"


def _damage(path: Path, rng: random.Random) -> tuple[str, ...]:
    """Damage a store; return what was done, and to which of its files."""
    every = sorted(item for item in path.rglob("*") if item.is_file() and item.name != "lock")
    first, second = rng.choice(every), rng.choice(every)
    kind = rng.choice(("bytes", "bytes", "exchange", "exchange alike", "gone", "empty", "copy"))
    if kind == "bytes":
        content = first.read_bytes()
        first.write_bytes(damaged(content, rng))
    elif kind == "gone":
        first.unlink()
    elif kind == "empty":
        first.write_bytes(b"")
    else:
        if kind == "exchange alike":
            second = rng.choice([item for item in every if item.parent == first.parent])
        if kind == "copy":
            first.write_bytes(second.read_bytes())
        else:
            exchange(first, second)
    alone = kind not in ("exchange", "exchange alike")
    return (kind, *(str(file.relative_to(path)) for file in ((first,) if alone else (first, second))))


def _study() -> Study:
    return Request(friso.load(RIG), AXES).study(["peaks"])


@cache
def _undisturbed() -> Path:
    """Return the store to which nothing happened."""
    path = folder_until_the_end("stores") / "a.zarr"
    sweep(friso.load(RIG), AXES, metrics=["peaks"], store=path)
    return path


@cache
def _columns() -> dict[str, np.ndarray]:
    runs = read_store(_undisturbed())
    return {str(name): runs[name].values for name in runs.data_vars}


def _write_missing(path: Path) -> None:
    """Write missing blocks as a run of the study does, without simulations."""
    columns = _columns()
    with Store.opened(path, _study()) as store:
        for block in list(store.missing()):
            store.write(block, {name: values[block] for name, values in columns.items()})


def _assert_same(path: Path, what: str, unless_empty: bool = False) -> None:
    """Compare a store with the undisturbed one; cells that are not done may be missing if `unless_empty`."""
    runs, whole = read_store(path), read_store(_undisturbed())
    for name, values in _columns().items():
        read = runs[name].values
        is_empty = (read == "") if read.dtype.kind == "U" else np.isnan(read)
        as_written = (read == values) | (is_empty & unless_empty) | (is_empty & (values != values))
        assert np.all(as_written), f"{what}: {name}"
    for name in whole.coords:
        assert np.array_equal(runs[name].values, whole[name].values), f"{what}: {name}"
    assert runs.attrs == whole.attrs, f"{what}: attributes"


def _contents(folder: Path) -> dict[str, str]:
    """Return the contents of the files of a folder, without locks."""
    every = (item for item in folder.rglob("*") if item.is_file() and item.name != "lock")
    return {str(item.relative_to(folder)): item.read_bytes().decode("latin-1") for item in every}


WRITING = {
    "files": files,
    "stores": stores,
    "store-faults": store_faults,
    "store-exchanges": store_exchanges,
    "store-versions": store_versions,
}
"""The campaigns by name."""
