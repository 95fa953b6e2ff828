"""FMUs: FMPy validates, compiles and runs them, and they reproduce friso's runs as built."""

import shutil
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from target_stages import CONTROLLERS, EXAMPLES, MACHINES
from test_targets import COMPILERS, STRICT, TRAPS, machined, needs_compiler, swing_of, written

import friso
from friso.drives.target import TARGETS, Parcel
from friso.drives.targets import fmu
from friso.questions.export.parcel import packed

fmpy = pytest.importorskip("fmpy", reason="FMPy, which runs FMUs, is not installed")
validation = pytest.importorskip("fmpy.validation")
runs_here = pytest.mark.skipif(not (COMPILERS and fmu._folder("3")), reason="no C compiler for this platform")
PAIRS = [(control, [*MACHINES][k % len(MACHINES)]) for k, control in enumerate(CONTROLLERS)]
STEP = 125e-6
SLAVES = {"2": ("getReal", "setReal"), "3": ("getFloat64", "setFloat64")}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written(tmp_path_factory.mktemp("fmu") / "out", "fmu", parcel())


def parcel() -> Parcel:
    return machined("van_dijk_notch", "rigid_lugre", 400)


@contextmanager
def opened(path: Path, version: str) -> Iterator[tuple[Any, dict[str, int]]]:
    """Open an FMU, with the references of its variables by name."""
    inside = fmpy.extract(str(path))
    description = fmpy.read_model_description(inside)
    one = fmpy.instantiate_fmu(inside, description, "CoSimulation")
    try:
        if version == "2":
            one.setupExperiment(startTime=0.0)
        yield one, {variable.name: variable.valueReference for variable in description.modelVariables}
    finally:
        one.freeInstance()
        shutil.rmtree(inside)


def values_of(one: Any, version: str, *places: int) -> list[float]:
    return getattr(one, SLAVES[version][0])([*places])


def put(one: Any, version: str, place: int, value: float) -> None:
    getattr(one, SLAVES[version][1])([place], [value])


