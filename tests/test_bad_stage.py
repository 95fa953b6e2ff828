"""Stage files that are wrong, as a table: each ends in one InputError with key, given, expected, example."""

from pathlib import Path

import pytest
from refusals import refused

import friso.equations.friction  # noqa: F401  the friction laws register themselves
from friso.stage import Stage, load, loads, parse_set
from friso.stage.tables import Masses

RIG = (Path(__file__).parents[1] / "examples" / "thesis_rig.toml").read_text(encoding="utf-8")
GAINS = 'kind = "pid"\nkp = "3 N/m"\nki = "4 N/(m*s)"\nkd = "6 N*s/m"'
TABLE_OF_GAINS = RIG[: RIG.index("[controller]")] + "[controller]\n{}\n\n" + RIG[RIG.index("[motion]") :]


CLAMPED = 'kind = "pid"\nanti_windup = "clamp"'
LIMITED = 'kind = "pid"\nforce_limit = "9 N"\nanti_windup = "back_calculation"'
TIMED = 'kind = "pid"\nforce_limit = "9 N"\nanti_windup_time = "50 ms"'
RULES = 'kind = "pid"\ncrossover = "8 Hz"\nalpha = 0.1\nbeta = 2\nderivative_on = "error"'
TIMES = "motion.acceleration_time, motion.return_at"
THERE = 'kind = "there_and_back"'


def refuses(text: str, key: str, words: str) -> None:
    with refused(key) as caught:
        loads(text, origin="rig.toml")
    assert words in str(caught.value)


def edited(old: str, new: str) -> str:
    assert RIG.count(old) == 1, old
    return RIG.replace(old, new)


STIFFNESS = 'stiffness = "2.4 N/mm"'


@pytest.mark.cases(first=9)
@pytest.mark.parametrize(
    ("value", "shown"),
    [
        ("2400", "2400 (a bare number without a unit)"),
        ("nan", "nan (a bare number without a unit)"),
        ('"2.4"', '"2.4" (its unit is missing)'),
        ('"N/mm"', '"N/mm" (does not begin with a number)'),
        ('"  "', '"  " (empty)'),
        ('"2.4 N"', '"2.4 N" (N is not convertible to N/m)'),
        ('"2.4 degC"', '"2.4 degC" (degC is not convertible to N/m)'),
        ('"2.4 N/m/rad"', '"2.4 N/m/rad" (N/m/rad is not convertible to N/m)'),
        ('"2.4 flurbs/mm"', '"2.4 flurbs/mm" ("flurbs/mm" is not a known unit)'),
        ('"2.4 n/MM"', '"2.4 n/MM" ("n/MM" is not a known unit; N/mm?)'),
        ('"0 N/mm"', '"0 N/mm"'),
        ('"nan N/mm"', '"nan N/mm" (not a finite number)'),
        ('"-Infinity N/mm"', '"-Infinity N/mm" (not a finite number)'),
        ('"1e307 N/mm"', '"1e307 N/mm" (too large: beyond 1e30 in SI)'),
        ('"1e-400 N/mm"', '"1e-400 N/mm" (too small: below 1e-30 in SI)'),
        ('"1e-320 N/Mm"', '"1e-320 N/Mm" (too small: below 1e-30 in SI)'),
        ('"2,4 N/mm"', '"2,4 N/mm" (a decimal comma; use a point)'),
        ('"−2.4 N/mm"', '"−2.4 N/mm" (a typographic minus sign; use -)'),
        ('"2_400 N/m"', '"2_400 N/m" ("_400 N/m" is not a unit)'),
        ('"٣ N/m"', '"٣ N/m" (does not begin with a number)'),
        ('"1 N/m + 1 N/m"', '"1 N/m + 1 N/m" ("N/m + 1 N/m" is not a unit)'),
        ('"1 m^(9^9^9^9)"', '"1 m^(9^9^9^9)" ("m^(9^9^9^9)" is not a unit)'),
        ('"1 m^9^9^9^9"', '"1 m^9^9^9^9" ("m^9^9^9^9" is not a unit)'),
        ("\"1 __import__('os')\"", "\"1 __import__('os')\" (\"__import__('os')\" is not a unit)"),
        ('"1 (N/m"', '"1 (N/m" ("(N/m" is not a unit)'),
        (f'"1{"0" * 5000} N/m"', f'"1{"0" * 55}... (too long)'),
        ("true", "true (not a text)"),
        ('["2.4 N/mm"]', "an array (not a text)"),
        ('{value = 2.4, unit = "N/mm"}', "a table (not a text)"),
        ("2026-01-01", "2026-01-01 (a date) (not a text)"),
    ],
    ids=lambda text: text[:40],
)
def test_values(value: str, shown: str) -> None:
    with refused("joint.stiffness") as caught:
        loads(edited(STIFFNESS, f"stiffness = {value}"), origin="rig.toml")
    assert (caught.value.origin, caught.value.actual, caught.value.example) == ("rig.toml", shown, STIFFNESS)
    assert {"N/m,", "greater"} <= {*caught.value.expected.split()}


