"""array.toml and model.toml: what is written is read back, what is wrong is refused with its line and advice."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from ninespring.errors import InputError
from ninespring.infer.declared import base_spec
from ninespring.infer.predict import plant_of
from ninespring.infer.problem import Problem
from ninespring.infer.scene import scene_of
from ninespring.io.logs.run import Run
from ninespring.model import native
from ninespring.model.effects import alloy
from ninespring.model.models import SCHEMA, Array, Model, model_text, read_array, read_model

HEAD = f'schema = "{SCHEMA}"\neffects = ["latent_heat"]\n\n[array]\nrows = 1\ncols = 2\n\n'


ARRAY = "[array]\nrows = 3\ncols = 3\n"
UNIT = 'unit = "W/K"'


def entry(text: str) -> str:
    return f"{HEAD}[[parameter]]\n{text}\n"


def refused(path: Path, read: Callable[[Path], object]) -> tuple[str, str]:
    """Return `line:column` of a refusal and what it says."""
    with pytest.raises(InputError) as caught:
        read(path)
    error = caught.value
    assert str(error).startswith(f"{path}:") and "\n" not in str(error)
    return f"{error.line}:{error.column}", error.message


@pytest.mark.parametrize(
    ("text", "place", "words"),
    [
        ("[sensor]\nnoise_c = 0.3\n", "1:1", "there is no [array] table"),
        ("[array]\nrows = 3\n", "1:1", "without cols"),
        ("[array]\nrows = 3\ncols = 2.5\n", "3:8", "cols must be a whole number"),
        ("[array]\nrows = 33\ncols = 32\n", "3:8", "more than 1024 springs"),
        ("array = 3\n", "1:9", "[array] must be a table"),
        (ARRAY + "pitch = 4\n", "4:1", "did you mean pitch_mm?"),
        (ARRAY + 'pitch_mm = "4"\n', "4:12", "must be a number, without quotes"),
        (ARRAY + "[spring]\nturns = -1\n", "5:9", "turns is -1"),
        (ARRAY + "[spring]\nturns = inf\n", "5:9", "turns"),
        (ARRAY + f"[spring]\nturns = {10**400}\n", "5:9", "it must be 0.1 to 1000"),
        (ARRAY + "[material]\n# turns = 1\n  mass = 2\n", "6:3", "no key 'mass'"),
        (ARRAY + '[sensor]\nnoise_c = "0.3"\n', "5:11", "without quotes"),
        (ARRAY + "[sensor]\nkind = 3\n", "5:8", "text in quotes"),
        ("[array]\nrows = 3\ncols =\n", "3:7", "this is not TOML"),
        (ARRAY + "rows = 2\n", "4:9", "this is not TOML"),
        (ARRAY + "[[param", "4:8", "this is not TOML"),
        (ARRAY + "pitch_mm = 4,5\n", "4:13", "a decimal comma?"),
        (ARRAY + "board = {2 = {supply_limit_a = 4,5}}\n", "4:35", "a decimal comma?"),
    ],
)
def test_a_wrong_array_is_refused_where_it_is_wrong(tmp_path: Path, text: str, place: str, words: str) -> None:
    path = tmp_path / "array.toml"
    path.write_text(text)
    at, said = refused(path, read_array)
    assert at == place and words in said


@pytest.mark.parametrize(
    ("text", "place", "words"),
    [
        (HEAD.replace("model/1", "model/9"), "1:10", "this version reads"),
        (HEAD.partition("\n")[2], "1:1", "without schema"),
        (f'schema = "{SCHEMA}"\n', "1:1", "there is no [array] table"),
        (HEAD + "pitch_mm = 4\n\n[colour]\n", "10:1", "no key 'colour'"),
        (HEAD.replace("latent_heat", "latent_heet"), "2:13", "did you mean latent_heat?"),
        (HEAD.replace('"latent_heat"', '"radiation",\n "radiation"'), "2:13", "appears twice"),
        (HEAD.replace('["latent_heat"]', '"latent_heat"'), "2:11", "must be a list"),
        (entry("value = 1.0"), "8:1", "without name"),
        (entry(f'name = "loss_w"\nvalue = 1.0\n{UNIT}'), "9:8", "did you mean loss_w_per_k?"),
        (entry('name = "loss_w_per_k"'), "8:1", "without value"),
        (entry('name = "loss_w_per_k"\nvalue = 0.01'), "8:1", "without unit"),
        (entry('name = "loss_w_per_k"\nvalue = 0.01\nunit = "mW/K"'), "11:8", "is in 'W/K', not in 'mW/K'"),
        (entry(f'name = "loss_w_per_k"\nvalue = 99.0\n{UNIT}'), "10:9", "it must be 0 to 10"),
        (entry(f'name = "loss_w_per_k"\nvalue = nan\n{UNIT}'), "10:9", "it must be 0 to 10"),
        (entry(f'name = "loss_w_per_k"\nvalue = 0.01\n{UNIT}\nspring = 3'), "12:10", "1 to 2"),
        (entry(f'name = "loss_w_per_k"\nvalue = 0.01\n{UNIT}\nstderr = -1'), "12:10", "stderr is -1"),
        (entry(f'name = "loss_w_per_k"\nvalue = 0.01\n{UNIT}\neffect = "radiation"'), "12:10", "no effect"),
        (entry(f'name = "orthogonal_w_per_k"\nvalue = 0.01\n{UNIT}\nspring = 1'), "12:10", "of the whole array"),
        (
            entry(f'name = "loss_w_per_k"\nvalue = 0.01\n{UNIT}')
            + f'[[parameter]]\nname = "loss_w_per_k"\nvalue = 0.02\n{UNIT}\n',
            "14:9",
            "twice",
        ),
        (HEAD + "[provenance]\nauthor = 3\n", "9:1", "no key 'author'"),
        (HEAD + "[provenance]\nnote = 3\n", "9:8", "text in quotes"),
        (HEAD + "[provenance]\nlogs = [3]\n", "9:8", "must be a table"),
    ],
)
def test_a_wrong_model_is_refused_where_it_is_wrong(tmp_path: Path, text: str, place: str, words: str) -> None:
    path = tmp_path / "model.toml"
    path.write_text(text)
    at, said = refused(path, read_model)
    assert at == place and words in said


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.tuples(st.integers(0, 400), st.integers(0, 30), st.binary(max_size=9)), min_size=1, max_size=4))
def test_a_damaged_model_is_read_or_refused_with_one_line(tmp_path: Path, wounds: list[tuple[int, int, bytes]]) -> None:
    whole = Model(Array(1, 2, 4.0, {"turns": 10.0}, {}, {"kind": "camera"}), ["latent_heat"], {"loss_w_per_k": 0.01})
    whole.provenance = {"note": "a", "logs": [{"file": "a", "sha256": "0"}]}
    data = model_text(whole).encode()
    for at, cut, put in wounds:
        data = data[:at] + put + data[at + cut :]
    path = tmp_path / "model.toml"
    path.write_bytes(data)
    try:
        assert read_model(path).array.springs >= 1
    except InputError as error:
        assert str(error).startswith(f"{path}:") and "\n" not in str(error)


@settings(deadline=None)
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


def test_what_is_inconsistent_is_named_with_its_values() -> None:
    model = Model(Array(1, 1))
    model.effects = ["latent_heat"]
    model.parameters = {"martensite_start_c": 50.47938, "austenite_finish_c": 50.47938, "austenite_start_c": 44.0}
    model.parameters["martensite_finish_c"] = 40.0
    with pytest.raises(native.NativeError) as caught:
        plant_of(model).start_from_measured(np.array([20.0]))
    assert "martensite_start_c must be below austenite_finish_c: 50.47938, 50.47938" in str(caught.value)


@pytest.mark.parametrize("middle_c", [50.479376, 80.0, 119.99999])
@pytest.mark.parametrize(
    ("low", "high"), [("martensite_start_c", "austenite_finish_c"), ("martensite_finish_c", "austenite_start_c")]
)
def test_an_alloy_that_a_fit_may_have_is_read_back_open(tmp_path: Path, middle_c: float, low: str, high: str) -> None:
    points = dict.fromkeys(("martensite_finish_c", "austenite_start_c"), middle_c - 10.0)
    points |= dict.fromkeys(("martensite_start_c", "austenite_finish_c"), middle_c + 10.0)
    points |= {"martensite_finish_c": middle_c - 20.0, "austenite_finish_c": middle_c + 20.0}
    assert not alloy.shut(points)
    assert not alloy.shut({low: 1.0}), "what is not fitted is as it was declared"
    assert alloy.shut(points | {high: points[low] + 0.9 * alloy.OPEN_K})
    model = Model(Array(1, 1))
    model.effects, model.parameters = ["latent_heat"], points | {high: points[low] + 1.01 * alloy.OPEN_K}
    path = tmp_path / "model.toml"
    path.write_text(model_text(model))
    assert plant_of(read_model(path)).check() is None


def test_a_fit_does_not_come_to_an_alloy_that_is_shut() -> None:
    problem = pulse_problem()
    spec = base_spec(problem).with_effect("latent_heat", alloy.numbers(scene_of(problem)), (), "")
    start = {free.key: free.start for free in spec.free}
    gap = problem.base_value("austenite_finish_c") - problem.base_value("martensite_start_c")
    for open_k, shown in ((2.0 * alloy.OPEN_K, True), (0.5 * alloy.OPEN_K, False)):
        values = start | {alloy.HYSTERESIS: open_k - gap}
        left = problem.simulate(spec, [values[free.key] for free in spec.free], 0)
        assert bool(np.abs(left).max() < 200.0) is shown


def pulse_problem() -> Problem:
    time_s = np.arange(60.0)
    shown = 20.0 + np.random.default_rng(1).normal(0.0, 0.1, (60, 1))
    run = Run("run", "", time_s, "power", np.zeros((60, 1)), shown, np.zeros(60), np.full(60, 20.0))
    return Problem(Array(1, 1), [run])
