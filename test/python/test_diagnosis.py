"""The diagnosis: known numbers are recovered with honest errors, missing effects found, none invented."""

from __future__ import annotations

import copy
import json

import jsonschema
import msgspec
import numpy as np
import pytest
from command import ninespring
from made import an_effect
from ninespring.export.settings import left_out
from ninespring.find import diagnosis, search
from ninespring.find.certainty import CERTAIN, Witness, witness
from ninespring.infer.declared import base_spec
from ninespring.infer.fit import Fit
from ninespring.infer.predict import plant_of, predict
from ninespring.infer.problem import Problem
from ninespring.io import results
from ninespring.io.logs import read_log
from ninespring.model import native
from ninespring.model.models import Array
from ninespring.model.spec import Free, Spec

PUBLISHED = jsonschema.Draft202012Validator(json.loads(results.schema("diagnosis")))


def names(result: dict) -> list[str]:
    return [e["name"] for e in result["effects"]]


def test_nothing_is_adopted_where_nothing_is_missing(make_log) -> None:
    result = diagnosis.diagnose(Array(), [read_log(make_log(seed=3))]).result
    assert names(result) == []
    assert result["unexplained"] is False
    assert result["after"]["rmse_c"] == pytest.approx(0.3, rel=0.05)


def test_what_a_fit_keeps_of_long_logs_is_bounded_by_readings(make_log) -> None:
    run = read_log(make_log(seconds=9000))
    one = diagnosis.prepare(Array(), [run])
    assert 2000 < sum(len(each.time_s) for each in one.runs) <= 3000  # nine springs
    three = diagnosis.prepare(Array(), [run] * 3)
    assert sum(len(each.time_s) for each in three.runs) <= 3000


@pytest.mark.parametrize(
    ("effect", "numbers", "columns"),
    [
        ("latent_heat", {"latent_heat_j": 8.0}, "iv"),
        ("sensor_lag", {"sensor_lag_s": 6.0}, "iv"),
        ("shared_air", {"air_heat_capacity_j_per_k": 4.0, "air_exchange_w_per_k": 0.1}, "iv"),
        ("holder_mass", {"holder_coupling_w_per_k": 0.004, "holder_heat_capacity_j_per_k": 0.6}, "iv"),
        ("fan_wake", {"wake_w_per_k": 0.0015, "wake_direction": 1.0}, "iv"),
        ("spring_mismatch", {"loss_scale[4]": 1.3}, "iv"),
        ("resistance_phase", {"resistance_austenite_ohm": 0.24}, "i"),
    ],
)
def test_the_missing_effect_is_named_with_its_number(make_log, effect: str, numbers: dict, columns: str) -> None:
    found = diagnosis.diagnose(Array(), [read_log(make_log(effects={effect: numbers}, seed=2, columns=columns))])
    result = found.result
    assert names(result) == [effect]
    fitted = result["effects"][0]["parameters"]
    first = next(iter(numbers))
    assert fitted[first]["value"] == pytest.approx(numbers[first], rel=0.15)
    assert result["after"]["holdout_rmse_c"] < 1.1 * 0.3
    PUBLISHED.validate(result)
    with pytest.raises(jsonschema.ValidationError):
        PUBLISHED.validate(result | {"effects": [{"name": "ghost"}]})
    on_chip = effect not in left_out(found.model)
    assert (effect in found.model.effects) and result["effects"][0]["on_chip"] == on_chip