@pytest.mark.cases(first=30)
@pytest.mark.parametrize(
    ("old", "new", "key", "words"),
    [
        ('"8 Hz"', "8", "controller.crossover", "bare number"),
        ('"8 Hz"', '"8 1/s"', "controller.crossover", "could mean Hz or rad/s"),
        ('"8 Hz"', '"8 Bq"', "controller.crossover", "not a frequency"),
        ('"8 Hz"', '"8 rad"', "controller.crossover", "not a frequency"),
        ("alpha = 0.1", "alpha = 0", "controller.alpha", "between 0 and 1"),
        ("alpha = 0.1", "alpha = 1", "controller.alpha", "between 0 and 1"),
        ("alpha = 0.1", "alpha = nan", "controller.alpha", "between 0 and 1"),
        ("alpha = 0.1", 'alpha = "0.1"', "controller.alpha", "a bare number"),
        ("alpha = 0.1", "alpha = true", "controller.alpha", "a bare number"),
        ("alpha = 0.1", "", "controller.alpha", "nothing"),
        ("beta = 2", "beta = 0.99", "controller.beta", "1 or greater"),
        ("beta = 2", "beta = inf", "controller.beta", "1 or greater"),
        ("beta = 2", f"beta = 1{'0' * 400}", "controller.beta", "a huge integer"),
        ("damping_ratio = 0.01", "damping_ratio = -0.01", "parasitic.damping_ratio", "0 or greater"),
        ('"1.2 kg"', '"0 kg"', "masses.cart", "greater than 0"),
        ('cart  = "1.2 kg"', "", "masses", "both masses"),
        ('name = "Thesis rig"', "name = 3", "name", "a text in quotes"),
        ("locked = false", 'locked = "no"', "joint.locked", "true or false"),
        ("locked = false", "locked = 0", "joint.locked", "true or false"),
        ('kind = "pid"', 'kind = "PID"', "controller.kind", '"adrc", "cascade", "pid"'),
        ('kind = "pid"', "", "controller.kind", "nothing"),
        ('kind = "pid"', CLAMPED, "controller.anti_windup", "force_limit"),
        ('kind = "pid"', LIMITED, "controller.anti_windup", "time in which"),
        ('kind = "pid"', TIMED, "controller.anti_windup_time", "no"),
        ('kind = "pid"', 'kind = "pid"\nforce_limit = "0 N"', "controller.force_limit", "greater than 0"),
        (THERE, 'kind = "there and back"', "motion.kind", '"profile", "ramp"'),
        (THERE, "", "motion.kind", "nothing"),
        (THERE, "kind = []", "motion.kind", "an array"),
        ('model = "lugre"', 'model = "lugree"', "friction.model", 'one of "dahl"'),
        ("[masses]", "[[masses]]", "masses", "a table of keys"),
        ('duration = "20 s"', "", "motion.duration", "nothing"),
        ('stroke = "1 mm"', "", "joint.stroke", "locked = true"),
        ('stroke = "1 mm"', 'strokes = "1 mm"', "joint.strokes", "did you mean stroke?"),
        ("[motion]", "[Motion]", "Motion", "did you mean motion?"),
        ('return_at = "5 s"', 'velocity = "1 m/s"', "motion.velocity", "an unknown key"),
        ('coulomb = "1 N"', 'coulomb = "3.1 N"', "friction.coulomb, friction.static", "no larger"),
        ('mass = "0.25 kg"', 'mass = "500 g"', "parasitic.mass, masses.stage", "smaller than the stage mass"),
        ('duration = "20 s"', 'duration = "5.05 s"', f"{TIMES}, motion.duration", "finished within the duration"),
        ('return_at = "5 s"', 'return_at = "59 ms"', TIMES, "finished before return_at"),
        ("beta = 2", 'beta = 2\nkp = "3 N/m"', "controller", "(van Dijk's rules) together with kp (gains)"),
        ("beta = 2", 'beta = 2\ntau = "1 ms"', "controller", "one form, not both"),
    ],
    ids=lambda item: item[:30],
)
def test_keys(old: str, new: str, key: str, words: str) -> None:
    refuses(edited(old, new), key, words)


