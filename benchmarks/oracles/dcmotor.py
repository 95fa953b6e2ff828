"""Compare with MuJoCo's LuGre bristles, which are held exactly over each time step.

MuJoCo takes speed as constant over a step and solves the bristles' equation exactly (actuator `dcmotor`, attribute
`lugre`), so a run errs in proportion to the step. Runs are of the stick-slip of the LuGre paper, with several time
steps.
"""

from collections.abc import Iterator
from functools import cache
from importlib import import_module
from pathlib import Path

import numpy as np

import friso
from benchmarks.oracles.oracle import Finding, NotInstalled, Oracle, number

EXAMPLE = Path(__file__).parents[2] / "examples" / "lugre_stick_slip.toml"

SPRING, PULL = 2.0, 0.1
"""Stiffness of the spring [N/m], and speed of its far end [m/s]."""

SPEED, END = 0.05, 14.5
"""Speed [m/s] whose upward passages are timed, and duration [s] of two slips."""

STEPS = 4e-4, 2e-4, 1e-4, 5e-5
"""Time steps [s]."""

MODEL = """<mujoco><option timestep="{step!r}" gravity="0 0 0" integrator="Euler"/>
<worldbody><body><joint name="guide" type="slide" axis="1 0 0" stiffness="2" damping="0.4"/>
<geom type="sphere" size="0.1" mass="1"/></body></worldbody>
<actuator><dcmotor joint="guide" input="none" motorconst="0 0" resistance="1" lugre="1e5 316.2277660168379 1 1.5 1e-3"/>
</actuator></mujoco>"""


def crossings(times: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """Return the times [s] at which the speed passes `SPEED` upward, interpolated."""
    at = np.flatnonzero((speed[:-1] < SPEED) & (speed[1:] >= SPEED))
    return times[at] + (SPEED - speed[at]) / (speed[at + 1] - speed[at]) * np.diff(times)[at]


@cache
def by_mujoco(step: float) -> tuple[float, float, float]:
    """Return first passage [s], time to the next [s], and top speed [m/s], by MuJoCo."""
    try:
        mujoco = import_module("mujoco")  # only compared with
    except ImportError as missing:
        raise NotInstalled("mujoco is not installed (pip install mujoco)") from missing
    model = mujoco.MjModel.from_xml_string(MODEL.format(step=step))
    data = mujoco.MjData(model)
    count = round(END / step)
    speed, velocity, force = np.empty(count), data.qvel, data.qfrc_applied
    for k in range(count):
        force[0] = SPRING * PULL * step * k
        mujoco.mj_step(model, data)
        speed[k] = velocity[0]
    first, second = crossings(step * (1 + np.arange(count)), speed)
    return float(first), float(second - first), float(speed.max())


@cache
def by_friso() -> tuple[float, float, float]:
    """Return first passage [s], time to the next [s], and top speed [m/s], by friso."""
    response = friso.simulate(friso.load(EXAMPLE), 1e-9, 1e-4)
    time, speed = response["time"].to_numpy(), response["velocity"].to_numpy()
    first, second = crossings(time[time < END], speed[time < END])
    return float(first), float(second - first), float(speed[time < END].max())


def over_the_time_step() -> Iterator[Finding]:
    names = "first passage of 0.05 m/s", "period", "top speed"
    runs, own = np.array([by_mujoco(step) for step in STEPS]), np.array(by_friso())
    limit = 2 * runs[-1] - runs[-2]
    for name, unit, friso_value, value in zip(names, ("s", "s", "m/s"), own, limit, strict=True):
        yield number(f"{name}, MuJoCo's at a step of 0", friso_value, value, rtol=1e-5, unit=unit, digits=7)
    for name, errors in zip(names, (runs - own).T, strict=True):
        orders = np.log2(errors[:-1] / errors[1:])
        shown = ", ".join(f"{error:.2e}" for error in errors)
        words = f"errors against friso: {shown}", f"order {orders[-1]:.3f} (1: the hold)"
        yield Finding(f"{name}, steps of 400, 200, 100, 50 us", *words, abs(float(orders[-1]) - 1) < 0.1)


ORACLES = (
    Oracle(
        "mujoco-time-step",
        "MuJoCo holds speed over a time step, over which it solves LuGre's bristles exactly: its error is of first "
        "order in the step, and its limit at a step of 0 is the published stick-slip.",
        "MuJoCo, XML reference, actuator/dcmotor, attribute lugre (mujoco.readthedocs.io); case: "
        "Canudas de Wit and others 1995, doi:10.1109/9.376053",
        "MuJoCo's numbers extrapolated to a step of 0 agree with friso's to 1e-5, ten times what the extrapolation "
        "leaves; the error against friso falls with an order within 0.1 of 1.",
        over_the_time_step,
    ),
)
