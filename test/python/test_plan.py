"""A planned recording identifies the array, and asks for no more than the supply and the springs stand."""

from __future__ import annotations

import json
from pathlib import Path

import ninespring as ns
import numpy as np
import pytest
from command import ended
from ninespring.errors import InputError
from ninespring.find import plan
from ninespring.io import results
from ninespring.io.logs import log_text
from ninespring.io.recording import Step, script_lines
from ninespring.model import native
from ninespring.model.models import Array
from plants import a_plant, columns_of


def driven(steps: list[Step], springs: int, duration_s: float, current_a: float) -> tuple[np.ndarray, np.ndarray]:
    """Return currents (seconds, springs) and fan (seconds,) of steps, as a board takes them."""
    current, fan = np.zeros((int(duration_s), springs)), np.zeros(int(duration_s))
    for step in steps:
        at, word = int(step.at_s or 0), step.line.split()
        if word[0] == "fan":
            fan[at:] = float(word[1]) / 100
        elif word[0] == "on":
            current[at:, slice(None) if word[1] == "all" else int(word[1]) - 1] = float(word[2]) / 100 * current_a
        elif word[0] == "off":
            current[at:, slice(None) if word[1] == "all" else int(word[1]) - 1] = 0.0
    return current, fan


@pytest.mark.parametrize(("rows", "cols", "supply_a"), [(3, 3, 14.0), (3, 3, 4.0), (1, 2, 4.0), (4, 4, 14.0)])
def test_a_plan_keeps_the_limits_and_drives_every_spring(rows: int, cols: int, supply_a: float) -> None:
    array = Array(rows, cols)
    made = plan.make_plan(array, 900.0, 2.0, supply_a, 105.0)
    steps = script_lines("\n".join(made.steps), "steps.txt", 900.0)
    current, fan = driven(steps, array.springs, 900, 2.0)
    assert current.sum(axis=1).max() <= supply_a + 1e-9
    assert current.sum(axis=1).max() == pytest.approx(made.most_a)
    assert ((current > 0).mean(axis=0) > 0.05).all()
    assert len(np.unique(current[current > 0])) >= 3
    assert 0.2 < fan.mean() < 0.3 and not current[-60:].any()
    assert (fan == 0.5).mean() > 0.1 and (fan == 1.0).mean() > 0.1, "half the fan tells its curve"
    plant = a_plant((rows, cols), ["latent_heat", "resistance_phase"])
    shown = plant.simulate(np.arange(900.0), native.CURRENT, current, fan, np.full(900, 20.0))
    assert 98.0 < shown.max() <= 105.0


def test_without_a_thermometer_every_spring_crosses_often_and_none_is_ever_without_a_current() -> None:
    made = plan.make_plan(Array(), 1800.0, 2.6, 14.0, 105.0, board_alone=True)
    current, fan = driven(script_lines("\n".join(made.steps), "steps.txt", 1800.0), 9, 1800, 2.6)
    assert current[1:].min() > 0.2 and current.sum(axis=1).max() <= 14.0
    plant = a_plant((3, 3), ["latent_heat", "resistance_phase"])
    traced = plant.trace(np.arange(1800.0), native.CURRENT, current, fan, np.full(1800, 20.0))
    for blown in (False, True):
        phase = traced[(fan > 0.5) == blown, :, 1]
        crossings = (np.abs(np.diff((phase > 0.5).astype(int), axis=0))).sum(axis=0)
        assert crossings.min() >= 4, f"up and down twice, fan {blown}"
    assert traced[:, :, 0].max() <= 105.0
    assert (fan == 0.5).mean() > 0.09


def test_without_a_thermometer_thin_wire_that_never_transforms_is_refused_and_planned_with_less_current() -> None:
    thin = Array(1, 4, spring={"wire_diameter_mm": 0.6, "coil_diameter_mm": 4.0, "turns": 9.0})
    with pytest.raises(InputError, match=r"with 2.6 A a spring comes to \d+ degC at most.*of thin wire less"):
        plan.make_plan(thin, 1800.0, 2.6, 14.0, 105.0, board_alone=True)
    assert plan.make_plan(thin, 1800.0, 1.5, 14.0, 105.0, board_alone=True).share_on.min() > 0.2


def test_a_plan_tells_the_board_what_resistance_other_springs_have() -> None:
    thin = Array(1, 2, spring={"wire_diameter_mm": 0.4})
    steps = plan.make_plan(thin, 900.0, 0.8, 14.0, 105.0).steps
    told = [step.removeprefix("$resistance_") for step in steps if step.startswith("$resistance_")]
    assert told == ["maximum_ohm=1.999", "minimum_ohm=0.320", "martensite_ohm=0.700", "austenite_ohm=0.875"]
    assert not any("resistance" in step for step in plan.make_plan(Array(1, 2), 900.0, 0.8, 14.0, 105.0).steps)


