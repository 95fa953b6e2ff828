"""Test the [flexure] table of stage files: what follows from it, and what is refused."""

from pathlib import Path

import numpy as np
import pytest
from refusals import refused

import friso
from friso.leaf_springs import closed_forms
from friso.leaf_springs.beams import beams
from friso.leaf_springs.closed_forms import parasitic_mode
from friso.leaf_springs.mechanism import Mechanism, block_inertia
from friso.materials import materials
from friso.stage import Stage, load, loads, save, violations
from friso.studies.cells import allowed_cells, flat_cells
from friso.studies.sweep import sweep

RIG = Path(__file__).parents[1] / "examples" / "thesis_rig.toml"
NUMBERS = 'young = "210 GPa"\npoisson = 0.3\ndensity = "7850 kg/m^3"\nyield = "1.1 GPa"'
LEAVES = '[flexure]\nleaves = 2\nlength = "70 mm"\nwidth = "45 mm"\nthickness = "0.35 mm"\nspacing = "60 mm"\n'
FOLLOWS = ("joint.stiffness", "parasitic.frequency", "parasitic.mass", "parasitic.damping_ratio")


def text_with(table: str = LEAVES + 'material = "stainless 1.4310"') -> str:
    """The thesis rig, its joint made of leaf springs."""
    text = RIG.read_text(encoding="utf-8")
    start, end = text.index("\n[parasitic]"), text.index("\n[controller]")
    return text[:start].replace('stiffness = "2.4 N/mm"\n', "") + "\n" + table + "\n" + text[end:]


@pytest.fixture(scope="module")
def stage() -> Stage:
    return loads(text_with())


def test_stiffness_and_parasitic_mode_follow(stage: Stage) -> None:
    flat = stage.flat()
    value = Mechanism.of(flat)
    frequency, share = parasitic_mode(value)
    assert flat["joint.stiffness"] == pytest.approx(closed_forms.drive_stiffness(value), rel=1e-12)
    assert flat["joint.stiffness"] == pytest.approx(2540 * 195 / 210, rel=5e-3)
    assert flat["parasitic.frequency"] == pytest.approx(frequency, rel=1e-12)
    assert flat["parasitic.mass"] == pytest.approx(0.5 * share / (1 + share), rel=1e-12)
    assert flat["parasitic.damping_ratio"] == 0.01
    assert 300 < frequency < 400


def resonances(stage: Stage) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies [Hz] and residues [1/kg] of the oscillations of a stage whose cart is stuck, by frequency: the plant
    from force to position is the sum of residue/(s^2 + 2 zeta omega s + omega^2)."""
    plant = friso.linear(stage, "stuck")
    into = plant.B[:, plant.input_labels.index("force")]
    poles, shapes = np.linalg.eig(plant.A)
    residues = (plant.C[plant.output_labels.index("stage")] @ shapes) * np.linalg.solve(shapes, into.astype(complex))
    upper = np.flatnonzero(poles.imag > 0)
    upper = upper[np.argsort(np.abs(poles[upper]))]
    return np.abs(poles[upper]) / (2 * np.pi), (residues[upper] * 2j * poles[upper].imag).real


@pytest.mark.parametrize(
    ("changes", "kind"),
    [
        ({}, "leaf bending, in phase"),
        ({"flexure.actuation_x": "85 mm", "flexure.sensor_x": "85 mm"}, "stage about y"),
        ({"flexure.actuation_y": "20 mm", "flexure.sensor_y": "20 mm"}, "stage about x"),
    ],
)
def test_the_plant_resonates_as_the_beams_do(stage: Stage, changes: dict[str, str], kind: str) -> None:
    """The plant resonates in its highest mode, with the beams' frequency and residue."""
    changed = stage.replace(changes)
    modes = beams(Mechanism.of(changed.flat()), 1e-3).modes[1:]
    mode = max(modes, key=lambda item: abs(item.actuator * item.sensor) / item.frequency**2)
    assert mode.name == kind
    frequencies, residues = resonances(changed)
    assert frequencies[-1] == pytest.approx(mode.frequency, rel=0.05)
    assert residues[-1] == pytest.approx(mode.actuator * mode.sensor, rel=0.15)
    assert frequencies[0] == pytest.approx(10.86, rel=0.01)  # the drive mode, that of nearly all of the mass
    assert residues[0] == pytest.approx(1 / 0.5, rel=0.01)


def test_a_mode_of_another_sign_counts_by_its_size(stage: Stage) -> None:
    """Actuator and sensor on either side of the middle: the equations know no negative residue."""
    alike = stage.replace({"flexure.actuation_y": "20 mm", "flexure.sensor_y": "20 mm"}).flat()
    against = stage.replace({"flexure.actuation_y": "20 mm", "flexure.sensor_y": "-20 mm"}).flat()
    assert [against[key] for key in FOLLOWS] == pytest.approx([alike[key] for key in FOLLOWS], rel=1e-9)


