"""Test moves with effects outside the model.

Run by `python -m benchmarks.identify_effects [FAMILY ...]`. Machines drawn at random are simulated by a separate
program (LuGre friction by an implicit step, and a sampled servo unknown to friso). Each has one effect that is in no
stage file, of 10 % of the friction or more; some are sound. `--machines 5` sets their number in a family. For each
family it prints how many logs were noticed (a doubt was raised, or the log refused), how many named the right cause
first, how many reported values hold the truth, and how many were still reported. Sound logs show false alarms.
"""

import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, field

import numpy as np
from numba import njit

from benchmarks.report import each, numbered, print_table
from friso.errors import InputError
from friso.identification.experiments.moves import KIND
from friso.identification.kind import NOTHING_CHOSEN, Prior
from friso.identification.logs.log import Log

STEP, TIME, PARTS = 1e-3, 6.0, 50
"""Sample time and length of a log [s], and simulation steps per sample."""

MOVES = ((0.3, 1.0), (1.1, -1.0), (1.9, 0.4), (2.7, -0.4), (3.5, 0.7), (4.3, -0.7), (5.1, 0.15))
"""Instants [s] at which moves begin, and their speeds relative to the highest."""


@dataclass(frozen=True)
class Effects:
    """A machine and the effects on it; each effect is off by default.

    Lengths are in m, forces in N, times in s. `load` is the fraction of the mass behind the measured position, on a
    spring of `stiffness` with `play`; friction acts on the motor's side, or `on_load`. Bristle damping falls with the
    speed as the Stribeck effect does, to the power `damping_falls`; 0 makes it constant. It is `damping_at_rest` times
    half of the critical one at rest.
    """

    mass: float
    coulomb: float
    static: float
    stribeck: float
    viscous: float
    bristle: float
    top: float
    crossover: float
    position_noise: float
    force_noise: float
    load_friction: float = 0.0
    by_place: float = 0.0
    cogging: float = 0.0
    pitch: float = 0.02
    load: float = 0.0
    stiffness: float = 0.0
    damping: float = 0.0
    play: float = 0.0
    late: float = 0.0
    late_at_end: float = 0.0
    most: float = np.inf
    logged: float = 1.0
    on_load: float = 0.0
    digit: float = 0.0
    gain_after: float = 1.0
    gain_fast: float = 1.0
    gain_beyond: float = 1.0
    with_reference: float = 0.0
    sign: float = 1.0
    damping_falls: float = 1.0
    damping_at_rest: float = 1.0
    by_direction: float = 0.0


@njit(cache=True)
def _run(reference, speed, p, step, parts):
    """Return position [m] and force [N] at the samples, (n,), for a machine's numbers `p`."""
    mass, coulomb, static, stribeck, viscous, bristle, kp, kd, ki = p[0], p[1], p[2], p[3], p[4], p[5], p[6], p[7], p[8]
    grows, place, cogging, pitch = p[9], p[10], p[11], p[12]
    load, stiffness, damping, play = p[13], p[14], p[15], p[16]
    later, gain, on_load, gain_fast, gain_beyond, falls = p[17], p[18], p[19], p[20], p[21], p[22]
    by_direction = p[24]
    n = len(reference)
    position, force = np.zeros(n), np.zeros(n)
    h = step / parts
    own = mass * (1 - load)
    top, middle = np.abs(speed).max(), (reference.max() + reference.min()) / 2
    carried = mass * load
    x = v = y = w = z = total = 0.0
    last = 0.0
    bristle_damping = p[23] * np.sqrt(bristle * mass)
    for k in range(n):
        position[k] = x
        error = reference[k] - x
        total += ki * error * step
        measured = (x - last) / step if k else 0.0
        last = x
        times = gain if 2 * k > n else 1.0
        times *= gain_fast if abs(speed[k]) > 0.3 * top else 1.0
        times *= gain_beyond if reference[k] > middle else 1.0
        u = times * (kp * error + kd * (speed[k] - measured) + total)
        u = min(max(u, -later), later)
        force[k] = u
        for _ in range(parts):
            factor = 1.0 + place * np.sin(2 * np.pi * x / (0.6 * pitch * 10))
            slides = w if on_load > 0 else v
            factor *= 1.0 + (by_direction if slides > 0 else -by_direction)
            curve = np.exp(-((slides / stribeck) ** 2))
            level = (coulomb + (static - coulomb) * curve) * factor + grows * abs(u)
            new = (z + h * slides) / (1 + h * bristle * abs(slides) / level)
            rate = (new - z) / h
            z = new
            friction = bristle * z + bristle_damping * curve**falls * rate + viscous * slides
            spring = 0.0
            if load > 0:
                gap = x - y
                beyond = gap - min(max(gap, -play / 2), play / 2)
                if beyond != 0.0 or play == 0.0:
                    spring = stiffness * beyond + damping * (v - w)
                w += h * (spring - on_load * friction) / carried
                y += h * w
            v += h * (u - (1 - on_load) * friction - spring + cogging * np.sin(2 * np.pi * x / pitch)) / own
            x += h * v
    return position, force


