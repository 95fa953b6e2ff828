"""Every kind of stage the equations distinguish, as stage files, for the tests that must hold for all of them."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import maxwell_slip as maxwell_slip

import friso
from friso.engine.build import write_module
from friso.engine.tableaus import TABLEAUS
from friso.equations.model import assemble
from friso.equations.structure import structure
from friso.stage import Stage

MASSES = {
    "both": 'cart = "1.2 kg"\nstage = "0.5 kg"',
    "cart": 'cart = "1 kg"',
    "stage": 'stage = "1.7 kg"',
}


def lugre(exponent: float, static: str = "3 N", viscous: str = "0.5 N*s/m") -> str:
    return f"""model = "lugre"
static = "{static}"
coulomb = "1 N"
stribeck_velocity = "1.6 mm/s"
stribeck_exponent = {exponent}
bristle_stiffness = "1e5 N/m"
bristle_damping = "316.2277660168379 N*s/m"
viscous = "{viscous}"
"""


def stribeck(exponent: float) -> str:
    return f"""model = "stribeck"
static = "3 N"
coulomb = "1 N"
stribeck_velocity = "5 mm/s"
stribeck_exponent = {exponent}
viscous = "0.5 N*s/m"
regularisation_velocity = "1 mm/s"
"""


def maxwell(share: float | None = None, viscous: str = "0.5 N*s/m") -> str:
    """The law of `maxwell_slip`, which is registered from outside friso: three elements that stick or slip."""
    return f"""model = "maxwell_slip"
element_stiffness = ["100 N/mm", "80 N/mm", "60 N/mm"]
element_strength = ["0.9 N", "0.96 N", "0.96 N"]
viscous = "{viscous}"
{"" if share is None else f"kinetic_share = {share}"}
"""


def elasto_plastic(exponent: float = 2, deflection: str = "7 um", damping: str = "316.2277660168379 N*s/m") -> str:
    return f"""model = "elasto_plastic"
