"""Compute stored findings again: `python -m benchmarks.evidence [NAME ...] [--equations]`.

Without arguments, the entries of friso/evidence.toml are listed with their dates, and those older than the equations or
than the code behind them are marked. NAME computes an entry again and writes it back with today's date, the revision of
the equations and the digest of that code; "quick" stands for all entries that take less than a few minutes each.
Documents that state a finding are listed if the value has changed: they are edited by hand.

`--equations` compares the reference numbers of the equations (`benchmarks.canonical`) with the stored ones. If they
differ, it begins a new revision: every entry is then older than the equations.
"""

import argparse
import json
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import Any

from benchmarks.canonical import differ, reference_numbers
from benchmarks.code_digest import code_digest
from benchmarks.ode23s import other_solvers, thesis_solver
from benchmarks.report import print_table
from friso import evidence
from friso.evidence import Entry, Equations

FILE = Path(evidence.__file__).with_name("evidence.toml")
ROOT = Path(__file__).parent.parent
DRIVE = "examples/thesis_drive.toml"

HEAD = """# Findings of our own computations that take too long to repeat where they are stated (friso.evidence).
# Written by `python -m benchmarks.evidence`; only `about`, `rests_on`, `stated` and `note` are edited by hand.
"""

Values = dict[str, float]
NAN = float("nan")


def friso(*arguments: str) -> dict[str, Any]:
    """Return the JSON document of a command, run in the repository's folder."""
    command = [sys.executable, "-m", "friso", *arguments, "--json"]
    done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, check=True)
    return json.loads(done.stdout)


def rig(experiment: str) -> dict[str, Any]:
    """Return what an experiment of the virtual rig finds on the thesis's rig."""
    return friso("rig", experiment, DRIVE)["results"]


def rig_in_position() -> Values:
    runs = rig("in-position")["runs"]
    locked, free = (runs[case]["all"] for case in ("locked", "free"))
    return {
        "rms_ratio": free["rms_m"] / locked["rms_m"],
        "locked_peak_m": locked["peak_m"],
        "free_peak_m": free["peak_m"],
    }


def rig_hunting() -> Values:
    document = rig("hunting")
    rows, locked, free = document["crossovers_hz"], *(document["cases"][case]["counted"] for case in ("locked", "free"))
    rails = len(document["rail_seeds"])
    last = max(row for row, counted in enumerate(locked) if counted["share"] > 0)
    return {
        "rails": rails,
        "locked_at_8_hz": round(rails * locked[rows.index(8.0)]["share"]),
        "free_at_8_hz": round(rails * free[rows.index(8.0)]["share"]),
        "locked_at_9_5_hz": round(rails * locked[rows.index(9.5)]["share"]),
        "locked_none_from_hz": rows[last + 1],
    }


def rig_stiffness() -> Values:
    document = rig("stiffness")
    low, high = document["interval_n_per_m"]
    return {"stiffness_n_per_m": document["stiffness_n_per_m"], "low_n_per_m": low, "high_n_per_m": high}


def rig_presliding() -> Values:
    places = rig("presliding")["places"]
    names = ("stiffness_n_per_m", "damping_n_s_per_m", "mass_kg")
    values = {name: [place[name][0] for place in places] for name in names}
    return {f"{end.__name__}_{name}": end(numbers) for name, numbers in values.items() for end in (min, max)}


def rig_frf() -> Values:
    document = rig("frf")
    low, high = document["locked"]["mass_interval_kg"]
    return {
        "locked_kg": document["locked"]["mass_kg"],
        "locked_low_kg": low,
        "locked_high_kg": high,
        "free_kg": document["free"]["mass_kg"],
        "locked_weak_motor_kg": document["apparent_mass_locked_kg"][1],
        "free_weak_motor_kg": document["apparent_mass_free_kg"][1],
        "locked_strong_motor_kg": document["apparent_mass_locked_kg"][2],
        "free_crossing_hz": document["free_loop"]["crossings_hz"][-1],
        "highest_stable_hz": document["highest_stable_hz"],
    }


