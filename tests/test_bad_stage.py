"""Stage files that are wrong, as a table: each ends in one InputError with key, given, expected, example."""

from pathlib import Path

import pytest
from refusals import refused

import friso.equations.friction  # noqa: F401  the friction laws register themselves
from friso.errors import InputError
from friso.stage import Stage, load, loads, parse_set
from friso.stage.tables import Masses

RIG = (Path(__file__).parents[1] / "examples" / "thesis_rig.toml").read_text(encoding="utf-8")
GAINS = 'kind = "pid"\nkp = "3 N/m"\nki = "4 N/(m*s)"\nkd = "6 N*s/m"'
TABLE_OF_GAINS = RIG[: RIG.index("[controller]")] + "[controller]\n{}\n\n" + RIG[RIG.index("[motion]") :]


def message(text: str) -> str:
    with pytest.raises(InputError) as caught:
        loads(text, origin="rig.toml")
    return str(caught.value)


def edited(old: str, new: str) -> str:
    assert RIG.count(old) == 1, old
    return RIG.replace(old, new)


NUMBER_AND_UNIT = "number and unit in quotes, convertible to N/m, greater than 0"
STIFFNESS = 'stiffness = "2.4 N/mm"'


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        ("2400", "2400 (a bare number without a unit)"),
        ("2.4e3", "2400.0 (a bare number without a unit)"),
        ("nan", "nan (a bare number without a unit)"),
        ('"2.4"', '"2.4" (its unit is missing)'),
        ('"N/mm"', '"N/mm" (does not begin with a number)'),
        ('""', '"" (empty)'),
        ('"  "', '"  " (empty)'),
        ('"stiff"', '"stiff" (does not begin with a number)'),
        ('"2.4 N"', '"2.4 N" (N is not convertible to N/m)'),
        ('"2.4 N N"', '"2.4 N N" (N N is not convertible to N/m)'),
        ('"2.4 parsecs"', '"2.4 parsecs" (parsecs is not convertible to N/m)'),
        ('"2.4 degC"', '"2.4 degC" (degC is not convertible to N/m)'),
        ('"2.4 dB"', '"2.4 dB" (dB is not convertible to N/m)'),
        ('"2.4 N/m/rad"', '"2.4 N/m/rad" (N/m/rad is not convertible to N/m)'),
        ('"2.4 flurbs/mm"', '"2.4 flurbs/mm" ("flurbs/mm" is not a known unit)'),
        ('"2.4 Ns/m"', '"2.4 Ns/m" ("Ns/m" is not a known unit)'),
        ('"2.4 n/MM"', '"2.4 n/MM" ("n/MM" is not a known unit; N/mm?)'),
        ('"-2.4 N/mm"', '"-2.4 N/mm"'),
        ('"0 N/mm"', '"0 N/mm"'),
        ('"nan N/mm"', '"nan N/mm" (not a finite number)'),
        ('"inf N/mm"', '"inf N/mm" (not a finite number)'),
        ('"-Infinity N/mm"', '"-Infinity N/mm" (not a finite number)'),
        ('"1e400 N/mm"', '"1e400 N/mm" (too large: beyond 1e30 in SI)'),
        ('"1e307 N/mm"', '"1e307 N/mm" (too large: beyond 1e30 in SI)'),
        ('"1e-400 N/mm"', '"1e-400 N/mm" (too small: below 1e-30 in SI)'),
        ('"1e-320 N/Mm"', '"1e-320 N/Mm" (too small: below 1e-30 in SI)'),
        ('"2,4 N/mm"', '"2,4 N/mm" (a decimal comma; use a point)'),
        ('"−2.4 N/mm"', '"−2.4 N/mm" (a typographic minus sign; use -)'),
        ('"2_400 N/m"', '"2_400 N/m" ("_400 N/m" is not a unit)'),
        ('"0x10 N/m"', '"0x10 N/m" ("x10 N/m" is not a known unit)'),
        ('"٣ N/m"', '"٣ N/m" (does not begin with a number)'),
        ('"3*4 N/m"', '"3*4 N/m" ("*4 N/m" is not a unit)'),
        ('"1 N/m + 1 N/m"', '"1 N/m + 1 N/m" ("N/m + 1 N/m" is not a unit)'),
        ('"(1+2j) N/m"', '"(1+2j) N/m" (does not begin with a number)'),
        ('"1+2j N/m"', '"1+2j N/m" ("+2j N/m" is not a unit)'),
        ('"1 N/m;N/m"', '"1 N/m;N/m" ("N/m;N/m" is not a unit)'),
        ('"1 m^(9^9^9^9)"', '"1 m^(9^9^9^9)" ("m^(9^9^9^9)" is not a unit)'),
        ('"1 m^9^9^9^9"', '"1 m^9^9^9^9" ("m^9^9^9^9" is not a unit)'),
        ("\"1 __import__('os')\"", "\"1 __import__('os')\" (\"__import__('os')\" is not a unit)"),
        ('"1 (N/m"', '"1 (N/m" ("(N/m" is not a unit)'),
        ('"1 N//m"', '"1 N//m" ("N//m" is not a unit)'),
        (f'"1{"0" * 5000} N/m"', f'"1{"0" * 55}... (too long)'),
        ("true", "true (not a text)"),
        ('["2.4 N/mm"]', "an array (not a text)"),
        ('{value = 2.4, unit = "N/mm"}', "a table (not a text)"),
        ("2026-01-01", "2026-01-01 (a date) (not a text)"),
    ],
    ids=lambda text: text[:40],
)
def test_values(value: str, shown: str) -> None:
    text = message(edited('stiffness = "2.4 N/mm"', f"stiffness = {value}"))
    place, *parts = text.splitlines()
    assert place == "rig.toml: joint.stiffness"
    assert [part.partition(":")[2].strip() for part in parts] == [shown, NUMBER_AND_UNIT, STIFFNESS]


