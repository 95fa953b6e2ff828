"""Both models of leaf springs against shells, on ten mechanisms spread over the design space.

`python tests/test_flexure_shells.py` prints the errors of docs/evidence/flexure.md, on a finer mesh.
"""

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
import shells

from friso.leaf_springs.beams import beams
from friso.leaf_springs.closed_forms import closed_form_model
from friso.leaf_springs.mechanism import Evaluation, Mechanism, MovingBody, block_inertia
from friso.materials import materials

LeafModel = Callable[[Mechanism, float], Evaluation]
MODELS: dict[str, LeafModel] = {"closed forms": closed_form_model, "beams": beams}
MECHANISMS = {
    # leaves, length, width, thickness, spacing [mm], material, mass [kg], x of its centre beyond the leaf ends [mm]
    "the thesis's": (2, 70, 45, 0.35, 60, "stainless 1.4310", 0.5, 0),
    "small": (4, 40, 20, 0.2, 10, "spring steel", 0.1, 5),
    "square": (2, 60, 60, 0.3, 60, "spring steel", 0.5, 0),
    "narrow": (2, 100, 30, 0.5, 60, "titanium", 0.5, 10),
    "slender": (2, 50, 12, 0.25, 40, "beryllium copper", 0.2, 0),
    "large and square": (2, 80, 80, 0.4, 100, "stainless 1.4310", 2.0, 0),
    "heavy": (2, 120, 60, 0.8, 90, "spring steel", 5.0, 20),
    "tiny": (3, 30, 25, 0.15, 10, "stainless 1.4310", 0.05, 0),
    "very slender": (2, 90, 15, 0.4, 60, "aluminium", 0.2, 0),
    "stiff": (2, 45, 45, 0.5, 45, "spring steel", 1.0, -10),
}
LIMITS = {"drive": 0.02, "support": 0.05, "turning": 0.05, "frequency": 0.05, "stress": 0.03, "buckling": 0.02}
"""Largest errors allowed, by the first word of the compared quantity."""

TWISTED = {"turning about z, deflected": 0.1}
"""Less is known of turning the stage on deflected leaves, which twists them."""

KINDS = {
    "stage uz": "drive",
    "stage uy": "stage along y",
    "stage rx": "stage about x",
    "stage ry": "stage about y",
    "stage rz": "stage about z",
    "leaves bending 1": "leaf bending",
    "leaves twisting 1": "leaf torsion",
}
"""Modes that are compared, the lowest of each kind, by their names of the shells and of friso."""


def mechanism(name: str) -> Mechanism:
    leaves, length, width, thickness, spacing, material, mass, beyond = MECHANISMS[name]
    data = materials()[material]
    length, width, thickness, spacing, beyond = (mm * 1e-3 for mm in (length, width, thickness, spacing, beyond))
    bare = Mechanism(
        leaves,
        length,
        width,
        thickness,
        spacing,
        *(float(data.young), data.poisson, float(data.density)),
        *(float(data.yield_strength), float(data.fatigue)),
        MovingBody(mass, (0.0, 0.0, 0.0), (length + beyond, 0.0, 0.0)),
        *((length + beyond, 0.0, 0.0),) * 2,
    )
    return Mechanism(**{**bare.__dict__, "body": MovingBody(mass, block_inertia(mass), bare.body.centre)})


