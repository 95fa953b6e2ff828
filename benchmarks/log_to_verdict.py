"""Follow drawn machines from their log to the verdict, and compare with what the machines do.

`python -m benchmarks.log_to_verdict [--machines 20] [--first 0] [--kept FILE]` draws rigid machines
(tests/machines.py), simulates a log of moves of each with noise and digits, and asks `friso identify --check` with the
machine's own controller, as a user would. Of ten machines two move one way alone, two log one move alone, one has a log
with a wrong clock, unit or sign, and five have sound logs. Truth is the check of the true machine, and, for the cure
told, of the true machine with that bandwidth. With `--kept`, results are appended to a file as they come, and not
computed again.
"""

import json
import sys
import tempfile
import time
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import friso
from benchmarks.report import each, numbered, print_table
from friso.errors import InputError
from friso.hunting.criteria import ATTRACTED
from friso.identification.logs.log import Log

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))
from machines import Machine, drawn, moves

KINDS = ("sound", "one-way", "sound", "poor", "sound", "wrong", "sound", "one-way", "sound", "poor")
"""Kind of log of machine k modulo ten."""

WRONGS = ("clock", "unit", "sign")
"""What is wrong with the logs of wrong ones, in turn."""

POOR_SECONDS = 1.1
"""Length [s] of a log that shows one move alone."""


def log_of(machine: Machine, kind: str, wrong: str) -> Log:
    """Return the log of a machine's moves, spoilt by its kind."""
    log = moves(machine)
    count = len(log.time)
    if kind == "poor":
        count = round(POOR_SECONDS / log.sample_time)
    rows = slice(0, count)
    signals = {name: values[rows] for name, values in log.signals.items()}
    clock = 2.0 if wrong == "clock" else 1.0
    if wrong == "unit":
        signals["position"] = 1e-3 * signals["position"]
        signals["reference"] = 1e-3 * signals["reference"]
    if wrong == "sign":
        signals["force"] = -signals["force"]
    return replace(log, time=clock * log.time[rows], sample_time=clock * log.sample_time, signals=signals)


def written(log: Log, path: Path) -> None:
    """Write a log as CSV with units."""
    columns = np.column_stack([log.time - log.time[0], log["reference"], log["position"], log["force"]])
    header = "t [s],reference [m],position [m],force [N]"
    np.savetxt(path, columns, delimiter=",", header=header, comments="", fmt="%.9g")


def followed(seed: int) -> dict[str, Any]:
    """Return what the answer and the truth say of a machine."""
    machine, kind = drawn(seed, False), KINDS[seed % len(KINDS)]
    wrong = WRONGS[seed // len(KINDS) % len(WRONGS)] if kind == "wrong" else ""
    log = log_of(machine, kind, wrong)
    if kind == "one-way":
        log = forward_alone(machine)
    truth = friso.check(machine.truth)
    case = truth["given"]
    result: dict[str, Any] = {"seed": seed, "kind": kind + (f": {wrong}" if wrong else "")}
    result["true"] = {
        "attracted": case.verdict in ATTRACTED,
        "verdict": case.verdict,
        "certain": case.judgement.hunting.certain,
        "amplitude": case.judgement.swing.amplitude if case.judgement.swing else None,
        "period": case.judgement.swing.period if case.judgement.swing else None,
        "edge": case.judgement.margin.crossover if case.judgement.margin else None,
    }
    with tempfile.TemporaryDirectory() as folder:
        path, stage = Path(folder) / "log.csv", Path(folder) / "controller.toml"
        written(log, path)
        stage.write_text(controller_alone(machine.truth))
        started = time.process_time()
        try:
            answer = friso.identify(path, stage=stage, check=True)
        except InputError as error:
            return result | {"asked": f"{error.key}: {error.actual}", "seconds": time.process_time() - started}
    result["seconds"] = time.process_time() - started
    result["doubts"] = list(answer.result.doubts)
    if answer.checked is None:
        return result | {"asked": "no stage"}
    checked = answer.checked
    case_checked = checked["given"]
    draws = checked.draws
    result["headline"] = checked.sentences()[0]
    result["condition"] = checked.condition
    result["sure"] = bool(case_checked.judgement.hunting.certain and not checked.condition)
    result["attracted"] = case_checked.verdict in ATTRACTED
    if draws is not None:
        document = checked.document()["cases"]["given"]["draws"]
        result["draws"] = {key: document[key] for key in ("amplitude_m", "period_s", "edge_hz", "cure_hz", "split")}
        if document["cure_hz"]:
            cured = friso.check(machine.truth.with_numbers({"controller.crossover": document["cure_hz"][0]}))
            result["cured"] = cured["given"].verdict not in ATTRACTED
    return result


def forward_alone(machine: Machine) -> Log:
    """Return a log of moves that all go forward."""
    flat = machine.flat
    top, ramp = flat["motion.acceleration"] * flat["motion.acceleration_time"], flat["motion.acceleration_time"]
    step = machine.sample_time / 4
    instants = np.arange(round(8.0 / step)) * step
    velocity = np.zeros(len(instants))
    for start, share in ((0.2, 1.0), (1.4, 0.5), (2.6, 0.2), (4.2, 1.0), (5.4, 0.05)):
        corners = start + np.array([0.0, ramp, ramp + 0.3, 2 * ramp + 0.3])
        velocity += np.interp(instants, corners, [0.0, share * top, share * top, 0.0])
    return machine.followed("moves", np.cumsum(velocity) * step)


def controller_alone(stage: friso.Stage) -> str:
    """Return a stage file with the controller alone, which knows the mass that it was tuned for."""
    mass = sum(value for name, value in stage.masses if value is not None)
    lines = ["[controller]", 'kind = "pid"', f'crossover = "{stage.flat()["controller.crossover"]} Hz"']
    return "\n".join([*lines, "alpha = 0.1", "beta = 2", f'tuned_mass = "{float(mass)} kg"', ""])


def table(results: Iterable[Mapping[str, Any]]) -> None:
    """Print how many answers are sure, right and within their ranges, by kind of log."""
    rows = []
    results = list(results)
    for kind in sorted({one["kind"] for one in results}):
        some = [one for one in results if one["kind"] == kind]
        answered = [one for one in some if "asked" not in one]
        sure = [one for one in answered if one["sure"]]
        wrong = [one for one in sure if one["attracted"] != one["true"]["attracted"]]
        held = {}
        for name, key in (("amplitude", "amplitude_m"), ("period", "period_s"), ("edge", "edge_hz")):
            pairs = [(one["draws"][key], one["true"][name]) for one in answered if "draws" in one]
            pairs = [(ends, value) for ends, value in pairs if ends and value]
            inside = sum(ends[0] * 0.99 <= value <= ends[1] * 1.01 for ends, value in pairs)
            held[name] = f"{inside} of {len(pairs)}"
        cures = [one["cured"] for one in answered if "cured" in one]
        cells = [kind, len(some), len(some) - len(answered), len(sure), len(wrong), *held.values()]
        rows.append([*map(str, cells), f"{sum(cures)} of {len(cures)}"])
    columns = ["log", "machines", "asked", "sure", "sure and wrong", "amplitude", "period", "edge", "cure holds"]
    print_table(columns, rows)


def main() -> None:
    """Follow the machines, and print the table."""
    options, results = numbered(__doc__, 20).parse_args(), []
    tasks = [(seed,) for seed in range(options.first, options.first + options.machines)]
    for _, one in each(tasks, lambda task: followed(int(task[0])), options.kept):
        print(json.dumps(one, default=float), flush=True)
        results.append(one)
    table(results)


if __name__ == "__main__":
    main()