def test_what_was_planned_identifies_the_array(tmp_path: Path) -> None:
    made = plan.make_plan(Array(), 900.0, 2.0, 14.0, 105.0)
    current, fan = driven(script_lines("\n".join(made.steps), "steps.txt"), 9, 900, 2.0)
    true = {"heat_capacity_j_per_k": 0.33, "loss_w_per_k": 0.0066, "orthogonal_w_per_k": 0.0008, "latent_heat_j": 7.0}
    plant = a_plant((3, 3), {"latent_heat": true})
    time_s, ambient = np.arange(900.0), np.full(900, 20.0)
    shown = plant.simulate(time_s, native.POWER, current**2 * 0.2, fan, ambient)
    shown += np.random.default_rng(3).normal(0.0, 0.3, shown.shape)
    columns = columns_of(i=current, v=current * 0.2, t=shown) | {"fan": fan, "ambient_c": ambient}
    (tmp_path / "log.csv").write_text(log_text(time_s, columns))
    model = ns.fit(tmp_path / "log.csv", effects=["latent_heat"])
    for name, value in true.items():
        assert model.parameters[name] == pytest.approx(value, rel=0.03), name


def test_what_cannot_be_planned_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"duration_s = 100\.0: not a number from 300"):
        plan.make_plan(Array(), 100.0, 1.7, 14.0, 105.0)
    with pytest.raises(InputError, match="do not drive one spring"):
        plan.make_plan(Array(), 900.0, 1.7, 1.0, 105.0)
    assert ended("plan", "-o", tmp_path / "steps.txt")[0] == 0
    text = (tmp_path / "steps.txt").read_text()
    assert "at most" in text and script_lines(text, "steps.txt", 900.0)[0].line == "policy open"


ASKED = {
    "separating_experiment": "staircase: all springs on; watch spring 5",
    "experiment": {
        "name": "staircase",
        "inputs": "all springs on",
        "spring": 5,
        "difference_c": 1.5,
        "at_s": 300.0,
        "duration_s": 600.0,
        "current_a": 1.8,
        "steps": [
            {"at_s": 0.0, "percent": [0, 50, 0, 0, 0, 0, 0, 0, 0], "fan": 0},
            {"at_s": 240.0, "percent": [100] * 9, "fan": 100},
            {"at_s": 300.0, "percent": [0] * 9, "fan": 0},
        ],
    },
}


def test_the_experiment_that_a_diagnosis_asks_for_is_planned_within_the_limits(tmp_path: Path) -> None:
    told, steps = tmp_path / "diagnosis.json", tmp_path / "steps.txt"
    told.write_text(json.dumps({"rivals": [{"experiment": {"name": "of a table"}}, ASKED]}))
    assert ended("plan", "--for", told, "-o", steps)[0] == 0
    text = steps.read_text()
    assert text.startswith("# staircase: all springs on; watch spring 5\n") and "--duration 610" in text
    lines = script_lines(text, "steps.txt", 610.0)
    assert [one.line for one in lines[:2]] == ["policy open", "$open_current_a=1.556"]  # 14 A for nine
    timed = [(one.at_s, one.line) for one in lines if one.at_s is not None]
    assert timed[:3] == [(5.0, "on 2 50"), (245.0, "fan 100"), (245.0, "on 1 100")]
    assert timed[-1] == (305.0, "off 9") and len(timed) == 1 + 10 + 10
    asked = results.read(results.Experiment, ASKED["experiment"])
    cooler = plan.plan_experiment(Array(), asked, 14.0, 45.0)
    assert 40.0 < cooler.hottest_c <= 45.0 and cooler.most_a < 13.9
    with pytest.raises(InputError, match="for 9 springs, the array has 2"):
        plan.plan_experiment(Array(1, 2), asked, 14.0, 105.0)


@pytest.mark.parametrize(
    ("text", "said"), [("[]", "no diagnosis.json"), ("{", "no diagnosis.json"), ('{"rivals": []}', "asks for no")]
)
def test_what_asks_for_no_experiment_is_said(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "diagnosis.json").write_text(text)
    code, told = ended("plan", "--for", tmp_path / "diagnosis.json", "-o", tmp_path / "x.txt")
    assert code == 2 and said in told and not (tmp_path / "x.txt").exists()
