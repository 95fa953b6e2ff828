"""Solve a mass under a PID with Coulomb and static friction exactly, from stop to stop.

There are no bristles. While the mass slides to one side, the loop is linear: the sum of forces, m x'' + kd x' + kp x +
ki (integral of x), stays at minus the Coulomb friction. It breaks away from rest when the motor force reaches static
friction, so it begins with an acceleration of gap over mass, the gap being static less Coulomb friction. Where it next
stops follows from the matrix exponential, and is one map of the distance at which it stuck. Derived here; the
statements are from

- Armstrong, Amin 1996, PID control in the presence of static friction, Automatica 32(5) 679-692,
  doi:10.1016/0005-1098(95)00199-9: with static above Coulomb friction every stabilising PID has a limit cycle;
- Ruderman, arXiv 2311.03724 and 2006.08977: with Coulomb friction alone there is none, but stops ever closer by.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import expm
from scipy.optimize import root_scalar

from benchmarks.oracles.oracle import Finding, Oracle, lugre
from friso.hunting import Ensemble, Hunting, find_cycles, find_swings, hunting
from friso.stage import Stage

MASS, COULOMB, GAP = 1.7, 1.0, 2.0
"""Mass [kg], Coulomb friction [N], and excess of static friction over it [N]."""

MANY, ASKED, SHOWN = 300, 24, 6
"""Number of drawn controllers that are solved exactly, that friso is asked about, and that are shown all the way to the
limit."""

DISTANCES = np.geomspace(1e-3, 1e4, 71)
"""Distances at which the mass sticks, relative to the gap over kp."""

SHARPER, SHARP = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5), 1e-3
"""Steps to the limit of LuGre, and the step at which most controllers are asked. A step is the Stribeck velocity
relative to the fastest speed that the gap alone causes. The bristles are stiffer than the loop by the inverse square of
the step, and by at least a thousand."""

LONG = 60.0
"""Time for which a slide is followed, in units of the loop's."""

NEAR = 0.01
"""Largest relative difference of the amplitude of friso's cycle from the exact one at the last step to the limit."""


@dataclass(frozen=True)
class Pid:
    """Gains of a PID [N/m, N/(m s), N s/m], with the derivative of the position."""

    kp: float
    ki: float
    kd: float

    @property
    def omega(self) -> float:
        return float(np.sqrt(self.kp / MASS))

    @cached_property
    def rows(self) -> np.ndarray:
        """Return the linear loop of place, speed and acceleration while the mass slides to one side."""
        return np.array([[0, 1, 0], [0, 0, 1], [-self.ki / MASS, -self.kp / MASS, -self.kd / MASS]])

    @cached_property
    def responses(self) -> np.ndarray:
        """Return the responses of place, speed and acceleration at many times, (times, 3, 3)."""
        step, all_of = expm(self.rows * self.times[1]), [np.eye(3)]
        for _ in self.times[1:]:
            all_of.append(step @ all_of[-1])
        return np.array(all_of)

    @cached_property
    def times(self) -> np.ndarray:
        return np.linspace(0.0, LONG / self.omega, 6001)

    def stop(self, distance: float, gap: float) -> np.ndarray:
        """Return place [m], speed and acceleration at the next stop; NaN for creeping home.

        The mass stuck at a distance [m] above its reference and broke away downward, with an acceleration of -gap/mass.
        """
        start = np.array([distance, 0.0, -gap / MASS])
        speeds = self.responses[:, 1] @ start
        after = np.flatnonzero(speeds[2:] >= 0)
        if not after.size:
            return np.full(3, np.nan)
        before = self.responses[after[0] + 1] @ start
        within = (0.0, float(self.times[1]))
        end = root_scalar(lambda t: float((expm(self.rows * t) @ before)[1]), bracket=within, xtol=1e-15).root
        return expm(self.rows * end) @ before

    def cycle(self) -> tuple[float, bool]:
        """Return half of peak to peak of the limit cycle [m], NaN without one.

        Also tell whether the mass sticks at its ends.
        """
        unit = GAP / self.kp

        def growth(distance: float) -> float:
            return -self.stop(distance * unit, GAP)[0] / distance - unit

        values = np.array([growth(distance) for distance in DISTANCES])
        signs = np.flatnonzero((values[:-1] > 0) & ~(values[1:] > 0))
        if not signs.size or not np.isfinite(values[signs[-1] + 1]):
            return np.nan, False
        bracket = DISTANCES[signs[-1] : signs[-1] + 2]
        distance = unit * root_scalar(growth, bracket=bracket, method="brentq", xtol=1e-12).root
        return distance, bool(abs(MASS * self.stop(distance, GAP)[2] - COULOMB) <= COULOMB + GAP)

    def ratio(self) -> float:
        """Return the ratio of the distances of successive stops under Coulomb friction alone.

        It does not depend on the distance. It is below 0 if the mass stops before its reference, and 0 if it creeps
        home.
        """
        place = self.stop(1.0, 0.0)[0]
        return 0.0 if np.isnan(place) else -float(place)