def rig_slow_cycles() -> Values:
    document = rig("measured-cycles")
    levels, (lopsided,) = document["levels"], [entry for entry in document["by_asymmetry"] if entry["from"] == 0.05]
    row, column = levels["static_over_file"].index(1.0), levels["coulomb_over_file"].index(2.0)
    weak = {
        name: levels[name][1][row][column] / document["even_rail"][name][0] for name in ("period_s", "peak_to_peak_m")
    }
    return {
        "lopsided_period": lopsided["period_over_even"],
        "weak_motor_period": weak["period_s"],
        "weak_motor_swing": weak["peak_to_peak_m"],
    }


def rig_constant_speed() -> Values:
    document = rig("constant-speed")
    shown = [place["shown"] for place in document["many_speeds"]["places"]]
    names = {
        "friction.stribeck_velocity": "stribeck_m_per_s",
        "friction.viscous": "viscous_n_s_per_m",
        "friction.coulomb": "coulomb_n",
        "friction.static": "static_n",
    }
    values = {short: [place[key]["value"] for place in shown if key in place] for key, short in names.items()}
    key = "friction.stribeck_velocity"
    slow = [place["shown"][key]["value"] for place in document["slow_sliding"] if key in place["shown"]]
    values["slow_stribeck_m_per_s"] = slow
    return {f"{end.__name__}_{name}": end(numbers) for name, numbers in values.items() for end in (min, max)}


def compare_thesis_rig() -> Values:
    document = friso("compare", "examples/thesis_rig.toml", "--machines", "2000")
    values = {"machines": float(document["machines"])}
    for name, stage in document["stages"].items():
        word = name.split()[-1]
        values |= {
            f"{word}_swings": stage["swings"]["probability"],
            f"{word}_in_position": stage["in_position"]["probability"],
            f"{word}_settled": stage["settled"],
            f"{word}_force_n": stage["largest_force_n"]["value"],
        }
        if stage["settling_time_s"]["value"] is not None:
            values[f"{word}_settling_s"] = stage["settling_time_s"]["value"]
    return values


def frequency_delays() -> Values:
    from friso.frequency.bode import limits
    from friso.stage import load

    stage, edges = load(ROOT / "examples" / "thesis_rig.toml"), {}
    for delay in (0, 50, 100, 200, 500, 1000):
        for name, locked in (("locked", True), ("free", False)):
            drive = {"drive": {"sample_time": "50 us", "delay": f"{delay} us"}, "joint.locked": locked}
            edges[f"{name}_{delay}_us_hz"] = limits(stage.replace(drive).flat()).highest_stable or 0.0
    return edges


def hunting_locked_rig() -> Values:
    crossovers = ("--set", "joint.locked=true", "--x", "controller.crossover=1 Hz..40 Hz")
    points = friso("boundary", "examples/thesis_rig.toml", *crossovers)["points"]
    symmetric = {kind: [point["value"] for point in points if (point["cycle"], point["kind"]) == ("symmetric", kind)]
                 for kind in ("flip", "fold")}  # fmt: skip
    return {"edge_hz": min(symmetric["flip"]), "fold_hz": max(symmetric["fold"])}


def hunting_limiter() -> Values:
    import numpy as np

    from friso.engine.batch import output_variables
    from friso.hunting import CYCLE_RTOL, Ensemble, find_cycles, multipliers
    from friso.stage import load

    stages = Ensemble.held(
        load(ROOT / "examples" / "thesis_rig.toml").replace({"controller.crossover": "5 Hz"}).flat(), 1
    )
    cycles = find_cycles(stages)
    half, points = float(cycles.orbits.times[0]), 400_000
    samples = stages.run(cycles.states, cycles.orbits.times, 1e-8, interval=half / points).samples[0].T
    flat = {**stages.flat, "motion.displacement": float(stages.length[0]), "motion.duration": half}
    outputs = output_variables(stages.kernel, flat, samples, np.arange(samples.shape[1]) * (half / points))
    touching = np.abs(np.asarray(outputs["joint_deflection"][1])) > flat["joint.stroke"]
    aside = np.geomspace(1e-6, 0.005, 40)  # over 1 % of the distance
    aside = np.concatenate([-aside, aside]) * np.abs(cycles.states[0, stages.sticking])
    several = np.zeros(len(aside), dtype=np.int64)
    beside = replace(cycles.take(several).orbits, states=cycles.states + aside[:, None] * cycles.direction)
    local = np.real(multipliers(stages.take(several), beside, CYCLE_RTOL).local[:, 0])
    return {
        "touches": float(np.count_nonzero(np.diff(touching.astype(int)) == 1)),
        "least": float(local.min()),
        "greatest": float(local.max()),
        "slope": float(cycles.slope[0]),
    }


