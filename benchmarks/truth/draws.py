"""Draw stages at random: all structures, laws and controllers.

Numbers are log-uniform over realistic ranges. A numbered stage does not depend on what else is drawn. Structures come
from a pool, each of whose members is a kernel to compile: numbers that differ by the size of the pool share one.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import count, islice
from typing import Any

import numpy as np

from friso.quantities import Quantity
from friso.stage import Stage
from friso.stage.section import numeric_fields
from friso.stage.tables import FRICTION, friction_law
from friso.studies.laws import with_friction

GRAVITY = 9.81
SPREAD = 3.0
"""Factor around its example within which an unfamiliar key is drawn."""


ELEMENTS = 4
"""Number of Maxwell-slip elements, which decides on the structure."""


@dataclass(frozen=True)
class Form:
    """Choices that decide on the structure of a stage.

    - `exponent`: None stands for any number.
    - `control`: "rules" of van Dijk, or gains with their derivative "on error", or on the measurement, "filtered" or
      "plain".
    - `windup`: what the integrator does at the force limit.
    - `bias`: the mass on which it acts.
    - `deadband`: of the error.
    - `drive`: a "transmission", with a "backlash" or none, and the side of the encoder.
    - `motor`: law of the friction at the motor.
    - `filtered`: a notch and a low-pass filter.
    - `setting`: one against friction.
    - `axis`: of the size of machine axes.
    """

    joint: str
    friction: str = "lugre"
    exponent: float | None = 2.0
    asymmetry: bool = False
    control: str = "rules"
    windup: str = ""
    parasitic: bool = False
    bias: str = ""
    deadband: bool = False
    drive: str = ""
    motor: str = ""
    filtered: bool = False
    setting: str = ""
    axis: bool = False


FORMS = (
    Form("rigid"),
    Form("free"),
    Form("locked"),
    Form("free", parasitic=True),
    Form("rigid", bias="stage"),
    Form("rigid", control="on error"),
    Form("free", exponent=None),
    Form("rigid", "stribeck"),
    Form("free", asymmetry=True),
    Form("locked", parasitic=True),
    Form("rigid", "dahl"),
    Form("free", control="on error", parasitic=True),
    Form("rigid", exponent=None, asymmetry=True, bias="cart"),
    Form("free", bias="stage"),
    Form("rigid", control="plain", windup="clamp"),
    Form("free", "stribeck", parasitic=True),
    Form("rigid", windup="back_calculation", bias="stage"),
    Form("touching", control="filtered"),
    Form("free", windup="none"),
    Form("locked", "dahl", bias="cart", parasitic=True),
    Form("free", "dahl", control="plain"),
    Form("rigid", "stribeck", exponent=None, asymmetry=True, control="filtered"),
    Form("rigid", "none", bias="stage"),
    Form("free", exponent=1.0, asymmetry=True, bias="cart", control="filtered"),
    Form("rigid", "elasto_plastic"),
    Form("free", "elasto_plastic"),
    Form("rigid", "gms"),
    Form("free", "gms"),
    Form("rigid", "rolling"),
    Form("free", "rolling"),
)
"""Structures, one for each kernel to compile, with every friction law that comes with friso."""


MACHINES = (
    Form("rigid", control="cascade", filtered=True),
    Form("rigid", control="filtered", drive="backlash at the load"),
    Form("rigid", deadband=True),
    Form("free", control="cascade"),
    Form("rigid", control="filtered", drive="transmission at the load"),
    Form("rigid", control="cascade", filtered=True, windup="clamp"),
    Form("rigid", drive="backlash at the motor"),
    Form("free", control="filtered", deadband=True),
)
"""Structures of machines, a separate series: cascades with filters, screws and belts, deadbands."""

AXES = tuple(
    replace(form, axis=True)
    for form in (
        Form("rigid", control="adrc"),
        Form("rigid", setting="leak", bias="stage"),
        Form("rigid", control="plain", setting="integral deadband"),
        Form("rigid", asymmetry=True, bias="stage", windup="clamp"),
        Form("rigid", control="on error", setting="reset"),
        Form("rigid", setting="standstill"),
        Form("rigid", control="plain", setting="push"),
        Form("rigid", setting="integral limit", bias="stage"),
        Form("free", control="adrc"),
        Form("rigid", "elasto_plastic", bias="stage", windup="back_calculation"),
        Form("rigid", "gms", control="cascade"),
        Form("rigid", "rolling", asymmetry=True, bias="stage"),
        Form("rigid", "dahl", windup="none"),
        Form("rigid", control="cascade", drive="backlash at the load", bias="stage"),
        Form("free", setting="integral deadband"),
        Form("rigid", control="cascade", setting="leak", windup="clamp"),
    )
)
"""Axes of machines: 5 to 200 kg, 3 to 100 N of friction, crossovers of 5 to 80 Hz, with settings against friction."""

DRIVES = (
    Form("rigid", control="filtered", drive="transmission at the motor", motor="lugre", axis=True),
    Form("rigid", control="cascade", drive="backlash at the load", motor="lugre", axis=True),
    Form("rigid", "none", control="filtered", drive="transmission at the load", motor="lugre", axis=True),
    Form("rigid", "dahl", control="filtered", drive="backlash at the motor", motor="stribeck", axis=True),
)
"""Axes with friction at the motor, in addition to that of the guide or alone."""

SERVOS = tuple(
    replace(form, axis=True)
    for form in (
        Form("rigid", "dwell"),
        Form("rigid", "load_dependent"),
        Form("rigid", setting="schedule"),
        Form("rigid", control="cascade", setting="inner gains"),
        Form("free", "dwell"),
        Form("rigid", "load_dependent", control="cascade"),
        Form("rigid", "dwell", setting="freeze"),
        Form("rigid", "load_dependent", setting="rest in moves"),
    )
)
"""Axes with the friction of robots' joints, and with what drives' files set at standstill."""

SERIES = {"stages": FORMS, "machines": MACHINES, "axes": AXES, "drives": DRIVES, "servos": SERVOS}

UNDER_LAWS = ("dahl", "elasto_plastic", "rolling", "gms")
"""Further series: stages with LuGre friction and van Dijk's controller alone, each under this law instead."""