@cache
def by_shells(name: str, mesh: shells.Mesh = shells.MESH) -> dict[str, float]:
    """Return results of shells.

    They are stiffness [N/m, N m] straight and deflected by L/50, frequencies [Hz], stress [Pa] at L/100, and buckling
    load [N].
    """
    example = mechanism(name)
    sheet = shells.Sheet(
        example.length, example.width, example.thickness, example.young, example.poisson, example.density
    )
    row, body = (int(example.leaves), example.spacing), example.body
    straight = shells.mechanism_stiffness(sheet, *row, mesh=mesh)
    bent = shells.mechanism_stiffness(sheet, *row, deflection=example.length / 50, mesh=mesh)
    frequencies, kinds = shells.modes(
        sheet, *row, body.mass, body.inertia, body.centre, count=6 + 8 * row[0], mesh=mesh
    )
    finer = (mesh[0] * 4 // 3, mesh[1] * 4 // 3)
    results = {
        "stress": shells.clamp_stress(sheet, example.length / 100, mesh=finer)[1],
        "buckling": shells.buckling_load(sheet, row[0], mesh=mesh),
    }
    for kind, frequency in zip(kinds, frequencies, strict=True):
        if kind in KINDS:
            results.setdefault(f"frequency, {KINDS[kind]}", float(frequency))
    return results | stiffnesses(straight, bent)


def stiffnesses(straight: np.ndarray, bent: np.ndarray) -> dict[str, float]:
    free = 1 / np.linalg.inv(straight)[2, 2], 1 / np.linalg.inv(bent)[2, 2]
    return {
        "drive, straight": float(free[0]),
        "drive, deflected": float(free[1]),
        "support x, straight": straight[0, 0],
        "support y, straight": straight[1, 1],
        "support x, deflected": bent[0, 0],
        "support y, deflected": bent[1, 1],
        "turning about x, straight": straight[3, 3],
        "turning about y, straight": straight[4, 4],
        "turning about z, straight": straight[5, 5],
        "turning about x, deflected": bent[3, 3],
        "turning about y, deflected": bent[4, 4],
        "turning about z, deflected": bent[5, 5],
    }


def by_model(evaluation: Evaluation, half: Evaluation) -> dict[str, float]:
    """Return results of a model at strokes of L/50 and L/100."""
    results = {"stress": half.stress, "buckling": evaluation.buckling} | stiffnesses(*evaluation.stiffness)
    for mode in evaluation.modes:
        results.setdefault(f"frequency, {mode.name.split(',')[0]}", mode.frequency)
    # the stiffness along x and y of the evaluation is that of its matrices, which closed forms have twice
    supports = {"support x": evaluation.support_x, "support y": evaluation.support_y}
    both = {
        f"{name}, {at}": support[k]
        for name, support in supports.items()
        for at, k in (("straight", 0), ("deflected", -1))
    }
    return results | both | {"drive, straight": evaluation.drive[0], "drive, deflected": evaluation.drive[-1]}


def errors(name: str, model: LeafModel, mesh: shells.Mesh = shells.MESH) -> dict[str, float]:
    example = mechanism(name)
    results, expected = (
        by_model(model(example, example.length / 50), model(example, example.length / 100)),
        by_shells(name, mesh),
    )
    return {key: results[key] / value - 1 for key, value in expected.items() if key in results}


@pytest.mark.cases(slow=5)
@pytest.mark.parametrize("name", MECHANISMS)
def test_both_models_agree_with_shells(name: str) -> None:
    for model in MODELS.values():
        deviations = errors(name, model)
        assert {"frequency, drive", "frequency, leaf bending", "frequency, leaf torsion"} <= deviations.keys()
        limits = {key: LIMITS[key.split(",")[0].split()[0]] for key in deviations} | TWISTED
        wrong = {key: f"{deviation:.2%}" for key, deviation in deviations.items() if abs(deviation) > limits[key]}
        assert not wrong


def test_published_leaf() -> None:
    """references.md, section 3: pyfe3d 40 x 24 of the thesis's leaf, E 210 GPa."""
    sheet = shells.Sheet(0.07, 0.045, 0.35e-3, 210e9, 0.3, 7850.0)
    assert shells.mechanism_stiffness(sheet, 2, 0.06)[2, 2] == pytest.approx(2540, rel=5e-3)
    mean, largest = shells.clamp_stress(sheet, 1e-3)
    assert mean == pytest.approx(48.6e6, rel=0.01)
    assert largest == pytest.approx(51.8e6, rel=0.01)


if __name__ == "__main__":
    for title, model in MODELS.items():
        table: dict[str, list[float]] = {}
        for mechanism in MECHANISMS:
            for key, error in errors(mechanism, model, mesh=(48, 24)).items():
                table.setdefault(key, []).append(100 * error)
        for key, column in sorted(table.items()):
            worst = max(column, key=abs)
            print(f"{title:13s} {key:28s} worst {worst:6.2f} % of {len(column):2d}, typical {np.median(column):6.2f} %")
