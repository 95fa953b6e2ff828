"""Compare tuning with a brute-force search: `python -m benchmarks.tune`.

Options are `[--axes N ...] [--settings N] [--fresh N]`. Axes with four controllers, three levels of friction, without
and with a parasitic mode (24, by their numbers) are tuned remedy by remedy, the joint kept. A Sobol sequence of
settings over the same ranges is measured by the same moves and margins on the same machines. The best setting at which
no machine hunts, and which meets the goal on a hundred others, is compared with the tuned one in the settling time of
95 %. If tuning found nothing, anything that the brute search finds counts as missed. All tuned stages are measured on
fresh machines, and the fraction that meets the goal is counted. `--thesis` tunes the rig of the thesis instead.
"""

import argparse
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from time import process_time

import numpy as np
from scipy.stats import qmc

from benchmarks.report import Goal as Target
from benchmarks.report import print_goals, print_table
from friso.frequency.bode import loop_bandwidths
from friso.questions.tune.words import changes
from friso.remedies.catalogue import BANDWIDTH
from friso.remedies.machines import Fleet, Goal, draw_fleet
from friso.remedies.method import machines_of_search, tune
from friso.remedies.search import Budget, Search, modulus_margins, moves_of_points
from friso.remedies.verified import Performance, moving
from friso.stage import Stage, load, loads
from friso.stage.correlations import Correlations

AXIS = """
[masses]
cart = "1.2 kg"
stage = "0.5 kg"
[friction]
model = "lugre"
static = "3 N"
coulomb = "1 N"
stribeck_velocity = "1.6 mm/s"
stribeck_exponent = 2
bristle_stiffness = "1e5 N/m"
bristle_damping = "316 N*s/m"
viscous = "0.5 N*s/m"
[motion]
kind = "there_and_back"
acceleration = "100 m/s^2"
acceleration_time = "30 ms"
return_at = "3 s"
duration = "10 s"
[controller]
"""

CONTROLLERS = {
    "van Dijk": 'kind = "pid"\ncrossover = "8 Hz"\nalpha = 0.1\nbeta = 2\n',
    "PID on the error": 'kind = "pid"\nkp = "1.4 kN/m"\nki = "11 kN/(m*s)"\nkd = "85 N*s/m"\ntau = "5 ms"\n',
    "PID on the measurement": 'kind = "pid"\nkp = "1.4 kN/m"\nki = "11 kN/(m*s)"\nkd = "85 N*s/m"\n'
    'derivative_on = "measurement"\n',
    "cascade": 'kind = "cascade"\nkv = "10 1/s"\nkp = "85 N*s/m"\nvelocity_integral_time = "100 ms"\n',
}

LEVELS = (0.5, 1.0, 2.0)
"""Factors of all friction forces."""

LIMIT, WITHIN, ALIKE = 30.0, 2e-6, 1.05
"""Limit of the bandwidth [Hz], tolerance [m], and largest ratio of the tuned settling time to the best one."""

JOINT = {"locked": True, "limiter_stiffness": "2e7 N/m", "limiter_damping": "100 N*s/m"}
MODE = {"frequency": "300 Hz", "mass": "0.25 kg", "damping_ratio": 0.01}

HEAD = ("machine", "way", "", "tuned", "brute", "ratio", "fresh machines that meet it", "CPU")

CHUNK, BATCH, PART = 1024, 8, 1000
"""Settings that are measured, and surveyed, at once; and number of fresh machines at once."""

NEVER = 1e3
"""Settling time [s] beyond any run."""

BEYOND = 1.3
"""Ratio to the tuned settling time up to which the brute search keeps settings."""


def axes() -> Iterator[tuple[str, Stage]]:
    """Yield all axes: four controllers, three levels of friction, without and with mode."""
    for level, mode in product(LEVELS, (False, True)):
        for name, controller in CONTROLLERS.items():
            stage = loads(AXIS + controller)
            flat = stage.flat()
            keys = ("friction.static", "friction.coulomb", "friction.bristle_stiffness", "friction.bristle_damping")
            stage = stage.with_numbers({key: level * flat[key] for key in keys})
            label = f"{name}, friction x {level:g}{', mode' if mode else ''}"
            yield label, stage.replace({"joint": JOINT, "parasitic": MODE}) if mode else stage


