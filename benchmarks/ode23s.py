"""Run the thesis's solver (Sec. 3.2.3) on its rig: MATLAB's ode23s at 1e-4.

Its steps are up to 1e-4 s. The method is that of Shampine and Reichelt (1997), The MATLAB ODE Suite, SIAM J. Sci.
Comput. 18, Sec. 3, with their control of the step. The absolute tolerance, which the thesis does not state, is
Simulink's 1e-6 in every state. The equations of the rig are written here by hand, from Sec. 3.1 and 3.2 and Table 1 and
2: nothing of friso's equations or engine is used.
"""

from collections.abc import Mapping

import numpy as np
from numba import njit

RTOL, ATOL, LARGEST = 1e-4, 1e-6, 1e-4

STATES = 9
"""Position and velocity of cart, stage and parasitic mass; bristles; filtered error; its integral."""

_D = 1 / (2 + np.sqrt(2))
_E32 = 6 + np.sqrt(2)

SAMPLE = 1e-3
"""Time between recorded samples [s]."""


@njit
def reference(t: float, acceleration: float, time: float, back: float) -> float:
    """Return the reference of a move there and back; each half accelerates, then brakes."""
    if t >= back:
        return acceleration * time**2 - _moved(t - back, acceleration, time)
    return _moved(t, acceleration, time)


@njit
def _moved(t: float, acceleration: float, time: float) -> float:
    if t <= time:
        return acceleration * t * t / 2
    left = max(2 * time - t, 0.0)
    return acceleration * (time * time - left * left / 2)


@njit
def rates(t: float, x: np.ndarray, p: np.ndarray, out: np.ndarray) -> None:
    """Write dx/dt into `out`; `p` are the numbers listed by `parameters`."""
    (cart, stage, part, inner_k, inner_d, static, coulomb, stribeck, s0, s1, s2, locked, k_j, d_j, stroke, k_l, d_l,
     k_p, tau_z, tau_i, tau_p, acceleration, time, back) = p  # fmt: skip
    x_c, v_c, x_s, v_s, x_i, v_i, z, low, integral = x
    level = coulomb + (static - coulomb) * np.exp(-((v_c / stribeck) ** 2))
    z_rate = v_c - s0 * abs(v_c) * z / level
    friction = s0 * z + s1 * z_rate + s2 * v_c
    gap, rate = x_s - x_c, v_s - v_c
    if locked > 0:
        pull = k_l * gap + d_l * rate
    else:
        pull = k_j * gap + d_j * rate
        if abs(gap) > stroke:
            pull += k_l * (gap - np.sign(gap) * stroke) + d_l * rate
    inner = inner_k * (x_s - x_i) + inner_d * (v_s - v_i)
    low_rate = (reference(t, acceleration, time, back) - x_s - low) / tau_p
    force = k_p * ((1 + tau_z / tau_i) * low + integral / tau_i + tau_z * low_rate)
    out[0], out[1] = v_c, (pull - friction) / cart
    out[2], out[3] = v_s, (force - pull - inner) / (stage - part)
    out[4], out[5] = v_i, inner / part
    out[6], out[7], out[8] = z_rate, low_rate, low


@njit
def ode23s(p: np.ndarray, end: float, rtol: float, atol: float, largest: float, sample: float) -> tuple:
    """Solve from rest; return samples of the position, (n,), and counts of steps and rejections."""
    n, t, h = STATES, 0.0, 1e-6
    x, new, moved = np.zeros(n), np.zeros(n), np.zeros(n)
    f0, f1, f2, ft = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    jacobian, samples = np.zeros((n, n)), np.zeros(round(end / sample) + 1)
    taken, steps, rejected = 1, 0, 0
    rates(t, x, p, f0)
    while t < end * (1 - 1e-12):
        dt = 1e-9
        rates(t + dt, x, p, ft)
        ft = (ft - f0) / dt
        for j in range(n):
            moved[:] = x
            change = 1e-7 * max(abs(x[j]), 1e-6)
            moved[j] += change
            rates(t, moved, p, f1)
            jacobian[:, j] = (f1 - f0) / change
        failed = False
        while True:
            h = min(h, largest, end - t)
            inverse = np.linalg.inv(np.eye(n) - h * _D * jacobian)
            k1 = inverse @ (f0 + h * _D * ft)
            rates(t + h / 2, x + h / 2 * k1, p, f1)
            k2 = inverse @ (f1 - k1) + k1
            new[:] = x + h * k2
            rates(t + h, new, p, f2)
            k3 = inverse @ (f2 - _E32 * (k2 - f1) - 2 * (k1 - f0) + h * _D * ft)
            worst = 0.0
            for i in range(n):
                scale = max(abs(x[i]), abs(new[i]), atol / rtol)
                worst = max(worst, abs(h / 6 * (k1[i] - 2 * k2[i] + k3[i])) / scale)
            if worst <= rtol:
                break
            rejected += 1
            h *= 0.5 if failed else max(0.1, 0.8 * (rtol / worst) ** (1 / 3))
            failed = True
        steps += 1
        while taken < len(samples) and taken * sample <= t + h * (1 + 1e-9):
            share = (taken * sample - t) / h
            curve = share * (1 - share) / (1 - 2 * _D), share * (share - 2 * _D) / (1 - 2 * _D)
            samples[taken] = x[2] + h * (curve[0] * k1[2] + curve[1] * k2[2])
            taken += 1
        t += h
        x[:], f0[:] = new, f2
        if not failed:
            h *= min(5.0, 1 / max(0.2, 1.25 * (worst / rtol) ** (1 / 3)))
    return samples, steps, rejected


