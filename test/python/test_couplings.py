"""Couplings from geometry: held to closed forms, to energy, to the network that they are for; bad input is refused whole."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command import ended
from ninespring.explore import closed_forms, couplings, geometry
from ninespring.explore.field import Mesh, screening_length
from ninespring.model.cooling import Cooling
from ninespring.model.models import Array, read_array, read_model

pytest.importorskip("skfem", reason="SKIPPED: scikit-fem is missing: pip install 'ninespring[explore]'")
pytest.importorskip("gmsh", reason="SKIPPED: gmsh is missing: pip install 'ninespring[explore]'", exc_type=Exception)


COARSE = Mesh(9, 2, 1)


@pytest.mark.parametrize("name", closed_forms.PROBLEMS)
def test_the_field_comes_to_the_closed_form(name: str) -> None:
    errors = []
    for corners in (8, 12 if "fin" in name else 18):
        found, exact = closed_forms.PROBLEMS[name](Mesh(corners, 1, 1))
        errors.append(abs(found / exact - 1))
    assert errors[1] < 0.01
    assert errors[1] <= errors[0]


def test_rings_conduct_like_the_cylinder_of_maxwells_grid() -> None:
    # thin wires in a plane, all heat to one side (Maxwell, Treatise, 203): further out by s / (2 pi) ln(2 pi r / s)
    for wire, coil, spacing in ((0.1, 20.0, 0.8), (0.2, 20.0, 1.0)):
        grid = coil / 2 + spacing / (2 * np.pi) * np.log(np.pi * wire / spacing)
        assert geometry.ring_radius_mm(wire, coil, spacing) == pytest.approx(grid, abs=0.02 * spacing)
    # turns that nearly touch are a smooth tube
    assert geometry.ring_radius_mm(0.8, 3.45, 0.82) == pytest.approx(2.125, abs=0.1)


def test_the_screening_length_gives_back_the_correlation() -> None:
    from scipy.special import k0, k1

    x = 1.0 / screening_length(2.3, 1.0)
    assert 2 * x * k1(x) / k0(x) == pytest.approx(2.3)


@pytest.fixture(scope="module")
def found() -> couplings.Found:
    return couplings.couplings(Array(3, 3, 5.0), "coarse")  # the longest of these tests


def test_the_heat_that_goes_in_comes_out(found: couplings.Found) -> None:
    assert found.still.balance < 1e-6
    assert found.blown is not None and found.blown.balance < 1e-6


def test_the_network_answers_like_the_field(found: couplings.Found) -> None:
    assert found.drive_error < 0.03
    assert found.still.error < 1e-3 and found.blown is not None and found.blown.error < 1e-3
    # a network with other couplings does not: the check can fail
    wrong = replace(found.model, parameters=found.model.parameters | {"orthogonal_w_per_k": 0.0004})
    assert couplings.drive_error(found.geometry, wrong, found.still, found.blown) > 0.03


def test_what_is_found_is_plausible_and_has_errors(found: couplings.Found) -> None:
    values = found.model.parameters
    # the balance at 1.5 A and 105 degC is 5.8 mW/K, with the fan 10.8 (docs/physics.md): no measurement went in here
    assert found.model.array.springs == 9
    assert 0.0015 < values["loss_w_per_k"] < 0.006 < values["loss_fan_w_per_k"] < 0.013
    assert values["orthogonal_w_per_k"] > values["diagonal_w_per_k"]
    assert found.pairs.orthogonal > found.pairs.diagonal > found.pairs.second > 0
    for name in ("loss_w_per_k", "orthogonal_w_per_k", "heat_capacity_j_per_k"):
        assert 0 < found.model.stderr[name] < 0.2 * values[name]


def modes_of(**cooling: object) -> tuple[couplings.Modes, couplings.Modes | None]:
    return couplings.fields_of(geometry.geometry_of(Array(1, 2, 6.0, cooling=cooling)), COARSE)


def test_walls_metal_and_wind_do_what_they_must() -> None:
    plain, blown = modes_of(fan_direction="west")
    assert blown is not None
    # the stream goes west: spring 2 warms spring 1 more than spring 1 warms spring 2
    assert blown.response()[0, 1] > 1.2 * blown.response()[1, 0]
    assert np.allclose(plain.response(), plain.response().T)
    faster = modes_of(fan_m_per_s=2.0)[1]
    assert faster is not None and faster.response()[0, 0] < blown.response()[0, 0] < plain.response()[0, 0]
    metal, _ = modes_of(plate="aluminium", fan_m_per_s=0.0)
    assert metal.response()[0, 0] < plain.response()[0, 0]
    # a wall is a fin of its plate: the higher, the cooler the springs beside it
    wall, none = modes_of(plate="aluminium", baffle="copper", fan_m_per_s=0.0)
    low, _ = modes_of(plate="aluminium", baffle="copper", baffle_height_mm=6.0, fan_m_per_s=0.0)
    assert none is None
    assert wall.response()[0, 0] < low.response()[0, 0] < metal.response()[0, 0]


def ask(folder: Path, text: str, *more: object) -> tuple[int, str]:
    (folder / "array.toml").write_text(text)
    return ended("couplings", folder / "array.toml", "--mesh", "coarse", "-o", folder / "model.toml", *more)


def test_the_command_writes_a_model_that_the_others_read(tmp_path: Path) -> None:
    text = '[array]\nrows = 1\ncols = 2\npitch_mm = 5\n[cooling]\nfan_m_per_s = 0\nplate = "none"\n'
    assert ask(tmp_path, text, "--json", tmp_path / "c.json")[0] == 0
    model = read_model(tmp_path / "model.toml")
    assert model.array.cols == 2 and "geometry" in model.provenance["note"]
    assert model.parameters["loss_fan_w_per_k"] == model.parameters["loss_w_per_k"]
    result = json.loads((tmp_path / "c.json").read_text())
    assert result["drive_error"] < 0.03 and result["second_fan_w_per_k"] is None


def test_a_larger_array_repeats_what_a_part_of_it_does() -> None:
    part = geometry.geometry_of(Array(3, 3, 5.0))
    lumped = couplings.Lumped(
        {"plate_coupling_w_per_k": 1e-3, "plate_loss_w_per_k": 0.01, "edge_loss_fraction": 0.1}, {}, 0.0
    )
    lumped.values |= {"plate_heat_capacity_j_per_k": 2.0, "loss_w_per_k": 1e-3, "loss_fan_w_per_k": 2e-3}
    whole = replace(part, rows=8, cols=8)
    model = couplings.model_of(Array(8, 8, 5.0), whole, part, lumped, {})
    assert model.array.springs == 64
    larger = couplings.plate_area(whole) / couplings.plate_area(part)
    assert model.parameters["plate_loss_w_per_k"] == pytest.approx(0.01 * larger)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[array]\nrows=3\ncols=3\npitch_mm=4\n", "coils overlap: 3.45 mm mean coil"),
        ("[array]\nrows=3\ncols=3\n", "without pitch_mm"),
        ("[array]\nrows=3\ncols=3\npitch_mm=5\n[cooling]\nfan_speed=1\n", "did you mean fan_m_per_s?"),
        ("[array]\nrows=3\ncols=3\npitch_mm=5\n[cooling]\nplate='aluminum'\n", "did you mean aluminium?"),
        ("[array]\nrows=3\ncols=3\npitch_mm=5\n[cooling]\nfan_m_per_s=-1\n", "it must be 0 to 10"),
        ("[array]\nrows=3\ncols=3\npitch_mm=5\n[cooling]\nfan_m_per_s=0.01\n", "write 0 for still air"),
        ("[array]\nrows=3\ncols=3\npitch_mm=5\n[cooling]\nspring_length_mm=5\n", "do not fit into 5 mm"),
        (
            "[array]\nrows=3\ncols=3\npitch_mm=5\n[cooling]\nbaffle='steel'\nbaffle_thickness_mm=1\n",
            "does not fit between",
        ),
        ("[array]\nrows=3\ncols=3\npitch_mm=6\n[cooling]\nbaffle='steel'\nplate='none'\n", "plate must not be none"),
        ("[array]\nrows=3\ncols=3\npitch_mm=6\n[spring]\ncoil_diameter_mm=0.7\n", "cannot be wound"),
        ("cooling = 3\n[array]\nrows=3\ncols=3\npitch_mm=6\n", "must be a table"),
    ],
)
def test_what_cannot_be_built_is_refused_whole(tmp_path: Path, text: str, says: str) -> None:
    code, said = ask(tmp_path, text)
    assert code == 2 and says in said and str(tmp_path / "array.toml") in said
    assert not (tmp_path / "model.toml").exists()


def test_an_array_with_cooling_is_read_by_everybody(tmp_path: Path) -> None:
    path = tmp_path / "array.toml"
    path.write_text('[array]\nrows=1\ncols=2\n[cooling]\nplate = "copper"\nfan_direction = "south"\n')
    assert read_array(path).cooling == {"plate": "copper", "fan_direction": "south"}
    assert Cooling().fan_m_per_s == 0.63
