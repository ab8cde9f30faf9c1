"""A steps.txt that identifies an array: every spring on and off at its own times and levels, within the limits.

What a fit needs: each spring heats while its neighbours do and while they do not, at more than one level, some beyond the
transformation; the fan blows for a part, at half its command and at full; at the end everything cools. Without a thermometer v / i tells all, and tells nothing
without a current: then a spring that rests keeps a little, and every turn crosses the transformation. What the array stands: the supply's current, the
springs' temperature, as the declared array's simulation has it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..export.settings import CROSSED, FIRMWARE_EFFECTS, best_plant
from ..io import ranges, results
from ..model import native
from ..model.models import Array, Model
from ..model.simulate import RESISTANCES, array_parameters, board_settings

LEVELS = (100, 100, 75, 50)
"""Percent of the current; full level half of the time, for only that transforms."""
SHORTEST_S, LONGEST_S = 30.0, 150.0
"""A spring stays on or off for so long: from less to more than a time constant (50 s)."""
FAN = ((0.42, 0.56, 50), (0.56, 0.72, 100))
FAN_OFTEN = ((0.15, 0.33, 100), (0.38, 0.48, 50), (0.55, 0.75, 100))
"""From and to, in parts of the duration, and percent: half the command tells what the fan gives there, which is not half."""
COOL_FROM = 0.88
"""Part of the duration."""
RESTING_A = 0.25
"""A spring's current at rest where v / i is all there is: a quarter more than what v / i is read from."""
THROUGH = 0.8
"""Of the way from austenite start to finish: nine tenths of a spring have transformed."""
BACK_OFF_S = 5.0
THROUGH_S, BEYOND_K = 240.0, 1.0
"""A spring is driven so long at the most to pass its transformation, and so far beyond its end."""
FIRST_S = 5.0
"""An experiment begins so long after the recording: what was there before is seen."""
BACK_OFF, LEAST_A = 0.97, 0.05
"""Of the current, where an experiment would pass a limit."""


@dataclass
class Stretch:
    """A spring is driven from one time to another (s), at a level in percent."""

    spring: int
    begin_s: float
    end_s: float
    level: int


@dataclass
class Plan:
    """What to send, and what is expected of it."""

    steps: list[str]
    hottest_c: float
    most_a: float
    share_on: np.ndarray
    """(springs,) part of the time that each spring is driven."""


def make_plan(
    array: Array,
    duration_s: float,
    current_a: float,
    supply_a: float,
    hottest_c: float,
    seed: int = 1,
    board_alone: bool = False,
) -> Plan:
    """Return a plan; `current_a` is a spring's at full level, `supply_a` the most of all, `hottest_c` of any spring.

    `board_alone`: for a recording without any thermometer.
    """
    ranges.PLAN_S.check("duration_s", duration_s)
    ranges.SEED.check("seed", seed)
    _check_limits(supply_a, hottest_c, current_a)
    resting = math.ceil(100.0 * RESTING_A / current_a) if board_alone else 0
    levels, fan = ((100,), FAN_OFTEN) if board_alone else (LEVELS, FAN)
    if supply_a < current_a:
        raise InputError(f"the supply's {supply_a:g} A do not drive one spring with {current_a:g} A")
    most = supply_a / current_a * 100.0 - resting * array.springs
    if most < 100.0:
        raise InputError(f"the supply's {supply_a:g} A do not drive one spring while the others keep {RESTING_A:g} A")
    stretches = _stretches(array.springs, duration_s, most, levels, np.random.default_rng(seed))

    def simulated() -> tuple[np.ndarray, np.ndarray]:
        return _simulated(array, stretches, duration_s, current_a, resting, fan)

    drive, temperature = simulated()
    for _ in range(20 * len(stretches)):
        rows, springs = np.nonzero(temperature > hottest_c)
        if not rows.size:
            break
        # the one that is too hot first, or a neighbour that heats it, ends a little before
        row, k = int(rows[0]), int(springs[0])
        on = [one for one in stretches if one.begin_s <= row < one.end_s + LONGEST_S]
        guilty = max(on, key=lambda one: (one.spring == k, one.end_s >= row, one.level))
        guilty.end_s = min(guilty.end_s, float(row)) - BACK_OFF_S
        stretches = [one for one in stretches if one.end_s - one.begin_s >= BACK_OFF_S]
        drive, temperature = simulated()
    else:
        raise InputError(f"no plan keeps the springs below {hottest_c:g} degC with {current_a:g} A: lower the current")
    plant, least_c = _declared(array), float(temperature.max(axis=0).min())
    start_c, finish_c = plant.get("austenite_start_c"), plant.get("austenite_finish_c")
    if board_alone and least_c < start_c + THROUGH * (finish_c - start_c):
        raise InputError(
            f"with {current_a:g} A a spring comes to {least_c:.0f} degC at most, and v / i is read by the transformation, which "
            f"ends at {finish_c:g}: another current (of thin wire less), or a hotter limit than {hottest_c:g}"
        )
    return Plan(
        steps=whole_springs(array) + _lines(array.springs, stretches, duration_s, current_a, resting, fan),
        hottest_c=float(temperature.max()),
        most_a=float(drive.sum(axis=1).max()),
        share_on=(drive > 1.01 * resting / 100.0 * current_a).mean(axis=0),
    )


