"""The measured data: skipped, saying so, where they are not."""

from __future__ import annotations

from pathlib import Path

import pytest
from ninespring import diagnosis, importing, steady
from ninespring.logs import read_log
from ninespring.models import Array, Model


def test_six_camera_values_are_explained_by_one_number_and_rivals_have_experiments(
    measured: Path,
) -> None:
    states = steady.paper_states(measured / "paper" / "steady.csv", "camera")
    result = steady.diagnose_states(Array(), {}, states)
    assert result["baseline"]["rmse_c"] > 13.0
    assert result["after"]["holdout_rmse_c"] < 1.5
    assert result["rivals"]
    assert all("apart" in r["separating_experiment"] for r in result["rivals"])


@pytest.mark.parametrize(
    ("file", "before", "after"),
    [("energy_balance_600", 1.26, 0.63), ("second_order_mimo_201", 1.23, 0.58)],
)
def test_the_laboratory_is_explained_better_than_by_the_textbook(
    measured: Path, tmp_path: Path, file: str, before: float, after: float
) -> None:
    path = tmp_path / "log.csv"
    path.write_text(importing.import_table(measured / "tclab_apm" / f"{file}.txt", "tclab"))
    model = Model(Array(1, 2))
    model.parameters = {
        "heat_capacity_j_per_k": 2.0,
        "loss_w_per_k": 0.012,
        "command_power_w": 1.0,
    }
    result = diagnosis.diagnose(Array(1, 2), [read_log(path, 2)], model=model).result
    assert "sensor_lag" in [e["name"] for e in result["effects"]]
    assert result["after"]["rmse_c"] < after
    assert result["after"]["holdout_rmse_c"] < before


def test_a_glitch_and_an_unlogged_drift_are_handled_without_being_told(measured: Path, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(importing.import_table(measured / "tclab_mlid_prbs" / "tclab_prbs.csv", "tclab-prbs"))
    run = read_log(path, 2)
    assert any("spike" in note for note in run.notes)
    model = Model(Array(1, 2))
    model.parameters = {
        "heat_capacity_j_per_k": 2.0,
        "loss_w_per_k": 0.012,
        "command_power_w": 1.0,
    }
    result = diagnosis.diagnose(Array(1, 2), [run], model=model).result
    assert {"ambient_drift", "sensor_lag"} <= {e["name"] for e in result["effects"]}