static = "3 N"
coulomb = "1 N"
stribeck_velocity = "1.6 mm/s"
stribeck_exponent = {exponent}
bristle_stiffness = "1e5 N/m"
bristle_damping = "{damping}"
breakaway_deflection = "{deflection}"
viscous = "0.5 N*s/m"
"""


def rolling(exponent: float = 1.5) -> str:
    bristles = lugre(2).replace('"lugre"', '"rolling"')
    return f"{bristles}rolling_exponent = {exponent}\n"


def dwell(time: str = "50 ms", exponent: float = 2) -> str:
    bristles = lugre(exponent).replace('"lugre"', '"dwell"')
    return f'{bristles}dwell_time = "{time}"\n'


def load_dependent(coefficient: float = 0.2, exponent: float = 2) -> str:
    bristles = lugre(exponent).replace('"lugre"', '"load_dependent"')
    return f"{bristles}load_coefficient = {coefficient}\n"


def gms(exponent: float = 2, damping: str = "", **keys: str) -> str:
    """Three elements as stiff as the bristles of `lugre`."""
    values = {"static": "3 N", "coulomb": "1 N", "attraction": "500 N/s", "viscous": "0.5 N*s/m", **keys}
    lines = [f'{name} = "{value}"' for name, value in values.items()]
    return "\n".join([
        'model = "gms"',
        *lines,
        f'stribeck_velocity = "1.6 mm/s"\nstribeck_exponent = {exponent}',
        'element_stiffness = ["50 N/mm", "30 N/mm", "20 N/mm"]\nelement_share = [0.2, 0.3, 0.5]',
        damping,
    ])  # fmt: skip


MICRO_DAMPING = 'element_damping = ["150 N*s/m", "100 N*s/m", "60 N*s/m"]'

DAHL = 'model = "dahl"\ncoulomb = "1 N"\nbristle_stiffness = "1e5 N/m"\nviscous = "0.5 N*s/m"'
NO_FRICTION = 'model = "none"'

LOCKED = 'locked = true\nlimiter_stiffness = "2e7 N/m"\nlimiter_damping = "100 N*s/m"'
PARASITIC = 'frequency = "300 Hz"\nmass = "0.25 kg"\ndamping_ratio = 0.01'


def free(stroke: str = "1 mm") -> str:
    leaves = f'stiffness = "2.4 N/mm"\ndamping = "0.5 N*s/m"\nstroke = "{stroke}"'
    return f'{leaves}\nlimiter_stiffness = "2e7 N/m"\nlimiter_damping = "100 N*s/m"'


TOUCHING = free("0 mm")


def van_dijk(crossover: str = "8 Hz", extra: str = "") -> str:
    return f'kind = "pid"\ncrossover = "{crossover}"\nalpha = 0.1\nbeta = 2\ntuned_mass = "1.7 kg"\n{extra}'


def gains(kp: float = 1000, ki: float = 0, kd: float = 0, tau: float = 0, extra: str = "") -> str:
    terms = {"kp": f"{kp!r} N/m", "ki": f"{ki!r} N/(m*s)", "kd": f"{kd!r} N*s/m", "tau": f"{tau!r} s"}
    lines = [f'{name} = "{value}"' for name, value in terms.items()]
    return "\n".join(['kind = "pid"', *lines, extra])


def cascade(kv: str = "60 1/s", kp: str = "50 N*s/m", extra: str = "", **keys: str) -> str:
    lines = [f'{name} = "{value}"' for name, value in {"kv": kv, "kp": kp, **keys}.items()]
    return "\n".join(['kind = "cascade"', *lines, extra])


MEASURED = 'derivative_on = "measurement"\n'


def limit(force: str, anti_windup: str = "", time: str = "") -> str:
    how = {"force_limit": force, "anti_windup": anti_windup, "anti_windup_time": time}
    return "".join(f'{key} = "{value}"\n' for key, value in how.items() if value)


def there_and_back(duration: str = "20 s", back: str = "5 s", acceleration: str = "100 m/s^2") -> str:
    ramp = f'acceleration = "{acceleration}"\nacceleration_time = "30 ms"\nreturn_at = "{back}"'
    return f'kind = "there_and_back"\n{ramp}\nduration = "{duration}"'


def release(displacement: str = "2 mm", duration: str = "1 s") -> str:
    return f'kind = "release"\ndisplacement = "{displacement}"\nduration = "{duration}"'


def step(size: str = "1 mm", duration: str = "1 s") -> str:
    return f'kind = "step"\nsize = "{size}"\nduration = "{duration}"'


def ramp(velocity: str = "0.1 m/s", duration: str = "1 s") -> str:
    return f'kind = "ramp"\nvelocity = "{velocity}"\nduration = "{duration}"'


HOLD = 'kind = "hold"\nduration = "1 s"'


def a_filter(kind: str, **keys: object) -> str:
    lines = [f"{name} = {value!r}" for name, value in {"kind": kind, **keys}.items()]
    return "\n".join(["[[controller.filters]]", *lines, ""]).replace("'", '"')


FORWARD_FILTERS = (
    a_filter("notch", frequency="60 Hz", width="20 Hz", depth=0.9)
    + a_filter("low_pass", frequency="300 Hz", order=1)
    + a_filter("sampled_biquad", numerator=[0.94, -1.85, 0.93], denominator=[-1.85, 0.87], sample_time="1 ms")
)

FEEDBACK_FILTERS = a_filter(
    "biquad", path="feedback", zero_frequency="90 Hz", zero_damping=0.1, pole_frequency="80 Hz", pole_damping=0.5
) + a_filter("lead_lag", path="feedback", zero_frequency="400 Hz", pole_frequency="200 Hz")


def stage(
    motion: str, masses: str = "both", friction: str = "", joint: str = "", parasitic: str = "", controller: str = ""
) -> Stage:
    """The stage with these sections; an empty one is left out."""
    sections = {"masses": MASSES[masses], "friction": friction, "joint": joint, "parasitic": parasitic}
    sections |= {"controller": controller, "motion": motion}
    return friso.loads("\n".join(f"[{name}]\n{body}\n" for name, body in sections.items() if body))


CONDITIONS = {
    f"conditions.{key}": value
    for key, value in {
        **{"load": 1.3, "load_share": 0.8, "load_per_acceleration": "0.01 s^2/m"},
        **{"cold": 1.6, "running_time": "5 min", "warm_up_time": "20 min"},
    }.items()
}

FULL = {"kp": 3000, "ki": 2000, "kd": 60}

VARIANTS: dict[str, Stage] = {
    "rigid": stage(release(), friction=lugre(2), controller=van_dijk("4 Hz")),
    "rigid cart, P": stage(ramp(), "cart", lugre(2, "1.5 N", "0.4 N*s/m"), controller=gains(2)),
    "rigid stage, PI": stage(step(), "stage", lugre(1), controller=gains(1000, 500)),
    "rigid, no friction, PID": stage(step(), friction=NO_FRICTION, controller=gains(kp=1000, ki=2000, kd=50, tau=2e-3)),
    "rigid, no friction section": stage(there_and_back(), controller=van_dijk("20 Hz")),
    "rigid, LuGre 3, P": stage(release(), friction=lugre(3), controller=gains(1000)),
    "rigid, Stribeck 1.5, PD measured": stage(
        there_and_back(), friction=stribeck(1.5), controller=gains(kp=1000, kd=20, extra=MEASURED)
    ),
    "rigid, Stribeck 2, PI, limit": stage(
        ramp(), friction=stribeck(2), controller=gains(1000, 500, extra=limit("4 N"))
    ),
    "rigid, Stribeck 3": stage(HOLD, friction=stribeck(3), controller=gains(1000)),
    "rigid, Dahl, PD limit": stage(
        there_and_back(), "cart", DAHL, controller=gains(kp=1000, kd=20, extra=MEASURED + limit("4 N"))
    ),
    "rigid, LuGre 0.7, PID measured": stage(
        step(), friction=lugre(0.7), controller=gains(**FULL, tau=1e-3, extra=MEASURED)
    ),
    "rigid, Maxwell slip, PID": stage(step(), friction=maxwell(), controller=gains(**FULL, tau=1e-3)),
    "free, parasitic, Maxwell slip": stage(
        there_and_back(), friction=maxwell(), joint=free(), parasitic=PARASITIC, controller=van_dijk()
    ),
    "rigid, elasto-plastic": stage(step(), friction=elasto_plastic(1.5), controller=van_dijk()),
    "free, elasto-plastic 1": stage(
        there_and_back(), friction=elasto_plastic(1), joint=free(), controller=gains(**FULL, tau=1e-3)
    ),
    "rigid, rolling": stage(release(), friction=rolling(), controller=van_dijk()),
    "rigid, dwell": stage(release(), friction=dwell(), controller=van_dijk()),
    "free, dwell 1": stage(
        there_and_back(), friction=dwell(exponent=1), joint=free(), controller=gains(**FULL, tau=1e-3)
    ),
    "rigid, load-dependent": stage(release(), friction=load_dependent(), controller=van_dijk()),
    "free, load-dependent 1": stage(
        there_and_back(), friction=load_dependent(exponent=1), joint=free(), controller=gains(**FULL, tau=1e-3)
    ),
    "rigid, conditions": stage(there_and_back(), friction=lugre(2), controller=van_dijk()).replace(CONDITIONS),
    "rigid, GMS": stage(release(), friction=gms(damping=MICRO_DAMPING), controller=van_dijk()),
    "free, parasitic, GMS 1": stage(
        there_and_back(), friction=gms(1), joint=free(), parasitic=PARASITIC, controller=van_dijk()
    ),
    "rigid, van Dijk, limit": stage(step("10 mm"), friction=lugre(2), controller=van_dijk("8 Hz", limit("6 N"))),
    "rigid, limit, wound up": stage(
        step("10 mm"), friction=lugre(2), controller=gains(**FULL, tau=1e-3, extra=limit("6 N", "none"))
    ),
    "rigid, limit, back-calculation": stage(
        step("10 mm"), friction=lugre(2), controller=van_dijk("8 Hz", limit("6 N", "back_calculation", "20 ms"))
    ),
    "rigid, cascade": stage(
        there_and_back(acceleration="1 m/s^2"),
        friction=lugre(2),
        controller=cascade(
            velocity_integral_time="30 ms",
            acceleration_feedforward="1.7 kg",
            coulomb_feedforward="1 N",
            viscous_feedforward="0.5 N*s/m",
            extra="velocity_feedforward = 0.9\n" + limit("6 N"),
        ),
    ),
    "rigid, cascade, two integrals": stage(
        step(),
        friction=lugre(2),
        controller=cascade(
            position_integral_time="90 ms",
            velocity_integral_time="30 ms",
            proportional_on="measurement",
            velocity_filter="1 ms",
        ),
    ),
    "rigid, PI, filters, limit": stage(
        step(), friction=lugre(2), controller=gains(2000, 5000, extra=limit("4 N") + FORWARD_FILTERS + FEEDBACK_FILTERS)
    ),
    "rigid, van Dijk, low-pass": stage(
        step(),
        friction=lugre(2),
        controller=van_dijk(
            "8 Hz",
            limit("6 N", "back_calculation", "20 ms")
            + a_filter("low_pass", frequency="200 Hz", order=2, damping_ratio=0.6),
        ),
    ),
    "rigid, cascade, filters": stage(
        step(),
        friction=lugre(2),
        controller=cascade(velocity_integral_time="30 ms", extra=FEEDBACK_FILTERS + FORWARD_FILTERS),
    ),
    "locked": stage(there_and_back(), friction=lugre(2), joint=LOCKED, controller=van_dijk()),
    "locked, parasitic": stage(
        there_and_back(), friction=lugre(2), joint=LOCKED, parasitic=PARASITIC, controller=van_dijk()
    ),
    "locked, Stribeck 1": stage(ramp(), friction=stribeck(1), joint=LOCKED, controller=gains(**FULL, tau=1e-3)),
    "free": stage(there_and_back(), friction=lugre(4), joint=free(), controller=van_dijk()),
    "free, parasitic": stage(
        there_and_back(), friction=lugre(2), joint=free(), parasitic=PARASITIC, controller=van_dijk()
    ),
    "free, limiter that only pushes": stage(
        there_and_back(),
        friction=lugre(2),
        joint=free("20 um").replace('"100 N*s/m"', '"2e4 N*s/m"') + "\nlimiter_pulls = false",
        parasitic=PARASITIC,
        controller=van_dijk(),
    ),
    "free, no friction, limit": stage(
        step("5 mm"), joint=free("0.3 mm"), controller=gains(**FULL, extra=MEASURED + limit("20 N"))
    ),
    "free, parasitic, Dahl, PD": stage(
        release(), friction=DAHL, joint=free(), parasitic=PARASITIC, controller=gains(3000, kd=60, tau=1e-3)
    ),
    "free, LuGre 2.5, P": stage(release(), friction=lugre(2.5), joint=free(), controller=gains(1000)),
    "touching": stage(step(), friction=DAHL, joint=TOUCHING, controller=gains(**FULL, tau=1e-3)),
    "touching, parasitic": stage(
        HOLD, friction=stribeck(2.5), joint=TOUCHING, parasitic=PARASITIC, controller=van_dijk()
    ),
}


def plain_module(chosen: Stage, folder: Path, method: str = "Rodas5P") -> ModuleType:
    """The generated module of a stage for eight lanes, not compiled: `module.step` runs it line by line, for one."""
    file = folder / "plain_kernel.py"
    form = structure(chosen.flat())
    file.write_text(write_module(assemble(form), TABLEAUS[method], repr(form), lanes=8))
    name = f"plain_kernel_{abs(hash((form, method)))}"
    spec = importlib.util.spec_from_file_location(name, file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module
