"""Write a first specification from a stage file.

Ranges lie around the stage's own numbers, and leaves have sizes that are sold.
"""

from __future__ import annotations

from collections.abc import Sequence

from friso.design_method.prepare import by_rules, check_designable
from friso.design_method.settings import settings
from friso.equations.controllers.van_dijk import CROSSOVER
from friso.equations.motion import size
from friso.quantities import as_toml, percent
from friso.stage import Stage
from friso.stage.stage import numeric_keys

STATIC, COULOMB = "friction.static", "friction.coulomb"

COMMENT = "   # "
"""Separator between a line and its comment."""

SPREAD = ("static", "coulomb", "stribeck_velocity", "bristle_stiffness", "viscous")


def outline(stage: Stage) -> str:
    """Return the text of a specification with comments.

    The present crossover becomes the machine's limit. Ranges follow from uncertain keys of the stage file, or are
    assumed. Moves go up to the travel, and sheets are spring steel in usual gauges. Raises InputError for a stage that
    `friso design` cannot design for.
    """
    check_designable(stage)
    flat = stage.flat()
    limit = f"{by_rules(stage).flat()[CROSSOVER]:.4g}"
    friction = [
        _line(stage, f"friction.{name}", settings.friction_spread) for name in SPREAD if flat.get(f"friction.{name}")
    ]
    masses = [
        _line(stage, f"masses.{name}", settings.mass_spread) for name in ("cart", "stage") if f"masses.{name}" in flat
    ]
    both = masses if len(masses) == 2 else [f"# {line}; to be divided, unless both are given" for line in masses]
    travel, acceleration = _move(stage)
    own = flat.get("joint.stroke")
    stroke = f"{own / 2:.4g} m .. {own:.4g} m" if own else "0.3 mm .. 1 mm"
    name = f"name = {as_toml('Friction isolator of ' + (stage.name or 'the stage'))}\n\n"
    return name + _aligned(
        [
            "[machine]   # the highest crossover that it allows, by van Dijk's rules",
            f'crossover_limit = "{limit} Hz"   # the present one; or parasitic_frequencies = ["480 Hz"]',
            "",
            "[friction]   # ranges; a key left out stays as in the stage file",
            *friction,
            "",
            "[masses]",
            *both,
            "",
            "[moves]",
            f'travel = "{settings.shortest_move * travel:g} m .. {travel:g} m"',
            f'acceleration = "{settings.shortest_move * acceleration:g} m/s^2 .. {acceleration:g} m/s^2"',
            "",
            "[position]",
            'window = "1 um"   # in position: stays this close to the reference',
            '# settling_time = "1 s"   # what 95 % of the moves may take',
            "",
            "[load]   # at the leaf ends, beside the weight of the stage",
            'force_x = "0 N"   # along the leaves',
            'force_y = "0 N"   # along their width, as of a cable',
            "",
            "[leaves]   # what may be built",
            "leaves = 2",
            'length = "30 mm .. 70 mm"',
            'width = "15 mm .. 45 mm"',
            'spacing = "30 mm .. 60 mm"',
            'thickness = "0.1 mm .. 0.5 mm"   # standard gauges in this range, or a list of available sheets',
            'materials = ["stainless 1.4310"]',
            f'stroke = "{stroke}"   # the largest feasible one is chosen',
            'offset = "1 mm"   # of actuator and sensor from the middle of the width',
            "",
            "[safety]   # factors; those left out are the defaults",
            "hunting = 1.2   # crossover over the edge of hunting",
            "",
        ]
    )


def _aligned(lines: Sequence[str]) -> str:
    """Align the comments of lines below each other."""
    parts = [line.partition(COMMENT) for line in lines]
    widest = max(len(line) for line, _, comment in parts if comment)
    return "\n".join(f"{line:{widest}}{COMMENT}{comment}" if comment else line for line, _, comment in parts)


def _line(stage: Stage, key: str, share: float) -> str:
    """Return the line of a key with its range: the stage's own, or `share` to both sides.

    Coulomb friction does not exceed the static friction.
    """
    flat, own = stage.flat(), stage.uncertain().get(key)
    name, unit = key.split(".")[1], numeric_keys(flat)[key].unit
    low, high = (own.low, own.high) if own else ((1 - share) * flat[key], (1 + share) * flat[key])
    cut = ""
    if key == COULOMB and STATIC in flat:
        static = stage.uncertain().get(STATIC)
        most = static.high if static else (1 + share) * flat[STATIC]
        cut, high = ", up to the static friction" if high > most else "", min(high, most)
    why = ("as in the stage file" if own else f"assumed: {percent(share)} about the stage file's") + cut
    return f'{name} = "{low:.4g} {unit} .. {high:.4g} {unit}"   # {why}'


def _move(stage: Stage) -> tuple[float, float]:
    """Return travel [m] and acceleration [m/s^2] of the stage's motion, or 10 mm at 10 m/s^2."""
    flat = stage.flat()
    if flat["motion.kind"] != "there_and_back" or not flat["motion.acceleration"]:
        return 1e-2, 10.0
    rate = float(flat["motion.acceleration"])
    return float(size(flat)), rate