def hunting_supercritical() -> Values:
    """Return the finding that a test asserts, or raise an exception if it does not hold."""
    entry = evidence.findings_on_file()["hunting.supercritical"]
    subprocess.run([sys.executable, "-m", *shlex.split(entry.command), "-p", "no:cacheprovider"], cwd=ROOT, check=True)
    return dict(entry.values)


def design_thesis() -> Values:
    with tempfile.TemporaryDirectory() as folder:
        asked = "examples/thesis_rig.toml", "examples/specs/thesis.toml", "--anyway"
        document = friso("design", *asked, "--out", folder)
    joint, leaves, controller = document["joint"], document["leaves"], document["controller"]
    free, locked = document["verification"], document["verification"]["locked"]
    return {
        "limit_hz": document["machine_limit_hz"],
        "without_edge_hz": document["without"]["highest_edge_hz"],
        "needed": float(document["needed"]),
        "stiffness_n_per_m": joint["stiffness_n_per_m"],
        "stroke_m": joint["stroke_m"],
        "force_n": joint["force_at_stroke_n"],
        "least_static_n": joint["least_static_friction_n"],
        "edge_hz": joint["highest_edge_hz"],
        "interfering_hz": leaves["first_interfering_hz"],
        "crossover_hz": controller["crossover_hz"],
        "margin": controller["least_modulus_margin"],
        "kp_n_per_m": controller["kp_n_per_m"],
        "ki_n_per_m_s": controller["ki_n_per_m_s"],
        "kd_n_s_per_m": controller["kd_n_s_per_m"],
        "moves": free["moves"],
        "not_at_rest": free["not_at_rest"],
        "settling_s": free["settling_95_s"],
        "locked_settling_s": locked["settling_95_s"],
    }


def hunting_adrc() -> Values:
    from friso.equations.controllers.pid import crossing_ratio

    keys = ("--set", "joint.locked=true", "--set", 'controller={kind="adrc", bandwidth="3 Hz", observer_ratio=5}')
    points = friso("boundary", "examples/thesis_rig.toml", *keys, "--x", "controller.bandwidth=0.5 Hz..15 Hz")["points"]
    edge = min(point["value"] for point in points if (point["cycle"], point["kind"]) == ("symmetric", "flip"))
    return {"edge_hz": edge, "crossing_hz": crossing_ratio(5.0) * edge}


def minutes(*arguments: str) -> float:
    """Return the CPU time [min] of a command and the processes it starts.

    Other work on the machine hardly changes it.
    """
    import resource  # Windows has none

    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    friso(*arguments)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return (after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime) / 60


QUICK: Mapping[str, Callable[[], Values]] = {
    "rig.stiffness": rig_stiffness,
    "rig.presliding": rig_presliding,
    "rig.in-position": rig_in_position,
    "rig.hunting": rig_hunting,
    "rig.frf": rig_frf,
    "frequency.delays": frequency_delays,
    "hunting.locked-rig": hunting_locked_rig,
    "hunting.limiter": hunting_limiter,
    "hunting.supercritical": hunting_supercritical,
    "hunting.adrc": hunting_adrc,
    "thesis.solver": thesis_solver,
    "thesis.other-solvers": other_solvers,
}

LONG: Mapping[str, Callable[[], Values]] = {
    "rig.constant-speed": rig_constant_speed,
    "rig.slow-cycles": rig_slow_cycles,
    "compare.thesis-rig": compare_thesis_rig,
    "design.thesis": design_thesis,
    "guideline.minutes": lambda: {"rough": minutes("guideline", "--samples", "64")},
}