def test_defaults_are_the_stated_ones(stage: Stage) -> None:
    """Stage: an aluminium block at the leaf ends, as deep as their row; actuator and sensor at its centre of mass."""
    value = Mechanism.of(stage.flat())
    edge, depth = (0.5 / 2700) ** (1 / 3), 0.06
    height = 0.5 / 2700 / (edge * depth)
    squares = np.array([height, edge, depth]) ** 2
    assert value.body.inertia == pytest.approx(0.5 / 12 * (squares.sum() - squares), rel=1e-12)
    assert value.body.centre == (0.07, 0.0, 0.0)
    assert value.actuation == value.sensor == (0.07, 0.0, 0.0)
    assert value.stress_concentration == 1.5
    changed = stage.replace(
        {"flexure.centre_z": "-5 mm", "flexure.actuation_y": "8 mm", "flexure.inertia_z": "2e-4 kg*m^2"}
    )
    moved = Mechanism.of(changed.flat())
    assert moved.body.centre == pytest.approx((0.07, 0.0, -0.005))
    assert moved.actuation == moved.sensor == pytest.approx((0.07, 0.008, -0.005))
    assert moved.body.inertia[2] == 2e-4
    elsewhere = Mechanism.of(changed.replace({"flexure.sensor_y": "-1 mm"}).flat())
    assert (elsewhere.actuation[1], elsewhere.sensor[1]) == pytest.approx((0.008, -0.001))


def test_a_material_is_its_numbers(stage: Stage) -> None:
    expected = materials()["stainless 1.4310"]
    own = {"young": expected.young.text, "poisson": expected.poisson, "density": expected.density.text}
    own |= {"yield": expected.yield_strength.text, "fatigue": expected.fatigue.text}
    written = stage.replace({"flexure.material": None, **{f"flexure.{key}": value for key, value in own.items()}})
    with_name = stage.flat()
    assert with_name.pop("flexure.material") == expected.name
    assert {key: value for key, value in written.flat().items() if value != ""} == with_name


def test_all_materials_have_sources_and_plausible_numbers() -> None:
    assert len(materials()) >= 5
    for name, material in materials().items():
        assert material.name == name
        assert len(material.source) > 20
        assert len(material.grade) > 3
        assert 60e9 < material.young < 220e9
        assert 0.25 < material.poisson < 0.4
        assert 2500 < material.density < 9000
        assert 400e6 < material.yield_strength < 1500e6
        assert 0.2 * material.yield_strength < material.fatigue < 0.7 * material.yield_strength
        assert (
            4500 < np.sqrt(material.young / material.density) < 5300 or name == "beryllium copper"
        )  # speed of sound in metals


@pytest.mark.parametrize("share", [-1.0, -0.3, 0.3, 0.6, 0.9])
def test_load_along_the_leaves(stage: Stage, share: float) -> None:
    """Against the exact beam-column, clamped and guided, k L^3/(E I) = u^3/(2 tan(u/2) - u), u = L sqrt(P/(E I))."""
    buckling = float(closed_forms.buckling_load(Mechanism.of(stage.flat())))
    u = np.pi * np.sqrt(complex(share))
    exact = float((u**3 / (2 * np.tan(u / 2) - u)).real) / 12
    loaded = stage.replace({"flexure.load": f"{share * buckling!r} N"})
    assert loaded.flat()["joint.stiffness"] / stage.flat()["joint.stiffness"] == pytest.approx(exact, rel=0.015)


def test_leaves_that_buckle(stage: Stage) -> None:
    with refused("flexure.load"):
        stage.replace({"flexure.load": "140 N"})
    loads_along = np.array([0.0, 130.0, 140.0])
    assert allowed_cells(stage, {}, {"flexure.load": loads_along}).tolist() == [True, True, False]


def test_saved_and_loaded_again(stage: Stage, tmp_path: Path) -> None:
    assert {type(stage.flat()[key]) for key in FOLLOWS} == {float}
    numbers = loads(text_with(LEAVES + NUMBERS + '\ncentre_x = "72 mm"\nfatigue = "400 MPa"'))
    for item in (stage, numbers):
        save(item, tmp_path / "saved.toml", overwrite=True)
        again = load(tmp_path / "saved.toml")
        assert again.flat() == item.flat()
        assert again.to_toml() == item.to_toml()


