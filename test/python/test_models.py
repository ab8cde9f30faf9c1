"""array.toml and model.toml: what is written is read back, what is wrong is refused with its line and advice."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from ninespring import native
from ninespring.errors import InputError
from ninespring.fit.predict import plant_of
from ninespring.models import SCHEMA, Array, Model, model_text, read_array, read_model

HEAD = f'schema = "{SCHEMA}"\neffects = ["latent_heat"]\n\n[array]\nrows = 1\ncols = 2\n\n'


def entry(text: str) -> str:
    return f"{HEAD}[[parameter]]\n{text}\n"


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("[sensor]\nnoise_c = 0.3\n", 1, "there is no [array] table"),
        ("[array]\nrows = 3\n", 1, "without cols"),
        ("[array]\nrows = 3\ncols = 2.5\n", 3, "cols must be a whole number"),
        ("[array]\nrows = 9\ncols = 9\n", 2, "more than 64 springs"),
        ("[array]\nrows = 3\ncols = 3\npitch = 4\n", 4, "did you mean pitch_mm?"),
        ('[array]\nrows = 3\ncols = 3\npitch_mm = "4"\n', 4, "must be a number, without quotes"),
        ("[array]\nrows = 3\ncols = 3\n[spring]\nturns = -1\n", 5, "turns is -1"),
        ("[array]\nrows = 3\ncols =\n", 3, "this is not TOML"),
    ],
)
def test_a_wrong_array_is_refused_where_it_is_wrong(tmp_path: Path, text: str, line: int, words: str) -> None:
    path = tmp_path / "array.toml"
    path.write_text(text)
    with pytest.raises(InputError) as refused:
        read_array(path)
    assert f":{line}:" in str(refused.value) and words in str(refused.value)


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        (HEAD.replace("model/1", "model/9"), 1, "this version reads"),
        (HEAD.replace("latent_heat", "latent_heet"), 2, "did you mean latent_heat?"),
        (entry('name = "loss_w"\nvalue = 1.0'), 9, "did you mean loss_w_per_k?"),
        (entry('name = "loss_w_per_k"'), 9, "without value"),
        (entry('name = "loss_w_per_k"\nvalue = 0.01\nunit = "mW/K"'), 9, "is in 'W/K', not in 'mW/K'"),
        (entry('name = "loss_w_per_k"\nvalue = 99.0'), 10, "it must be 0 to 10"),
        (entry('name = "loss_w_per_k"\nvalue = 0.01\nspring = 3'), 9, "there is no spring 3"),
        (entry('name = "orthogonal_w_per_k"\nvalue = 0.01\nspring = 1'), 9, "of the whole array"),
        (
            entry('name = "loss_w_per_k"\nvalue = 0.01') * 1 + '[[parameter]]\nname = "loss_w_per_k"\nvalue = 0.02\n',
            9,
            "twice",
        ),
    ],
)
def test_a_wrong_model_is_refused_where_it_is_wrong(tmp_path: Path, text: str, line: int, words: str) -> None:
    path = tmp_path / "model.toml"
    path.write_text(text)
    with pytest.raises(InputError) as refused:
        read_model(path)
    assert f":{line}:" in str(refused.value) and words in str(refused.value)


@given(data=st.data())
def test_what_is_written_is_read_back(data: st.DataObject, tmp_path_factory: pytest.TempPathFactory) -> None:
    model = Model(Array(data.draw(st.integers(1, 8)), data.draw(st.integers(1, 8))))
    table = native.parameter_table()
    for name in data.draw(st.sets(st.sampled_from(sorted(table)), max_size=6)):
        known = table[name]
        if known.name in ("wake_direction", "convection_correlation", "supply_chopped"):
            continue
        value = data.draw(st.floats(known.minimum, known.maximum, allow_subnormal=False))
        spring = data.draw(st.integers(1, model.array.springs)) if known.per_spring else 0
        full = f"{name}[{spring}]" if spring and data.draw(st.booleans()) else name
        model.parameters[full] = value
        if data.draw(st.booleans()):
            model.stderr[full] = abs(value) / 3
    model.effects = data.draw(st.lists(st.sampled_from(native.effect_names()), unique=True))
    model.provenance = {"note": 'with "quotes" and\nlines', "rmse_after_c": 0.25}
    path = tmp_path_factory.mktemp("model") / "model.toml"
    path.write_text(model_text(model))
    again = read_model(path)
    assert (again.array.rows, again.array.cols) == (model.array.rows, model.array.cols)
    assert again.effects == model.effects and set(again.parameters) == set(model.parameters)
    for name, value in model.parameters.items():
        assert again.parameters[name] == pytest.approx(value, rel=1e-6, abs=1e-300)
    assert again.stderr == pytest.approx(model.stderr, rel=1e-6, abs=1e-300)
    assert again.provenance["note"] == model.provenance["note"]


def test_a_model_is_the_plant_that_it_describes() -> None:
    model = Model(Array(1, 2))
    model.effects = ["supply_sag"]
    model.parameters = {"loss_w_per_k[2]": 0.02, "loss_w_per_k": 0.01, "supply_chopped": 1.0}
    model.array.spring = {"wire_diameter_mm": 1.6}
    plant = plant_of(model)
    assert (plant.get("loss_w_per_k[1]"), plant.get("loss_w_per_k[2]")) == (0.01, 0.02)
    assert plant.get("supply_chopped") == 1.0
    # four times the section: four times the heat capacity, a quarter of the resistance
    assert plant.get("heat_capacity_j_per_k") == pytest.approx(4 * 0.300, rel=0.01)
    assert plant.get("resistance_martensite_ohm") == pytest.approx(0.175 / 4, rel=0.01)