def plan_experiment(
    array: Array, experiment: results.Experiment, supply_a: float, hottest_c: float, current_a: float | None = None
) -> Plan:
    """Return the plan of an experiment that a diagnosis asks for, with less current where a limit would be passed.

    `experiment` is a rival's; `current_a` is a spring's at full level where that has none.
    """
    _check_limits(supply_a, hottest_c, current_a)
    steps = experiment.steps
    percent = np.array([one.percent for one in steps], dtype=float)
    if percent.shape[1] != array.springs:
        raise InputError(f"the experiment is for {percent.shape[1]} springs, the array has {array.springs}")
    full_a = experiment.current_a or current_a
    if not full_a:
        raise InputError("the diagnosed logs have no current: give that of a spring at full level, --current")
    time_s = np.arange(0.0, experiment.duration_s)
    at = np.searchsorted([one.at_s for one in steps], time_s, "right") - 1
    fan = np.array([one.fan for one in steps])[at] / 100.0
    full_a = min(full_a, supply_a / max(percent.sum(axis=1).max() / 100.0, 1e-9))
    drive, plant = percent[at] / 100.0 * full_a, _declared(array)
    while (hottest := float(_temperatures(plant, drive, fan).max())) > hottest_c:
        if full_a < LEAST_A:
            raise InputError(f"this experiment gets hotter than {hottest_c:g} degC with any current")
        full_a *= BACK_OFF
        drive = percent[at] / 100.0 * full_a
    lines = [*whole_springs(array), "policy open", f"$open_current_a={full_a:.3f}", "off all", "fan 0"]
    before, blows = np.zeros(array.springs), 0
    for one in steps:
        stamp = f"at {one.at_s + FIRST_S:g} = "
        lines += [f"{stamp}fan {one.fan}"] * (one.fan != blows)
        for k in np.flatnonzero(np.array(one.percent) != before):
            level = one.percent[k]
            lines.append(f"{stamp}on {k + 1} {level}" if level else f"{stamp}off {k + 1}")
        before, blows = np.array(one.percent), one.fan
    return Plan(lines, hottest, float(drive.sum(axis=1).max()), (drive > 0).mean(axis=0))


def plan_through(model: Model, spring: int, supply_a: float, hottest_c: float) -> Plan:
    """Return the plan that drives one spring (from 1) through all of its transformation and lets it cool.

    With the least current that takes it clearly beyond the end, as the model has it with its error; `hottest_c` is the limit.
    """
    _check_limits(supply_a, hottest_c, None)
    if not 1 <= spring <= model.array.springs:
        raise InputError(f"there is no spring {spring}: the array has {model.array.springs}")
    plant = best_plant(model)
    end_c = plant.get("austenite_finish_c") + CROSSED * model.stderr.get("austenite_finish_c", 0.0) + BEYOND_K
    if end_c > hottest_c:
        raise InputError(
            f"the transformation may end as late as {end_c:.0f} degC, and the hottest may be {hottest_c:g}"
        )
    time_s = np.arange(0.0, 2.0 * THROUGH_S)
    for current_a in np.arange(0.6, min(ranges.PLAN_CURRENT_A.high, supply_a) + 1e-9, 0.1):
        drive = np.zeros((len(time_s), model.array.springs))
        drive[: int(THROUGH_S), spring - 1] = current_a
        beyond = np.flatnonzero(_temperatures(plant, drive)[: int(THROUGH_S), spring - 1] >= end_c)
        if not beyond.size:
            continue
        off_s = int(beyond[0]) + 1
        drive[off_s:] = 0.0
        hottest = float(_temperatures(plant, drive).max())
        if hottest > hottest_c:
            break
        lines = ["policy open", f"$open_current_a={current_a:.3f}", "off all", "fan 0"]
        lines += [f"at {FIRST_S:g} = on {spring} 100", f"at {FIRST_S + off_s:g} = off {spring}"]
        return Plan(lines, hottest, float(current_a), (drive > 0).mean(axis=0))
    raise InputError(
        f"no current up to the limits takes spring {spring} to {end_c:.0f} degC and not above {hottest_c:g}"
    )


