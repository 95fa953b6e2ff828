"""Cases of a check and figures that are made up: looking at plots needs no engine."""

import hashlib
import json
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import xarray as xr

from friso.axis import LINEAR
from friso.equations.controllers.pid import PidGains, VanDijk
from friso.hunting import Cycle, Hunting, Judgement, Kick, Margin, MoveShare, ReturnMap, Target
from friso.questions.check.question import CheckAnswer
from friso.shown.drawing import matplotlib_renderer, plotly_renderer
from friso.shown.drawing.figure import Axis, Figure, Limit, Map, Markers, Panel, Series


def check_html(cases: dict[str, Any]) -> str:
    """The page of cases that have their traces, and for which no isolator is looked up."""
    stage = next(iter(cases.values())).stage if "given" not in cases else cases["given"].stage
    answer = CheckAnswer(cases, stage=stage, draws=None, laws=None, cut=False, traced=cases, isolator=None)
    return answer.page().html()


UNITS = {
    "reference": "m",
    "position": "m",
    "velocity": "m/s",
    "error": "m",
    "force": "N",
    "force_p": "N",
    "force_i": "N",
    "force_d": "N",
    "cart_position": "m",
    "cart_velocity": "m/s",
    "joint_deflection": "m",
    "friction_force": "N",
}


NO_RETURN = "from every distance the stage swings back less far than it started"


def fake_solver(status: str) -> Any:
    return SimpleNamespace(status=status, steps=4321, rejected=321, rtol=1e-6, done=status == "done")


def fake_cycle(symmetric: bool = True, multiplier: float = -0.9312, apart: float = 0.0) -> Cycle:
    """A cycle of a stage that turns at 0.52 mm, `apart` [m] farther out on one side than on the other."""
    time = np.linspace(0, 1.6277, 401)
    position = 5.2e-4 * np.tanh(8 * np.cos(2 * np.pi * time / 1.6277)) + apart / 2
    arrays = {"position": position, "cart_position": 0.9 * position, "velocity": np.gradient(position, time)}
    variables = {name: ("time", array) for name, array in (arrays | {"force": 3 * np.sin(time)}).items()}
    signals = {**variables, "time": ("time", time)}
    return Cycle(symmetric, 5.2e-4, 0.0, 1.6277, multiplier, np.array([multiplier]), -0.93, -0.9311, 1e-12, signals)


def fake_hunting(*cycles: Cycle, reason: str = "", certain: bool = True) -> Hunting:
    distances = np.geomspace(5e-5, 4e-3, 32)[None, :]
    returns = np.where(distances > 2e-4, 1e-3 - 0.93 * distances, 0.0)
    target = Target(5.2e-4, 1.6277, 100.0, 25.0) if any(cycle.attracts for cycle in cycles) else None
    return Hunting(cycles, reason, certain, ReturnMap(distances, returns, np.ones((1, 32))), (), target)


def hunts(**changes: Any) -> Judgement:
    """Return a judgement like that of the thesis rig, locked."""
    result = Judgement(
        "hunts",
        fake_hunting(fake_cycle()),
        Kick(((1.72e-3, 10.8e-3), (22.7e-3, 43.3e-3), (59.3e-3, 0.156)), (1.73e-5, 0.156)),
        Kick(((0.0231, 0.0734),), (5e-4, 4.4)),
        MoveShare(128, 111, {"motion.acceleration": (10.0, 200.0), "motion.acceleration_time": (0.003, 0.06)}),
        Margin(1.2187, 9.7496, True, 1.2248),
    )
    return replace(result, **changes)


def settles(**changes: Any) -> Judgement:
    """Return a judgement like that of the thesis rig, free."""
    edge = Margin(0.6998, 5.598, True, 0.7064)
    result = Judgement("settles", fake_hunting(reason=NO_RETURN), margin=edge, settled_after=0.5123)
    return replace(result, **changes)


def cannot_hunt(verdict: Any = "settles") -> Judgement:
    return Judgement(verdict, Hunting((), "there is no friction to stick to", True, None))