def simulated(machine: Effects, rng: np.random.Generator) -> Log:
    """Return a log of a machine's moves, with noise, with columns for time, position and force."""
    clock = np.arange(round(TIME / STEP)) * STEP
    ramp, cruise, wanted = 0.12, 0.35, np.zeros(len(clock))
    for start, share in MOVES:
        corners = start + np.array([0.0, ramp, ramp + cruise, 2 * ramp + cruise])
        wanted += np.interp(clock, corners, [0.0, share * machine.top, share * machine.top, 0.0])
    window = np.hanning(41)
    wanted = np.convolve(wanted, window / window.sum(), "same")
    reference = np.cumsum(wanted) * STEP
    omega = 2 * np.pi * machine.crossover
    kp, kd, ki = machine.mass * omega**2 / 3, machine.mass * omega, machine.mass * omega**3 / 30
    numbers = np.array([
        machine.mass, machine.coulomb, machine.static, machine.stribeck, machine.viscous, machine.bristle, kp, kd, ki,
        machine.load_friction, machine.by_place, machine.cogging, machine.pitch, machine.load, machine.stiffness,
        machine.damping, machine.play, machine.most, machine.gain_after, machine.on_load,
        machine.gain_fast, machine.gain_beyond, machine.damping_falls,
        machine.damping_at_rest, machine.by_direction,
    ])  # fmt: skip
    position, force = _run(reference, wanted, numbers, STEP, PARTS)
    late = machine.late + (machine.late_at_end - machine.late) * clock / TIME if machine.late_at_end else machine.late
    force = np.interp(clock - late, clock, force) if np.any(late) else force
    force = machine.sign * (force + machine.force_noise * rng.standard_normal(len(clock)))
    force = np.clip(force, -machine.logged * np.abs(force).max(), machine.logged * np.abs(force).max())
    force = np.round(force / machine.digit) * machine.digit if machine.digit else force
    position = position + machine.position_noise * rng.standard_normal(len(clock))
    signals = {"position": position, "force": force} | ({"reference": reference} if machine.with_reference else {})
    return Log("log", clock, STEP, signals, (slice(0, len(clock)),))