def brute(search: Search, count: int, most: float) -> float:
    """Return the best settling time [s] below `most`, infinite if there is none.

    Settings must keep all constraints, must not hunt, and must meet the goal on enough fresh machines. It is exact:
    among so few machines the 95 % settling time is that of the slowest one, so a setting is dropped once it is too
    slow, or breaks a constraint, on one of them.
    """
    shares = qmc.Sobol(len(search.remedy.variables), rng=0).random(count)
    chunks = np.array_split(shares, max(1, count // CHUNK))
    stage, remedy = search.remedy.stage, search.remedy
    shares = np.concatenate(
        [chunk[loop_bandwidths(stage, remedy.changes(chunk), len(chunk)) <= LIMIT] for chunk in chunks]
    )
    slowest = np.zeros(len(shares))
    for number in range(search.machines.count):
        machine = search.machines.take(np.array([number]))
        chunks = np.array_split(shares, max(1, len(shares) // CHUNK))
        times = np.maximum(slowest, np.concatenate([times_on(search, chunk, machine, most) for chunk in chunks]))
        shares, slowest = shares[times < most], times[times < most]
    for batch in np.array_split(np.argsort(slowest), max(1, len(shares) // BATCH)):
        clear = batch[search.clear(shares[batch])] if len(batch) else batch
        if len(clear) and (meets := search.share(shares[clear]) >= search.goal.surely(search.fresh.count)).any():
            return float(slowest[clear[meets]].min())
    return float("inf")


def performance_of(stage: Stage, machines: Fleet, goal: Goal, drive: Stage) -> Performance:
    """Measure moves, margins and attractors; the stage `drive` gives sampling and delay.

    Sampling and delay count for the margins.
    """
    return moving(stage, machines, goal, drive).surveyed(stage, machines, goal)


def meeting(stage: Stage, fresh: Fleet, goal: Goal, drive: Stage) -> float:
    """Return the fraction of fresh machines that meet the goal with a stage."""
    parts = np.array_split(np.arange(fresh.count), max(1, fresh.count // PART))
    shares = [performance_of(stage, fresh.take(part), goal, drive).share(goal).probability for part in parts]
    return float(np.average(shares, weights=[len(part) for part in parts]))


def times_on(search: Search, shares: np.ndarray, machine: Fleet, most: float) -> np.ndarray:
    """Return the settling times [s] of settings on one machine.

    They are infinite from `most` on, and if a constraint is broken.
    """
    remedy, goal, times = search.remedy, search.goal, np.full(len(shares), np.inf)
    if not len(shares):
        return times
    left = np.flatnonzero(modulus_margins(remedy, shares, machine, search.drive)[:, 0] >= goal.margin)
    if left.size:
        times[left] = moves_of_points(remedy, shares[left], machine, goal).settling[:, 0]
        left = np.flatnonzero(times < most)
    if left.size:
        slower = moves_of_points(remedy, shares[left], machine, goal, slower=goal.distance).looser[:, 0]
        times[left[~np.isfinite(slower)]] = np.inf
    return np.where(times < most, times, np.inf)


def thesis() -> None:
    """Tune the thesis's rig at 8 Hz: bandwidth, isolator, and its own design (Sec. 3.4)."""
    rig = load(Path(__file__).parents[1] / "examples" / "thesis_rig.toml")
    locked, free = rig.replace({"joint.locked": True}), rig.replace({"joint.locked": False})
    goal = Goal(bandwidth_limit=25.0)
    begun = process_time()
    advice = tune(locked, goal, chosen=["bandwidth", "isolator"])
    print(f"{process_time() - begun:.0f} s")
    listed = {"locked": advice.present, "thesis, Sec. 3.4": performance_of(free, advice.machines, goal, free)}
    listed |= {outcome.remedy.name: outcome.measured for outcome in advice.outcomes if outcome.measured}
    head = ("", "meet the goal", "95 % settle in", "median", "force", "margin", "stiffness")
    rows = [
        (
            name,
            f"{100 * part.share(goal).probability:.0f} %",
            *(f"{value:.3g}" for value in (part.slowest(goal), part.median, part.force(goal), part.least_margin(goal))),
            f"{part.stiffness:.3g}",
        )
        for name, part in listed.items()
    ]
    print_table(head, rows)
    for outcome in advice.outcomes:
        print(
            outcome.remedy.name,
            outcome.certainty,
            outcome.doubts,
            outcome.stage and changes(advice.stage, outcome.stage),
        )


def main() -> None:
    """Tune machines, search by brute force, measure on fresh machines."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--axes", type=int, nargs="*", default=[*range(24)])
    parser.add_argument("--settings", type=int, default=2**17)
    parser.add_argument("--fresh", type=int, default=10_000)
    parser.add_argument("--ways", nargs="*", default=["bandwidth", "gains"])
    parser.add_argument("--thesis", action="store_true")
    options = parser.parse_args()
    if options.thesis:
        return thesis()
    wanted = Goal(within=WITHIN, bandwidth_limit=LIMIT, joint=False)
    rows: list[tuple[str, ...]] = []
    ratios, met = list[float](), list[float]()
    listed = [*axes()]
    for name, stage in (listed[number] for number in options.axes):
        begun = process_time()
        advice = tune(stage, wanted, chosen=options.ways)
        goal = advice.goal
        seconds = process_time() - begun
        machines = machines_of_search(stage, Correlations(), Budget(), advice.seed, goal, stage)
        fresh = draw_fleet(stage, Correlations(), options.fresh, 77, goal.moves)
        for outcome in advice.outcomes:
            tuned_stage = outcome.stage if outcome.certainty == "works" else None
            compared, share = ("", "", ""), ""  # the bandwidth does not settle soonest
            if outcome.remedy.name in {*options.ways} - {BANDWIDTH}:
                search = Search(outcome.remedy, goal, machines, advice.machines, stage, Budget(), lambda label: None)
                tuned = float(search.measured(outcome.shares[None]).settling[0]) if tuned_stage else np.inf
                best = brute(search, options.settings, min(BEYOND * tuned, NEVER))
                ratios.append(tuned / best if np.isfinite(best) else 0.0)
                compared = (f"{tuned:.4g} s", f"{best:.4g} s", f"{ratios[-1]:.3f}")
            if tuned_stage:
                met.append(meeting(tuned_stage, fresh, goal, stage))
                share = f"{100 * met[-1]:.2f} %"
            rows.append((name, outcome.remedy.name, outcome.certainty, *compared, share, f"{seconds:.0f} s"))
            print(*rows[-1], sep=" | ", flush=True)
    print_table(HEAD, rows)
    worst, least = max(ratios, default=np.inf), min(met, default=0.0)
    neither = ratios.count(0.0)
    print_goals(
        [
            Target("settling time over the best of the brute search", f"<= {ALIKE}", f"{worst:.3f}", worst <= ALIKE),
            Target("ways for which neither found any that is as good", "", f"{neither} of {len(ratios)}", None),
            Target(
                "share of fresh machines that meet the goal",
                f">= {wanted.share}",
                f"{least:.3f}",
                least >= wanted.share,
            ),
        ],
        f"{options.settings} settings, {options.fresh} fresh machines; numpy {np.__version__}",
    )


if __name__ == "__main__":
    main()
