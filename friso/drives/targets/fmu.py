"""FMI 2.0 and 3.0 for co-simulation (FMUs), with sources in C and, if there is a compiler, a binary for this platform.

The archives hold the C of the target c behind the functions of the standard (fmi-standard.org), whose archives,
descriptions and functions these are. With a machine, there are archives of the machine and of both, too.
"""

from __future__ import annotations

import platform
import shutil
import subprocess
import sys
import uuid
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from friso.drives.gains import DRIVE_OUTPUT
from friso.drives.program import MEANINGS, MOTOR_POSITION, POSITION, identifier
from friso.drives.target import CodeTarget, Parcel
from friso.drives.targets.c import TARGET as C
from friso.equations.sampled import SAMPLE_TIME
from friso.quantities import by_pint
from friso.version import VERSION

BASE_UNITS = {"gram": "kg", "meter": "m", "second": "s", "ampere": "A", "kelvin": "K", "radian": "rad"}
"""Base units of the standard, by pint's names."""

COMPILERS = ("cc", "gcc", "clang")
FLAGS = ("-std=c99", "-O2", "-shared", "-fPIC", "-fvisibility=hidden")
SUFFIXES = {"linux": "so", "darwin": "dylib"}
PROCESSORS = {"x86_64": "x86_64", "aarch64": "aarch64", "arm64": "aarch64"}
"""The standard's names of processors, by those of systems."""

FOLDERS = {"2": {"x86_64": "{system}64"}, "3": {own: f"{one}-{{system}}" for own, one in PROCESSORS.items()}}
"""Folders of binaries in an archive, by version of the standard and processor."""

TRIAL = (("trial.c", "#include <math.h>\n#include <stdlib.h>\n#include <string.h>\nint trial(void) { return 0; }\n"),)
"""Source by which a compiler shows that it works; that of macOS may be an empty shell."""

RESERVED = {"model", "fmi2", "fmi3", "stdbool", "stdint"}
"""Names that would collide with functions and files of the interface."""

OUTPUT, BEFORE, DROPPED, START = "output", "output_before", "dropped", "start_position"
"""Names of variables beside parameters and inputs."""

CAUSALITY = {
    "time": 'causality="independent" variability="continuous"',
    "parameter": 'causality="parameter" variability="fixed"',
    "input": 'causality="input"',
    "output": 'causality="output"',
}


@dataclass(frozen=True)
class FmuVariable:
    """A variable of an FMU, of a `kind` of `CAUSALITY`, with the value with which it starts."""

    name: str
    kind: str
    start: float
    unit: str
    meaning: str

    @property
    def causality(self) -> str:
        """Return the attributes of the standard for the kind."""
        return CAUSALITY[self.kind]

    @property
    def has_start(self) -> bool:
        """Tell whether the user may set the value before the run."""
        return self.kind in ("parameter", "input")


@dataclass(frozen=True)
class FmuPart:
    """Controller or machine as fields of a structure, and statements that begin, go on for a sample, and tell."""

    fields: Sequence[str]
    begun: Sequence[str]
    sampled: Sequence[str]
    told: Sequence[str]


@dataclass(frozen=True)
class FmuModel:
    """What an archive holds."""

    name: str
    about: str
    variables: Sequence[FmuVariable]
    part: FmuPart


