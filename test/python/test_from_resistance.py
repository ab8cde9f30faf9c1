"""A board and nothing else: heat capacity, losses and couplings from v / i, and what such a log must have."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from ninespring import native
from ninespring.cli import cli
from ninespring.errors import InputError
from ninespring.logs import log_text
from ninespring.models import read_model

TRUE = {"heat_capacity_j_per_k": 0.34, "loss_w_per_k": 0.0052, "orthogonal_w_per_k": 0.0007, "latent_heat_j": 7.5}


def board_log(
    path: Path, strongest_a: float = 2.1, effects: dict[str, dict[str, float]] | None = None, **more: np.ndarray | None
) -> Path:
    """Write what a board logs of an array that is not as declared, springs in turn and together; no temperature."""
    rng = np.random.default_rng(4)
    rows = 900
    time_s, current = np.arange(float(rows)), np.full((rows, 9), 0.25)
    for k in range(9):
        for at in range(10 + 11 * k, rows, 150):
            current[at : at + 70, k] = strongest_a * rng.uniform(0.75, 1.0)
    plant = native.Plant(3, 3)
    plant.set_effects(["latent_heat", "resistance_phase", *(effects or {})])
    plant.set_all(TRUE)
    for numbers in (effects or {}).values():
        plant.set_all(numbers)
    plant.reset()
    ohm = np.empty((rows, 9))
    for row in range(rows):
        ohm[row] = [native.library().plant_resistance_ohm(plant._plant, k) for k in range(9)]
        for k in range(9):
            plant.drive(k, native.CURRENT, current[row, k])
        native.library().plant_step(plant._plant, 1.0)
    ohm = ohm * (1.0 + 0.03 * np.linspace(-1, 1, 9))
    voltage = current * ohm + rng.normal(0.0, 5e-4, current.shape)
    columns = {f"i{k + 1}_a": current[:, k] for k in range(9)} | {f"v{k + 1}_v": voltage[:, k] for k in range(9)}
    columns |= {"ambient_c": np.full(rows, 20.0)} | more
    path.write_text(log_text(time_s, {name: one for name, one in columns.items() if one is not None}))
    return path


def fit(*words: object) -> None:
    done = CliRunner().invoke(cli, ["fit", *map(str, words)])
    if done.exception and not isinstance(done.exception, SystemExit):
        raise done.exception


def test_a_board_alone_tells_capacity_loss_coupling_and_latent_heat(tmp_path: Path) -> None:
    fit(board_log(tmp_path / "board.csv"), "-o", tmp_path / "m.toml", "--json", tmp_path / "r.json")
    model = read_model(tmp_path / "m.toml")
    for name, value in TRUE.items():
        assert model.parameters[name] == pytest.approx(value, rel=0.1 if name.startswith("orth") else 0.05), name
    assert set(model.effects) == {"latent_heat", "resistance_phase", "spring_mismatch"}, "no effect that is not there"
    assert "only a thermometer can say" in model.provenance["note"]
    assert model.provenance["hottest_c"] > 88.0 and "rmse_after_c" not in model.provenance
    result = json.loads((tmp_path / "r.json").read_text())
    assert result["rmse_c"] is None and result["rmse_ohm"] < 0.5 * result["rmse_before_ohm"]
    own = [model.parameters[f"resistance_scale[{k}]"] for k in range(1, 10)]
    assert np.all(np.diff(own) > 0), "each wire has a resistance of its own"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"strongest_a": 0.9}, "no spring's v / i ever changes"),
        ({"ambient_c": None}, "log ambient_c"),
    ],
)
def test_a_log_that_cannot_tell_is_refused_with_what_it_lacks(tmp_path: Path, change: dict, said: str) -> None:
    with pytest.raises(InputError, match=said):
        fit(board_log(tmp_path / "board.csv", **change), "-o", tmp_path / "m.toml")
    assert not (tmp_path / "m.toml").exists()


def test_logs_with_and_without_temperatures_are_not_mixed(tmp_path: Path, make_log) -> None:
    with pytest.raises(InputError, match="give one kind at a time"):
        fit(board_log(tmp_path / "board.csv"), make_log(), "-o", tmp_path / "m.toml")


def test_a_board_alone_is_diagnosed_with_its_effect_and_no_degrees(tmp_path: Path) -> None:
    log = board_log(tmp_path / "board.csv", effects={"edge_loss": {"edge_loss_fraction": 0.25}})
    done = CliRunner().invoke(cli, ["diagnose", str(log), "-o", str(tmp_path / "out")], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    result = json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    assert [one["name"] for one in result["effects"]] == ["edge_loss"]
    fraction = result["effects"][0]["parameters"]["edge_loss_fraction"]
    assert abs(fraction["value"] - 0.25) < 4.0 * fraction["stderr"]
    assert result["after"]["rmse_c"] is None and result["after"]["rmse_ohm"] < 0.5 * result["baseline"]["rmse_ohm"]
    assert "edge_loss" in read_model(tmp_path / "out" / "model.toml").effects
    assert "only a thermometer can say" in (tmp_path / "out" / "report.html").read_text()
