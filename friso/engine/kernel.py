"""Represent the kernel of a structure: its compiled equations and step, cached on disk."""

from __future__ import annotations

import pickle
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from threading import Lock
from types import ModuleType
from typing import Any

import numpy as np

from friso.engine.arrays import STATISTICS, Batch, BatchOptions, Results, new_queue
from friso.engine.building import built_entries
from friso.engine.cache import CodeRequest, Compiled
from friso.engine.machine_code import (
    FUNCTIONS,
    LANES,
    LOOKED_UP,
    CompiledKind,
    Loops,
    ModelLayout,
    argument_kind,
    load_object,
)
from friso.equations.as_built import AsBuilt
from friso.equations.imposed import Dragged, Driven, Imposed
from friso.equations.roles import Role, Steady
from friso.equations.structure import Structure, carrying_force
from friso.stage import Section
from friso.stage.rig import QUADRATIC
from friso.stage.section import plug_ins
from friso.stage.tables import friction_law

KernelForm = Structure | Imposed | Driven | AsBuilt
"""Forms for which a kernel can be made: stages, friction under an imposed motion, stages that follow a log, and stages
with their real drive."""


STEP_WORK, OPERATION_WORK, CALL_WORK = 3.5, 0.0011, 0.126
"""Work of a step of a run (see `friso.engine.allowance`): a constant, a term for each operation in its source, and one
for each call of a function such as an exponential. They were fitted on 25 November 2026 to 33 kernels, which take 63 to
280 ns a step, and match them to 30 %."""

_STEP = re.compile(r"^def step\(.*?(?=^def |\Z)", re.DOTALL | re.MULTILINE)
_OPERATIONS = re.compile(r"[-+*/]")
_CALLS = re.compile(r"\b(?:exp|gaussian|power|sqrt|tanh|sine|log|clipped)\(")


