"""Analyse sampled loops, at one rate or several, lifted to their common period.

After that period all loops are due again. The controller is that of `friso.equations.sampled`, as a drive computes it.
Over a period of N samples the loop is a time-invariant system with N inputs and outputs (lifting: Chen, Francis 1995,
Optimal Sampled-Data Control Systems, chapter 8; Bittanti, Colaneri 2009, Periodic Systems, chapter 6). Its poles decide
on stability.

Cut at the actuator, it has N characteristic loci. A gain or a phase common to all samples brings it to the edge of
stability where one locus passes -1 (MacFarlane, Postlethwaite 1977, doi:10.1080/00207177708922217). So margins are
those of a locus. With all loops at one rate, the loci are the loop's response at a frequency and at its aliases.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache, reduce
from typing import Any

import numpy as np
import sympy as sp

from friso.equations.blocks import Loop
from friso.equations.component import Held
from friso.equations.sampled import counter, sampled_controller
from friso.equations.structure import ControllerForm, shared_structure
from friso.frequency.parts import FORCE, RATED, STAGE
from friso.frequency.system import Complex, Declared, System
from friso.stage.controllers import FrictionSettings
from friso.stage.rig import LOOPS


@dataclass(frozen=True)
class Lifted(System):
    """A system of a drive over the period of its loops: x' = a x + b u, y = c x + d u.

    x' is x one period later; u and y hold the N samples of a period. Shapes are a (members, n, n), b (members, n, N), c
    (members, N, n), and d (members, N, N).
    """

    def over(self, turn: np.ndarray) -> Complex:
        """Return the transfer matrices at frequencies given by a signal's `turn` [rad] in a sample.

        `turn` has the shape (k,), and the result (members, k, N, N).
        """
        return self.at(np.exp(1j * turn * self.d.shape[-1]))

    def fundamental(self, turn: np.ndarray) -> Complex:
        """Return the response to a harmonic signal at its own frequency, shape (members, k).

        The signal turns by an angle (k,) [rad] in each sample.
        """
        return _fundamental(self.over(turn), turn)

    def locus(self, turn: np.ndarray) -> Complex:
        """Return the characteristic locus that follows the response of the loop, shape (members, k).

        It is evaluated at the frequency at which a signal turns by `turn` [rad] in a sample.
        """
        return locus_of(self.over(turn), turn)


def _fundamental(matrices: Complex, turn: np.ndarray) -> Complex:
    """Return the response to a harmonic signal at its own frequency, shape (members, k).

    `matrices` are transfer matrices over a period, (members, k, N, N), at frequencies at which the signal turns by
    `turn` [rad] in a sample.
    """
    turns = np.exp(1j * turn[:, None] * np.arange(matrices.shape[-1]))  # (k, N)
    answers = (matrices @ turns[..., None])[..., 0]
    return np.asarray((answers * turns.conj()).mean(axis=-1), dtype=complex)


def locus_of(matrices: Complex, turn: np.ndarray) -> Complex:
    """Return the characteristic locus that follows the response of a loop, shape (members, k).

    It is the eigenvalue closest to the response to a harmonic signal at its own frequency. `matrices` are transfer
    matrices over a period, (members, k, N, N); the signal turns by `turn` [rad] in a sample.
    """
    if matrices.shape[-1] == 1:
        return matrices[..., 0, 0]
    eigenvalues = np.linalg.eigvals(matrices)
    near = np.abs(eigenvalues - _fundamental(matrices, turn)[..., None]).argmin(axis=-1)
    return np.take_along_axis(eigenvalues, near[..., None], axis=-1)[..., 0].astype(complex)


def samples_controller(flat: Mapping[str, Any], members: int, period: int) -> tuple[System, ...]:
    """Return the controller of a drive at each sample of the period of its loops.

    Its inputs are the measured position and the position from which the velocity is taken [m]. Its outputs are the
    force [N] and the numbers held for the next sample. A controller that feeds back one encoder's position does not use
    the second input.
    """
    form = shared_structure(flat)
    assert form.controller is not None
    both = form.controller.section.feeds_back == "velocity"
    if form.transmission is not None:
        both |= form.transmission.position != form.transmission.velocity
    over = round(float(flat.get("drive.velocity_samples", 1.0)))
    ratios = {name: _samples(flat, name) for name in form.controller.loops}
    kinds: dict[tuple[bool, ...], System] = {}
    systems = []
    for k in range(period):
        due = tuple(name not in ratios or k % ratios[name] == 0 for name in LOOPS)
        if due not in kinds:
            kinds[due] = _declared(form.controller, due, both, over).at(flat, members)
        systems.append(kinds[due])
    return tuple(systems)


def _samples(flat: Mapping[str, Any], name: str) -> int:
    """Return the number of samples after which a loop is due again."""
    key = f"drive.{name}_sample_time"
    return round(float(flat[key] / flat["drive.sample_time"])) if key in flat else 1


@cache
def _declared(form: ControllerForm, due: tuple[bool, ...], both: bool, velocity_samples: int) -> Declared:
    """Return the equations of a controller at a sample at which some loops are `due`.

    They are for small motions. With `both`, the two measured positions are distinguished.
    """
    bare = replace(form, anti_windup=None, settings=FrictionSettings(leak=form.settings.leak))
    y, rated = sp.symbols("measured_position measured_rated", real=True)
    seen = Loop(-y, y, sp.S.Zero, sp.S.Zero, rated=rated if both else None)
    force, held = sampled_controller(bare, seen, velocity_samples)
    passed: dict[Any, Any] = {counter(name): sp.Integer(not now) for name, now in zip(LOOPS, due, strict=True)}
    numbers: list[Held] = [number for number in held if number.symbol not in passed]
    following = tuple(sp.sympify(number.update).subs(passed) for number in numbers)
    symbols = tuple(number.symbol for number in numbers)
    return Declared(symbols, following, {STAGE: y, RATED: rated}, {FORCE: sp.sympify(force).subs(passed)})


def closed_over_period(machine: System, controls: tuple[System, ...]) -> np.ndarray:
    """Return by what matrix the states of the closed loop change over a period, (members, n, n).

    `machine` is the plant, and `controls` the controller at each sample of the period.
    """
    first, *later = (_step(machine, control, 1.0) for control in controls)
    return reduce(lambda whole, step: step @ whole, later, first)


def cut_over_period(machine: System, controls: tuple[System, ...]) -> Lifted:
    """Return the loop over a period of its drive, cut at the actuator.

    It leads from the forces of a period to the controller's forces, with the sign reversed.
    """
    steps = [_step(machine, control, 0.0) for control in controls]
    held = np.zeros((len(machine.a), controls[0].a.shape[-1], 1))
    push = np.concatenate([machine.b, held], axis=1)
    answers = [-np.concatenate([control.d @ machine.c, control.c], axis=2) for control in controls]
    return _lifted(steps, [push] * len(steps), answers)


def controller_over_period(controls: tuple[System, ...], measured: str) -> Lifted:
    """Return the controller over a period, from one measured signal to the forces.

    The signal `measured` is STAGE or RATED.
    """
    seen = [control.take((measured,), (FORCE,)) for control in controls]
    lifted = _lifted([control.a for control in seen], [control.b for control in seen], [control.c for control in seen])
    direct = np.zeros_like(lifted.d)
    for k, control in enumerate(seen):
        direct[:, k, k] = control.d[:, 0, 0]
    return replace(lifted, d=lifted.d + direct)


def unseen(control: System, measured: str) -> System:
    """Return the controller with all effects of its input `measured` set to 0; the input stays."""
    column = control.inputs.index(measured)
    b, d = control.b.copy(), control.d.copy()
    b[..., column] = d[..., column] = 0.0
    return replace(control, b=b, d=d)


def _lifted(steps: list[np.ndarray], pushes: list[np.ndarray], answers: list[np.ndarray]) -> Lifted:
    """Combine a system's samples over a period: x' = step x + push u, y = answer x at each one.

    The lists have the matrices of each sample, in order.
    """
    count, (members, n) = len(steps), steps[0].shape[:2]
    along = np.broadcast_to(np.eye(n), (members, n, n))
    inputs = np.zeros((members, n, count))  # from the inputs so far to the present state
    c, d = np.zeros((members, count, n)), np.zeros((members, count, count))
    for k, (step, push, answer) in enumerate(zip(steps, pushes, answers, strict=True)):
        c[:, [k]], d[:, [k]] = answer @ along, answer @ inputs
        along, inputs = step @ along, step @ inputs
        inputs[:, :, [k]] += push
    return Lifted(along, inputs, c, d)


def _step(machine: System, control: System, shut: float) -> np.ndarray:
    """Return by what matrix the states of plant and controller change over a sample.

    The plant is `machine`, and the shape (members, n, n). `shut` is 1 if the loop is closed, so that the controller's
    force acts, and 0 if it is cut.
    """
    of_machine = [machine.a + shut * (machine.b @ control.d @ machine.c), shut * (machine.b @ control.c)]
    return np.block([of_machine, [control.b @ machine.c, control.a]])