def drawn(count: int) -> list[Pid]:
    """Draw stabilising PIDs, log-uniform.

    Natural frequencies are 1 to 20 Hz, damping 0.2 to 2, and the integral 2 to 90 % of Hurwitz's limit, kp kd > m ki.
    """
    rng, pids = np.random.default_rng(1996), list[Pid]()
    for _ in range(count):
        omega, damping, share = np.exp(rng.uniform(np.log([2 * np.pi, 0.2, 0.02]), np.log([40 * np.pi, 2.0, 0.9])))
        kp, kd = MASS * omega**2, 2 * damping * MASS * omega
        pids.append(Pid(float(kp), float(share * kp * kd / MASS), float(kd)))
    return pids


def stage(pid: Pid, sharpness: float, gap: float = GAP) -> Stage:
    """Return the mass with LuGre friction; a smaller `sharpness` is nearer to the limit."""
    top = gap / (MASS * pid.omega) if gap else 1e-3
    bristles = pid.kp * max(1e3, sharpness**-2)
    damping = float(np.sqrt(bristles * MASS))
    friction = lugre(COULOMB + gap, COULOMB, sharpness * top, bristles, damping, 0.0)
    return Stage(
        name="towards the limit",
        masses={"cart": f"{MASS} kg"},
        friction=friction,
        controller={
            "kind": "pid",
            "kp": f"{pid.kp!r} N/m",
            "ki": f"{pid.ki!r} N/(m*s)",
            "kd": f"{pid.kd!r} N*s/m",
            "derivative_on": "measurement",
        },
        motion={"kind": "release", "displacement": f"{10 * (COULOMB + GAP) / pid.kp!r} m", "duration": "20 s"},
    )


def always() -> Iterator[Finding]:
    pids = drawn(MANY)
    exact = [pid.cycle() for pid in pids]
    count, sticking = (
        int(np.sum(values)) for values in (np.isfinite([size for size, _ in exact]), [s for _, s in exact])
    )
    words = f"{count} of {MANY}; it sticks at both ends in {sticking}"
    yield Finding("drawn PIDs with a limit cycle, by the exact map alone", "-", words, None)
    asked = list(zip(pids[:ASKED], (size for size, _ in exact), strict=False))
    for name, amplitude in (("found by the survey", surveyed), ("closed from the return map", closed)):
        sizes = [amplitude(stage(pid, SHARP)) / size - 1 for pid, size in asked]
        near = int(np.sum(np.abs(sizes) < NEAR))
        what = f"limit cycles {name}, within {100 * NEAR:g} % of the exact ones, at v_s of {SHARP:g}"
        words = f"{near}; {int(np.sum(np.isnan(sizes)))} without a cycle", f"{ASKED} of {ASKED}"
        yield Finding(what, *words, near == ASKED)
    for sharpness in SHARPER[2:]:
        yield from at_the_limit([hunting(stage(pid, sharpness)) for pid, _ in asked], sharpness)
    for number, (pid, (size, _)) in enumerate(zip(pids[:SHOWN], exact, strict=False)):
        yield towards(f"PID {number}", pid, size)


def at_the_limit(answers: Sequence[Hunting], sharpness: float) -> Iterator[Finding]:
    """Yield stages for which friso is certain of more or fewer attractors than one cycle.

    The exact solution has one.
    """
    motions = [len(a.surveyed.motions) if a.certain and a.surveyed else 1 for a in answers]
    for words, wrong in (("nothing", np.equal(motions, 0)), ("more than one motion", np.greater(motions, 1))):
        which = ", ".join(f"PID {k}" for k in np.flatnonzero(wrong))
        what = f"stages that {words} attracts, for certain, at v_s of {sharpness:g}"
        yield Finding(what, f"{wrong.sum()} of {len(motions)}{which and f' ({which})'}", "none", not wrong.any())


