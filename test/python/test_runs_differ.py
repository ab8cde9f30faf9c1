"""What is a run's own: found, sized and told apart from the array's, on data of a simulation written here."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ninespring.find import diagnosis
from ninespring.infer.predict import in_its_room, predict
from ninespring.io import results
from ninespring.io.logs import log_text, read_log
from ninespring.io.statistics import rms
from ninespring.model.models import Array, Model
from ninespring.say.page import findings
from plants import columns_of, levels

CAPACITY, LOSS, LINK, FULL_W, ROOM_C, NOISE_C = 2.0, 0.012, 0.004, 0.7, 21.0, 0.05


def two_heaters(folder: Path, runs: list[dict[str, float]], *, volts: bool = False) -> list[Path]:
    """Write logs of two coupled heaters, integrated by Euler at 0.1 s; each run with a gain and offsets of its own."""
    out = []
    for number, own in enumerate(runs):
        rng = np.random.default_rng(number)
        time_s = np.arange(600.0)
        level = levels(rng)
        room = ROOM_C + own.get("room", 0.0)
        true, shown = np.full(2, room), np.empty((600, 2))
        for row in range(600):
            shown[row] = true
            for _ in range(10):
                heat = own.get("gain", 1.0) * FULL_W * level[row]
                true = true + 0.1 / CAPACITY * (heat - LOSS * (true - room) + LINK * (true[::-1] - true))
        shown = shown + own.get("read", 0.0) + rng.normal(0.0, NOISE_C, shown.shape)
        current = np.sqrt(FULL_W * level / 0.2)
        drive = {"i": current, "v": 0.2 * current} if volts else {"u": level}
        path = folder / f"run{number + 1}.csv"
        path.write_text(log_text(time_s, columns_of(**drive, t=shown) | {"ambient_c": np.full(600, ROOM_C)}))
        out.append(path)
    return out


def diagnosis_of(paths: list[Path]) -> diagnosis.Diagnosis:
    """Diagnose logs of the two heaters, declared roughly."""
    model = Model(Array(1, 2))
    model.parameters = {"heat_capacity_j_per_k": CAPACITY, "loss_w_per_k": 0.01, "command_power_w": 0.6}
    found = diagnosis.diagnose(Array(1, 2), [read_log(path, 2) for path in paths], model=model)
    assert not any("@" in name for name in found.model.parameters), "what is a run's own is in no model"
    return found


def diagnosed(paths: list[Path]) -> dict[str, Any]:
    """Return what diagnosis.json has of them."""
    return diagnosis_of(paths).result


@pytest.mark.parametrize("volts", [False, True])
def test_a_drive_that_is_stronger_in_one_run_is_found_and_sized(tmp_path: Path, volts: bool) -> None:
    result = diagnosed(two_heaters(tmp_path, [{"gain": 1.0}, {"gain": 1.12}, {"gain": 0.95}], volts=volts))
    assert result["effects"] == []
    (one,) = result["runs_differ"]
    assert one["name"] == "run_drive_gain"
    gain = [one["parameters"][f"drive_gain@{r}"]["value"] for r in (1, 2, 3)]
    assert gain[1] / gain[0] == pytest.approx(1.12, abs=0.01)
    assert gain[2] / gain[0] == pytest.approx(0.95, abs=0.01)
    assert all(one["parameters"][f"drive_gain@{r}"]["stderr"] < 0.01 for r in (1, 2, 3)), "told relative to their mean"
    assert one["spread"]["value"] == pytest.approx(np.std(np.log([1.0, 1.12, 0.95])), rel=0.3)
    assert not result["unexplained"]
    assert result["after"]["rmse_c"] < 1.1 * NOISE_C < result["baseline"]["rmse_c"]
    assert any("run 2" in text for _, text in findings(results.read(results.Diagnosis, result)))


def test_surroundings_that_are_not_as_logged_are_found_in_a_single_run(tmp_path: Path) -> None:
    result = diagnosed(two_heaters(tmp_path, [{"room": 2.5}]))
    said = {one["name"] for one in (*result["runs_differ"], *result["effects"], *result["rivals"])}
    assert "run_ambient_offset" in said
    assert result["after"]["rmse_c"] < 1.1 * NOISE_C


def test_offsets_of_several_runs_come_out_each_at_its_size(tmp_path: Path) -> None:
    result = diagnosed(two_heaters(tmp_path, [{"room": 1.5}, {"room": -1.0}, {"room": 0.2}]))
    (one,) = [one for one in result["runs_differ"] if one["name"] in ("run_ambient_offset", "run_sensor_offset")]
    values = [number["value"] for number in one["parameters"].values()]
    assert np.allclose(values, [1.5, -1.0, 0.2], atol=0.1)
    assert one["spread"]["unit"] == "K"
    assert one["spread"]["value"] == pytest.approx(1.05, rel=0.3)
    assert result["effects"] == []


def test_surroundings_that_are_elsewhere_in_all_runs_are_one_number_which_a_further_run_is_predicted_with(
    tmp_path: Path,
) -> None:
    *fitted, unseen = two_heaters(tmp_path, [{"room": 2.5}, {"room": 2.5}, {"room": 2.5}])
    found = diagnosis_of(fitted)
    (one,) = found.told.runs_differ
    assert one.parameters["ambient_offset_k"].value == pytest.approx(2.5, abs=0.1) and "in all runs" in one.text
    assert not found.told.effects, "thermometers of which no power is known show no gain"
    run = in_its_room(found.model, read_log(unseen, 2))
    assert in_its_room(found.model, run) is run and "warmer than ambient_c" in run.notes[-1]
    assert rms([predict(found.model, run) - run.temperature_c]) < 1.2 * NOISE_C


def test_runs_that_are_alike_are_not_said_to_differ(tmp_path: Path) -> None:
    result = diagnosed(two_heaters(tmp_path, [{}, {}]))
    assert result["runs_differ"] == []
    assert result["effects"] == []