@dataclass(frozen=True)
class Kernel:
    """The compiled code of a structure's equations, with the loops that run it.

    `module` has the names of states, of numbers held between samples, of parameters and outputs. `layout` says where
    numbers are in the buffer, with the addresses of the machine code.
    """

    module: ModuleType
    layout: ModelLayout = field(compare=False)
    loops: Loops = field(compare=False)
    source: str = field(compare=False, repr=False)

    @cached_property
    def work(self) -> float:
        """Return the work of one step of a run, counted in operations of its source.

        It is equal on every machine.
        """
        step = "".join(_STEP.findall(self.source))
        return STEP_WORK + OPERATION_WORK * len(_OPERATIONS.findall(step)) + CALL_WORK * len(_CALLS.findall(step))

    def run(self, queue: np.ndarray, batch: Batch, settings: BatchOptions, results: Results) -> None:
        """Compute this thread's share of a batch: the runs whose numbers it takes from the queue.

        The results are written into `results`.
        """
        self.loops(self._buffer(), self.layout, queue, batch, settings, results)

    def _buffer(self) -> np.ndarray:
        """Return room for the numbers of all runs computed at once, aligned to 64 bytes.

        A register that straddles two cache lines takes twice as long.
        """
        numbers = self.layout.rows * self.layout.lanes
        room = np.empty(numbers + 8)
        first = -room.__array_interface__["data"][0] % 64 // 8
        return room[first : first + numbers]

    @property
    def states(self) -> tuple[str, ...]:
        """Return the names of the states."""
        return self.module.STATE_NAMES

    @property
    def position(self) -> int:
        """Return the index of the state that is the measured position of the stage."""
        return self.layout.position

    @property
    def velocity(self) -> int:
        """Return the index of the state that is the velocity of the stage."""
        return self.layout.velocity

    @property
    def cart_position(self) -> int:
        """Return the index of the state that is the position of the body with friction.

        It is the position of the cart, or of the stage if there is no joint.
        """
        return self.module.CART_POSITION

    @property
    def cart_velocity(self) -> int:
        """Return the index of the state that is the velocity of the body with friction."""
        return self.module.CART_VELOCITY

    def having(self, role: Role) -> list[int]:
        """Return the indices of states and held numbers that have a `role`."""
        return [i for i, state_role in enumerate(self.module.ROLES) if state_role == role]

    @property
    def held(self) -> tuple[str, ...]:
        """Return the names of numbers held between samples, and then of modes with memory."""
        return self.module.HELD_NAMES

    @property
    def full_state(self) -> tuple[str, ...]:
        """Return the names of all values of a run at an instant: the states, then the held numbers.

        Modes with memory, such as slipping, come last among the held numbers.
        """
        return self.states + self.held

    @property
    def sample_size(self) -> int:
        """Return how many numbers a sample of a run consists of: those of `full_state`.

        With a sampled drive, the held numbers follow that the drive computed from the sample. They differ from those in
        `full_state` where they act later than at the instant of the sample.
        """
        return len(self.full_state) + self.layout.clocked * len(self.held)

    @property
    def switches(self) -> tuple[int, ...]:
        """Return the numbers of the kinks, where derivatives jump, that are modes with memory."""
        return self.module.SWITCHES

    @property
    def initial_size(self) -> int:
        """Return how many numbers of `full_state` a run needs to start from.

        Modes with memory may be derived from them.
        """
        return len(self.full_state) - len(self.switches)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Return the names of the parameters."""
        return self.module.PARAMETERS

    @property
    def kinks(self) -> tuple[str, ...]:
        return self.module.KINK_NAMES

    @property
    def outputs(self) -> dict[str, tuple[str, str]]:
        """Return the unit and the label of each output, by name."""
        return self.module.OUTPUTS

    def settled(self, flat: dict[str, Any], steady: Steady, runs: int) -> np.ndarray:
        """Return states and held numbers in a steady motion after all transients.

        The shape is (runs, initial_size). `flat` has the stages' keys in SI; they and the numbers of the motion may be
        arrays of shape (runs,).
        """
        return self.settled_at(self.values(flat, runs), steady, runs)

    def at_rest(self, flat: Mapping[str, Any], place: Any, runs: int, displacement: Any = 0.0) -> np.ndarray:
        """Return the states in which stages at rest at a place [m] begin, shape (runs, initial_size).

        Friction bears nothing (see `steady_at_rest`).
        """
        return self.settled_at(self.values(flat, runs), self.steady_at_rest(flat, place, runs, displacement), runs)

    def steady_at_rest(self, flat: Mapping[str, Any], place: Any, runs: int, displacement: Any = 0.0) -> Steady:
        """Return the steady motion of stages at rest at a place [m], with arrays of shape (runs,) or numbers.

        The controller has held them there, with its reference there. The actuator carries the constant forces of
        [bias], and of a cable with the drive as built, by the integral of its controller or, without one, by an error;
        joint and transmission are deflected by what they carry of [bias]. With a `displacement` [m], the place is that
        far from the reference, where something else has held the stage: filters have settled on the error, and
        integrals hold nothing of it. `flat` has the stages' keys in SI.
        """
        force = carrying_force(flat)
        if self.layout.clocked:
            force = (force + flat["cable.stiffness"] * place) / flat["drive.motor_constant_ratio"]
        values = self.values(flat, runs)
        steady = self._with_error(values, Steady(-displacement, place, force=force, deflected=1.0))
        if not np.any(displacement):
            return steady
        if not (integrals := self.having(Role.INTEGRAL)):
            return steady._replace(force=self.module.stiffness(values)[0] * steady.error)
        empty, one = (
            self.settled_at(values, steady._replace(force=newton), runs)[:, integrals[-1]] for newton in (0.0, 1.0)
        )
        return steady._replace(force=force - empty / (one - empty))

    def _with_error(self, values: list[np.ndarray], steady: Steady) -> Steady:
        """Add to a steady motion the error at which a controller without integral exerts its force.

        The position changes by as much, the other way. With an integral the motion is returned unchanged.
        """
        (stiffness,) = self.module.stiffness(values)
        if not np.any(steady.force) or self.having(Role.INTEGRAL) or not np.all(stiffness):
            return steady
        error = steady.force / stiffness
        return steady._replace(error=steady.error + error, position=steady.position - error)

    def settled_at(self, values: list[np.ndarray], steady: Steady, runs: int) -> np.ndarray:
        """Return states in a steady motion after all transients, shape (runs, initial_size).

        `values` are those of the parameters.
        """
        return columns(self.module.settled(steady, values), runs)

    def modes(self, full: np.ndarray, time: Any, reference: Any, values: list[Any]) -> np.ndarray:
        """Return on which side of each kink runs are: 1 beyond and 0 before it, shape (kinks, ...).

        At a kink derivatives jump. `full` is the full state, or the states alone, with states along the first axis.
        `time` [s] and `reference` are those of the runs at that instant, and `values` those of the parameters. Modes
        with memory are taken from the full state; from states alone they are those in which a run begins.
        """
        sides = self.module.surfaces(full[: len(self.states)], time, reference, values)
        modes = np.zeros((len(self.kinks), *full.shape[1:]))
        for k, side in enumerate(sides):
            modes[k] = np.asarray(side) > 0
        if len(full) == len(self.full_state):
            modes[list(self.switches)] = full[self.initial_size :]
        return modes

    def with_modes(self, starts: np.ndarray, reference: Any, values: list[Any]) -> np.ndarray:
        """Append to initial states the modes with memory in which runs begin, if they lack them.

        `starts` has the shape (runs, initial_size), or is complete already. `reference` holds the references at the
        start, and `values` the parameters.
        """
        if starts.shape[1] == len(self.full_state):
            return starts
        modes = self.modes(starts.T, 0.0, reference, values)[list(self.switches)]
        return np.hstack([starts, modes.T])

    def values(self, flat: Mapping[str, Any], runs: int) -> list[np.ndarray]:
        """Return the parameters of each run [SI], each of shape (runs,), from the stages' keys."""
        rows = np.empty((len(self.parameters), runs))
        for row, name in zip(rows, self.parameters, strict=True):
            row[:] = flat[name]
        return list(rows)

    def scales(self, values: list[np.ndarray], runs: int) -> np.ndarray:
        """Return the magnitudes of the states, shape (runs, states), of runs; 1 where the model gives none."""
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
            scales = columns(self.module.scales(values), runs)
        scales[~((scales > 0) & np.isfinite(scales))] = 1.0
        return scales


