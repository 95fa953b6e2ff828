"""Parts of stage files, of which tests put stages together; kinds of stage stand in the book (`VARIANTS`)."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

from book import VARIANTS as VARIANTS

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


FULL = {"kp": 3000, "ki": 2000, "kd": 60}


def plain_module(chosen: Stage, folder: Path, method: str = "Rodas5P") -> ModuleType:
    """The generated module of a stage for eight lanes, not compiled: `module.step` runs it line by line, for one."""
    file = folder / "plain_kernel.py"
    form = structure(chosen.flat())
    file.write_text(write_module(assemble(form), TABLEAUS[method], repr(form), lanes=8))
    name = f"plain_kernel_{abs(hash((form, method)))}"
    spec = importlib.util.spec_from_file_location(name, file)
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module
