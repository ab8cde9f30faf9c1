"""A board and nothing else: heat capacity, losses and couplings from v / i, and what such a log must have."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from command import ended
from ninespring.find import board_alone
from ninespring.infer import from_resistance
from ninespring.io import results
from ninespring.io.logs import log_text, read_log
from ninespring.model import native
from ninespring.model.models import Array, read_model
from ninespring.say import page
from plants import a_plant, columns_of

TRUE = {"heat_capacity_j_per_k": 0.34, "loss_w_per_k": 0.0052, "orthogonal_w_per_k": 0.0007, "latent_heat_j": 7.5}


def board_log(
    path: Path,
    strongest_a: float = 2.1,
    effects: dict[str, dict[str, float]] | None = None,
    rows: int = 600,
    **more: np.ndarray | None,
) -> Path:
    """Write what a board logs of an array that is not as declared, springs in turn and together; no temperature."""
    rng = np.random.default_rng(4)
    time_s, current = np.arange(float(rows)), np.full((rows, 9), 0.25)
    for k in range(9):
        for at in range(10 + 11 * k, rows, 150):
            current[at : at + 70, k] = strongest_a * rng.uniform(0.75, 1.0)
    own = {f"resistance_scale[{k + 1}]": 1.0 + 0.03 * (k - 4) / 4 for k in range(9)}
    on = {"latent_heat": TRUE, "resistance_phase": {}, "spring_mismatch": own}
    plant = a_plant((3, 3), on | (effects or {}))
    ohm = np.empty((rows, 9))
    for row in range(rows):
        ohm[row] = [native.library().plant_resistance_ohm(plant._plant, k) for k in range(9)]
        for k in range(9):
            plant.drive(k, native.CURRENT, current[row, k])
        native.library().plant_step(plant._plant, 1.0)
    ohm = 0.5 * (ohm + np.concatenate([ohm[1:], ohm[-1:]]))
    # means of four readings that are rounded as the board's are
    hunting = current + rng.uniform(-0.008, 0.008, (4, *current.shape))
    voltage = (4e-3 * np.round(hunting * ohm / 4e-3)).mean(axis=0)
    current = hunting.mean(axis=0)
    columns = columns_of(i=current, v=voltage) | {"ambient_c": np.full(rows, 20.0)} | more
    path.write_text(log_text(time_s, {name: one for name, one in columns.items() if one is not None}))
    return path


def test_a_row_in_which_the_current_changed_is_no_resistance(tmp_path: Path) -> None:
    run = read_log(board_log(tmp_path / "board.csv"), or_resistance=True)
    assert run.current_a is not None and run.voltage_v is not None
    # on for half a row: the mean of the current, the voltage as it was while there was one
    run.current_a[21, 0], run.voltage_v[21, 0] = 0.5 * run.current_a[22, 0], run.voltage_v[22, 0]
    ohm = from_resistance.ohm_of(run)
    assert np.isnan(ohm[21, 0]) and ohm[30, 0] == pytest.approx(run.voltage_v[30, 0] / run.current_a[30, 0])
    assert np.isfinite(ohm).mean() > 0.9


def test_a_board_alone_tells_capacity_loss_coupling_and_latent_heat(tmp_path: Path) -> None:
    ended("fit", board_log(tmp_path / "board.csv"), "-o", tmp_path / "m.toml", "--json", tmp_path / "r.json")
    model = read_model(tmp_path / "m.toml")
    for name, value in TRUE.items():
        assert model.parameters[name] == pytest.approx(value, rel=0.1 if name.startswith("orth") else 0.05), name
    assert set(model.effects) == {"latent_heat", "resistance_phase", "spring_mismatch"}, "no effect that is not there"
    assert "only a thermometer can say" in model.provenance["note"]
    assert model.provenance["hottest_c"] > 88.0 and "rmse_after_c" not in model.provenance
    result = json.loads((tmp_path / "r.json").read_text())
    assert result["rmse_c"] is None and result["rmse_v"] < 0.5 * result["rmse_before_v"]
    own = [model.parameters[f"resistance_scale[{k}]"] for k in range(1, 10)]
    assert np.all(np.diff(own) > 0), "each wire has a resistance of its own"


@pytest.mark.parametrize(
    ("change", "said"),
    [({"strongest_a": 0.9}, "no spring's v / i ever changes"), ({"ambient_c": None}, "log ambient_c")],
)
def test_a_log_that_cannot_tell_is_refused_with_what_it_lacks(tmp_path: Path, change: dict, said: str) -> None:
    code, told = ended("fit", board_log(tmp_path / "board.csv", **change), "-o", tmp_path / "m.toml")
    assert code == 2 and said in told
    assert not (tmp_path / "m.toml").exists()


def test_logs_with_and_without_temperatures_are_not_mixed(tmp_path: Path, make_log) -> None:
    code, said = ended("fit", board_log(tmp_path / "board.csv"), make_log(), "-o", tmp_path / "m.toml")
    assert code == 2 and "give one kind at a time" in said


OUTER_ALIKE = {"edge_loss_fraction": 0.0} | {f"loss_scale[{k}]": 1.25 for k in range(1, 10) if k != 5}


@pytest.mark.parametrize(
    ("numbers", "name", "true"),
    [({"edge_loss_fraction": 0.25}, "edge_loss_fraction", 0.25), (OUTER_ALIKE, "outer_loss_scale", 1.25)],
)
def test_a_board_alone_is_diagnosed_with_its_effect_and_no_degrees(
    tmp_path: Path, numbers: dict[str, float], name: str, true: float
) -> None:
    log = board_log(tmp_path / "board.csv", effects={"edge_loss": numbers})
    assert ended("diagnose", log, "-o", tmp_path / "out")[0] == 0
    result = json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    assert [one["name"] for one in result["effects"]] == ["edge_loss"]
    found = result["effects"][0]["parameters"][name]
    assert abs(found["value"] - true) < 4.0 * found["stderr"]
    assert ("Or: Spring 5 loses 20" in result["effects"][0]["text"]) == (name == "outer_loss_scale")
    assert result["after"]["rmse_c"] is None and result["after"]["rmse_v"] < 0.5 * result["baseline"]["rmse_v"]
    assert "edge_loss" in read_model(tmp_path / "out" / "model.toml").effects
    assert "only a thermometer can say" in (tmp_path / "out" / "report.html").read_text()


def test_a_board_alone_tells_a_contact_that_got_worse(tmp_path: Path) -> None:
    run = read_log(board_log(tmp_path / "board.csv", rows=900), or_resistance=True)
    assert run.current_a is not None and run.voltage_v is not None
    run.voltage_v[300:, 3] += 0.02 * run.current_a[300:, 3]
    run.drive[:, 3] = run.current_a[:, 3] * run.voltage_v[:, 3]
    told, model = board_alone.diagnose(Array(), [run])
    result = results.plain(told)
    (contact,) = result["effects"]
    assert contact["name"] == "contact_resistance" and contact["variant"].startswith("spring 4, from 3")
    assert contact["parameters"]["contact_ohm[4]"]["value"] == pytest.approx(0.02, rel=0.1)
    assert not result["unexplained"] and "Missing: contact_resistance" in page.board_verdict(told)
    assert model.parameters["loss_w_per_k"] == pytest.approx(TRUE["loss_w_per_k"], rel=0.05)


def test_a_board_alone_tells_a_resistance_that_rises_with_temperature(tmp_path: Path) -> None:
    rises = {"resistance_martensite_rise_per_k": 8e-4, "resistance_austenite_rise_per_k": 8e-4}
    path = board_log(tmp_path / "board.csv", effects={"resistance_temperature": rises})
    told, model = board_alone.diagnose(Array(), [read_log(path, or_resistance=True)])
    result = results.plain(told)
    (rise,) = result["effects"]
    assert rise["name"] == "resistance_temperature" and not result["unexplained"]
    for name, value in rises.items():
        assert model.parameters[name] == pytest.approx(value, rel=0.15)