FREQUENCY = "number and unit in quotes, convertible to Hz, rad/s or rpm, greater than 0"


@pytest.mark.parametrize(
    ("old", "new", "lines"),
    [
        # frequencies
        (
            '"8 Hz"',
            "8",
            (
                "controller.crossover",
                "8 (a bare number without a unit)",
                FREQUENCY,
                '= "8 Hz"',
            ),
        ),
        (
            '"8 Hz"',
            '"8 1/s"',
            ("controller.crossover", '"8 1/s" (could mean Hz or rad/s)', FREQUENCY, '= "8 Hz"'),
        ),
        (
            '"8 Hz"',
            '"8 Bq"',
            ("controller.crossover", '"8 Bq" (not a frequency)', FREQUENCY, '= "8 Hz"'),
        ),
        ('"8 Hz"', '"8 s"', ("controller.crossover", '"8 s" (not a frequency)', FREQUENCY, '= "8 Hz"')),
        ('"8 Hz"', '"8 rad"', ("controller.crossover", '"8 rad" (not a frequency)', FREQUENCY, '= "8 Hz"')),
        # bare numbers
        (
            "alpha = 0.1",
            "alpha = 0",
            ("controller.alpha", "0", "between 0 and 1 (both excluded)", "alpha = 0.1"),
        ),
        (
            "alpha = 0.1",
            "alpha = 1",
            ("controller.alpha", "1", "between 0 and 1 (both excluded)", "alpha = 0.1"),
        ),
        (
            "alpha = 0.1",
            "alpha = nan",
            ("controller.alpha", "nan", "a bare number without quotes, between 0 and 1", "alpha = 0.1"),
        ),
        ("alpha = 0.1", 'alpha = "0.1"', ("controller.alpha", '"0.1"', "a bare number", "alpha = 0.1")),
        ("alpha = 0.1", "alpha = true", ("controller.alpha", "true", "a bare number", "alpha = 0.1")),
        (
            "beta = 2",
            "beta = 0.99",
            ("controller.beta", "0.99", "a bare number without quotes, 1 or greater", "beta = 2"),
        ),
        (
            "beta = 2",
            "beta = inf",
            ("controller.beta", "inf", "a bare number without quotes, 1 or greater", "beta = 2"),
        ),
        (
            "beta = 2",
            f"beta = 1{'0' * 400}",
            ("controller.beta", "a huge integer", "a bare number without quotes, 1 or greater", "beta = 2"),
        ),
        (
            "damping_ratio = 0.01",
            "damping_ratio = -0.01",
            (
                "parasitic.damping_ratio",
                "-0.01",
                "a bare number without quotes, 0 or greater",
                "damping_ratio = 0.01",
            ),
        ),
        # masses
        (
            '"1.2 kg"',
            '"0 kg"',
            ("masses.cart", '"0 kg"', "convertible to kg, greater than 0", 'cart = "1.2 kg"'),
        ),
        (
            '"1.2 kg"',
            '"-1 kg"',
            ("masses.cart", '"-1 kg"', "convertible to kg, greater than 0", 'cart = "1.2 kg"'),
        ),
        (
            'cart  = "1.2 kg"',
            "",
            ("masses", "a [joint], but a single mass", "both masses", 'cart = "1.2 kg"'),
        ),
        # texts, booleans, choices, tables
        ('name = "Thesis rig"', "name = 3", ("name", "3", "a text in quotes", 'name = "Thesis rig"')),
        ("locked = false", 'locked = "no"', ("joint.locked", '"no"', "true or false", "locked = true")),
        ("locked = false", "locked = 0", ("joint.locked", "0", "true or false", "locked = true")),
        (
            'kind = "pid"',
            'kind = "PID"',
            ("controller.kind", '"PID"', 'one of "adrc", "cascade", "pid"', 'kind = "pid"'),
        ),
        ('kind = "pid"', "", ("controller.kind", "nothing", 'one of "adrc", "cascade", "pid"', 'kind = "adrc"')),
        (
            'kind = "pid"',
            'kind = "pid"\nanti_windup = "clamp"',
            ("controller.anti_windup", '"clamp"', "a force_limit as well", 'force_limit = "200 N"'),
        ),
        (
            'kind = "pid"',
            'kind = "pid"\nforce_limit = "9 N"\nanti_windup = "back_calculation"',
            ("controller.anti_windup", '"back_calculation"', "time in which", 'anti_windup_time = "50 ms"'),
        ),
        (
            'kind = "pid"',
            'kind = "pid"\nforce_limit = "9 N"\nanti_windup_time = "50 ms"',
            ("controller.anti_windup_time", "no anti_windup", "belongs", 'anti_windup = "back_calculation"'),
        ),
        (
            'kind = "pid"',
            'kind = "pid"\nforce_limit = "0 N"',
            ("controller.force_limit", '"0 N"', "convertible to N, greater than 0", 'force_limit = "200 N"'),
        ),
        (
            'kind = "there_and_back"',
            'kind = "there and back"',
            (
                "motion.kind",
                '"there and back"',
                '"profile", "ramp", "recorded", "release", "sine", "step", "there_and_back"',
                'kind = "there',
            ),
        ),
        (
            'kind = "there_and_back"',
            "",
            ("motion.kind", "nothing", 'one of "chirp", "hold"', 'kind = "chirp"'),
        ),
        (
            'kind = "there_and_back"',
            "kind = []",
            ("motion.kind", "an array", 'one of "chirp"', "kind ="),
        ),
        (
            'model = "lugre"',
            'model = "lugree"',
            ("friction.model", '"lugree"', 'one of "dahl"', 'model = "lugre"'),
        ),
        ("[masses]", "[[masses]]", ("masses", "an array", "a table of keys", '[masses] cart = "1.2 kg"')),
        # missing and unknown keys
        (
            'duration = "20 s"',
            "",
            ("motion.duration", "nothing", "convertible to s, greater than 0", 'duration = "20 s"'),
        ),
        (
            'stroke = "1 mm"',
            "",
            ("joint.stroke", "nothing", "only a joint with locked = true needs none", 'stroke = "1 mm"'),
        ),
        (
            'stroke = "1 mm"',
            'strokes = "1 mm"',
            (
                "joint.strokes",
                "an unknown key; did you mean stroke?",
                "one of locked, stiffness",
                'stroke = "1 mm"',
            ),
        ),
        (
            "[motion]",
            "[Motion]",
            (
                "Motion",
                "an unknown key; did you mean motion?",
                "one of name, source, note, unknown, axis, masses",
                '[motion] kind = "step"',
            ),
        ),
        (
            'return_at = "5 s"',
            'velocity = "1 m/s"',
            ("motion.velocity", "an unknown key", "one of kind, acceleration", "kind ="),
        ),
        # rules between keys
        (
            'coulomb = "1 N"',
            'coulomb = "3.1 N"',
            (
                "friction.coulomb, friction.static",
                'coulomb = "3.1 N", static = "3 N"',
                "no larger",
                'static = "3 N"',
            ),
        ),
        (
            'mass = "0.25 kg"',
            'mass = "500 g"',
            (
                "parasitic.mass, masses.stage",
                'mass = "500 g", stage = "0.5 kg"',
                "smaller than the stage mass",
                "mass",
            ),
        ),
        (
            'duration = "20 s"',
            'duration = "5.05 s"',
            (
                "motion.duration",
                'return_at = "5 s", duration = "5.05 s"',
                "finished within the duration",
                '= "20 s"',
            ),
        ),
        (
            'return_at = "5 s"',
            'return_at = "59 ms"',
            (
                "motion.return_at",
                'acceleration_time = "30 ms", return_at = "59 ms"',
                "finished before return_at",
                '"5 s"',
            ),
        ),
        # the two forms of the controller
        (
            "beta = 2",
            'beta = 2\nkp = "3 N/m"',
            (
                "controller",
                "crossover, alpha, beta, tuned_mass (van Dijk's rules) together with kp (gains)",
                "one",
                "kp",
            ),
        ),
        (
            "beta = 2",
            'beta = 2\ntau = "1 ms"',
            ("controller", "(van Dijk's rules) together with tau (gains)", "one form, not both", "crossover"),
        ),
        (
            "alpha = 0.1",
            "",
            ("controller.alpha", "nothing", "a bare number without quotes, between 0 and 1", "alpha = 0.1"),
        ),
    ],
    ids=lambda item: item if isinstance(item, str) else "",
)
def test_keys(old: str, new: str, lines: tuple[str, str, str, str]) -> None:
    head, inputs, expected, example, *also = message(edited(old, new)).split("\n")
    key, *fragments = lines
    assert all(line.startswith("  also:     ") for line in also)
    assert head.startswith("rig.toml: ")
    assert key in head
    assert inputs.startswith("  given:    ")
    assert expected.startswith("  expected: ")
    assert example.startswith("  example:  ")
    assert all(fragment in line for fragment, line in zip(fragments, (inputs, expected, example), strict=True))