def _between(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a number evenly in its logarithm."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def plain(rng: np.random.Generator) -> dict[str, float]:
    """Draw the numbers of a sound machine."""
    mass = _between(rng, 1.0, 6.0)
    top = _between(rng, 0.15, 0.6)
    coulomb = mass * top / 0.12 * _between(rng, 0.1, 0.6)  # a motor that never brakes hides friction that grows
    return {
        "mass": mass,
        "coulomb": coulomb,
        "static": coulomb * rng.uniform(1.05, 1.6),
        "stribeck": _between(rng, 1e-3, 8e-3),
        "viscous": coulomb * _between(rng, 0.1, 0.8) / top,
        "bristle": coulomb / _between(rng, 4e-6, 2e-5),
        "top": top,
        "crossover": _between(rng, 8.0, 20.0),
        "position_noise": _between(rng, 1e-7, 1e-6),
        "force_noise": (mass * top / 0.12 + coulomb) * _between(rng, 2e-3, 1e-2),
    }


def _sound(m: dict[str, float], rng: np.random.Generator) -> dict[str, float]:
    return {}


def _constant_damping(m: dict[str, float], rng: np.random.Generator) -> dict[str, float]:
    return {"damping_falls": 0.0}


def _load_friction(m: dict[str, float], rng: np.random.Generator) -> dict[str, float]:
    return {"load_friction": rng.uniform(0.08, 0.2)}


def _play(m: dict[str, float], rng: np.random.Generator) -> dict[str, float]:
    load = rng.uniform(0.3, 0.6)
    stiffness = m["mass"] * load * (2 * np.pi * rng.uniform(150, 250)) ** 2
    damping = 0.2 * np.sqrt(stiffness * m["mass"] * load)
    parts = {"load": load, "stiffness": stiffness, "damping": damping, "play": _between(rng, 1.5e-5, 1.5e-4)}
    return parts | {"on_load": float(rng.integers(2))}


def _by_place(m: dict[str, float], rng: np.random.Generator) -> dict[str, float]:
    return {"by_place": rng.uniform(0.15, 0.4), "pitch": _between(rng, 0.02, 0.06)}


def _by_direction(m: dict[str, float], rng: np.random.Generator) -> dict[str, float]:
    return {"by_direction": rng.uniform(0.08, 0.2) * rng.choice([-1, 1])}


def _cogging(m: dict[str, float], rng: np.random.Generator) -> dict[str, float]:
    return {"cogging": m["coulomb"] * rng.uniform(0.12, 0.4), "pitch": _between(rng, 0.01, 0.05)}


def _second_mode(m: dict[str, float], rng: np.random.Generator) -> dict[str, float]:
    load = rng.uniform(0.2, 0.5)
    stiffness = m["mass"] * load * (2 * np.pi * _between(rng, 20, 60)) ** 2
    return {"load": load, "stiffness": stiffness, "damping": 0.06 * np.sqrt(stiffness * m["mass"] * load)}


def _delay(m: dict[str, float], rng: np.random.Generator) -> dict[str, float]:
    return {"late": rng.uniform(1e-3, 6e-3)}


def _drifting_delay(m: dict[str, float], rng: np.random.Generator) -> dict[str, float]:
    return {"late": 0.0, "late_at_end": rng.uniform(2e-3, 8e-3)}


def _saturated(m: dict[str, float], rng: np.random.Generator) -> dict[str, float]:
    return {"most": (m["mass"] * m["top"] / 0.12 + m["coulomb"]) * rng.uniform(0.6, 0.85)}


def _clipped(m: dict[str, float], rng: np.random.Generator) -> dict[str, float]:
    return {"logged": rng.uniform(0.6, 0.85)}


def _coarse(m: dict[str, float], rng: np.random.Generator) -> dict[str, float]:
    return {"digit": m["coulomb"] * rng.uniform(0.15, 0.6)}


def _with_reference(m: dict[str, float], rng: np.random.Generator) -> dict[str, float]:
    return {"with_reference": 1.0}


def _gain_switch(m: dict[str, float], rng: np.random.Generator) -> dict[str, float]:
    return {rng.choice(["gain_after", "gain_fast", "gain_beyond"]): rng.uniform(0.4, 0.7), "with_reference": 1.0}


def _wrong_sign(m: dict[str, float], rng: np.random.Generator) -> dict[str, float]:
    return {"sign": -1.0}


FAMILIES: Mapping[str, tuple[Callable[[dict[str, float], np.random.Generator], dict[str, float]], tuple[str, ...]]] = {
    "sound": (_sound, ()),
    "sound, constant damping": (_constant_damping, ()),
    "load friction": (_load_friction, ("load-friction",)),
    "play": (_play, ("play",)),
    "friction by place": (_by_place, ("friction-by-place",)),
    "friction by direction": (_by_direction, ("friction-by-direction",)),
    "cogging": (_cogging, ("cogging",)),
    "second mode": (_second_mode, ("coupling", "oscillation")),
    "delay": (_delay, ("delay", "timing")),
    "drifting delay": (_drifting_delay, ("drifting-delay", "delay", "timing")),
    "saturated force": (_saturated, ()),
    "clipped log": (_clipped, ("the channel clips",)),
    "coarse force": (_coarse, ("force-digits",)),
    "sound, with reference": (_with_reference, ()),
    "gain switch": (_gain_switch, ("changing-gains",)),
    "wrong sign": (_wrong_sign, ("the other sign",)),
}
"""Families by name: the effect that each adds to a sound machine, and the doubts that are right about it, or words in
them. A saturated force that is logged as it acts belongs to the model."""

KEYS = {
    "masses.cart": "mass",
    "friction.coulomb": "coulomb",
    "friction.viscous": "viscous",
    "friction.static": "static",
    "friction.bristle_stiffness": "bristle",
}
"""Keys of the stage file, and the numbers of a machine that their intervals should hold."""


@dataclass
class Outcome:
    """Result for one log: doubts in words with names, first cause, values held and reported."""

    family: str
    seed: int
    refused: str = ""
    doubts: list[list[str]] = field(default_factory=list)
    held: int = 0
    missed: list[str] = field(default_factory=list)
    seconds: float = 0.0

    @property
    def noticed(self) -> bool:
        """Tell whether any doubt or refusal was stated."""
        return bool(self.refused or self.doubts)

    def right(self, names: Iterable[str]) -> bool:
        """Tell whether the first cause named is one of these."""
        causes = [name for name, _ in self.doubts if name not in ("model", "little-friction")]
        # the cause that explains the inverse model is in its words
        said = self.doubts[0][1] if self.doubts else self.refused
        return (bool(causes) and causes[0] in names) or any(name in said for name in names)


def outcome(family: str, seed: int) -> Outcome:
    """Identify the log of one machine of a family."""
    rng = np.random.default_rng((seed, 56))
    numbers = plain(rng)
    numbers |= FAMILIES[family][0](numbers, rng)
    machine, result = Effects(**numbers), Outcome(family, seed)
    begin = time.process_time()
    try:
        identified = KIND.analyse([log := simulated(machine, rng)], Prior(KIND.around(log)), NOTHING_CHOSEN)
    except InputError as error:
        result.refused = f"{error.actual}; {error.expected}"
        return result
    result.seconds = time.process_time() - begin
    result.doubts = [[one.doubt, one.words] for one in identified.quality.findings if one.words]
    for estimate in identified.estimates:
        if estimate.determined and estimate.name in KEYS:
            truth = numbers[KEYS[estimate.name]]
            holds = estimate.low <= truth <= estimate.high
            result.held += holds
            if not holds:
                result.missed.append(f"{estimate.name} {estimate.low:.4g} to {estimate.high:.4g}, true {truth:.4g}")
    return result


def main() -> None:
    """Run the families, and print the table."""
    parser = numbered(__doc__, 5)
    parser.add_argument("families", nargs="*", default=[*FAMILIES])
    arguments = parser.parse_args()
    table, seeds = [], range(arguments.first, arguments.first + arguments.machines)
    for family in arguments.families:
        several = []
        tasks = [(family, seed) for seed in seeds]
        for (_, seed), data in each(tasks, lambda task: asdict(outcome(str(task[0]), int(task[1]))), arguments.kept):
            one = Outcome(**data)
            said = one.refused or "; ".join(f"[{name}] {words[:150]}" for name, words in one.doubts)
            print(f"{family} {seed}: {one.seconds:.0f} s; {said}; missed: {one.missed}", flush=True)
            several.append(one)
        right = sum(one.right(FAMILIES[family][1]) for one in several)
        held, missed = sum(one.held for one in several), sum(len(one.missed) for one in several)
        noticed, count = sum(one.noticed for one in several), len(several)
        row = f"{noticed} of {count}", f"{right} of {count}", f"{held} of {held + missed}"
        table.append([family, *row, f"{held + missed} of {len(KEYS) * count}"])
    print_table(("family", "noticed", "right cause first", "values held", "values reported"), table)


if __name__ == "__main__":
    main()