def _models(parcel: Parcel) -> list[FmuModel]:
    """Return the models of a parcel: the controller and, if it has one, the machine and both together."""
    name, begins, run = parcel.name, parcel.vector.start, parcel.machine
    held = begins[OUTPUT]
    output = FmuVariable(OUTPUT, "output", held, parcel.unit, "output of the controller")
    time = FmuVariable("time", "time", 0.0, "s", "time")
    before = FmuVariable(BEFORE, "parameter", held, parcel.unit, "output with which control begins")
    dropped = FmuVariable(DROPPED, "output", 0.0, "1", "samples that changed nothing, as their results were not finite")
    inputs = [
        FmuVariable(str(one), "input", begins[str(one)], parcel.units[str(one)], MEANINGS[one][1])
        for one in parcel.program.inputs
    ]
    own = _parameters(parcel, parcel.program.parameters, but=SAMPLE_TIME)  # an FMU keeps its clock
    variables = [time, *own, before, *inputs, output, dropped]
    models = [FmuModel(name, "the controller", variables, _controller(parcel, own, _places(variables)))]
    if run is None:
        return models
    theirs, unit = _parameters(parcel, run.machine.parameters), parcel.units[str(POSITION)]
    start = FmuVariable(START, "parameter", begins[str(POSITION)], unit, "position at rest with which it begins")
    read = [FmuVariable(str(one), "output", start.start, unit, MEANINGS[one][1]) for one in (POSITION, MOTOR_POSITION)]
    variables = [time, *theirs, start, replace(output, kind="input"), *read]
    part = _machine(parcel, theirs, _places(variables), OUTPUT)
    models.append(FmuModel(f"{name}_machine", "the machine with its friction", variables, part))
    outside = [one for one in inputs if one.name not in {one.name for one in read}]
    shared = {one.name: one for one in (*own, *theirs)}
    variables = [time, *shared.values(), before, start, *outside, *read, output, dropped]
    at = _places(variables)
    control, machine = _controller(parcel, own, at), _machine(parcel, theirs, at, BEFORE)
    both = FmuPart(
        [*control.fields, *machine.fields],
        [*machine.begun, *machine.told, *control.begun],
        [*machine.told, *control.sampled, *control.told, *machine.sampled],
        [*machine.told, *control.told],
    )
    return [*models, FmuModel(f"{name}_loop", "controller and machine in one", variables, both)]


def _parameters(parcel: Parcel, values: Mapping[Any, float], but: Any = None) -> list[FmuVariable]:
    """Return the parameters of a part, whose values are those of keys by symbol, `but` one."""
    named = {str(key): value for key, value in values.items() if key != but}
    return [FmuVariable(key, "parameter", value, parcel.units.get(key) or "1", key) for key, value in named.items()]


def _places(variables: Sequence[FmuVariable]) -> dict[str, str]:
    """Return where the values of variables stand in C, by name."""
    return {one.name: f"v[{k}]" for k, one in enumerate(variables)}


def _controller(parcel: Parcel, own: Sequence[FmuVariable], at: Mapping[str, str]) -> FmuPart:
    """Return the controller, whose values stand `at` places."""
    name, inputs = parcel.name, ", ".join(at[one] for one in parcel.inputs)
    return FmuPart(
        [f"{name}_parameters parameters;", f"{name}_state controller;"],
        [
            f"{name}_defaults(&model->parameters);",
            *(f"model->parameters.{identifier(one.name)} = {at[one.name]};" for one in own),
            f"{name}_init(&model->controller, &model->parameters, {inputs}, {at[BEFORE]});",
        ],
        [f"(void){name}_step(&model->controller, {inputs});"],
        [f"{at[OUTPUT]} = model->controller.output;", f"{at[DROPPED]} = (double)model->controller.dropped;"],
    )


def _machine(parcel: Parcel, own: Sequence[FmuVariable], at: Mapping[str, str], held: str) -> FmuPart:
    """Return the machine, whose values stand `at` places, and which begins at rest under the output named `held`."""
    name, run = parcel.name, parcel.machine
    assert run is not None
    begin = f"{name}_machine_init(&model->machine, &model->of_machine, {at[START]}, {at[held]}, {run.steps});"
    return FmuPart(
        [f"{name}_machine_parameters of_machine;", f"{name}_machine machine;"],
        [*(f"model->of_machine.{identifier(one.name)} = {at[one.name]};" for one in own), begin],
        [f"{name}_machine_step(&model->machine, {at[OUTPUT]});"],
        [f"{at[str(one)]} = {name}_machine_{one}(&model->machine);" for one in (POSITION, MOTOR_POSITION)],
    )


def _powers(unit: str) -> dict[str, int]:
    """Return the powers of the base units of the standard in a unit."""
    _, root, _ = by_pint(unit)
    return {BASE_UNITS[name]: int(power) for name, power in root.items()}


