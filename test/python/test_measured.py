"""The measured data: skipped, saying so, where they are not."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from ninespring.find import diagnosis, steady
from ninespring.infer.predict import predict
from ninespring.infer.result import model_of
from ninespring.io import importing, results
from ninespring.io.logs import log_text, read_log
from ninespring.io.logs.run import Run
from ninespring.model.models import Array, Model
from ninespring.say.page import verdict


def test_six_camera_values_are_explained_by_one_number_and_rivals_have_experiments(
    measured: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "bench" / "diagnose"))
    from paper import paper_states

    states = paper_states(measured / "paper" / "steady.csv", "camera")
    result = results.plain(steady.diagnose_states(Array(), {}, states))
    assert result["baseline"]["rmse_c"] > 13.0
    assert result["after"]["holdout_rmse_c"] < 1.5
    assert result["rivals"]
    assert all("apart" in r["separating_experiment"] for r in result["rivals"])


@pytest.mark.parametrize(
    "file", ["energy_balance_600", pytest.param("second_order_mimo_201", marks=pytest.mark.nightly)]
)
def test_the_laboratory_is_explained_far_better_than_by_the_textbook(measured: Path, tmp_path: Path, file: str) -> None:
    """Textbook, in sample: 1.26 and 1.23 K; with sensor lag and a fitted ambient 0.63 and 0.58."""
    path = tmp_path / "log.csv"
    path.write_text(importing.import_table(measured / "tclab_apm" / f"{file}.txt", "tclab"))
    model = Model(Array(1, 2))
    model.parameters = {"heat_capacity_j_per_k": 2.0, "loss_w_per_k": 0.012, "command_power_w": 1.0}
    result = diagnosis.diagnose(Array(1, 2), [read_log(path, 2)], model=model).result
    effects = {e["name"]: e.get("variant") for e in result["effects"]}
    assert "sensor_lag" in effects
    assert effects["supply_sag"] == "chopped loads"
    assert result["after"]["rmse_c"] < 0.25
    assert result["after"]["holdout_rmse_c"] < 0.33


def prbs(measured: Path, folder: Path) -> Run:
    """Return the board that is heated at random, its room not logged."""
    path = folder / "log.csv"
    path.write_text(importing.import_table(measured / "tclab_mlid_prbs" / "tclab_prbs.csv", "tclab"))
    return read_log(path, 2)


def declared() -> Model:
    model = Model(Array(1, 2))
    model.parameters = {"heat_capacity_j_per_k": 2.0, "loss_w_per_k": 0.012, "command_power_w": 1.0}
    return model


@pytest.mark.nightly
def test_a_glitch_is_handled_and_an_unlogged_drift_is_no_name_but_noise_that_lasts(
    measured: Path, tmp_path: Path
) -> None:
    run = prbs(measured, tmp_path)
    assert any("spike" in note for note in run.notes)
    found = diagnosis.diagnose(Array(1, 2), [run], model=declared())
    assert {one["name"] for one in found.result["effects"]} <= {"sensor_lag"} and found.result["unexplained"]
    assert found.final.colour is not None and found.final.colour.share > 1.0
    assert found.result["unseen"]["rmse_c"] < 0.8 * found.result["unseen"]["declared_rmse_c"]


def test_where_nothing_found_predicts_as_well_the_model_is_the_better_baseline_and_says_so(
    measured: Path, tmp_path: Path
) -> None:
    run = prbs(measured, tmp_path)
    half = len(run.time_s) // 2
    found = diagnosis.diagnose(Array(1, 2), [run.part(slice(half))], model=declared())
    unseen = found.told.unseen
    assert isinstance(unseen, results.Unseen)
    assert unseen.rmse_c <= 1.05 * min(unseen.declared_rmse_c, unseen.with_lag_rmse_c)
    assert "The model is the declared model with a lag, by least squares" in unseen.text
    assert unseen.text in verdict(found.told)
    problem, fit, _ = diagnosis.fit_effects(Array(1, 2), [run.part(slice(half))], ["sensor_lag"], model=declared())
    second = run.part(slice(half, None))
    later = replace(second, time_s=second.time_s - second.time_s[0])
    off = [
        np.sqrt(np.nanmean((later.temperature_c - predict(model, later)) ** 2))
        for model in (found.model, model_of(problem, fit, problem.runs))
    ]
    assert off[0] <= 1.05 * off[1]


def test_beside_a_cause_without_a_name_the_model_is_the_better_baseline_where_that_foretells_better(
    measured: Path, tmp_path: Path
) -> None:
    path = tmp_path / "log.csv"
    path.write_text(importing.import_table(measured / "tclab_apm" / "energy_balance_600.txt", "tclab"))
    run = read_log(path, 2)
    later = run.part(run.time_s > run.time_s[-1] / 2.0)
    found = diagnosis.diagnose(Array(1, 2), [replace(later, time_s=later.time_s - later.time_s[0])], model=declared())
    unseen = found.told.unseen
    assert isinstance(unseen, results.Unseen) and found.told.unnamed
    assert unseen.rmse_c <= 1.05 * min(unseen.declared_rmse_c, unseen.with_lag_rmse_c)
    assert found.effects, "what was found is told all the same"
    assert bool(found.model.effects) != ("The model is the declared model" in unseen.text)


@pytest.mark.parametrize(("file", "share"), [("AB0", 0.5), ("AB1", 0.75)])
def test_the_latent_heat_of_a_real_actuator_is_named_with_its_alloy_declared_roughly(
    tmp_path: Path, file: str, share: float
) -> None:
    """The data's licence is unknown: they are not carried here, and read only where NINESPRING_PRIVATE says where."""
    private = os.environ.get("NINESPRING_PRIVATE")
    if not private:
        pytest.skip("NINESPRING_PRIVATE is not set: the real actuator's log (niti_pulse) is not public")
    raw = pd.read_csv(Path(private) / "niti_pulse" / f"{file}.csv")
    raw.columns = ["row", "t", "ambient", "force", "pwm", "rate"]
    raw = raw.rolling(15, center=True, min_periods=1).median().iloc[::20]
    path = tmp_path / "log.csv"
    columns = {"u1": raw.pwm / 255.0, "t1_c": raw.t, "ambient_c": raw.ambient}
    path.write_text(log_text(raw.row.to_numpy() * 0.01, {name: one.to_numpy(float) for name, one in columns.items()}))
    model = Model(Array(1, 1))
    model.parameters = {"command_power_w": 10.0, "austenite_start_c": 48.0, "austenite_finish_c": 58.0}
    model.parameters |= {"martensite_start_c": 42.0, "martensite_finish_c": 32.0}
    result = diagnosis.diagnose(Array(1, 1), [read_log(path, 1)], model=model).result
    assert "latent_heat" in {e["name"] for e in result["effects"]}
    assert result["after"]["rmse_c"] < share * result["baseline"]["rmse_c"]
    assert result["unseen"]["rmse_c"] < 0.6 * result["unseen"]["declared_rmse_c"]