@dataclass(frozen=True)
class KernelRequest:
    """Request for a kernel: a structure, the solver's method, and how many runs to do at once.

    With `variational`, small deviations from a run are integrated too.
    """

    structure: KernelForm
    variational: bool = False
    method: str = "Rodas5P"
    lanes: int = LANES

    @property
    def sections(self) -> tuple[type[Section], ...]:
        """Return the classes of stage-file sections that contribute equations: friction, controller."""
        form = self.structure if isinstance(self.structure, Structure | Imposed) else self.structure.structure
        controller = form.controller if isinstance(form, Structure) else None
        return (friction_law(form.friction), *((controller.section,) if controller else ()))

    @property
    def title(self) -> str:
        """Describe what is compiled in a few words, for messages."""
        form = self.structure if isinstance(self.structure, Structure | Imposed) else self.structure.structure
        words = [form.title if isinstance(form, Structure) else f"{form.friction} friction"]
        words += [_CIRCUMSTANCES[type(self.structure)]] if type(self.structure) in _CIRCUMSTANCES else []
        words += ["variational equations"] if self.variational else []
        words += [f"{self.lanes} lane{'s' * (self.lanes > 1)}"] if self.lanes != LANES else []
        return ", ".join(words)


_CIRCUMSTANCES = {
    Imposed: "imposed motion",
    Dragged: "along a measured motion",
    Driven: "following a log",
    AsBuilt: "drive as built",
}
"""Words for forms that are not a complete stage."""


def kernel(
    structure: KernelForm,
    variational: bool = False,
    method: str = "Rodas5P",
    lanes: int = LANES,
) -> Kernel:
    """Return the compiled code that integrates stages of a structure by a step method.

    The code integrates `lanes` runs at once. With `variational`, it also integrates how a small deviation of each state
    grows (`friso.equations.model`).
    """
    return kernels([KernelRequest(structure, variational, method, lanes)])[0]