def towards(name: str, pid: Pid, amplitude: float) -> Finding:
    """Compare what friso says about a PID on the way to the limit with the exact limit cycle."""
    steps = SHARPER[:4]
    off = [surveyed(stage(pid, sharpness)) / amplitude - 1 for sharpness in steps]
    words = [f"{100 * share:.2g} %" if np.isfinite(share) else "no cycle" for share in off]
    text = f"cycle off by {', '.join(words)} at v_s of {', '.join(f'{s:g}' for s in steps)}"
    return Finding(f"{name}: limit cycle", text, f"±{1e3 * amplitude:.5g} mm", abs(off[-1]) < NEAR)


def surveyed(one: Stage) -> float:
    """Return half of peak to peak [m] of a stage's attractor by friso's survey.

    It is that of the largest closed cycle, or else of the largest observed swing; NaN without an attractor.
    """
    swings = find_swings(one.flat())
    cycles = [swing for swing in swings if swing.cycles is not None]
    return max((swing.amplitude for swing in cycles or swings), default=np.nan)


def closed(one: Stage) -> float:
    """Return half of peak to peak [m] of the cycle that friso closes at a fixed point.

    The fixed point is one of its return map. NaN without one.
    """
    return float(find_cycles(Ensemble.held(one.flat(), 1)).amplitude[0])


def never() -> Iterator[Finding]:
    pids = drawn(MANY)
    ratios = np.array([pid.ratio() for pid in pids])
    words = f"{int(np.sum(np.abs(ratios) < 1))} of {MANY}, by {ratios.min():.3g} to {ratios.max():.3g}"
    yield Finding("drawn PIDs that stop nearer every time, by the exact map alone", "-", words, None)
    for law in ("lugre", "dahl"):
        answers = [hunting(coulomb_stage(pid, law)) for pid in pids[:ASKED]]
        quiet = sum(not (answer.attracting or answer.observed) for answer in answers)
        certain = sum(answer.certain for answer in answers)
        words = f"{quiet} ({certain} certain)", f"{ASKED} of {ASKED}"
        yield Finding(f"PIDs under which nothing attracts, on bristles of {law}", *words, quiet == ASKED)


def coulomb_stage(pid: Pid, law: str) -> Stage:
    """Return the mass with Coulomb friction alone, on LuGre's or Dahl's bristles."""
    one = stage(pid, SHARPER[0], 0.0)
    if law == "lugre":
        return one
    keys = {"coulomb": f"{COULOMB} N", "bristle_stiffness": f"{1e3 * pid.kp!r} N/m", "viscous": "0 N*s/m"}
    return one.replace({"friction": {"model": "dahl", **keys}})


SOURCES: Sequence[str] = (
    "Armstrong, Amin 1996, Automatica 32(5) 679, doi:10.1016/0005-1098(95)00199-9; exact map derived in switch.py",
    "Ruderman, arXiv 2311.03724 and 2006.08977; exact map derived in switch.py",
)

ORACLES = (
    Oracle(
        "always",
        "A mass under any stabilising PID with static above Coulomb friction, no bristles and no Stribeck velocity has "
        "a limit cycle.",
        SOURCES[0],
        "Friso has bristles and a Stribeck velocity. Made stiffer and smaller, its cycle has to come within 1 % of the "
        "exact one: Stribeck friction and bristles act on less than a thousandth of the swing then. The exact map has "
        "one fixed point, with a slope of less than 1 in magnitude, so one cycle attracts each stage and nothing else. "
        "At v_s of 1e-5 bristles are 1e10 times as stiff as the loop, which friso calls unusual. First "
        "asked were cycles closed from the return map alone; as these were missing, the survey was asked too.",
        always,
    ),
    Oracle(
        "never",
        "A mass under a stabilising PID with Coulomb friction alone has no limit cycle.",
        SOURCES[1],
        "Nothing attracts in friso's answer, with LuGre's bristles and with Dahl's.",
        never,
    ),
)