@dataclass(frozen=True)
class FakeCase:
    """A stand-in with the attributes that `friso.hunting.Case` promises."""

    stage: Any
    trace: xr.Dataset | None
    judgement: Judgement = field(default_factory=settles)
    peaks: int = 0
    peak_times: np.ndarray = field(default_factory=lambda: np.empty(0))
    peak_heights: np.ndarray = field(default_factory=lambda: np.empty(0))
    peak_to_peak: float = 2e-10
    offset: float = 0.0
    period: float | None = None
    bands: tuple[float, float] = (1e-6, 1e-5)
    settling_time: dict[float, float | None] = field(default_factory=lambda: {1e-6: 0.8234, 1e-5: 0.5123})
    in_the_end: dict[float, float | None] = field(default_factory=lambda: {1e-6: 0.8234, 1e-5: 0.5123})
    largest_force: float = 179.4
    solver: Any = field(default_factory=lambda: fake_solver("done"))
    unstable: tuple[str, ...] = ()
    unstable_bandwidths: tuple[Any, ...] = ()
    breakaway: float = 3.0
    force_limit: float | None = None
    unmoved: bool = False
    runs_away: bool = False
    feeding: Any = None
    static_friction: Any = None
    faster: Any = None
    slower: Any = None
    dwells: tuple[Any, ...] = ()
    tracking: Any = None
    stick_slip: Any = None

    @property
    def verdict(self) -> str:
        return self.judgement.verdict


def fake_stage(
    name: str = "Thesis rig", locked: bool | None = None, force_limit: float | None = None, duration: float = 20.0
) -> Any:
    joint = None if locked is None else SimpleNamespace(locked=locked, stroke=1e-3)
    return SimpleNamespace(
        name=name,
        source="made up",
        note="",
        unknown_keys=(),
        assumed_keys=(),
        uncertain=dict,
        friction=object(),
        states_friction=True,
        doubt="",
        axis_kind=LINEAR,
        conditions=None,
        **dict.fromkeys(("drive", "rail", "cable", "floor")),
        joint=joint,
        controller=SimpleNamespace(
            note=lambda flat: "",
            force_limit=force_limit,
            **{"kp": 3.0, "ki": 4.0, "kd": 6.0, "tau": 0.0},
            bandwidth_name=VanDijk.bandwidth_name,
            speeds_up=PidGains.speeds_up,
        ),
        motion=SimpleNamespace(duration=duration),
        flat=lambda: {
            "motion.kind": "there_and_back",
            "motion.acceleration": 100.0,
            "motion.acceleration_time": 0.03,
            "motion.return_at": 0.0,
            "motion.duration": duration,
        },
        to_toml=lambda: f"name = {json.dumps(name)}\n",
    )


def fake_trace(
    kind: str = "there_and_back", hunting: bool = False, duration: float = 20.0, samples: int = 4001
) -> xr.Dataset:
    """A trace with the shape of the real ones: smooth, with a hunting square wave, spikes in the D share."""
    time = np.linspace(0, duration, samples)
    reference = {
        "there_and_back": 0.09 * ((time > 0.03) & (time < 5.03)),
        "step": np.full(samples, 1.0),
        "ramp": 0.1 * time,
        "release": np.zeros(samples),
        "hold": np.zeros(samples),
    }[kind]
    decay = 0.0 if kind == "hold" else 2e-3
    deviation = decay * np.exp(-4 * np.mod(time, 5.03)) * (time < 15)
    wave = np.tanh(8 * np.sin(2 * np.pi * time / 1.63)) if hunting else np.zeros(samples)
    deviation = deviation + 5.2e-4 * wave
    velocity = np.gradient(reference + deviation, time)
    shares = {
        "force_p": 2 * wave,
        "force_i": 3 * np.cos(2 * np.pi * time / 1.63),
        "force_d": -0.01 * velocity,
    }
    values = shares | {
        "reference": reference,
        "position": reference + deviation,
        "velocity": velocity,
        "error": -deviation,
        "force": sum(shares.values()),
        "cart_position": reference + deviation,
        "cart_velocity": velocity,
        "joint_deflection": 0.5 * deviation,
        "friction_force": np.tanh(1e3 * velocity),
    }
    variables = {name: ("time", np.asarray(array, float), {"units": UNITS[name]}) for name, array in values.items()}
    turns = np.arange(0.4, duration, 0.815)
    variables["turning_time"] = ("turning_point", turns, {"units": "s"})
    variables["turning_deviation"] = ("turning_point", 5.2e-4 * (-0.9) ** np.arange(len(turns)), {"units": "m"})
    return xr.Dataset(variables, coords={"time": ("time", time, {"units": "s"})}, attrs={"name": "Thesis rig"})


