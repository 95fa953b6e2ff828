"""Controllers that leave friso: every target is compiled or executed, and reproduces friso's run as built."""

import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import own_controller  # noqa: F401  (registers "pi-d")
import pytest
import structured_text
import sympy as sp
from inside import friso_inside
from markdown_it import MarkdownIt
from target_stages import CONTROLLERS, EXAMPLES, MACHINES, stage_of

import friso
from friso.drives.program import Program
from friso.drives.target import TARGETS, CodeTarget, Parcel
from friso.errors import InputError
from friso.frequency.loops import RATED, STAGE, controller_over_period, samples_controller
from friso.questions.export.parcel import packed, verdict_line
from friso.stage import Stage
from friso.virtual_rig.run import as_built_keys
from friso.virtual_rig.verdict import Built

STRICT = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-Wdouble-promotion", "-O1", "-fsanitize=undefined")
TRAPS = {"gcc": "-fsanitize-undefined-trap-on-error", "clang": "-fsanitize-trap=undefined"}
COMPILERS = [name for name in TRAPS if shutil.which(name)]
needs_compiler = pytest.mark.skipif(not COMPILERS, reason="no C compiler (gcc, clang) is installed")
SHORT, LONG = 1500, 100_000
SETTINGS: list[dict[str, Any]] = [
    {"controller.error_deadband": "2 um"},
    {"controller.integral_deadband": "2 um", "controller.integral_deadband_exit": "5 um"},
    {"controller.integral_reset": True},
    {"controller.integral_leak": "0.1 Hz"},
    {"controller.integral_limit": "1 N"},
    {"controller.standstill_window": "20 um", "controller.standstill_factor": 2.0},
    {"controller.stiction_push": "0.5 N", "controller.stiction_push_window": "2 um"},
    {"controller.dither_amplitude": "1 N", "controller.dither_frequency": "200 Hz"},
    {"controller.filters": [{"kind": "low_pass", "frequency": "900 Hz", "discretisation": "prewarped"}]},
    {"drive.integral_discretisation": "forward_euler", "drive.filter_discretisation": "backward_euler"},
    {"drive.integrator_deadband": "1 um", "drive.integrator_reset": True, "drive.feedforward_coulomb": "1 N"},
]
PAIRS = [(control, machine) for control in CONTROLLERS for machine in MACHINES]


@cache
def parcel_of(control: str, machine: str, samples: int = SHORT) -> Parcel:
    return packed(stage_of(control, machine), TARGETS["c"], "axis", {}, samples)