def _archive(parcel: Parcel, model: FmuModel, version: str) -> bytes:
    """Return the archive of a model for a version of the standard, which depends on nothing but what it holds."""
    code = {name: text for name, text in C.files(parcel).items() if name.endswith((".c", ".h")) and "_test" not in name}
    named = {one.unit for one in model.variables if one.unit != "1" and DRIVE_OUTPUT not in one.unit}
    values = {
        "model": model.name,
        "about": " ".join([*parcel.header[:1], f"This is {model.about}."]),
        "tool": f"friso {VERSION}",
        "period": repr(parcel.program.period),
        "stop": repr(len(parcel.vector.output) * parcel.program.period),
        "variables": [*model.variables],
        "machine": parcel.machine is not None,
        "part": model.part,
        "units": {unit: _powers(unit) for unit in sorted(named)},
        "token": "",
    }
    identity = "".join([model.name, version, *code.values(), parcel.rendered("model.h", **values)])
    values["token"] = f"{{{uuid.uuid5(uuid.NAMESPACE_URL, identity)}}}"
    interface = f"fmi{version}.c"
    code |= {f"{model.name}_fmu.h": parcel.rendered("model.h", **values)}
    code |= {interface: parcel.rendered(interface, **values)}
    values["compiled"] = [name for name in code if name.endswith(".c")]
    description = parcel.rendered(f"fmi{version}.xml", **values)
    files: dict[str, str | bytes] = {"modelDescription.xml": description}
    files |= {f"sources/{name}": text for name, text in code.items()}
    if version == "3":
        files["sources/buildDescription.xml"] = parcel.rendered("build.xml", **values)
    if (folder := _folder(version)) and (binary := _binary(tuple(code.items()))):
        files[f"binaries/{folder}/{model.name}.{SUFFIXES[sys.platform]}"] = binary
    content = BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(zipfile.ZipInfo(name), data, zipfile.ZIP_DEFLATED)
    return content.getvalue()


def _folder(version: str) -> str:
    """Return the folder of this platform's binaries in an archive, or "" if the standard or friso names none."""
    folder = FOLDERS[version].get(platform.machine(), "") if sys.platform in SUFFIXES else ""
    return folder.format(system=sys.platform)


@cache
def _binary(code: Iterable[tuple[str, str]]) -> bytes:
    """Compile sources by name to a shared library; empty without a compiler that works."""
    compiler = _compiler()
    return _library(compiler, code) if compiler else b""


@cache
def _compiler() -> str:
    """Return the first C compiler that works; "" if there is none."""
    for path in filter(None, map(shutil.which, COMPILERS)):
        with suppress(subprocess.CalledProcessError, OSError):
            _library(path, TRIAL)
            return path
    return ""


def _library(compiler: str, code: Iterable[tuple[str, str]]) -> bytes:
    """Compile sources by name to a shared library. Raises CalledProcessError if the compiler refuses them."""
    with TemporaryDirectory() as folder:
        for name, text in code:
            (Path(folder) / name).write_text(text, "utf-8")
        sources = [name for name, _ in code if name.endswith(".c")]
        subprocess.run([compiler, *FLAGS, *sources, "-lm", "-o", "binary"], cwd=folder, check=True, capture_output=True)
        return (Path(folder) / "binary").read_bytes()


def _remark() -> str:
    """Say for which platforms the archives are compiled."""
    folders = {version: folder for version in FOLDERS if _compiler() and (folder := _folder(version))}
    if folders:
        compiled = " and ".join(f"{folder} (FMI {version}.0)" for version, folder in folders.items())
        return f"Compiled for {compiled}; elsewhere importers compile the sources inside (python -m fmpy compile FILE)."
    return (
        "Not compiled, as no C compiler (cc, gcc, clang) works here, or the standard names no binary for this "
        "platform: the archives hold sources, which importers compile (python -m fmpy compile FILE)."
    )


def _files(parcel: Parcel) -> Mapping[str, Any]:
    """Return the archives, the test vectors, and a test that runs them."""
    name, vectors = parcel.name, [one for one in C.files(parcel).items() if one[0].endswith(".csv")]
    archives = {
        f"{model.name}_fmi{version}.fmu": _archive(parcel, model, version)
        for model in _models(parcel)
        for version in "23"
    }
    return {**archives, **dict(vectors), f"{name}_test.py": parcel.rendered("fmu_test.py.jinja")}


TARGET = CodeTarget("FMI", _files, C.own_names | RESERVED, holds_machine=True, remark=_remark)