LAW_FORMS = (Form("rigid"), Form("free"), Form("locked"))
LAW_ELEMENTS = {"rigid": 4, "free": 2, "locked": 6}
"""Structures of stages under a law, and the number of elements of a law with several, as each needs a kernel."""


def numbers_of(series: str, first: int, stages: int) -> list[int]:
    """Return the numbers of so many stages of a series."""
    usable = (n for n in count(first) if series not in UNDER_LAWS or FORMS[n % len(FORMS)] in LAW_FORMS)
    return [*islice(usable, stages)]


def _under(law: str, seed: int, number: int) -> Stage:
    """Return the numbered stage under a law, with a shape before sliding drawn anywhere within its ranges."""
    stage, rng, joint = draw(seed, number), np.random.default_rng([seed, number, 11]), FORMS[number % len(FORMS)].joint
    keys = dict(friction_law(law).keeping(friction_law("lugre").shown(stage.flat()), LAW_ELEMENTS[joint]))
    if law == "elasto_plastic":
        most = keys["friction.coulomb"] / keys["friction.bristle_stiffness"]
        keys["friction.breakaway_deflection"] = float(rng.uniform(0.05, 0.95)) * most
    if law == "rolling":
        keys["friction.rolling_exponent"] = float(rng.uniform(1.0, 2.5))
    if law == "gms":
        shares = rng.dirichlet(np.full(sum("share" in key for key in keys), 3.0))
        keys["friction.attraction"] *= float(np.exp(rng.uniform(-2.3, 2.3)))
        keys |= {f"friction.element_share.{n}": float(value) for n, value in enumerate(shares, 1)}
    return with_friction(stage, law, keys)


def draw(seed: int, number: int, series: str = "stages") -> Stage:
    """Return the numbered stage of a series that begins with `seed`."""
    if series in UNDER_LAWS:
        return _under(series, seed, number)
    forms = SERIES[series]
    tables = _Draw(np.random.default_rng([seed, number]), forms[number % len(forms)]).tables()
    kind = "" if forms is FORMS else f", {series}"
    return Stage(name=f"seed {seed}{kind}, number {number}", **tables)


