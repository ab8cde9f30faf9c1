"""Beside a cause that has no name in the library, a known one is named all the same; the other is told by its kind and size."""

from __future__ import annotations

import numpy as np
import pytest
from ninespring import native
from ninespring.logs import read_log
from ninespring.models import Array
from ninespring.verdict import diagnosis

EDGES = {"edge_loss": {"edge_loss_fraction": 0.2}}


def astray(columns: dict[str, np.ndarray], extra: np.ndarray) -> None:
    """Add to the temperatures what heat beside that of the currents makes of the same array."""
    rows = len(columns["fan"])
    plant = native.Plant(3, 3)
    plant.set_effects(EDGES)
    plant.set_all(EDGES["edge_loss"])
    time_s, fan, around = np.arange(float(rows)), columns["fan"], np.full(rows, 20.0)
    power = np.column_stack([columns[f"i{k + 1}_a"] ** 2 * 0.2 for k in range(9)])
    shown = []
    for watts in (power, power + extra):
        twin = plant.copy()
        twin.reset()
        shown.append(twin.simulate(time_s, native.POWER, watts, fan, around))
    for k in range(9):
        columns[f"t{k + 1}_c"] = columns[f"t{k + 1}_c"] + shown[1][:, k] - shown[0][:, k]


def crosstalk(columns: dict[str, np.ndarray]) -> None:
    """Let the drive of spring 1 heat spring 9 by a fifth."""
    extra = np.zeros((len(columns["fan"]), 9))
    extra[:, 8] = 0.2 * columns["i1_a"] ** 2 * 0.2
    astray(columns, extra)


def test_a_known_effect_is_named_beside_heat_that_goes_astray(make_log) -> None:
    runs = [read_log(make_log(f"{seed}.csv", effects=EDGES, seed=seed, change=crosstalk)) for seed in (3, 4)]
    found = diagnosis.diagnose(Array(), runs).result
    (named,) = found["effects"]
    assert named["name"] == "edge_loss"
    assert named["parameters"]["edge_loss_fraction"]["value"] == pytest.approx(0.2, abs=0.01)
    assert found["unexplained"]
    (cause,) = found["unnamed"]
    assert "the drive of spring 1 also heats spring 9" in cause["text"]
    assert cause["size"] == pytest.approx(0.2, abs=0.01)


def test_nothing_without_a_name_where_the_library_explains_all(make_log) -> None:
    runs = [read_log(make_log(f"{seed}.csv", effects=EDGES, seed=seed)) for seed in (3, 4)]
    found = diagnosis.diagnose(Array(), runs).result
    assert found["unnamed"] == [] and not found["unexplained"]


def test_a_trickle_of_heat_is_no_thermometer_with_an_offset(make_log) -> None:
    """What the library would take for a false thermometer is told as what it is, where that explains more."""

    def trickle(columns: dict[str, np.ndarray]) -> None:
        extra = np.zeros((len(columns["fan"]), 9))
        extra[:, 3] = 0.06
        astray(columns, extra)

    runs = [read_log(make_log(f"{seed}.csv", effects=EDGES, seed=seed, change=trickle)) for seed in (3, 4)]
    found = diagnosis.diagnose(Array(), runs).result
    assert [one["name"] for one in found["effects"]] == ["edge_loss"] and found["unexplained"]
    (cause,) = found["unnamed"]
    assert "spring 4 is given heat all the time" in cause["text"]
    assert cause["size"] == pytest.approx(0.06, abs=0.005)