def parameters(flat: Mapping[str, float]) -> np.ndarray:
    """Return the numbers of `rates`, from the SI values of a stage file of the rig, and Eq. 8."""
    omega = 2 * np.pi * flat["controller.crossover"]
    part = flat["parasitic.mass"]
    stage = flat["masses.stage"]
    inner = 2 * np.pi * flat["parasitic.frequency"]
    reduced = 1 / (1 / part + 1 / (stage - part))
    lead = np.sqrt(1 / flat["controller.alpha"])
    tau_z = lead / omega
    names = ("static", "coulomb", "stribeck_velocity", "bristle_stiffness", "bristle_damping", "viscous")
    joint = ("stiffness", "damping", "stroke", "limiter_stiffness", "limiter_damping")
    return np.array(
        [
            flat["masses.cart"], stage, part, reduced * inner**2,
            2 * flat["parasitic.damping_ratio"] * reduced * inner,
            *(flat[f"friction.{name}"] for name in names), float(flat["joint.locked"]),
            *(flat[f"joint.{name}"] for name in joint),
            flat["controller.tuned_mass"] * omega**2 / lead, tau_z, flat["controller.beta"] * tau_z,
            1 / (omega * lead), flat["motion.acceleration"], flat["motion.acceleration_time"], flat["motion.return_at"],
        ]
    )  # fmt: skip


def counted_peaks(deviation: np.ndarray) -> int:
    """Count peaks by MATLAB's findpeaks as in Sec. 3.2.2.

    They are maxima after 10 s above 0.1 mm, the tallest first, 0.5 s apart.
    """
    from scipy.signal import find_peaks

    late = deviation[round(10 / SAMPLE) :]
    return len(find_peaks(late, height=1e-4, distance=0.5 / SAMPLE)[0])


def thesis_solver() -> dict[str, float]:
    """Return peaks, swing over the last quarter [m] and steps of every judged run.

    An example of a name is `locked_8_hz_peaks`.
    """
    from friso_thesis.studies.thesis.judges.solver import CASES
    from friso_thesis.studies.thesis.studies import thesis_rig

    values: dict[str, float] = {}
    for name, changes in CASES.items():
        flat = thesis_rig().replace(dict(changes)).flat()
        position, steps, _ = ode23s(parameters(flat), flat["motion.duration"], RTOL, ATOL, LARGEST, SAMPLE)
        swing = float(np.ptp(position[3 * len(position) // 4 :]))
        values |= {f"{name}_peaks": counted_peaks(position), f"{name}_swing_m": swing, f"{name}_steps": steps}
    return values


def other_solvers() -> dict[str, float]:
    """Return the results of three solvers at the thesis's tolerance, with its largest step and without.

    ode15s with the largest step is left out with the joint free: from 17.3 s on, at rest, SciPy's steps shrink to
    nanoseconds.

    They are peaks, swing over the last quarter [m], steps and evaluations of the equations of ode23s, of backward
    differentiation of variable order (the method of ode15s) and of Dormand and Prince's (ode45), with the joint locked
    and free. Examples of names are `locked_ode45_evaluations` and, with the largest step,
    `locked_ode45_held_evaluations`.
    """
    from friso_thesis.studies.thesis.studies import thesis_rig

    values: dict[str, float] = {}
    for joint in ("locked", "free"):
        flat = thesis_rig().replace({"joint.locked": joint == "locked"}).flat()
        numbers, end = parameters(flat), flat["motion.duration"]
        runs = {}
        for held, largest in (("", end), ("_held", LARGEST)):
            position, steps, rejected = ode23s(numbers, end, RTOL, ATOL, largest, SAMPLE)
            runs[f"ode23s{held}"] = position, steps, (STATES + 3) * steps + 2 * rejected
            for name in ("ode45",) if held and joint == "free" else ("ode15s", "ode45"):
                runs[f"{name}{held}"] = _of_scipy(name, numbers, end, largest)
        for name, (position, steps, evaluations) in runs.items():
            swing = float(np.ptp(position[3 * len(position) // 4 :]))
            shown = {"peaks": counted_peaks(position), "swing_m": swing, "steps": steps, "evaluations": evaluations}
            values |= {f"{joint}_{name}_{key}": value for key, value in shown.items()}
    return values


def _of_scipy(name: str, numbers: np.ndarray, end: float, largest: float) -> tuple[np.ndarray, int, int]:
    """Return samples of the stage's position, steps, and evaluations with Jacobians."""
    from scipy.integrate import BDF, RK45

    def derivative(t: float, x: np.ndarray) -> np.ndarray:
        out = np.empty(STATES)
        rates(t, x, numbers, out)
        return out

    method = {"ode15s": BDF, "ode45": RK45}[name]
    solver = method(derivative, 0.0, np.zeros(STATES), end, rtol=RTOL, atol=ATOL, first_step=1e-6, max_step=largest)
    times = np.arange(round(end / SAMPLE) + 1) * SAMPLE
    position, steps = np.zeros(len(times)), 0
    while solver.status == "running":
        solver.step()
        steps += 1
        first, last = np.searchsorted(times, [solver.t_old, solver.t], side="right")
        if last > first:
            position[first:last] = solver.dense_output()(times[first:last])[2]
    return position, steps, solver.nfev + STATES * solver.njev


if __name__ == "__main__":
    for name, value in (thesis_solver() | other_solvers()).items():
        print(name, value)