@pytest.mark.nightly
def test_each_spring_is_its_own_beside_a_law_of_all(make_log) -> None:
    """Springs that lie 4 % apart: one name of one spring or its thermometer after the other stood in for them."""
    losses = (1.04, 0.96, 0.97, 0.96, 1.02, 0.97, 1.06, 1.05, 0.97)
    masses = (1.04, 0.99, 0.97, 1.03, 1.0, 1.02, 0.96, 1.01, 0.98)
    each = {f"loss_scale[{k}]": one for k, one in enumerate(losses, 1)}
    each |= {f"heat_capacity_scale[{k}]": one for k, one in enumerate(masses, 1)}
    both = {"edge_loss": {"edge_loss_fraction": 0.2}, "spring_mismatch": each}
    runs = [read_log(make_log(f"{k}.csv", both, seed=k, noise=0.2)) for k in (1, 2)]
    found = diagnosis.diagnose(Array(), runs)
    result = found.result
    assert set(names(result)) == set(both) and not result["unexplained"] and not result["unnamed"]
    by_name = {one["name"]: one for one in result["effects"]}
    assert by_name["spring_mismatch"]["variant"] == "each its own"
    assert by_name["spring_mismatch"]["text"].startswith("Each spring loses its own: ")
    assert by_name["spring_mismatch"]["in_words"] == "each spring differs from the others"
    numbers = {key: one["value"] for one in result["effects"] for key, one in one["parameters"].items()}
    assert numbers["edge_loss_fraction"] == pytest.approx(0.2, abs=0.05)
    assert [numbers[f"heat_capacity_scale[{k}]"] for k in range(1, 10)] == pytest.approx(masses, abs=0.02)
    PUBLISHED.validate(result)
    again = diagnosis.diagnose(Array(), runs, model=found.model).result
    assert again["effects"] == [] and not again["unexplained"], "its model has all their numbers"


def test_what_is_not_believed_leaves_its_place_to_another(make_log, monkeypatch: pytest.MonkeyPatch) -> None:
    judged = []

    def doubted(problem: Problem, fit: Fit, effect: str, *rest: object) -> Witness:
        judged.append(effect)
        return msgspec.structs.replace(
            witness(problem, fit, effect, *rest), share=0.97 * (effect != "natural_convection")
        )

    monkeypatch.setattr(diagnosis, "witness", doubted)
    monkeypatch.setattr(diagnosis.unseen.Unseen, "tells", lambda *_: False)  # what it is foretold by is true here
    strong = {"natural_convection": {"convection_exponent": 0.25}}
    result = diagnosis.diagnose(Array(), [read_log(make_log(effects=strong, seed=3))]).result
    assert judged[0] == "natural_convection" and len(judged) > 1
    assert names(result) and "natural_convection" not in names(result)


def test_a_clock_that_runs_ahead_is_said(make_log, briefly: None) -> None:
    def shift(columns: dict[str, np.ndarray]) -> None:
        for k in range(1, 10):
            columns[f"t{k}_c"] = np.concatenate([columns[f"t{k}_c"][8:], np.full(8, np.nan)])

    result = diagnosis.diagnose(Array(), [read_log(make_log(change=shift, seconds=300))]).result
    assert any("correct the clock" in text for text in result["warnings"])
    assert "sensor_lag" not in names(result)


def test_numbers_the_data_cannot_fix_are_reported(make_log) -> None:
    def never_blown(columns: dict[str, np.ndarray]) -> None:
        columns["fan"] = np.full(300, 0.11)

    _, fit, _ = diagnosis.fit_effects(Array(), [read_log(make_log(change=never_blown, seconds=300))], [])
    listed = diagnosis.identifiability_of(fit)
    assert listed.correlated or listed.not_identifiable or listed.at_bounds


def test_what_is_written_is_held_to_its_units_and_ranges() -> None:
    number = results.Number(value=1.0, stderr=-0.1, unit="J")
    with pytest.raises(msgspec.ValidationError, match="stderr"):
        results.checked(number)
    assert results.plain(results.Number(value=np.float64(1.0), stderr=None, unit="J")) == {
        "value": 1.0,
        "stderr": None,
        "unit": "J",
    }


@pytest.mark.parametrize("of", results.SCHEMAS)
def test_the_schemas_of_the_results_are_printed(of: str) -> None:
    printed = json.loads(ninespring("schema", of).stdout)
    jsonschema.Draft202012Validator.check_schema(printed)
    assert {"$schema", "title", "anyOf", "$defs"} == set(printed) and len(printed["anyOf"]) > 2