@pytest.mark.cases(first=2)
@pytest.mark.parametrize(("control", "machine"), PAIRS)
def test_fmus_are_valid_and_reproduce_the_run(tmp_path: Path, control: str, machine: str) -> None:
    """FMPy finds nothing against the standard's schemas and rules, and the test that is written passes."""
    made = written(tmp_path / "out", "fmu", machined(control, machine, 300))
    archives = sorted(made.glob("*.fmu"))
    assert len(archives) == 6
    for path in archives:
        assert validation.validate_fmu(str(path)) == []
    if COMPILERS and fmu._folder("3"):
        done = subprocess.run([sys.executable, "axis_test.py"], cwd=made, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
        assert done.stdout.count("300 samples") == 2


@needs_compiler
def test_sources_compile_without_a_warning(folder: Path, tmp_path: Path) -> None:
    for version in "23":
        with zipfile.ZipFile(folder / f"axis_loop_fmi{version}.fmu") as archive:
            archive.extractall(tmp_path / version)
        sources = tmp_path / version / "sources"
        for compiler in COMPILERS:
            command = [compiler, *STRICT, TRAPS[compiler], "-c", *(path.name for path in sources.glob("*.c"))]
            done = subprocess.run(command, cwd=sources, capture_output=True, text=True)
            assert done.returncode == 0, done.stderr


@runs_here
@pytest.mark.parametrize("version", "23")
def test_a_state_is_kept_and_set_back(folder: Path, version: str) -> None:
    """From a saved state, kept in memory or as bytes, the machine goes on as it did before."""
    with opened(folder / f"axis_machine_fmi{version}.fmu", version) as (one, at):
        one.enterInitializationMode()
        one.exitInitializationMode()
        put(one, version, at["output"], 20.0)
        for k in range(10):
            one.doStep(k * STEP, STEP)
        state = (one.getFMUstate if version == "2" else one.getFMUState)()
        serialized = (one.serializeFMUstate if version == "2" else one.serializeFMUState)(state)
        ends = []
        for again in (state, (one.deSerializeFMUstate if version == "2" else one.deserializeFMUState)(serialized)):
            (one.setFMUstate if version == "2" else one.setFMUState)(again)
            for k in range(10, 30):
                one.doStep(k * STEP, STEP)
            ends += values_of(one, version, at["position"])
        assert ends[0] == ends[1] > 1e-9


@runs_here
@pytest.mark.parametrize("version", "23")
def test_what_is_not_allowed_is_an_error_and_changes_nothing(folder: Path, version: str) -> None:
    with opened(folder / f"axis_fmi{version}.fmu", version) as (one, at):
        with pytest.raises(fmpy.fmi1.FMICallException):
            one.doStep(0.0, STEP)
        put(one, version, at["output_before"], 3.0)
        one.enterInitializationMode()
        assert values_of(one, version, at["output"]) == [3.0]
        one.exitInitializationMode()
        for place in (at["output_before"], at["output"], at["time"], 9999):
            with pytest.raises(fmpy.fmi1.FMICallException):
                put(one, version, place, 1.0)
        for time, duration in ((1.0, STEP), (0.0, -STEP), (0.0, float("nan")), (0.0, 1e300)):
            with pytest.raises(fmpy.fmi1.FMICallException):
                one.doStep(time, duration)
        one.doStep(0.0, STEP)
        assert values_of(one, version, at["output"]) == pytest.approx([3.0])
        put(one, version, at["position"], float("nan"))
        one.doStep(STEP, STEP)
        assert values_of(one, version, at["output"], at["dropped"]) == pytest.approx([3.0, 1.0])


@runs_here
def test_communication_may_be_rarer_or_more_frequent_than_samples(folder: Path) -> None:
    """Samples fall on their own times; a master that steps otherwise sees the same motion."""
    ends = []
    for step in (STEP, 2.5 * STEP, 0.4 * STEP, 20 * STEP):
        with opened(folder / "axis_machine_fmi3.fmu", "3") as (one, at):
            one.enterInitializationMode()
            one.exitInitializationMode()
            put(one, "3", at["output"], 20.0)
            for k in range(round(100 * STEP / step)):
                one.doStep(k * step, step)
            ends += values_of(one, "3", at["position"], at["time"])
    assert len({*ends[::2]}) == 1
    np.testing.assert_allclose(ends[1::2], 100 * STEP)


@pytest.mark.slow
@runs_here
@pytest.mark.parametrize("version", "23")
def test_two_coupled_fmus_hunt_as_friso_s_machine(tmp_path: Path, version: str) -> None:
    """Amplitude and period of the cycle are those of friso's run as built, to 1e-3."""
    long = machined("van_dijk_notch", "rigid_lugre", 160_000)
    made, (start, *rows) = written(tmp_path / "out", "fmu", long), long.vector.table
    names, measured = long.inputs, []
    held, place = start[-1], names.index("position")
    with (
        opened(made / f"axis_fmi{version}.fmu", version) as (controller, at),
        opened(made / f"axis_machine_fmi{version}.fmu", version) as (machine, of),
    ):
        inputs, setter = [at[name] for name in names], SLAVES[version][1]
        put(controller, version, at["output_before"], held)
        put(machine, version, of["output"], held)
        for one in (machine, controller):
            one.enterInitializationMode()
            one.exitInitializationMode()
        for k, row in enumerate(rows):
            row[place] = values_of(machine, version, of["position"])[0]
            measured.append(row[place])
            getattr(controller, setter)(inputs, row[:-1])
            controller.doStep(k * STEP, STEP)
            put(machine, version, of["output"], values_of(controller, version, at["output"])[0])
            machine.doStep(k * STEP, STEP)
    reference = long.vector.inputs["reference_position"]
    theirs = swing_of(long.vector.true_position - reference)
    assert theirs[0] > 1e-5
    np.testing.assert_allclose(swing_of(np.array(measured) - reference), theirs, rtol=1e-3)


@pytest.mark.parametrize(("system", "processor", "names"), [
    ("darwin", "arm64", ["aarch64-darwin"]),
    ("darwin", "x86_64", ["darwin64", "x86_64-darwin"]),
    ("linux", "aarch64", ["aarch64-linux"]),
    ("linux", "x86_64", ["linux64", "x86_64-linux"]),
    ("win32", "AMD64", []),
])  # fmt: skip
def test_the_remark_names_the_folders_that_there_are(
    monkeypatch: pytest.MonkeyPatch, system: str, processor: str, names: list[str]
) -> None:
    monkeypatch.setattr(fmu, "_compiler", lambda: "cc")
    monkeypatch.setattr(fmu.sys, "platform", system)
    monkeypatch.setattr(fmu.platform, "machine", lambda: processor)
    folders = [fmu._folder(version) for version in "23"]
    remark = TARGETS["fmu"].remark()
    assert [one for one in folders if one] == names == [one for one in names if one in remark]
    assert ("Not compiled" in remark) is (not names)


def test_an_fmu_keeps_its_clock() -> None:
    """Sample time is no variable, as the clock of an archive does not follow it."""
    for model in fmu._models(parcel()):
        assert "drive.sample_time" not in {one.name for one in model.variables}
    assert "drive.sample_time" in {str(one) for one in parcel().program.parameters}


@pytest.mark.parametrize(("changes", "answers", "powers"), [
    ({"drive.force_per_output": "0.5 N*m"}, {}, None),
    ({}, {"motor_constant": "0.5 N*m/A"}, {"A": 1, "kg": -1, "m": -2, "s": 2}),
])  # fmt: skip
def test_outputs_have_their_units(
    changes: dict[str, str], answers: dict[str, str], powers: dict[str, int] | None
) -> None:
    """Also on a rotary axis, whose output per torque is one per newton metre; a drive's output has none."""
    stage = friso.load(EXAMPLES / "robot_wrist.toml").replace(changes)
    parcel = packed(stage, TARGETS["fmu"], "axis", answers, 50, plant=True)
    model = fmu._models(parcel)[0]
    description = zipfile.ZipFile(fmu.BytesIO(fmu._archive(parcel, model, "2"))).read("modelDescription.xml").decode()
    assert ('unit="A"' in description) is (powers is not None)
    assert powers is None or fmu._powers(parcel.units["output.per_newton"]) == powers
    assert "rad with 16 steps" in TARGETS["c"].files(parcel)["axis_machine.h"]