BY_HAND = ("rig.loop", "identify.known-truth")
"""Entries whose command takes an hour or more, and prints a table that is read by eye."""


def renewed(entry: Entry, values: Values) -> Entry:
    """Return the entry with values computed now."""
    revision = evidence.equations().revision
    code = code_digest(entry.rests_on)
    return replace(entry, values=values, computed=date.today(), equations=revision, code=code, note="")


def old(entries: Mapping[str, Entry]) -> list[str]:
    """Return the names of entries that were computed with other equations than the stored ones."""
    revision = evidence.equations().revision
    return [name for name, entry in entries.items() if entry.equations != revision]


def older_than_code(entries: Mapping[str, Entry]) -> list[str]:
    """Return the entries' names computed with other criteria, methods or experiments."""
    return [name for name, entry in entries.items() if entry.code != code_digest(entry.rests_on)]


def written(entries: Mapping[str, Entry], equations: Equations) -> str:
    """Return the content of the evidence file."""
    lines = [HEAD, "[equations]", f"revision = {equations.revision}", f"since = {equations.since}"]
    for stage, outputs in equations.numbers.items():
        lines += ["", f"[equations.numbers.{_quoted(stage)}]"]
        lines += [f"{output} = {json.dumps(values)}" for output, values in outputs.items()]
    for name, entry in entries.items():
        lines += ["", f"[finding.{_quoted(name)}]"]
        texts = {"about": entry.about, "command": entry.command, "note": entry.note}
        lines += [f"{key} = {_quoted(text)}" for key, text in texts.items() if text]
        lines += [f"computed = {entry.computed}", f"equations = {entry.equations}"]
        if entry.rests_on:
            lines += [f"rests_on = {json.dumps(entry.rests_on)}", f"code = {_quoted(entry.code)}"]
        lines.append(f"values = {{ {', '.join(f'{key} = {_number(value)}' for key, value in entry.values.items())} }}")
        if entry.stated:
            lines.append(f"[finding.{_quoted(name)}.stated]")
            lines += [f"{_quoted(place)} = {json.dumps(phrases, ensure_ascii=False)}" for place, phrases in
                      entry.stated.items()]  # fmt: skip
    return "\n".join(lines) + "\n"


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)


def _number(value: float) -> str:
    return f"{value:.6g}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join([*QUICK, *LONG])}; or: quick")
    parser.add_argument("--equations", action="store_true", help="compare the equations with the revision on file")
    arguments = parser.parse_args()
    entries, equations = dict(evidence.findings_on_file()), evidence.equations()
    if arguments.equations and (changed := differ(equations.numbers)):
        print("The equations have changed:", *changed, sep="\n  ")
        equations = Equations(equations.revision + 1, date.today(), reference_numbers())
        FILE.write_text(written(entries, equations), encoding="utf-8")
    names = [*QUICK] if arguments.names == ["quick"] else arguments.names
    if by_hand := sorted({*names} - {*QUICK, *LONG}):
        parser.error(
            f"{', '.join(by_hand)}: expected {', '.join([*QUICK, *LONG])}; {', '.join(BY_HAND)} are kept by hand"
        )
    for name in names:
        before, entries[name] = entries[name], renewed(entries[name], {**QUICK, **LONG}[name]())
        FILE.write_text(written(entries, equations), encoding="utf-8")
        changed = [
            key for key, value in entries[name].values.items() if _number(value) != _number(before.values.get(key, NAN))
        ]
        print(f"{name}: {f'changed: {changed}; see {[*before.stated]}' if changed else 'as before'}", flush=True)
    marks = dict.fromkeys(older_than_code(entries), "code") | dict.fromkeys(old(entries), "equations")
    rows = [[name, str(entry.computed), marks.get(name, ""), entry.command] for name, entry in entries.items()]
    print_table(("finding", "computed", "older than", "command"), rows)


if __name__ == "__main__":
    main()