def test_the_chip_takes_the_effect_and_not_the_thermometer_and_is_better_on_a_log_it_never_saw(make_log) -> None:
    both = {"latent_heat": {"latent_heat_j": 8.0}, "sensor_lag": {"sensor_lag_s": 5.0}}
    found = diagnosis.diagnose(Array(), [read_log(make_log(effects=both, seed=1))])
    assert set(names(found.result)) == set(both)
    text, message = native.chip_export(plant_of(found.model))
    value = float(next(line for line in text.splitlines() if line.startswith("$latent_heat_j=")).split("=")[1])
    assert value == pytest.approx(8.0, rel=0.1)
    assert "lag" not in text and "sensor_lag" in message
    held = read_log(make_log("held.csv", both, seed=9))
    before = copy.deepcopy(found.model)
    before.effects = ["sensor_lag"]
    before.parameters = {k: v for k, v in before.parameters.items() if k != "latent_heat_j"}

    def error(model) -> float:
        return float(np.sqrt(np.nanmean((held.temperature_c - predict(model, held, chip=True)) ** 2)))

    assert error(found.model) < 0.6 < error(before)


def test_simulations_in_threads_give_the_same_as_alone(make_log) -> None:
    problem = Problem(Array(), [read_log(make_log())])
    spec = base_spec(problem)
    values = [f.start for f in spec.free]
    alone = problem.simulate(spec, values, 0)
    for one in problem.simulate_many([(spec, values, 0)] * 8):
        assert np.array_equal(alone, one)


def test_what_the_same_readings_say_of_another_is_not_certain() -> None:
    def number(value: float) -> results.Number:
        return results.Number(value=value, stderr=0.001, unit="1")

    middle = {"loss_scale[5]": number(1.3), "heat_capacity_scale[5]": number(1.0)}
    for evidence, apart_c, shared in ((3.7, 0.0003, True), (30.0, 0.0003, False), (3.7, 0.3, False)):
        entry = an_effect("edge_loss", probability=0.99, certainty="certain", text="Outer springs lose 23 % less.")
        rival = results.Rival(
            instead_of="edge_loss",
            name="spring_mismatch",
            variant="spring 5",
            rmse_c=0.3,
            evidence=evidence,
            predictions_differ_c=apart_c,
            parameters=middle,
            separating_experiment="none",
        )
        diagnosis.share_with([entry], [rival], 0.06)
        assert (entry.certainty == "probable" and entry.probability < 0.5) == shared
        assert (entry.certainty == "certain") == (evidence > search.TOLD_APART)
        assert ("Or: Spring 5 loses 30" in entry.text and "only in combination" in entry.text) == shared


def test_an_effect_with_a_number_at_its_bound_is_never_certain(make_log) -> None:
    outer = {"edge_loss": {"edge_loss_fraction": 1.9}}  # more than any edge_loss of the library
    found = diagnosis.diagnose(Array(), [read_log(make_log(effects=outer))]).result
    (edge,) = (one for one in found["effects"] if one["name"] == "edge_loss")
    assert edge["parameters"]["edge_loss_fraction"]["note"] == "at its bound"
    assert "edge_loss_fraction" in found["identifiability"]["at_bounds"]
    assert edge["certainty"] == "probable" and edge["probability"] < CERTAIN < Witness(**edge["witness"]).probability()


def test_what_explains_most_and_is_not_named_all_the_same_is_said(make_log, monkeypatch) -> None:
    monkeypatch.setattr(Witness, "probability", lambda self: 0.4)
    monkeypatch.setattr(diagnosis.unseen.Unseen, "tells", lambda *_: False)  # what it is foretold by is true here
    found = diagnosis.diagnose(Array(), [read_log(make_log(effects={"plate_conduction": {}}))]).result
    assert not found["effects"] and found["unexplained"]
    assert any("plate_conduction" in one and "40% likely, it is not named" in one for one in found["warnings"])


def test_beside_a_room_at_its_bound_no_name_is_certain() -> None:
    room = Free("ambient_c@1", 20.0, 20.0, 24.0, "degC", run=0)
    edge = Free("edge_loss_fraction", 0.2, 0.0, 1.0, "1", effect="edge_loss")
    for room_c, fraction, ends in ((20.0, 0.2, True), (22.0, 0.2, False), (22.0, 1.0, True)):
        fit = Fit(Spec(("edge_loss",), free=(room, edge)), np.array([room_c, fraction]), 0.0, 1, [])
        assert diagnosis._at_an_end(fit, "edge_loss") is ends
        assert diagnosis._at_an_end(fit, "radiation") is (room_c == 20.0)