@pytest.mark.parametrize(
    ("controller", "fragments"),
    [
        (
            GAINS,
            [
                "controller.derivative_on, controller.kd, controller.tau",
                'kd = "6 N*s/m", tau = "0 s"',
                "measurement",
            ],
        ),
        ('kind = "pid"', ["controller", "neither crossover nor any of kp, ki, kd", "one of the two forms"]),
        ('kind = "pid"\ntau = "1 ms"', ["neither crossover nor any of kp, ki, kd"]),
        (GAINS.replace("3 N/m", "-3 N/m"), ["controller.kp", '"-3 N/m"', "0 or greater"]),
        ('kind = "pid"\nkpp = "3 N/m"', ["controller", "neither crossover nor any of kp"]),
        (f'{GAINS}\nderivative_on = "velocity"', ["controller.derivative_on", '"velocity"', '"error", "measurement"']),
        (
            'kind = "pid"\ncrossover = "8 Hz"\nalpha = 0.1\nbeta = 2\nderivative_on = "error"',
            ["crossover, alpha, beta (van Dijk's rules) together with derivative_on (gains)", "one form, not both"],
        ),
    ],
)
def test_gains(controller: str, fragments: list[str]) -> None:
    text = message(TABLE_OF_GAINS.replace("{}", controller))
    assert all(fragment in text for fragment in fragments)