def fake_case(hunting: bool = False, stage: Any = None, kind: str = "there_and_back", drop: Any = ()) -> FakeCase:
    trace = fake_trace(kind, hunting).drop_vars(list(drop))
    case = FakeCase(stage or fake_stage(), trace)
    if not hunting:
        return case
    times = 10.2 + 1.63 * np.arange(6)
    return replace(
        case,
        judgement=hunts(),
        peaks=6,
        peak_times=times,
        peak_heights=np.full(6, 5.2e-4),
        peak_to_peak=1.04e-3,
        period=1.63,
        settling_time={1e-6: None, 1e-5: None},
        in_the_end={1e-6: None, 1e-5: None},
    )


def both_joints(name: str = "Thesis rig", samples: int = 4001) -> dict[str, Any]:
    free = fake_case(stage=fake_stage(name, locked=False))
    locked = fake_case(hunting=True, stage=fake_stage(name, locked=True))
    free = replace(free, trace=fake_trace(samples=samples))
    locked = replace(locked, trace=fake_trace(hunting=True, samples=samples))
    return {"given": free, "locked": locked, "free": free}


def small_figure() -> Figure:
    """Every kind of thing that can be drawn, in SI units."""
    time = np.linspace(0, 2, 201)
    line = Series(time, 5e-4 * np.sin(time), "wave", "#0072B2")
    upper = Panel(
        "Upper",
        Axis("Time", "s"),
        Axis("Deviation", "m"),
        (line, replace(line, y=-line.y, dash="dashed")),
        (Markers(np.array([1.0, np.nan]), np.array([4e-4, 0.0]), "peak", "#D55E00", "triangle"),),
        (Limit((-1e-4, 1e-4), "band"),),
    )
    field = Map(np.linspace(1e3, 4e3, 4), np.linspace(0, 1e-3, 3), np.arange(12.0).reshape(3, 4), "Peaks", "")
    lower = Panel("Lower", Axis("Stiffness", "N/m"), Axis("Stroke", "m"), maps=(field,))
    return Figure("small", "Small", "A caption.", (upper, lower), columns=2, subject="Rig")


def _without_bands(figure: Figure) -> Figure:
    """The figure without areas, which each renderer makes of its own kind of polygon."""
    return replace(figure, panels=tuple(replace(panel, bands=()) for panel in figure.panels))


def mpl_arrays(figure: Figure) -> list[list[np.ndarray]]:
    axes = [a for a in matplotlib_renderer.render(_without_bands(figure)).axes if a.get_label() != "<colorbar>"]
    drawn = []
    for panel in axes:
        meshes = [np.asarray(mesh.get_array().filled(np.nan)) for mesh in panel.collections]
        lines = [np.asarray(data, float) for line in panel.lines for data in line.get_data()]
        drawn.append(meshes + lines)
    return drawn


def plotly_arrays(figure: Figure) -> list[list[np.ndarray]]:
    drawn: dict[str, list[np.ndarray]] = {f"x{i or ''}": [] for i in (0, *range(2, len(figure.panels) + 1))}
    for trace in plotly_renderer.render(_without_bands(figure)).data:
        if [*trace.x] == [None]:  # of the legend
            continue
        parts = (trace.z,) if trace.type == "heatmap" else (trace.x, trace.y)
        drawn[trace.xaxis] += [np.asarray(part, float) for part in parts]
    return list(drawn.values())


def same(left: list[list[np.ndarray]], right: list[list[np.ndarray]]) -> bool:
    return [len(panel) for panel in left] == [len(panel) for panel in right] and all(
        np.array_equal(a, b, equal_nan=True)
        for one, other in zip(left, right, strict=True)
        for a, b in zip(one, other, strict=True)
    )


def digests() -> list[str]:
    """Return digests of a figure in all formats, and of a page with several."""
    images = [matplotlib_renderer.image(small_figure(), form) for form in matplotlib_renderer.IMAGE_FORMATS]
    return [hashlib.sha256(content).hexdigest() for content in (*images, check_html(both_joints()).encode())]
