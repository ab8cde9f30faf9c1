"""A logged load moves the transformation: read, found beside latent heat, predicted; data of a simulation written here."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from ninespring.errors import InputError
from ninespring.export.settings import settings_of
from ninespring.find import diagnosis
from ninespring.infer.predict import predict
from ninespring.io.logs import log_text, read_log
from ninespring.io.logs.run import Run
from ninespring.model.models import Array, model_text, read_model
from ninespring.model.simulate import LOAD_STEP_N, load_changes, simulate_run
from plants import a_plant, columns_of

K_PER_N, NOISE_C, ROOM_C = 4.5, 0.2, 21.0


def austenite(temperature: np.ndarray, start_c: np.ndarray, finish_c: np.ndarray) -> np.ndarray:
    """Return a straight ramp from 0 to 1: not the plant's law."""
    return np.clip((temperature - start_c) / (finish_c - start_c), 0.0, 1.0)


def loaded(path: Path, k_per_n: float, seed: int) -> Path:
    """Write a log of two springs that transform again and again, a load of 0 to 2 N on each at its own times; Euler, 0.5 s."""
    rng = np.random.default_rng(seed)
    rows = 500
    current, load = np.zeros((rows, 2)), np.zeros((rows, 2))
    for k in range(2):
        at = int(rng.integers(5, 30))
        while at < rows:
            hold = int(rng.integers(60, 130))
            current[at : at + hold, k] = rng.uniform(1.7, 2.2)
            at += hold + int(rng.integers(40, 90))
        for begin in range(int(rng.integers(0, 60)), rows, 140):
            load[begin : begin + 80, k] = rng.uniform(0.8, 2.0)
    ohm, phase, true = 0.2, np.zeros(2), np.full(2, ROOM_C)
    shown = np.empty((rows, 2))
    for row in range(rows):
        shown[row] = true
        off = k_per_n * load[row]
        for _ in range(2):
            heat = 0.5 * (current[row] ** 2 * ohm - 5.5e-3 * (true - ROOM_C) + 5e-4 * (true[::-1] - true))
            # enthalpy first: temperature and phase follow from it on whichever branch is met
            low = np.full(2, -50.0) + ROOM_C
            high = np.full(2, 300.0)
            before = 0.3 * true + 8.0 * phase
            for _ in range(20):  # to a thousandth of the noise
                middle = 0.5 * (low + high)
                there = np.clip(
                    phase, austenite(middle, 88.0 + off, 98.0 + off), austenite(middle, 68.0 + off, 78.0 + off)
                )
                more = 0.3 * middle + 8.0 * there > before + heat
                low, high = np.where(more, low, middle), np.where(more, middle, high)
            true, phase = middle, there
    shown = shown + rng.normal(0.0, NOISE_C, shown.shape)
    columns = columns_of(i=current, v=current * ohm, t=shown) | {"ambient_c": np.full(rows, ROOM_C)}
    path.write_text(log_text(np.arange(float(rows)), columns | {f"f{k + 1}_n": load[:, k] for k in range(2)}))
    return path


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Return a log of a load that moves the transformation."""
    return read_log(loaded(tmp_path_factory.mktemp("load") / "log.csv", K_PER_N, 1), 2)


def test_what_is_shown_as_a_load_moves_is_from_before(run: Run) -> None:
    shown = []
    on = {"latent_heat": {}, "transformation_shift": {"transformation_shift_k_per_n": K_PER_N}}
    for lag in ({}, {"sensor_lag": {"sensor_lag_s": 0.02}}):
        shown.append(simulate_run(a_plant((1, 2), on | lag), run, run.ambient_c))
    # the spring itself jumps by kelvins with its load: a thermometer that is quick shows that in the row after
    assert np.abs(shown[0] - shown[1]).max() < 0.3


def test_a_load_is_found_sized_and_predicted(run: Run, tmp_path: Path) -> None:
    found = diagnosis.diagnose(Array(1, 2), [run])
    named = {one["name"]: one for one in found.result["effects"]}
    assert set(named) == {"latent_heat", "transformation_shift"}
    number = named["transformation_shift"]["parameters"]["transformation_shift_k_per_n"]
    assert number["unit"] == "K/N"
    assert number["value"] == pytest.approx(K_PER_N, abs=0.5)
    assert "newton" in named["transformation_shift"]["text"]
    (tmp_path / "model.toml").write_text(model_text(found.model))
    model = read_model(tmp_path / "model.toml")
    other = read_log(loaded(tmp_path / "other.csv", K_PER_N, 2), 2)
    with_load = float(np.sqrt(np.mean((predict(model, other) - other.temperature_c) ** 2)))
    other.load_n = None
    without = float(np.sqrt(np.mean((predict(model, other) - other.temperature_c) ** 2)))
    assert with_load < 0.7 * without
    assert "per_n" not in settings_of(found.model).lines


def test_a_load_that_moves_nothing_is_not_named(tmp_path: Path) -> None:
    run = read_log(loaded(tmp_path / "log.csv", 0.0, 1), 2)
    assert diagnosis.diagnose(Array(1, 2), [run]).effects == ["latent_heat"]


def test_a_load_is_laid_on_again_only_where_it_has_moved() -> None:
    load = np.array([0.0, 0.04, 0.08, 0.12, 0.16, 0.5, 0.5, 0.0])[:, None]
    rows = load_changes(load)
    assert rows.tolist() == [3, 5, 7]
    held = load[np.concatenate([[0], rows])[np.searchsorted(rows, np.arange(8), side="right")]]
    assert np.abs(held - load).max() < LOAD_STEP_N


def test_a_load_in_other_units_is_refused_with_its_place(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("time_s,i1_a,t1_c,f1_n\n0,0,20,0\n1,1,20,850\n2,0,21,0\n3,0,21,0\n")
    with pytest.raises(InputError, match=r"f1_n = 850 N: looks like millinewtons"):
        read_log(path, 1)