def test_the_same_numbers_written_as_a_joint(stage: Stage) -> None:
    """Leaf springs, and a joint of their stiffness and parasitic mode, are the same stage to the equations."""
    flat = stage.flat()
    units = dict(zip(FOLLOWS, ("N/m", "Hz", "kg", ""), strict=True))
    numbers = {key: f"{float(flat[key])!r} {unit}" if unit else flat[key] for key, unit in units.items()}
    joint = stage.replace({"flexure": None} | numbers)
    assert joint.flexure is None
    assert joint.flat() == {key: value for key, value in flat.items() if not key.startswith("flexure.")}
    for name, variant in stage.variants().items():
        own = {key: value for key, value in variant.flat().items() if not key.startswith("flexure.")}
        assert joint.variants()[name].flat() == own


def test_a_sweep_is_one_by_one(stage: Stage) -> None:
    thickness = np.array([0.2e-3, 0.35e-3, 0.5e-3, 0.9e-3])
    many = stage.flat({"flexure.thickness": thickness})
    for k, item in enumerate(thickness):
        alone = stage.flat({"flexure.thickness": item})
        written = stage.replace({"flexure.thickness": f"{float(item)!r} m"}).flat()
        for key in FOLLOWS:
            assert np.broadcast_to(many[key], thickness.shape)[k] == pytest.approx(alone[key], rel=1e-9)
            assert written[key] == pytest.approx(alone[key], rel=1e-9)
    assert np.all(np.diff(many["joint.stiffness"]) > 0)
    ratio = many["joint.stiffness"] / thickness**3  # linear in the third power
    assert ratio == pytest.approx(ratio[0], rel=1e-9)


def test_numbers_that_make_no_mechanism_are_marked(stage: Stage) -> None:
    """Cells of a sweep that no stage may have, rather than an error for all of them."""
    lengths = np.array([0.07, -0.07, -1e-9, np.nan, 0.002])
    flat = stage.flat({"flexure.length": lengths})
    broken = np.any(np.broadcast_arrays(*(where for where, _ in violations(flat)), lengths)[:-1], axis=0)
    assert broken.tolist() == [False, True, True, True, True]
    assert np.isfinite(np.broadcast_to(flat["joint.stiffness"], lengths.shape)[0])
    assert allowed_cells(stage, {}, {"flexure.length": lengths}).tolist() == [True, False, False, False, False]
    assert flat_cells(stage, {}, {"flexure.length": lengths})["joint.stiffness"][0] == pytest.approx(
        stage.flat()["joint.stiffness"], rel=1e-12
    )


@pytest.mark.parametrize(
    ("key", "values"),
    [
        ("flexure.leaves", [2.0, 21.0, 2.5, np.nan, 1.0]),
        ("flexure.width", [0.045, -1.0, 1e-3, np.nan, 0.0]),
        ("flexure.thickness", [0.35e-3, 8e-3, -1.0, np.nan]),
        ("flexure.spacing", [0.06, 0.3e-3, -0.06, np.nan, 0.0]),
        ("masses.stage", [0.5, -1.0, -0.5, np.nan]),
    ],
)
def test_bad_cells_are_found_in_every_number(stage: Stage, key: str, values: list[float]) -> None:
    assert np.flatnonzero(allowed_cells(stage, {}, {key: np.array(values)})).tolist() == [0]


def test_swept_by_friso(stage: Stage) -> None:
    short = stage.replace({"joint.locked": True, "motion.duration": "6 s"})
    runs = sweep(short, {"flexure.thickness": ["0.35 mm", "30 mm", "9 mm"]})
    assert (runs.outcome.values == "invalid").tolist() == [False, True, True]
    assert all("flexure.thickness" in reason for reason in runs.status.values[1:])
    reasons = [why for _, why in violations(stage.flat({"flexure.thickness": np.array([0.35e-3, -1e-3])}))]
    assert reasons[0].startswith("flexure.thickness")


@pytest.mark.parametrize("key", ["joint.stiffness", "parasitic.frequency"])
def test_what_follows_from_leaves_is_not_set_beside_them(stage: Stage, key: str) -> None:
    with refused(key):
        stage.flat({key: 1.0})


@pytest.mark.parametrize(("width", "depth"), [(0.0, 0.0), (0.2, 0.05), (0.05, 0.2), (0.3, 0.2)])
def test_a_block_of_unknown_inertia_fits_its_leaves(width: float, depth: float) -> None:
    """It weighs what the stage weighs, and is at least as wide as the leaves and as deep as their row."""
    moments, mass = np.array(block_inertia(2.0, width, depth)), 2.0
    x, y, z = np.sqrt(6 / mass * (moments.sum() - 2 * moments))
    assert x * y * z * 2700 == pytest.approx(mass)
    assert y >= width * (1 - 1e-9)
    assert z >= depth * (1 - 1e-9)
    assert x <= (mass / 2700) ** (1 / 3) * (1 + 1e-9)