@pytest.mark.parametrize("controller", [f'{GAINS}\ntau = "1 ms"', f'{GAINS}\nderivative_on = "measurement"'])
def test_gains_that_are_right(controller: str) -> None:
    assert loads(TABLE_OF_GAINS.replace("{}", controller)).flat()["controller.kd"] == 6.0


@pytest.mark.parametrize("table", ["masses", "controller", "motion"])
def test_missing_table(table: str) -> None:
    start = RIG.index(f"[{table}]")
    end = RIG.find("\n[", start)
    text = message(RIG[:start] + (RIG[end:] if end > 0 else ""))
    place, nothing, *others = text.splitlines()
    assert (place, nothing.split()) == (f"rig.toml: {table}", ["given:", "nothing"])
    assert others[0].endswith(f"[{table}]")
    assert others[1].split()[1] == f"[{table}]"


def test_empty_masses() -> None:
    text = message(RIG.replace('cart  = "1.2 kg"', "").replace('stage = "0.5 kg"', ""))
    assert text.startswith("rig.toml: masses\n")
    wording(text)


def test_parasitic_mode_needs_a_joint() -> None:
    start, end = RIG.index("\n[joint]"), RIG.index("\n[parasitic]")
    text = message(RIG[:start] + RIG[end:])
    assert text.startswith("rig.toml: parasitic\n")
    wording(text)


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"", "an empty file"),
        (b" \r\n\t", "an empty file"),
        (b"\xef\xbb\xbf", "an empty file"),
        (b"# nothing but a comment", "masses\n  given:    nothing"),
        (b'name = "caf\xe9"', "byte 12 is not UTF-8"),
        (RIG.encode("utf-16"), "given:    UTF-16\n"),
        (b"\x89PNG\r\n\x1a\n", "byte 1 is not UTF-8"),
        (
            b"[masses]\ncart = 1.2 kg\n",
            "not TOML: Expected newline or end of document after a statement (at line 2, c",
        ),
        (b"[masses]\ncart: 1\n", "(at line 2, column 5)"),
        (
            b'[masses]\ncart = "1 kg"\ncart = "2 kg"\n',
            "not TOML: Cannot overwrite a value (at line 3, column 14)",
        ),
        (b'masses.cart = "1 kg"\n[masses]\nstage = "1 kg"\n', "not TOML: "),
        (b'masses = "1 kg"\nmasses.cart = "1 kg"\n', "not TOML: "),
        (b'cart = "1 kg', "not TOML: "),
        (b"cart = " + b"[" * 100_000, "nested too deeply"),
        (b"beta = " + b"9" * 5000, "not TOML: "),
        (b"".join(b"[a%d]\n" % k for k in range(2000)), "2000 tables"),
        (b"a = 1\n" * 30_000, "30000 lines"),
        (b"[masses]\n[masses]\n", "not TOML: Cannot declare masses twice"),
        (b"{}", "not TOML: "),
        (b"name = '\x00'", "not TOML: "),
    ],
    ids=lambda item: str(item)[:30],
)
def test_contents(content: bytes, expected: str, tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    path.write_bytes(content)
    with pytest.raises(InputError) as caught:
        load(path)
    assert str(caught.value).startswith(f"{path}")
    assert expected in str(caught.value)


def test_no_file_and_folder(tmp_path: Path) -> None:
    with pytest.raises(
        InputError, match=r"missing\.toml\n  given:    no such file or directory\n  expected: a stage f"
    ):
        load(tmp_path / "missing.toml")
    with refused():
        load(tmp_path)
    with refused():
        load("rig\0.toml")


@pytest.mark.parametrize(
    ("changes", "fragments"),
    [
        ({"controller.crossover": 12}, ["controller.crossover\n", "12 (a bare number"]),
        ({"controler.crossover": "12 Hz"}, ["controler\n", "did you mean controller?"]),
        ({"controller.crossovr": "12 Hz"}, ["controller.crossovr\n", "did you mean crossover?"]),
        (
            {"controller.crossovr": None},
            ["controller.crossovr\n", "a key to remove", "a key that the stage has"],
        ),
        ({"controller.crossover.hz": 12}, ["controller.crossover.hz\n", "crossover is not a table"]),
        ({"controller": "12 Hz"}, ["controller\n", '"12 Hz"', "a table of keys"]),
        ({"controller.tau": "1 ms"}, ["controller\n", "together with tau", "not both"]),
        ({"joint.locked": "True"}, ["joint.locked\n", '"True"', "true or false"]),
        ({"motion.kind": "ramp"}, ["motion.acceleration\n", "an unknown key", "one of kind, velocity"]),
        ({"motion": None}, ["motion\n", "nothing", "a table [motion]"]),
        ({"": "x"}, ["an unknown key", "one of name, source"]),
        ({"name": "\ud800"}, ["name\n", "\\ud800", "a text in quotes"]),
        ({"joint.stroke": "1 \udcff"}, ["joint.stroke\n", "\\udcff", "is not a unit"]),
        ({"joint": None}, ["parasitic\n", "but no [joint]"]),
    ],
)
def test_changes(changes: dict[str, object], fragments: list[str]) -> None:
    with pytest.raises(InputError) as caught:
        loads(RIG).replace(changes)
    assert all(fragment in str(caught.value) for fragment in fragments)


def test_a_controller_in_another_form_replaces_that_of_the_file() -> None:
    """For example, friso's own choice in an identified stage is replaced by the machine's gains."""
    stage = loads(RIG).replace({"controller.kp": "3 N/m", "controller.force_limit": "5 N"})
    assert stage.as_written()["controller"] == {"kind": "pid", "kp": "3 N/m", "force_limit": "5 N"}
    assert loads(RIG).replace({"controller.crossover": "9 Hz"}).flat()["controller.crossover"] == 9


@pytest.mark.parametrize("text", ["controller.crossover", "=12 Hz", "", " = 3"])
def test_set_without_key_or_value(text: str) -> None:
    with refused():
        parse_set(text)


def test_wrong_sections_from_python() -> None:
    with refused("cart"):
        Masses(cart="3 m")  # pyright: ignore[reportArgumentType]
    masses = Masses(cart="3 kg")  # pyright: ignore[reportArgumentType]
    tables = loads(RIG).as_written()
    with refused("motion"):
        Stage(**{**tables, "motion": masses})
