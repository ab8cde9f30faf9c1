"""A planned recording identifies the array, and asks for no more than the supply and the springs stand."""

from __future__ import annotations

from pathlib import Path

import ninespring as ns
import numpy as np
import pytest
from click.testing import CliRunner
from ninespring import cli, native, plan
from ninespring.errors import InputError
from ninespring.logs import log_text
from ninespring.models import Array
from ninespring.recording import Step, script_lines


def driven(steps: list[Step], springs: int, duration_s: float, current_a: float) -> tuple[np.ndarray, np.ndarray]:
    """Return currents (seconds, springs) and fan (seconds,) of steps, as a board takes them."""
    current, fan = np.zeros((int(duration_s), springs)), np.zeros(int(duration_s))
    for step in steps:
        at, word = int(step.at_s or 0), step.line.split()
        if word[0] == "fan":
            fan[at:] = float(word[1]) / 100
        elif word[0] == "on":
            current[at:, int(word[1]) - 1] = float(word[2]) / 100 * current_a
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
    plant = native.Plant(rows, cols)
    plant.set_effects(["latent_heat", "resistance_phase"])
    plant.reset()
    shown = plant.simulate(np.arange(900.0), native.CURRENT, current, fan, np.full(900, 20.0))
    assert 98.0 < shown.max() <= 105.0


def test_what_was_planned_identifies_the_array(tmp_path: Path) -> None:
    made = plan.make_plan(Array(), 900.0, 2.0, 14.0, 105.0)
    current, fan = driven(script_lines("\n".join(made.steps), "steps.txt"), 9, 900, 2.0)
    true = {"heat_capacity_j_per_k": 0.33, "loss_w_per_k": 0.0066, "orthogonal_w_per_k": 0.0008, "latent_heat_j": 7.0}
    plant = native.Plant(3, 3)
    plant.set_effects(["latent_heat"])
    plant.set_all(true)
    plant.reset()
    time_s, ambient = np.arange(900.0), np.full(900, 20.0)
    shown = plant.simulate(time_s, native.POWER, current**2 * 0.2, fan, ambient)
    shown += np.random.default_rng(3).normal(0.0, 0.3, shown.shape)
    columns = {f"i{k + 1}_a": current[:, k] for k in range(9)} | {f"v{k + 1}_v": current[:, k] * 0.2 for k in range(9)}
    columns |= {f"t{k + 1}_c": shown[:, k] for k in range(9)} | {"fan": fan, "ambient_c": ambient}
    (tmp_path / "log.csv").write_text(log_text(time_s, columns))
    model = ns.fit(tmp_path / "log.csv", effects=["latent_heat"])
    for name, value in true.items():
        assert model.parameters[name] == pytest.approx(value, rel=0.03), name


def test_what_cannot_be_planned_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="too short"):
        plan.make_plan(Array(), 100.0, 1.7, 14.0, 105.0)
    with pytest.raises(InputError, match="do not drive one spring"):
        plan.make_plan(Array(), 900.0, 1.7, 1.0, 105.0)
    done = CliRunner().invoke(cli.cli, ["plan", "-o", str(tmp_path / "steps.txt")])
    assert done.exit_code == 0, done.output
    text = (tmp_path / "steps.txt").read_text()
    assert "at most" in text and script_lines(text, "steps.txt", 900.0)[0].line == "policy open"