def _check_limits(supply_a: float, hottest_c: float, current_a: float | None) -> None:
    ranges.PLAN_SUPPLY_A.check("supply_a", supply_a)
    ranges.PLAN_HOTTEST_C.check("hottest_c", hottest_c)
    if current_a is not None:
        ranges.PLAN_CURRENT_A.check("current_a", current_a)


def _stretches(
    springs: int, duration_s: float, most: float, levels: tuple[int, ...], rng: np.random.Generator
) -> list[Stretch]:
    """Return who is driven when; `most` is the sum of levels that the supply gives, percent.

    Whoever is due and does not fit waits, and the one that was driven least goes first.
    """
    out: list[Stretch] = []
    due_s = rng.uniform(5.0, LONGEST_S, springs)
    on_s, turns = np.zeros(springs), np.zeros(springs, dtype=int)
    end_of_heating = round(COOL_FROM * duration_s)
    for now in range(int(end_of_heating - SHORTEST_S)):
        taken = sum(one.level for one in out if one.end_s > now)
        for k in sorted(np.flatnonzero(due_s <= now), key=lambda k: on_s[k]):
            level = levels[(k + turns[k]) % len(levels)]
            if taken + level > most:
                continue
            end = min(now + round(rng.uniform(SHORTEST_S, LONGEST_S)), end_of_heating)
            out.append(Stretch(int(k), now, end, level))
            taken += level
            on_s[k] += end - now
            turns[k] += 1
            due_s[k] = end + rng.uniform(SHORTEST_S, LONGEST_S)
    return out


Blows = tuple[tuple[float, float, int], ...]
"""When the fan blows, parts of a plan, and how, percent."""


def _simulated(
    array: Array, stretches: list[Stretch], duration_s: float, current_a: float, resting: int, blows: Blows
) -> tuple[np.ndarray, np.ndarray]:
    time_s = np.arange(0.0, duration_s)
    drive = np.full((len(time_s), array.springs), resting / 100.0 * current_a)
    for one in stretches:
        drive[(time_s >= one.begin_s) & (time_s < one.end_s), one.spring] = one.level / 100.0 * current_a
    fan = np.zeros(len(time_s))
    for begin, end, percent in blows:
        fan[(time_s >= begin * duration_s) & (time_s < end * duration_s)] = percent / 100.0
    return drive, _temperatures(_declared(array), drive, fan)


def _declared(array: Array) -> native.Plant:
    plant = native.Plant(array.rows, array.cols)
    plant.set_all(array_parameters(array))
    plant.set_effects(FIRMWARE_EFFECTS)
    return plant


def whole_springs(array: Array) -> list[str]:
    """Return the lines that tell a board which resistance springs have, where it is another than the paper's.

    A board that takes them for the paper's gives them less current, and calls them a bad contact or a short.
    """
    if limits := board_settings(array):
        limits |= {name: value for name, value in array_parameters(array).items() if name in RESISTANCES}
    return [f"${name}={value:.3f}" for name, value in limits.items()]


def _temperatures(plant: native.Plant, drive: np.ndarray, fan: np.ndarray | None = None) -> np.ndarray:
    """Return (s, springs) degC of a plant from rest, given currents (s, springs) and fan (s,; None: off) each second."""
    plant.reset()
    around = np.full(len(drive), plant.get("ambient_c"))
    return plant.simulate(np.arange(0.0, len(drive)), native.CURRENT, drive, fan, around)


def _lines(
    springs: int, stretches: list[Stretch], duration_s: float, current_a: float, resting: int, blows: Blows
) -> list[str]:
    events: list[tuple[float, int, str]] = []
    for begin, end, percent in blows:
        events.append((round(begin * duration_s), 0, f"fan {percent}"))
        if all(end != following for following, _, _ in blows):
            events.append((round(end * duration_s), 0, "fan 0"))
    for one in stretches:
        rest = f"on {one.spring + 1} {resting}" if resting else f"off {one.spring + 1}"
        events.append((one.end_s, 0, rest))
        events.append((one.begin_s, 1, f"on {one.spring + 1} {one.level}"))
    head = ["policy open", f"$open_current_a={current_a:.3f}", "fan 0"]
    if resting:
        head.append(f"at 0 = on all {resting}")
    else:
        events.append((round(COOL_FROM * duration_s), 2, "off all"))
    return head + [f"at {at:g} = {line}" for at, _, line in sorted(events)]
