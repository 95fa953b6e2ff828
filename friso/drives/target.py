"""Declare targets: languages and forms in which a verified controller leaves friso."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import numpy as np

from friso.drives.languages import commented, single_difference
from friso.drives.machine import MachineRun
from friso.drives.program import MEANINGS, LinearController, Program, identifier
from friso.errors import InputError, markdown
from friso.quantities import quoted
from friso.registry import Registry


@dataclass(frozen=True)
class Vector:
    """A run of a stage as built, as the test of a controller that left friso.

    `start` has the inputs and the output with which the run begins, by name. `inputs` are those of each sample by name,
    and `output` is what the drive commanded there. All are in SI, or in the unit of the output, of the shape (n,).
    `true_position` is where the machine was [m], without the encoder.
    """

    start: Mapping[str, float]
    inputs: Mapping[str, np.ndarray]
    output: np.ndarray
    true_position: np.ndarray

    @property
    def table(self) -> list[list[float]]:
        """Return the start and then all samples as rows: the inputs in order, then the output."""
        samples = np.column_stack([*self.inputs.values(), self.output]).tolist()
        return [[*self.start.values()], *samples]

    def text(self) -> str:
        """Return the vector as CSV; the first row below the heading is the start."""
        rows = [",".join(map(repr, row)) for row in self.table]
        return "\n".join([",".join([*self.inputs, "output"]), *rows, ""])


@cache
def _templates() -> Any:
    """Return the templates, in which texts of XML are escaped."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    templates = Environment(
        loader=PackageLoader("friso.drives"),
        undefined=StrictUndefined,
        trim_blocks=True,
        keep_trailing_newline=True,
        autoescape=lambda name: name is not None and name.endswith(".xml"),
    )
    templates.filters |= {"commented": commented, "identifier": identifier, "markdown": markdown}
    templates.globals["zip"] = partial(zip, strict=True)
    return templates


INPUT_ROUNDINGS = 16.0
"""Roundings of each input, times its direct gain, that the output may differ besides. Where a velocity is a
difference of large positions, these exceed the rounding of the output."""

OUTPUT_ROUNDING = 1e-11
"""Difference from friso that rounding explains, relative to the largest output. Compilers order sums otherwise, and
filters magnify rounding: over the 58 stages of the tests the largest was 2e-12."""

SINGLE_RESERVE = 4.0
"""Difference from friso in single precision, relative to that of friso's own run in single precision. Compilers
that order sums otherwise have come to twice that."""


@dataclass(frozen=True)
class Parcel:
    """All that leaves friso with a controller.

    `name` begins the names of files and identifiers. `header` says in lines of text which stage, friso and verdict the
    controller is of. `linear` is the controller for small motions. `units` are those of the parameters, by key, and of
    the inputs; `unit` is that of the output. `digest` is that of the stage. `machine` is the
    machine as a plant, if it is wanted.
    """

    name: str
    header: Sequence[str]
    program: Program
    linear: LinearController
    vector: Vector
    units: Mapping[str, str]
    unit: str
    digest: str
    machine: MachineRun | None = None

    @property
    def inputs(self) -> list[str]:
        """Return the names of the inputs."""
        return [str(one) for one in self.program.inputs]

    @property
    def tolerance(self) -> float:
        """Return the difference in the output that rounding explains over the test vector, in double precision.

        It is relative to the output, and some roundings of what each input contributes at once.
        """
        largest = [float(np.abs(self.vector.inputs[name]).max()) for name in self.linear.inputs]
        direct = np.abs([d[0] for *_, d in self.linear.samples]).max(axis=0)
        of_inputs = INPUT_ROUNDINGS * float(np.finfo(float).eps) * float(direct @ largest)
        return OUTPUT_ROUNDING * float(np.abs(self.vector.output).max()) + of_inputs

    @property
    def single_tolerance(self) -> float:
        """Return the difference in the output that single precision explains over the test vector.

        It is what rounding made in a run of friso's own; compilers that order sums otherwise round otherwise.
        """
        own = single_difference(self.program, self.vector.start, self.vector.inputs)
        return SINGLE_RESERVE * own + self.tolerance

    @property
    def meanings(self) -> dict[str, str]:
        """Return unit and meaning of each input by its name, as the text of a comment."""
        return {str(one): f"[{self.units[str(one)]}] {MEANINGS[one][1]}" for one in self.program.inputs}

    @property
    def parameters(self) -> list[tuple[str, str, float, str]]:
        """Return identifier, key, value and unit of each parameter."""
        values = self.program.parameters.items()
        return [(identifier(one), str(one), value, self.units.get(str(one)) or "1") for one, value in values]

    @property
    def checked(self) -> list[str]:
        """Return the names of what has to be finite at a sample: what follows from it, and what it reads."""
        following = [f"next_{identifier(one)}" for one in self.program.memories]
        return [*following, "command", *(one for one in self.inputs if one in self.program.read)]

    def rendered(self, template: str, **values: Any) -> str:
        """Return the text of a template, which has the fields of this parcel and further `values` by name."""
        program = self.program
        own = {name: getattr(self, name) for name in ("name", "header", "program", "unit", "units", "inputs")}
        own |= {"parcel": self, "begins": (*program.prepared, *program.begins)}
        return _templates().get_template(template).render(own | values)


@dataclass(frozen=True)
class CodeTarget:
    """A form in which a controller leaves friso.

    `files` writes the files by name, as texts or bytes. `own_names` are names that the form takes for itself, and
    `ignores_case` tells that names which differ in case alone are one. A target that `holds_machine` can write the
    machine, too. `remark` is a sentence on what was written.
    """

    title: str
    files: Callable[[Parcel], Mapping[str, Any]]
    own_names: frozenset[str] = frozenset()
    ignores_case: bool = False
    holds_machine: bool = False
    remark: Callable[[], str] = str

    def check_names(self, name: str, program: Program) -> None:
        """Check that names in the code are usable.

        Raises InputError if the user's name is no identifier of the target, or if two names in the code collide.
        """
        expected = "a name of letters, digits and single underscores that begins with a letter"
        own = {*map(self._folded, self.own_names)}
        if not re.fullmatch(r"[A-Za-z](_?[A-Za-z0-9])*", name):
            raise InputError("name", quoted(name), expected, "name=axis_x")
        if self._folded(name) in own:
            raise InputError("name", f"{quoted(name)}, a word of {self.title}", expected, "name=axis_x")
        first: dict[str, str] = {}
        for one in program.names:
            text = self._folded(identifier(one))
            if text in own or text in first:
                other = first.get(text, f"a word of {self.title}")
                raise InputError("controller", f"{one}, which collides with {other}", f"other names in {self.title}")
            first[text] = one

    def _folded(self, name: str) -> str:
        """Return a name as the target compares it."""
        return name.lower() if self.ignores_case else name


TARGETS: Registry[CodeTarget] = Registry("friso.drives.targets", "TARGET", "friso.targets", CodeTarget)