class _Draw:
    """The tables of one stage."""

    def __init__(self, rng: np.random.Generator, form: Form) -> None:
        self.rng, self.form = rng, form
        self.cart = self.log(3e-3, 50.0)
        self.stage = self.cart * self.log(0.05, 5.0)
        self.mass = self.cart + self.stage
        self.crossover = self.log(1.0, 80.0)
        self.static = self.mass * GRAVITY * self.log(3e-3, 1.0)
        if form.axis:
            self.mass, self.crossover, self.static = self.log(5.0, 200.0), self.log(5.0, 80.0), self.log(3.0, 100.0)
            self.stage = self.mass * self.log(0.05, 0.8)
            self.cart = self.mass - self.stage
        self.omega = 2 * np.pi * self.crossover
        self.alpha, self.beta = self.log(0.03, 0.4), self.log(1.3, 8.0)

    def log(self, low: float, high: float) -> float:
        """Draw a number log-uniformly between two numbers."""
        return float(np.exp(self.rng.uniform(np.log(low), np.log(high))))

    def sign(self) -> float:
        return float(self.rng.choice([-1.0, 1.0]))

    @property
    def stiffness(self) -> float:
        """Return roughly the proportional stiffness of the loop [N/m]."""
        return self.mass * self.omega**2 * np.sqrt(self.alpha)

    @property
    def deflection(self) -> float:
        """Return the deflection of the loop by friction [m]."""
        return self.static / self.stiffness

    def tables(self) -> dict[str, Any]:
        tables: dict[str, Any] = {
            "masses": {"cart": _text(self.cart, "kg"), "stage": _text(self.stage, "kg")},
            "friction": self.friction(self.form.friction, self.static),
            "controller": self.controller(),
        }
        if self.form.joint != "rigid":
            tables["joint"] = self.joint()
        if self.form.parasitic:
            tables["parasitic"] = {
                "frequency": _text(max(self.log(80.0, 2000.0), 6 * self.crossover), "Hz"),
                "mass": _text(self.stage * self.rng.uniform(0.1, 0.7), "kg"),
                "damping_ratio": self.log(2e-3, 0.05),
            }
        if self.form.drive:
            tables |= self.drive()
        if self.form.bias:
            tables["bias"] = {self.form.bias: _text(self.sign() * self.static * self.log(0.01, 2.0), "N")}
        if self.form.motor:
            tables["motor_friction"] = self.friction(self.form.motor, self.static * self.log(0.1, 2.0))
        return tables | {"motion": self.motion()}

    def friction(self, model: str, static: float) -> dict[str, Any]:
        """Draw friction that breaks away at a force [N].

        Familiar keys are realistic for bearings, others lie around their examples.
        """
        law = FRICTION.classes[model]
        bristles = static / self.log(2e-7, 1e-4)
        coulomb = static * self.rng.uniform(0.2, 1.0)
        keys: dict[str, Any] = {
            "static": _text(static, "N"),
            "coulomb": _text(coulomb, "N"),
            "stribeck_velocity": _text(self.log(1e-4, 3e-3 if self.form.axis else 5e-2), "m/s"),
            "stribeck_exponent": self.form.exponent or self.rng.uniform(0.6, 2.6),
            "bristle_stiffness": _text(bristles, "N/m"),
            "bristle_damping": _text(2 * self.log(0.03, 1.5) * np.sqrt(bristles * self.mass), "N*s/m"),
            "viscous": _text(self.mass * self.log(0.01, 10.0) * float(self.rng.random() < 0.8), "N*s/m"),
            "regularisation_velocity": _text(self.log(1e-6, 1e-3), "m/s"),
        }
        if self.form.asymmetry:
            keys["asymmetry"] = self.sign() * self.log(0.01, 0.4)
        table: dict[str, Any] = {"model": model}
        for name, field in numeric_fields(law).items():
            if name in keys:
                table[name] = keys[name]
            elif law.model_fields[name].is_required():
                table[name] = self.about(field)
        if model == "elasto_plastic":
            table["breakaway_deflection"] = _text(coulomb / bristles * self.rng.uniform(0.1, 0.95), "m")
        if model == "rolling":
            table["rolling_exponent"] = self.rng.uniform(1.0, 3.0)
        if model == "gms":
            table |= self.elements(bristles)
            table["attraction"] = _text(bristles * self.log(3e-5, 0.15), "N/s")
        return table

    def elements(self, stiffness: float) -> dict[str, Any]:
        """Draw Maxwell-slip elements that yield one after the other.

        While sticking, their stiffness [N/m] adds up to the given one.
        """
        shares = self.rng.dirichlet(np.full(ELEMENTS, 2.0))
        shares[-1] += 1 - float(np.sum(shares))
        parts = np.geomspace(1.0, self.log(0.01, 0.5), ELEMENTS) * shares
        parts *= stiffness / parts.sum()
        damping = self.log(0.03, 1.5) * 2 * np.sqrt(stiffness * self.mass) / stiffness
        return {
            "element_stiffness": [_text(part, "N/m") for part in parts],
            "element_share": [float(share) for share in shares],
            "element_damping": [_text(damping * part, "N*s/m") for part in parts],
        }

    def about(self, field: Any) -> Any:
        """Draw a value around the example of a key."""
        if isinstance(field, Quantity):
            number, unit = field.example.strip('"').split(maxsplit=1)
            return _text(float(number) * self.log(1 / SPREAD, SPREAD), unit)
        return float(field.example) * self.log(1 / SPREAD, 1.0)

    def drive(self) -> dict[str, Any]:
        """Draw a motor behind a screw or belt, whose mode with the masses lies above the crossover."""
        kind, side = self.form.drive.split(" at the ")
        motor = self.mass * self.log(0.1, 5.0)
        reduced = motor * self.mass / (motor + self.mass)
        stiffness = reduced * (self.omega * self.log(4.0, 60.0)) ** 2
        table = {
            "mass": _text(motor, "kg"),
            "stiffness": _text(stiffness, "N/m"),
            "damping": _text(2 * self.log(0.01, 0.3) * np.sqrt(stiffness * reduced), "N*s/m"),
        }
        if kind == "backlash":
            table["backlash"] = _text(self.deflection * self.log(1e-3, 0.5), "m")
        return {"transmission": table, "encoder": {"position": side, "velocity": side}}

    def cascade(self) -> dict[str, Any]:
        """Draw a velocity loop with integral, and a slower position loop.

        The integral is as slow as a few of the velocity loop's times.
        """
        return {
            "kind": "cascade",
            "kv": _text(self.omega * self.log(0.1, 0.6), "1/s"),
            "kp": _text(self.mass * self.omega, "N*s/m"),
            "velocity_integral_time": _text(self.log(1.5, 15.0) / self.omega, "s"),
            "proportional_on": str(self.rng.choice(["error", "measurement"])),
        }

    def filters(self) -> list[dict[str, Any]]:
        """Draw a notch on the force and a low-pass in the feedback, both above the crossover."""
        notch, low_pass = (max(self.crossover * self.log(6.0, 40.0), 50.0) for _ in range(2))
        return [
            {"kind": "notch", "frequency": _text(notch, "Hz"), "width": _text(0.4 * notch, "Hz"), "depth": 0.9},
            {"kind": "low_pass", "path": "feedback", "frequency": _text(low_pass, "Hz")},
        ]

    def controller(self) -> dict[str, Any]:
        table: dict[str, Any] = {"kind": "pid"}
        if self.form.control == "cascade":
            table = self.cascade()
        elif self.form.control == "adrc":
            table = {
                "kind": "adrc",
                "bandwidth": _text(self.crossover / 3, "Hz"),
                "observer_ratio": self.log(3.0, 10.0),
            }
        elif self.form.control == "rules":
            table |= {"crossover": _text(self.crossover, "Hz"), "alpha": self.alpha, "beta": self.beta}
            if self.rng.random() < 0.2:
                table["tuned_mass"] = _text(self.mass * self.log(0.6, 1.6), "kg")
        else:
            kp, damping = self.stiffness, self.log(0.3, 1.5)
            natural = np.sqrt(kp / self.mass)
            table |= {
                "kp": _text(kp, "N/m"),
                "kd": _text(2 * damping * self.mass * natural, "N*s/m"),
                "ki": _text(kp * natural * damping * self.log(0.03, 1.0), "N/(m*s)"),
                "derivative_on": "error" if self.form.control == "on error" else "measurement",
            }
            if self.form.control != "plain":
                table["tau"] = _text(1 / (natural * self.log(6.0, 100.0)), "s")
        if self.form.windup:
            table |= {
                "force_limit": _text(self.static * self.log(3.0, 60.0), "N"),
                "anti_windup": self.form.windup,
            }
        if self.form.filtered:
            table["filters"] = self.filters()
        if self.form.deadband:
            table["error_deadband"] = _text(self.deflection * self.log(1e-4, 0.3), "m")
        if self.form.windup == "back_calculation":
            table["anti_windup_time"] = _text(self.log(0.1, 10.0) / self.omega, "s")
        return table | self.setting() if self.form.axis else table  # others are drawn as before settings existed

    def setting(self) -> dict[str, Any]:
        """Draw one of the settings of drives against friction."""
        error, force = self.deflection * self.log(1e-3, 1.0), self.static * self.log(0.05, 3.0)
        settings: dict[str, dict[str, Any]] = {
            "": {},
            "leak": {"integral_leak": _text(self.crossover * self.log(1e-3, 0.1), "Hz")},
            "integral limit": {"integral_limit": _text(force, "N")},
            "integral deadband": {
                "integral_deadband": _text(error, "m"),
                "integral_deadband_exit": _text(error * self.log(1.0, 10.0), "m"),
            },
            "reset": {"integral_reset": True},
            "standstill": {"standstill_window": _text(error, "m"), "standstill_factor": self.log(0.1, 3.0)},
            "schedule": {
                "schedule_error": [_text(error, "m"), _text(error * self.log(2.0, 30.0), "m")],
                "schedule_factor": [self.log(0.2, 2.0), 1.0],
            },
            "inner gains": {
                "standstill_window": _text(error, "m"),
                "standstill_window_exit": _text(error * self.log(1.0, 10.0), "m"),
                "standstill_factor": self.log(0.1, 3.0),
                "standstill_integral_factor": self.log(0.1, 3.0),
                "windows_at_rest": True,
            },
            "freeze": {
                "freeze_window": _text(error, "m"),
                "freeze_window_exit": _text(error * self.log(1.0, 10.0), "m"),
            },
            "rest in moves": {"integral_rests_in_moves": True},
            "push": {"stiction_push": _text(force, "N"), "stiction_push_window": _text(error, "m")},
        }
        return settings[self.form.setting]

    def joint(self) -> dict[str, Any]:
        stiffness = self.mass * (self.omega * self.log(0.15, 4.0)) ** 2
        reduced = self.cart * self.stage / self.mass
        contact = reduced * (2 * np.pi * max(self.log(300.0, 3000.0), 8 * self.crossover)) ** 2
        limiter_damping = 2 * self.log(5e-3, 1.0) * np.sqrt(contact * reduced) * float(self.rng.random() > 0.04)
        stroke = self.static / stiffness * self.log(0.02, 20.0) if self.form.joint != "touching" else 0.0
        return {
            "locked": self.form.joint == "locked",
            "stiffness": _text(stiffness, "N/m"),
            "damping": _text(2 * self.log(1e-3, 0.1) * np.sqrt(stiffness * self.stage), "N*s/m"),
            "stroke": _text(stroke, "m"),
            "limiter_stiffness": _text(contact, "N/m"),
            "limiter_damping": _text(limiter_damping, "N*s/m"),
        }

    def motion(self) -> dict[str, Any]:
        """Draw a move of any kind, from a fraction of the deflection by friction to a thousand."""
        kind = str(
            self.rng.choice(["there_and_back", "release", "step", "hold", "ramp"], p=[0.5, 0.18, 0.14, 0.12, 0.06])
        )
        size = min(self.deflection * self.log(0.2, 1000.0), 2.0)
        time = self.log(0.01, 0.3)
        keys: Mapping[str, dict[str, str]] = {
            "there_and_back": {
                "acceleration": _text(size / time**2, "m/s^2"),
                "acceleration_time": _text(time, "s"),
                "return_at": "5 s",
            },
            "release": {"displacement": _text(self.sign() * size, "m")},
            "step": {"size": _text(self.sign() * size, "m")},
            "hold": {},
            "ramp": {"velocity": _text(self.sign() * self.log(1e-5, 0.3), "m/s")},
        }
        return {"kind": kind, **keys[kind], "duration": "20 s"}


def _text(value: float, unit: str) -> str:
    return f"{value:.6g} {unit}"