def written(folder: Path, target: str, parcel: Parcel) -> Path:
    folder.mkdir(exist_ok=True)
    for name, content in TARGETS[target].files(parcel).items():
        (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    return folder


def built(folder: Path, compiler: str, main: str = "axis_test.c", *options: str) -> Path:
    """Compile the controller in a folder with a main program, with every warning an error."""
    command = [compiler, *STRICT, TRAPS[compiler], *options, "axis.c", main, "-lm", "-o", "run"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return folder / "run"


def ran(folder: Path, *command: Any) -> str:
    done = subprocess.run([*map(str, command)], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.cases(first=3)
@needs_compiler
@pytest.mark.parametrize(("control", "machine"), PAIRS)
def test_c_reproduces_the_run(tmp_path: Path, control: str, machine: str) -> None:
    """Both compilers, without a warning; in double precision to rounding, in single to the bound that it states."""
    folder = written(tmp_path / "c", "c", parcel_of(control, machine))
    for compiler in COMPILERS:
        for precision in ((), ("-DAXIS_SINGLE",)):
            assert f"{SHORT} samples" in ran(
                folder, built(folder, compiler, "axis_test.c", *precision), "axis_vector.csv"
            )


def block_of(parcel: Parcel) -> structured_text.Unit:
    return structured_text.parsed(TARGETS["st"].files(parcel)["FB_axis.st"])


@pytest.mark.cases(first=3)
@pytest.mark.parametrize(("control", "machine"), PAIRS)
def test_structured_text_reproduces_the_run(control: str, machine: str) -> None:
    """The program of the test, executed by an interpreter, passes; and TwinCAT's file holds the text of both."""
    parcel = parcel_of(control, machine)
    files = TARGETS["st"].files(parcel)
    program = structured_text.parsed(files["PRG_axis_test.st"], FB_axis=block_of(parcel))
    own = program.instance()
    for _ in range(len(own["expected_at"]) + 1):
        program.run(own)
    assert own["passed"]
    assert own["controller"]["dropped"] == 0
    for name in ("FB_axis", "PRG_axis_test"):
        pou = ElementTree.fromstring(files[f"{name}.TcPOU"].encode())
        declaration, body = (pou.findtext(f".//{place}") for place in ("Declaration", "Implementation/ST"))
        assert files[f"{name}.st"].startswith(f"{declaration}\n{body}")


@pytest.mark.cases(first=3)
@pytest.mark.parametrize(("control", "machine"), PAIRS)
def test_difference_equations_reproduce_the_run(tmp_path: Path, control: str, machine: str) -> None:
    folder = written(tmp_path / "d", "difference", parcel_of(control, machine))
    assert f"{SHORT} samples" in ran(folder, sys.executable, "axis_test.py")


@pytest.mark.cases(first=1)
@pytest.mark.parametrize("settings", SETTINGS)
def test_settings_against_friction_leave_friso(settings: dict[str, Any]) -> None:
    """Dead zones, gains at standstill, pushes, dither and the rest are in the code, which is compared with the run."""
    stage = stage_of("van_dijk_notch", "rigid_lugre").replace(settings)
    parcel = packed(stage, TARGETS["st"], "axis", {}, SHORT)
    rows = parcel.vector.table
    assert np.abs(outputs_in_text(parcel, rows)[:, 0] - np.array(rows)[1:, -1]).max() <= parcel.tolerance
    assert parcel.program.steps != parcel_of("van_dijk_notch", "rigid_lugre").program.steps


@pytest.mark.slow
def test_windows_in_a_position_loop_leave_friso() -> None:
    """They act at the samples of the slower loop, with its integral and with all that pauses or empties it."""
    own = {"windows_in_position_loop": True, "position_integral_time": "100 ms", "freeze_window": "1 um"}
    own |= {"freeze_window_exit": "5 um", "freeze_window_time": "5 ms", "standstill_window": "20 um"}
    own |= {"standstill_factor": 0.5, "integral_deadband": "2 um", "integral_rests_in_moves": True}
    changes = {f"controller.{key}": value for key, value in own.items()}
    parcel = packed(stage_of("cascade", "isolator").replace(changes), TARGETS["st"], "axis", {}, SHORT)
    rows = parcel.vector.table
    assert np.abs(outputs_in_text(parcel, rows)[:, 0] - np.array(rows)[1:, -1]).max() <= parcel.tolerance


@pytest.mark.slow
def test_every_kind_of_stage_leaves_friso() -> None:
    """Every controller that the tests know, and every example, is written and reproduces its run in structured text."""
    from variants import VARIANTS

    own = {"kind": "pi-d", "bandwidth": "6 Hz", "mass": "1.7 kg"}  # of tests/own_controller.py
    stages = {**VARIANTS, "own": stage_of("adrc", "gms").replace({"controller": own})}
    stages |= {path.stem: friso.load(path) for path in EXAMPLES.glob("controllers/*.toml")}
    count = 0
    for name, stage in stages.items():
        if "controller.kind" in stage.flat():
            parcel = packed(stage, TARGETS["c"], "axis", {}, 300)
            rows = parcel.vector.table
            off = np.abs(outputs_in_text(parcel, rows)[:, 0] - np.array(rows)[1:, -1]).max()
            assert off <= parcel.tolerance, name
            count += all(TARGETS[target].files(parcel) for target in TARGETS)
    assert count > 40


@pytest.mark.slow
@pytest.mark.parametrize("control", CONTROLLERS)
def test_a_hundred_thousand_samples(tmp_path: Path, control: str) -> None:
    """Over a hundred thousand samples, all targets stay within the bounds that they state for a few thousand."""
    parcel = parcel_of(control, "isolator", LONG)
    ran(written(tmp_path / "d", "difference", parcel), sys.executable, "axis_test.py")
    block, worst = block_of(parcel), 0.0
    own, inputs = block.instance(), parcel.inputs
    start, *rows = parcel.vector.table
    block.run(own, Enable=True, Manual=start[-1], **dict(zip(inputs, start, strict=False)))
    for row in rows:
        block.run(own, **dict(zip(inputs, row, strict=False)))
        worst = max(worst, abs(own["output"] - row[-1]))
    assert len(rows) == LONG
    assert worst <= parcel.tolerance
    folder = written(tmp_path / "c", "c", parcel)
    for compiler in COMPILERS[:1]:
        for precision in ((), ("-DAXIS_SINGLE",)):
            ran(folder, built(folder, compiler, "axis_test.c", *precision), "axis_vector.csv")


_LOOP = """
#include "axis.h"
#include <stdio.h>
#include <stdlib.h>
int main(void)
{
    axis_parameters parameters; axis_state state; char line[4096]; int begun = 0, k;
    axis_defaults(&parameters);
    while (fgets(line, sizeof line, stdin) != NULL) {
        double row[COUNT]; char *place = line;
        for (k = 0; k < COUNT; k++) row[k] = strtod(place, &place);
        if (!begun) axis_init(&state, &parameters, ROW, row[COUNT - 1]);
        else {
            double output = (double)axis_step(&state, REALS);
            printf("%.17g %lu\\n", output, state.dropped);
        }
        begun = 1;
    }
    return 0;
}
"""


def outputs_in_c(folder: Path, parcel: Parcel, rows: list[list[float]], compiler: str) -> np.ndarray:
    """Return outputs and counts of dropped samples, (n, 2), of the code in C for rows of inputs; the first begins."""
    written(folder, "c", parcel)
    places = range(len(parcel.inputs))
    text = _LOOP.replace("ROW", ", ".join(f"row[{k}]" for k in places))
    text = text.replace("REALS", ", ".join(f"(axis_real)row[{k}]" for k in places)).replace(
        "COUNT", str(len(places) + 1)
    )
    (folder / "loop.c").write_text(text)
    lines = "\n".join(" ".join(map(repr, row)) for row in rows)
    done = subprocess.run([built(folder, compiler, "loop.c")], input=lines, capture_output=True, text=True, check=True)
    return np.array([[float(one) for one in line.split()] for line in done.stdout.splitlines()])


def outputs_in_text(parcel: Parcel, rows: list[list[float]]) -> np.ndarray:
    """Return outputs and counts of dropped samples, (n, 2), of structured text for rows of inputs."""
    block, outputs = block_of(parcel), []
    own = block.instance()
    for k, row in enumerate(rows):
        block.run(own, Enable=True, Manual=rows[0][-1], **dict(zip(parcel.inputs, row, strict=False)))
        outputs += [[own["output"], own["dropped"]]] if k else []
    return np.array(outputs)


def extreme_rows(parcel: Parcel, seed: int) -> list[list[float]]:
    """Rows of inputs with values that are not finite, huge, denormal, and with jumps of an encoder that wraps."""
    rng = np.random.default_rng(seed)
    width = len(parcel.inputs)
    odd = [np.nan, np.inf, -np.inf, 1e300, -1e300, 1.7e308, 5e-324, -0.0, 2**32 * 5e-9, -(2**31) * 5e-9]
    rows = rng.normal(0, 1e-3, (400, width + 1))
    where = rng.random((400, width)) < 0.05
    rows[:, :width][where] = rng.choice(odd, where.sum())
    rows[0] = 0.0
    return rows.tolist()


@pytest.mark.cases(first=3)
@needs_compiler
@pytest.mark.parametrize("control", CONTROLLERS)
def test_extreme_inputs(tmp_path: Path, control: str) -> None:
    """Nothing undefined happens, outputs stay finite and within the limit, and all targets drop the same samples."""
    parcel = parcel_of(control, "rigid_lugre")
    limit = float(CONTROLLERS[control]["controller"]["force_limit"].split()[0])
    for seed in range(3):
        rows = extreme_rows(parcel, seed)
        text = outputs_in_text(parcel, rows)
        assert np.abs(text[:, 0]).max() <= limit
        assert 0 < text[-1, 1] < len(rows)
        for compiler in COMPILERS:
            code = outputs_in_c(tmp_path / compiler, parcel, rows, compiler)
            np.testing.assert_array_equal(code[:, 1], text[:, 1])
            assert np.abs(code[:, 0]).max() <= limit


@needs_compiler
def test_a_sample_that_is_not_finite_changes_nothing(tmp_path: Path) -> None:
    parcel = parcel_of("van_dijk_notch", "rigid_lugre")
    good = [1e-5, 0.0, 0.0, 0.0, 0.0]
    rows = [[0.0] * 5, *[good] * 3, [1e-5, 0.0, 0.0, float("nan"), 0.0], *[good] * 3]
    without = [*rows[:4], *rows[5:]]
    for outputs in (outputs_in_text, lambda p, r: outputs_in_c(tmp_path / "c", p, r, COMPILERS[0])):
        whole, rest = outputs(parcel, rows), outputs(parcel, without)
        assert whole[3, 0] == whole[2, 0]
        assert whole[-1, 1] == 1
        np.testing.assert_array_equal(np.delete(whole[:, 0], 3), rest[:, 0])


def bode_response(stage: Stage, period: int) -> Callable[[np.ndarray], np.ndarray]:
    """Return the response of friso bode's controller over a period of its loops, at angles per sample.

    Position and velocity are of one encoder, so that both inputs act together.
    """
    controls = samples_controller(as_built_keys(stage), 1, period)
    names = [name for name in (STAGE, RATED) if name in controls[0].inputs]
    return lambda turns: np.sum([controller_over_period(controls, name).over(turns)[0] for name in names], axis=0)


@pytest.mark.cases(first=3)
@needs_compiler
@pytest.mark.parametrize("control", CONTROLLERS)
def test_the_response_is_that_of_bode_plots(tmp_path: Path, control: str) -> None:
    """The compiled code answers sinusoids as the controller of friso bode does, far beyond windows and schedules."""
    stage = stage_of(control, "rigid_lugre").replace(
        {"controller.force_limit": None, "controller.integral_limit": None, "controller.anti_windup": None}
        | {"controller.anti_windup_time": None, "drive.position_sample_time": None}
        if control == "cascade"
        else {"controller.force_limit": None}
    )
    parcel = packed(stage, TARGETS["c"], "axis", {}, 10)
    wanted = bode_response(stage, 1)
    time, amplitude = np.arange(12_000), 1e3
    for turn in (0.02, 0.2, 1.0, 2.5):
        rows = np.zeros((len(time) + 1, len(parcel.inputs) + 1))
        rows[1:, parcel.inputs.index("position")] = amplitude * np.cos(turn * time)
        answer = outputs_in_c(tmp_path / "c", parcel, rows.tolist(), COMPILERS[0])[:, 0]
        late = time > 6000
        basis = np.column_stack([np.cos(turn * time), -np.sin(turn * time), np.ones(len(time)), time])[late]
        real, imaginary, *_ = np.linalg.lstsq(basis, answer[late], rcond=None)[0] / amplitude
        assert real + 1j * imaginary == pytest.approx(wanted(np.array([turn]))[0, 0, 0], rel=1e-6)


@pytest.mark.parametrize("control", CONTROLLERS)
def test_the_system_of_python_control(control: str) -> None:
    """At one rate and at several, the system has dt and the response of friso bode's controller."""
    parcel = parcel_of(control, "rigid_lugre")
    count = len(parcel.linear.samples)
    system = parcel.linear.as_system()
    assert system.dt == pytest.approx(count * 125e-6)
    turns = np.array([0.01, 0.1, 0.7])
    names = ["position"] if count == 1 else [f"position_{k}" for k in range(count)]
    columns = [system.input_labels.index(name) for name in names]
    ours = np.moveaxis(system(np.exp(1j * turns * count), squeeze=False)[:, columns], -1, 0)
    theirs = bode_response(stage_of(control, "rigid_lugre"), count)(turns)
    np.testing.assert_allclose(ours, theirs, rtol=1e-6, atol=1e-6 * np.abs(ours).max())


@pytest.mark.parametrize("control", ["van_dijk_notch", "adrc", "transfer_function"])
def test_biquads_have_the_response_of_the_state_space(control: str) -> None:
    parcel = parcel_of(control, "rigid_lugre")
    linear, document = parcel.linear, json.loads(TARGETS["difference"].files(parcel)["axis.json"])
    sections = {name: np.array(rows) for name, rows in document["biquads"].items()}
    assert {"reference_position", "position"} <= sections.keys()
    z = np.exp(1j * np.array([0.01, 0.3, 2.0]))[:, None, None] ** -np.arange(3)
    for name, rows in sections.items():
        upper, lower = ((rows[:, part] * z).sum(axis=-1) for part in (slice(0, 3), slice(3, 6)))
        np.testing.assert_allclose(
            (upper / lower).prod(axis=1), linear.response(name, np.array([0.01, 0.3, 2.0])), rtol=1e-6
        )


def test_bumpless_transfer_reset_and_enable() -> None:
    """The output is that of Manual until the block begins, goes on from there, and begins anew at a reset."""
    parcel = parcel_of("van_dijk_notch", "rigid_lugre")
    block = block_of(parcel)
    own = block.instance()
    at_rest = {"reference_position": 0.1, "position": 0.1}
    assert block.run(own, Enable=False, Manual=3.0, **at_rest)["output"] == 3.0
    assert not own["active"]
    for _ in range(5):
        assert block.run(own, Enable=True, **at_rest)["output"] == pytest.approx(3.0, abs=1e-9)
    assert own["active"]
    for _ in range(20):
        block.run(own, reference_position=0.1001)
    assert own["output"] > 3.1
    assert block.run(own, Reset=True, Manual=-2.0, **at_rest)["output"] == -2.0
    assert block.run(own, Reset=False)["output"] == pytest.approx(-2.0, abs=1e-9)
    assert block.run(own, Enable=False, Manual=0.5)["output"] == 0.5


@pytest.mark.slow
def test_files_are_identical_from_the_same_input() -> None:
    """Neither the order of sets nor the time of day is in the files."""
    code = (
        "import hashlib, target_stages\n"
        "from friso.drives.target import TARGETS\n"
        "from friso.questions.export.parcel import packed\n"
        "parcel = packed(target_stages.stage_of('cascade', 'rigid_lugre'), TARGETS['c'], 'axis', {}, 100)\n"
        "contents = [one for name in TARGETS for one in TARGETS[name].files(parcel).values()]\n"
        "contents = [one if isinstance(one, bytes) else one.encode() for one in contents]\n"
        "print(hashlib.sha256(b''.join(contents)).hexdigest())"
    )
    paths = [str(EXAMPLES.parent), str(Path(__file__).parent)]
    seen = set()
    for seed in ("1", "2"):
        environment = {**os.environ, "PYTHONHASHSEED": seed, "PYTHONPATH": os.pathsep.join(paths)}
        seen.add(subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, check=True).stdout)
    assert len(seen) == 1


def check_of(verdict: str, **more: Any) -> Any:
    """An answer of friso check, as far as its words go."""
    hunting = SimpleNamespace(certain=more.pop("certain", True), reason=more.pop("reason", ""))
    case = SimpleNamespace(judgement=SimpleNamespace(hunting=hunting), verdict=verdict)
    stage = stage_of("adrc", "rigid_lugre")
    answer = {"result": {"given": case}, "verdict": verdict, "stage": stage, "failure": "", "varied": ()}
    return SimpleNamespace(**{**answer, "as_built": None, **more})


def as_built(verdict: Any, certain: bool) -> Built:
    one = (1.0, 1.0)
    return Built(verdict, certain, one, one, {"hunts": 1}, {}, None, None, None, None, 1.0, None)


WARNS = {"settles": False, "transient": False} | dict.fromkeys(
    ("hunts", "bistable", "undecided", "none", "failed"), True
)
RIGID = friso.load(EXAMPLES / "ball_screw_axis.toml").replace({"friction": None})


@pytest.mark.parametrize(
    ("check", "warns"),
    [
        *((check_of(verdict), warns) for verdict, warns in WARNS.items()),
        (check_of("settles", certain=False, reason="too much work"), True),
        (check_of("settles", failure="the run stopped"), True),
        (check_of("settles", stage=SimpleNamespace(states_friction=False, unknown_keys=())), True),
        (check_of("settles", stage=RIGID), False),
        (check_of("settles", as_built=as_built("hunts", True)), True),
        (check_of("settles", as_built=as_built("settles", False)), True),
        (check_of("hunts", as_built=as_built("toggles", True)), False),
    ],
)
def test_only_a_sure_verdict_leaves_without_a_warning(check: Any, warns: bool) -> None:
    assert ("WARNING" in verdict_line(check)) == warns


@pytest.mark.slow
def test_a_hunting_stage_says_so_on_the_screen_and_in_every_file(tmp_path: Path) -> None:
    stage = EXAMPLES / "thesis_rig.toml"
    words = ("--set", "joint.locked=true", "--name", "axis", "--out", "out")
    for target, endings in (("c", {".c", ".h"}), ("st", {".st", ".TcPOU"}), ("difference", {".json", ".md", ".tex"})):
        done = friso_inside(tmp_path, "export", stage, "--to", target, *words, "--overwrite")
        assert done.returncode == 0, done.stderr
        assert "WARNING: the stage hunts" in done.stdout
        for path in (tmp_path / "out").iterdir():
            if path.suffix in endings and not path.name.endswith("_test.c"):
                assert "WARNING: the stage hunts" in path.read_text("utf-8"), path


@pytest.mark.slow
def test_what_is_written_stands_in_the_header(tmp_path: Path) -> None:
    stage = EXAMPLES / "twincat_cascade.toml"
    done = friso_inside(
        tmp_path, "export", stage, "--to", "c", "--set", "motor_constant=30 N/A", "--out", "out", "--json"
    )
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    header = (tmp_path / "out" / "twincat_cascade.h").read_text("utf-8")
    digest = hashlib.sha256(friso.load(stage).to_toml().encode()).hexdigest()
    for part in (digest, friso.__version__, "Verdict: as built, the stage settles", "there_and_back", "[A]"):
        assert part in header
    assert document["output_unit"] == "A"
    assert document["sure_not_to_hunt"] is True
    rows = np.loadtxt(tmp_path / "out" / "twincat_cascade_vector.csv", delimiter=",", skiprows=1)
    assert np.abs(rows[:, -1]).max() == pytest.approx(200 / 30)


def test_a_name_of_a_stage_stays_a_text_in_every_file() -> None:
    """It ends no text and no comment, is no markup, and tells Python no encoding, whatever it is."""
    lines = ['coding: say """; raise SystemExit', "\\u12 \\N{x}", 'ends in "', "*/ int evil; /* x", "*) x (* ]]> y"]
    lines += ["<script>alert(1)</script> &amp; <a@b.c>", "[a](b) *c* __d__ `e` ~~f~~ | $g$ # h", "# i"]
    parcel = replace(parcel_of("van_dijk_notch", "rigid_lugre", 10), header=lines)
    files = TARGETS["fmu"].files(parcel)
    compile(files["axis_test.py"].encode(), "axis_test.py", "exec")
    assert all(f"# {line}\n" in files["axis_test.py"] for line in lines)
    code = TARGETS["c"].files(parcel)["axis.c"]
    assert code.count("/*") == code.count("*/")
    assert "* / int evil; / * x" in code
    code = TARGETS["st"].files(parcel)["FB_axis.TcPOU"]
    declaration = ElementTree.fromstring(code.encode()).findtext("POU/Declaration", "")
    assert declaration.count("(*") == declaration.count("*)")
    page = TARGETS["difference"].files(parcel)["axis.md"]
    shown = MarkdownIt("gfm-like", {"linkify": False}).parse(page)
    (header,) = (one.children for one in shown if one.children and "coding" in one.content)
    shown_lines = "".join("\n" if one.type.endswith("break") else one.content for one in header)
    assert shown_lines.split("\n") == lines


RIG = EXAMPLES / "thesis_rig.toml"


def test_a_stage_without_a_controller_has_none_to_export() -> None:
    stage = friso.load(RIG)
    tables = {key: value for key, value in stage.as_written().items() if key != "controller"}
    with pytest.raises(InputError, match="controller"):
        friso.export(tables, to="c")


def test_names_that_collide_are_named() -> None:
    """Case matters in C and not in structured text, and words of a language are nobody's names."""

    def program(*names: str) -> Program:
        symbols = tuple(map(sp.Symbol, names))
        given = dict.fromkeys(("inputs", "prepared", "begins", "steps"), ())
        kept = dict.fromkeys(("memories", "started", "updates"), symbols)
        return Program(**given, **kept, parameters={}, command=sp.S.Zero, period=1e-3)

    TARGETS["c"].check_names("axis", program("Rate", "rate"))
    for target, names in (("st", ("Rate", "rate")), ("c", ("a.b", "a_b")), ("st", ("mod",)), ("c", ("double",))):
        with pytest.raises(InputError, match=re.escape(names[-1])):
            TARGETS[target].check_names("axis", program(*names))


def test_one_more_target_is_one_declaration(monkeypatch: pytest.MonkeyPatch) -> None:
    """A target from elsewhere is offered, checked and written as friso's own are."""

    def files(parcel: Parcel) -> dict[str, str]:
        return {f"{parcel.name}.txt": "\n".join([*parcel.header, str(parcel.program.command)])}

    monkeypatch.setitem(TARGETS.added, "plain", (CodeTarget("plain text", files), "Plain text"))
    monkeypatch.setattr("friso.questions.export.parcel.checked_stage", lambda stage, *_, **__: check_of("settles"))
    answer = friso.export(stage_of("adrc", "rigid_lugre"), to="plain")
    assert "Verdict: the stage does not hunt" in answer.target_files["stage.txt"]
    assert answer.system.dt == pytest.approx(125e-6)


def machined(control: str, machine: str, samples: int = SHORT, **changes: Any) -> Parcel:
    """Return a controller with its machine as a plant, without noise and digits of the encoder."""
    ideal = {"drive.encoder_noise": None, "drive.encoder_resolution": None}
    stage = stage_of(control, machine).replace({**ideal, **changes})
    return packed(stage, TARGETS["c"], "axis", {}, samples, plant=True)


@pytest.mark.cases(first=2)
@needs_compiler
@pytest.mark.parametrize("machine", [*MACHINES, "more kinks than states"])
def test_a_machine_in_c_is_the_one_in_python(tmp_path: Path, machine: str) -> None:
    """Both compilers, without a warning; over hundreds of samples it follows friso's run in Python to rounding."""
    if machine in MACHINES:
        parcel = machined("cascade", machine)
    else:
        friction = friso.load(EXAMPLES / "thesis_rig_elasto_plastic.toml").as_written()["friction"]
        parcel = machined("cascade", "rigid_lugre", friction=friction)
    folder = written(tmp_path / "c", "c", parcel)
    for compiler in COMPILERS:
        command = [compiler, *STRICT, TRAPS[compiler], "axis_machine.c", "axis_machine_test.c", "-lm", "-o", "run"]
        subprocess.run(command, cwd=folder, check=True)
        assert "200 samples" in ran(folder, folder / "run", "axis_machine_vector.csv")


@pytest.mark.parametrize(("machine", "largest"), [("rigid_lugre", 1e-9), ("isolator", 2e-5), ("gms", 2e-5)])
def test_a_machine_comes_closer_to_friso_with_more_steps(machine: str, largest: float) -> None:
    """The differences that the header tells fall with the steps in a sample; impacts of a limiter magnify them."""
    parcel = machined("cascade", machine)
    one, _, many = parcel.machine.differences.values()
    assert many < largest
    assert many < one / 4
    header = TARGETS["c"].files(parcel)["axis_machine.h"]
    assert f"{many:.1e} m with 16 steps" in header


_CLOSED = """
#include "axis.h"
#include "axis_machine.h"
#include <stdio.h>
#include <stdlib.h>
int main(void)
{
    axis_parameters parameters; axis_state state; axis_machine_parameters of_machine; axis_machine machine;
    char line[4096]; int k;
    axis_defaults(&parameters); axis_machine_defaults(&of_machine);
    axis_machine_init(&machine, &of_machine, 0.0, 0.0, 4);
    for (int begun = 0; fgets(line, sizeof line, stdin) != NULL; begun = 1) {
        double row[COUNT]; char *place = line;
        for (k = 0; k < COUNT; k++) row[k] = strtod(place, &place);
        row[PLACE] = axis_machine_position(&machine);
        if (!begun) axis_init(&state, &parameters, ROW, 0.0);
        else {
            printf("%.17g\\n", row[PLACE]);
            axis_machine_step(&machine, axis_step(&state, ROW));
        }
    }
    return 0;
}
"""


def closed_loop(folder: Path, parcel: Parcel) -> np.ndarray:
    """Return the positions of machine and controller in C, which follow the reference of the parcel's run."""
    written(folder, "c", parcel)
    count = len(parcel.inputs)
    text = _CLOSED.replace("ROW", ", ".join(f"row[{k}]" for k in range(count)))
    text = text.replace("PLACE", str(parcel.inputs.index("position"))).replace("COUNT", str(count))
    (folder / "closed.c").write_text(text)
    command = [COMPILERS[0], "-std=c99", "-O2", "axis.c", "axis_machine.c", "closed.c", "-lm", "-o", "run"]
    subprocess.run(command, cwd=folder, check=True)
    lines = "\n".join(" ".join(map(repr, row[:-1])) for row in parcel.vector.table)
    done = subprocess.run([folder / "run"], input=lines, capture_output=True, text=True, check=True)
    return np.array(done.stdout.split(), float)


def swing_of(deviation: np.ndarray) -> tuple[float, float]:
    """Return peak to peak, and the period in samples, of the last half of a deviation."""
    last = deviation[len(deviation) // 2 :]
    level = (last.max() + last.min()) / 2
    rises = np.flatnonzero((last[:-1] < level) & (last[1:] >= level))
    fine = rises + (level - last[rises]) / (last[rises + 1] - last[rises])
    return float(np.ptp(last)), float(np.diff(fine).mean())


@pytest.mark.slow
@needs_compiler
def test_machine_and_controller_in_c_hunt_as_friso_s(tmp_path: Path) -> None:
    """Amplitude and period of a hunting machine, both in C, are those of friso's run as built to 1e-3."""
    parcel = machined("van_dijk_notch", "rigid_lugre", 160_000)
    ours = closed_loop(tmp_path / "c", parcel) - parcel.vector.inputs["reference_position"]
    theirs = parcel.vector.true_position - parcel.vector.inputs["reference_position"]
    assert swing_of(theirs)[0] > 1e-5
    np.testing.assert_allclose(swing_of(ours), swing_of(theirs), rtol=1e-3)


@needs_compiler
def test_machine_and_controller_in_c_settle_as_friso_s(tmp_path: Path) -> None:
    """On the isolator, both come to rest at the end of the move, within a tenth of a micrometre."""
    parcel = machined("van_dijk_notch", "isolator", 39_000)
    ours = closed_loop(tmp_path / "c", parcel) - parcel.vector.inputs["reference_position"]
    theirs = parcel.vector.true_position - parcel.vector.inputs["reference_position"]
    for deviation in (ours, theirs):
        assert np.abs(deviation[-2000:]).max() < 1e-7


def test_a_machine_along_a_rail_is_refused() -> None:
    with pytest.raises(InputError, match="alike along its travel"):
        packed(friso.load(EXAMPLES / "thesis_drive.toml"), TARGETS["c"], "axis", {}, 10, plant=True)


def test_a_stage_with_bias_and_no_integral_begins_at_rest() -> None:
    """A constant force is held by an error, with which the exported controller begins, too."""
    controller = {"kind": "cascade", "kv": "25 1/s", "kp": "90 N*s/m", "force_limit": "150 N"}
    stage = stage_of("cascade", "rigid_lugre").replace({"controller": controller, "bias": {"cart": "-8 N"}})
    parcel = packed(stage, TARGETS["c"], "axis", {}, 500)
    assert parcel.vector.start["output"] == pytest.approx(8.0)
    assert parcel.vector.output[0] == pytest.approx(8.0, abs=1.0)
