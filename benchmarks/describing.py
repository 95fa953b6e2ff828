"""Compare describing functions with simulations, for docs/evidence/describing.md.

It takes three minutes.
"""

import sys
from pathlib import Path

import numpy as np

import friso
from friso.stage import Stage
from friso_thesis.studies.describing.function import describing
from friso_thesis.studies.describing.response import mass_line, plant_response
from friso_thesis.studies.harmonic_balance import harmonic_balance

ROOT = Path(__file__).parents[1]

LOCKED_CASES = ((0.5, 5.0), (1.0, 30.0), (2.0, 40.0), (3.0, 20.0), (5.0, 10.0), (10.0, 60.0))
"""Force [N] and frequency [Hz] of the comparisons with the joint locked."""

FREE_CASES = ((1.0, 3.0), (2.0, 9.0), (4.0, 5.0), (6.0, 20.0), (3.0, 40.0))
"""Force [N] and frequency [Hz] of the comparisons with the joint free."""

CROSSOVERS = [4, 6, 8, 9.5]
"""Crossovers [Hz] of the harmonic balance."""


def main() -> None:
    """Print all tables."""
    sys.path.insert(0, str(ROOT / "tests"))
    rig = friso.load(str(ROOT / "examples" / "thesis_rig.toml")).replace({"joint.locked": True})
    tables = {key: value for key, value in rig.as_written().items() if key not in ("joint", "parasitic")}
    rigid = Stage(**{**tables, "masses": {"cart": "1.7 kg"}})
    print_stiffness(rigid)
    print_locked(rigid)
    print_branches(rigid)
    print_free()
    print_mass_line(rig)
    print_balance(rigid)


def print_stiffness(rigid: Stage) -> None:
    """Print the dynamic stiffness of Table 2 of the thesis."""
    few = describing(rigid, [1e-6, 1e-5, 1e-4, 1e-3, 1e-2], [1, 10, 100])
    print(np.round(few["stiffness"].values, 1), float(few["gap"].max()))


def print_locked(rigid: Stage) -> None:
    """Print the response of the rigid mass over SciPy's LSODA."""
    from test_describing import driven

    for size, f in LOCKED_CASES:
        answer = complex(size * plant_response(rigid, [size], [f])["up"].item())
        start = [answer.real, (2j * np.pi * f * answer).real, 0.0]
        true = driven(lambda _, s=size: s, f, start, 20)
        print(f"{size} N, {f} Hz: {100 * (abs(answer / true) - 1):.1f} %, {np.degrees(np.angle(answer / true)):.1f}°")


def print_branches(rigid: Stage) -> None:
    """Print, at 5 Hz, the forces with two stable responses, and where simulations end.

    Simulations start from rest and from sliding.
    """
    from test_describing import driven

    forces = np.arange(1.0, 2.51, 0.1)
    both = plant_response(rigid, forces, [5.0])
    print(forces[both["answers"].values[:, 0] == 3][[0, -1]])
    for force, branches in zip(forces, both["response"].values[:, 0], strict=True):
        slid = force * branches[~np.isnan(branches)][-1]
        rest = driven(lambda t, s=force: s * min(1.0, t * 5 / 20), 5.0, [0.0, 0.0, 0.0], 60)
        moved = driven(lambda _, s=force: s, 5.0, [slid.real, (10j * np.pi * slid).real, 0.0], 40)
        error = abs(slid / moved) - 1 if abs(moved) > 1e-4 else np.nan
        print(f"{force:.1f} N: rest {1e6 * abs(rest):.0f} um, sliding {1e6 * abs(moved):.0f} um, {100 * error:.0f} %")


def print_free() -> None:
    """Print the response of the stage on a free joint over SciPy's LSODA."""
    from test_describing import against_simulation

    for size, f in FREE_CASES:
        off = against_simulation(size, f)
        print(f"{size} N, {f} Hz: {100 * (abs(off) - 1):.2f} %, {np.degrees(np.angle(off)):.1f} deg")


def print_mass_line(rig: Stage) -> None:
    """Print the mass line of the locked rig at ten places, relative to 1/(m omega^2)."""
    levels = map(float, np.linspace(1, 2.5, 10))
    places = [{"friction.static": f"{s} N", "friction.coulomb": f"{s / 3} N"} for s in levels]
    lines = mass_line(rig, places, [1.5, 3, 6, 12, 30], [5, 10, 20, 40, 60, 80, 120])
    for name in ("magnitude", "spread_magnitude", "phase", "spread_phase"):
        values = lines[name].mean("place") if "place" in lines[name].dims else lines[name]
        print(name, np.round(values.values if "magnitude" in name else np.degrees(values.values), 3), sep="\n")


def print_balance(rigid: Stage) -> None:
    """Print the harmonic balance by its highest harmonic, and the first series that solves it."""
    print(harmonic_balance(rigid, CROSSOVERS).drop_vars("status").to_dataframe().to_string())
    series = harmonic_balance(rigid, CROSSOVERS, range(25, 131, 2))
    for crossover, row in zip(series["crossover"], series["status"].values, strict=True):
        print(float(crossover), int(series["highest"][np.flatnonzero(row == "done")[0]]))


if __name__ == "__main__":
    main()
