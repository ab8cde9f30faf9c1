"""The C code reads what it is given to its end: an array that is too short is refused before, by name and shape."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
import pytest
from ninespring.errors import WorkError
from ninespring.model import native

ROWS, SPRINGS = 40, 4
GOOD: dict[str, object] = {
    "time_s": np.arange(float(ROWS)),
    "drive": np.full((ROWS, SPRINGS), 0.1),
    "fan": np.zeros(ROWS),
    "ambient_c": np.full(ROWS, 20.0),
    "command_power_w": np.ones(SPRINGS),
    "first_c": np.full(SPRINGS, 20.0),
    "shape": (2, 2),
}
WRONG = {
    "time_s": [np.arange(ROWS - 1.0), np.zeros((ROWS, 1)), np.zeros(0)],
    "drive": [np.zeros((ROWS, SPRINGS - 1)), np.zeros((ROWS - 1, SPRINGS)), np.zeros(ROWS * SPRINGS)],
    "fan": [np.zeros(ROWS - 1), np.zeros(0), np.float64(0.0), np.zeros((1, ROWS))],
    "ambient_c": [np.zeros(ROWS - 1), np.float64(20.0), np.zeros((ROWS, SPRINGS))],
    "command_power_w": [np.ones(SPRINGS - 1), np.float64(1.0)],
    "first_c": [np.zeros(SPRINGS - 1), np.zeros((2, 2))],
}


def simulate(log: dict) -> object:
    return native.Plant(2, 2).simulate(log["time_s"], native.POWER, log["drive"], log["fan"], log["ambient_c"])


def trace(log: dict) -> object:
    return native.Plant(2, 2).trace(log["time_s"], native.POWER, log["drive"], log["fan"], log["ambient_c"])


def readings(log: dict) -> object:
    return native.Plant(2, 2).readings(log["time_s"], log["drive"], log["fan"], log["ambient_c"])


def on_chip(log: dict) -> object:
    head = (log.get("lines", ""), log["shape"], log["time_s"], native.POWER, log["drive"])
    return native.chip_simulate(*head, log["command_power_w"], log["fan"], log["ambient_c"], log["first_c"])


PLANT = ("time_s", "drive", "fan", "ambient_c")
CASES = [
    pytest.param(call, name, wrong, id=f"{call.__name__}-{name}-{np.shape(wrong)}")
    for call, names in ((simulate, PLANT), (trace, PLANT), (readings, PLANT), (on_chip, tuple(WRONG)))
    for name in names
    for wrong in WRONG[name]
]


@pytest.mark.parametrize("call", [simulate, trace, readings, on_chip])
def test_a_log_of_the_right_shape_is_taken(call: Callable[[dict], object]) -> None:
    assert np.all(np.isfinite(call(GOOD)))


@pytest.mark.parametrize(("call", "name", "wrong"), CASES)
def test_a_wrong_shape_is_refused_by_name(call: Callable[[dict], object], name: str, wrong: np.ndarray) -> None:
    # where there is another number of times, it is what goes with them that has the wrong shape
    told = "drive" if name == "time_s" and wrong.ndim == 1 and wrong.size else name
    with pytest.raises(ValueError, match=rf"^{told} has shape \(.*\), wanted \(\d") as error:
        call({**GOOD, name: wrong})
    had = np.shape(GOOD["drive"]) if told != name else np.shape(wrong)
    assert f"has shape {had}," in str(error.value)


def test_what_is_no_array_yet_is_taken_as_one() -> None:
    assert np.array_equal(
        simulate({**GOOD, "fan": [0] * ROWS, "drive": np.full((SPRINGS, ROWS), 0.1).T}), simulate(GOOD)
    )


def test_settings_of_another_size_of_the_array_are_refused() -> None:
    with pytest.raises(WorkError, match=re.escape("$rows=3 $columns=2: the array is 2 x 2")):
        on_chip({**GOOD, "lines": "$rows=3\n"})


@pytest.mark.parametrize("shape", [(0, 3), (-2, -2), (1, 65), (65536, 65536)])
def test_an_array_that_no_board_has_is_refused(shape: tuple[int, int]) -> None:
    count = max(0, shape[0] * shape[1])
    if count > 65:
        with pytest.raises(ValueError, match="drive has shape"):
            on_chip({**GOOD, "shape": shape})
        return
    log = {"drive": np.zeros((ROWS, count)), "command_power_w": np.ones(count), "first_c": np.zeros(count)}
    with pytest.raises(WorkError, match="a board has 64"):
        on_chip({**GOOD, **log, "shape": shape})


@pytest.mark.parametrize("count", [0, 8, 10])
def test_a_pattern_has_every_spring(count: int) -> None:
    plant = native.Plant(3, 3)
    for call in (
        lambda: native.chip_drive(plant, "", [True] * count, 2, 1),
        lambda: native.chip_run(plant, (3, 3), [""], [True] * count, 0.0, 1, 2, 1),
    ):
        with pytest.raises(ValueError, match=rf"^pattern has shape \({count},\), wanted \(9,\)$"):
            call()


def test_every_board_has_lines() -> None:
    with pytest.raises(ValueError, match=r"^lines of 1 boards, wanted 2$"):
        native.chip_run(native.Plant(3, 6), (3, 3), [""], [True] * 18, 0.0, 1, 2, 1)


@pytest.mark.parametrize("part", [(0, 0, 3, 4), (1, 0, 3, 3), (0, -1, 3, 3), (0, 0, 0, 3), (4, 4, 1, 1)])
def test_a_part_lies_within_its_plant(part: native.Part) -> None:
    with pytest.raises(ValueError, match=r"part is .*, the plant has 3 rows and 3 columns"):
        native.chip_export(native.Plant(3, 3), part)


@pytest.mark.parametrize(
    ("name", "value", "limits"),
    [
        ("heat_capacity_j_per_k", 0.01, "has 0.0132 J/K at least"),
        ("martensite_finish_c", 77.5, "2 to 100 K wide"),
        ("latent_heat_j", 30.0, "at most 80 K"),
        ("orthogonal_w_per_k", 0.05, "at most 0.0655 W/K"),
    ],
)
def test_a_number_that_does_not_fit_the_others_on_the_chip_says_its_limits(
    name: str, value: float, limits: str
) -> None:
    plant = native.Plant(2, 2)
    plant.set_effects({"latent_heat"})
    plant.set(name, value)
    with pytest.raises(WorkError, match=limits):
        native.chip_export(plant)


@pytest.mark.parametrize("count", [1, 8, 10])
def test_first_temperatures_are_of_every_spring(count: int) -> None:
    with pytest.raises(ValueError, match=r"^first_c has shape .* wanted \(9,\)$"):
        native.Plant(3, 3).start_from_measured(np.full(count, 20.0))