def kernels(requests: Iterable[KernelRequest]) -> list[Kernel]:
    """Return several kernels, which are compiled side by side where they are missing."""
    requests = list(requests)
    missing = [request for request in dict.fromkeys(requests) if request not in _kernels]
    if missing:
        missing.sort(key=lambda request: not request.variational)  # variational kernels take longest
        for request, entry in zip(missing, built_entries([DRIVER, *map(_request, missing)])[1:], strict=True):
            _load(request, entry)
    return [_kernels[request] for request in requests]


_kernels: dict[KernelRequest, Kernel] = {}
_loading = Lock()

DRIVER = CodeRequest("driver", "the loops that run any kernel", "friso.engine.build")
"""Request for the loops that are compiled once for all kernels."""


def _request(request: KernelRequest) -> CodeRequest:
    """Make the request to compile a kernel.

    The kernel is pickled apart from the plug-ins, which the builder loads first, because it may hold their classes.
    """
    foreign = plug_ins(request.sections)
    digests = " ".join(plug_in.digest for plug_in in foreign)
    task = pickle.dumps((foreign, pickle.dumps(request)))
    return CodeRequest(f"{request!r} {digests}", request.title, "friso.engine.build", task, digests)


def _load(request: KernelRequest, entry: Compiled) -> None:
    """Load a compiled kernel from its entry in the cache."""
    with _loading:
        if request in _kernels:  # another thread was first
            return
        module = entry.module()
        functions = [name for name in FUNCTIONS if hasattr(module, name)]
        code = {**dict.fromkeys(FUNCTIONS, 0), **load_object(entry.code, functions)}
        arrays = {name: np.array(module.LOOKED_UP[name], np.int64) for name in LOOKED_UP}
        sizes = {**QUADRATIC._asdict(), **module.LAYOUT, "stands_since": module.LAYOUT["rows"]}
        layout = ModelLayout(**sizes | {"rows": sizes["rows"] + 1}, **arrays, **code)
        _kernels[request] = Kernel(module, layout, _loops(), entry.source)


@cache
def _loops() -> Loops:
    (entry,) = built_entries([DRIVER])
    return Loops(load_object(entry.code, ["run"])["run"], driver_kinds())


def columns(rows: Iterable[Any], runs: int) -> np.ndarray:
    """Stack the rows of a generated function into an array (runs, rows).

    Rows are numbers or arrays of shape (runs,).
    """
    rows = list(rows)
    full = np.empty((runs, len(rows)))
    for i, row in enumerate(rows):
        full[:, i] = row
    return full


def empty_results(runs: int, capacity: int, samples: int, outputs: int) -> Results:
    """Return empty arrays for the results of runs.

    There is room for `capacity` turning points and `samples` samples of each. `outputs` counts the values kept at
    samples and at the end of a run.
    """
    return Results(
        statistics=np.zeros((runs, len(STATISTICS))),
        statuses=np.zeros(runs, np.int64),
        turn_times=np.empty((runs, capacity)),
        turn_values=np.empty((runs, capacity)),
        turn_counts=np.zeros(runs, np.int64),
        samples=np.full((runs, samples, outputs), np.nan),
        ends=np.full((runs, outputs), np.nan),
    )


def driver_kinds() -> list[CompiledKind]:
    """Return the types of the arguments of the loops that run any kernel."""
    flat, square = np.zeros(1), np.zeros((1, 1))
    batch = Batch(square, square, square, square, flat, flat, np.zeros((1, 1, 4)), np.zeros(1, np.int64), square, flat)
    settings = BatchOptions(1.0, 1.0, 1.0, 1.0, 0.0, 1.0, np.zeros(1, np.int64))
    layout = ModelLayout(*(np.zeros(1, np.int64) if name in LOOKED_UP else 0 for name in ModelLayout._fields))
    return list(map(argument_kind, (flat, layout, new_queue(), batch, settings, empty_results(1, 1, 1, 1))))
