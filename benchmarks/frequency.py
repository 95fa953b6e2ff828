"""Time the linear analysis: `python -m benchmarks.frequency`.

It compares the worst case over a family of 10^4 states at once with one python-control system after the other. It also
times the whole analysis of the thesis rig, also with a sampled drive.
"""

from __future__ import annotations

import argparse

import control
import numpy as np

import friso
from benchmarks.report import Goal, clock, print_goals, print_table, spread
from friso.frequency.bode import bode
from friso.frequency.family import frequency_grid, scan_stability
from friso.frequency.members import Members, family
from friso.frequency.settings import FrequencySettings
from friso.stage import Stage
from friso_thesis.studies.thesis.studies import thesis_rig

MEMBERS = 10_000
ONE_BY_ONE = 50
DRIVES = {"continuous": {}, "sampled": {"drive.sample_time": "50 us", "drive.delay": "50 us"}}


def one_by_one(stage: Stage, members: Members, omega: np.ndarray) -> list[float]:
    """Return poles and least distance from -1 of each member, by python-control."""
    margins = []
    for k in range(len(members)):
        loop = friso.linear(stage, members[k], "open")
        poles = control.poles(loop.feedback(1))
        margins.append(float(np.abs(1 + loop(1j * omega)).min()) if np.real(poles).max() < 0 else np.nan)
    return margins


def run(repetitions: int) -> list[Goal]:
    rows, goals = [], []
    for name, changes in DRIVES.items():
        stage = thesis_rig().replace(changes)
        flat = stage.flat()
        members = family(flat, MEMBERS // 4, MEMBERS // 4)
        times = [clock(lambda: scan_stability(flat, members)) for _ in range(repetitions + 1)][1:]  # noqa: B023
        analyses = [clock(lambda: bode(stage)) for _ in range(repetitions)]  # noqa: B023
        rows.append([name, len(members), spread(times, digits=2), spread(analyses, digits=2)])
        about = f"worst case over {len(members)} states, {name}"
        goals.append(Goal(about, "< 1 s", f"{min(times):.2f} s", min(times) < 1))
        if name == "continuous":
            few = members[np.linspace(0, len(members) - 1, ONE_BY_ONE).astype(int)]
            grid = frequency_grid(flat, FrequencySettings.current().family_density)
            slow = clock(lambda: one_by_one(stage, few, grid)) / ONE_BY_ONE * len(members)  # noqa: B023
            ratio = f"{slow / min(times):.0f} times"
            goals.append(Goal("against python-control, state after state", "", ratio, None))
    print_table(("drive", "states", "scan min / median [s]", "friso.bode min / median [s]"), rows)
    return goals


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repetitions", type=int, default=5)
    print_goals(run(parser.parse_args().repetitions), "Goals")


if __name__ == "__main__":
    main()