@pytest.mark.parametrize(
    ("controller", "key", "words"),
    [
        (GAINS, "controller.derivative_on, controller.kd, controller.tau", "measurement"),
        ('kind = "pid"', "controller", "neither crossover nor any of kp, ki, kd"),
        ('kind = "pid"\ntau = "1 ms"', "controller", "neither crossover nor any of kp, ki, kd"),
        (GAINS.replace("3 N/m", "-3 N/m"), "controller.kp", "0 or greater"),
        ('kind = "pid"\nkpp = "3 N/m"', "controller", "neither crossover nor any of kp"),
        (f'{GAINS}\nderivative_on = "velocity"', "controller.derivative_on", '"error", "measurement"'),
        (RULES, "controller", "(van Dijk's rules) together with derivative_on (gains)"),
    ],
)
def test_gains(controller: str, key: str, words: str) -> None:
    refuses(TABLE_OF_GAINS.replace("{}", controller), key, words)


@pytest.mark.parametrize("controller", [f'{GAINS}\ntau = "1 ms"', f'{GAINS}\nderivative_on = "measurement"'])
def test_gains_that_are_right(controller: str) -> None:
    assert loads(TABLE_OF_GAINS.replace("{}", controller)).flat()["controller.kd"] == 6.0


@pytest.mark.parametrize("table", ["masses", "controller", "motion"])
def test_missing_table(table: str) -> None:
    start = RIG.index(f"[{table}]")
    end = RIG.find("\n[", start)
    refuses(RIG[:start] + (RIG[end:] if end > 0 else ""), table, f"[{table}]")


def test_tables_that_need_something() -> None:
    refuses(RIG.replace('cart  = "1.2 kg"', "").replace('stage = "0.5 kg"', ""), "masses", "mass")
    start, end = RIG.index("\n[joint]"), RIG.index("\n[parasitic]")
    refuses(RIG[:start] + RIG[end:], "parasitic", "[joint]")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "an empty file"),
        (b" \r\n\t", "an empty file"),
        (b"\xef\xbb\xbf", "an empty file"),
        (b"# nothing but a comment", "masses\n  given:    nothing"),
        (b'name = "caf\xe9"', "byte 12 is not UTF-8"),
        (RIG.encode("utf-16"), "given:    UTF-16\n"),
        (b"[masses]\ncart: 1\n", "(at line 2, column 5)"),
        (b'[masses]\ncart = "1 kg"\ncart = "2 kg"\n', "(at line 3, column 14)"),
        (b'masses.cart = "1 kg"\n[masses]\nstage = "1 kg"\n', "not TOML: "),
        (b"cart = " + b"[" * 100_000, "nested too deeply"),
        (b"beta = " + b"9" * 5000, "not TOML: "),
        (b"".join(b"[a%d]\n" % k for k in range(2000)), "2000 tables"),
        (b"a = 1\n" * 30_000, "30000 lines"),
        (b"name = '\x00'", "not TOML: "),
    ],
    ids=lambda item: str(item)[:30],
)
def test_contents(content: bytes, words: str, tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    path.write_bytes(content)
    with refused() as caught:
        load(path)
    assert str(caught.value).startswith(f"{path}")
    assert words in str(caught.value)


def test_no_file_and_folder(tmp_path: Path) -> None:
    for path, words in ((tmp_path / "missing.toml", "no such file"), (tmp_path, "folder"), ("rig\0.toml", "null")):
        with refused() as caught:
            load(path)
        assert words in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "key", "words"),
    [
        ({"controller.crossover": 12}, "controller.crossover", "12 (a bare number"),
        ({"controler.crossover": "12 Hz"}, "controler", "did you mean controller?"),
        ({"controller.crossovr": None}, "controller.crossovr", "a key that the stage has"),
        ({"controller.crossover.hz": 12}, "controller.crossover.hz", "crossover is not a table"),
        ({"controller": "12 Hz"}, "controller", "a table of keys"),
        ({"joint.locked": "True"}, "joint.locked", "true or false"),
        ({"motion.kind": "ramp"}, "motion.acceleration", "one of kind, velocity"),
        ({"motion": None}, "motion", "a table [motion]"),
        ({"name": "\ud800"}, "name", "\\ud800"),
        ({"joint.stroke": "1 \udcff"}, "joint.stroke", "\\udcff"),
        ({"joint": None}, "parasitic", "but no [joint]"),
    ],
)
def test_changes(changes: dict[str, object], key: str, words: str) -> None:
    with refused(key) as caught:
        loads(RIG).replace(changes)
    assert words in str(caught.value)


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
