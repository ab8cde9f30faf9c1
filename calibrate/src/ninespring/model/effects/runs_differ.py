"""What may be a run's own: the drive's gain, where the surroundings are, what the thermometers are off by.

Random effects: every run has its number, all of them scatter about what the array's model says, and how far is fitted, too.
They are of the measurement, not of the array: no model.toml has them. The plant knows none of them (`infer/problem.py` does).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from ..spec import AMBIENT_OFFSET, DRIVE_GAIN, RUN_AMBIENT, RUN_DRIVE, RUN_SENSOR, SENSOR_OFFSET, Free
from .effect import Candidate, Effect, Numbers, Scene, one_number, percent, sized

GAIN_SPREAD, OFFSET_SPREAD_K = 0.2, 3.0
"""What is believed before of how far runs lie apart: next to nothing; the data's own spread takes its place."""

ALIKE = "the same in all runs"
"""Variant of surroundings that are elsewhere than where they are logged, as by a sensor that stands there, or heat that nobody logs."""

RESTED_K = 1.0
"""How far from where a rested run begins its room is, one sigma (infer/room.py has the same of rooms that nobody logged)."""


def _number(key: str, r: int) -> Free:
    run = f"{key}@{r + 1}"
    if key == DRIVE_GAIN:
        return Free(run, 1.0, 0.2, 5.0, "1", log=True, run=r, prior=GAIN_SPREAD)
    return Free(run, 0.0, -20.0, 20.0, "K", run=r, prior=OFFSET_SPREAD_K)


def _room_of_the_only(scene: Scene) -> Free:
    """Return where the room of a run alone is: about where its springs rest, if they do, and not where it was logged."""
    number = _number(AMBIENT_OFFSET, 0)
    if scene.begins_k is None:
        return number
    return replace(number, start=scene.begins_k, prior=RESTED_K, absent=0.0)


def _each_run(scene: Scene, key: str, shows: bool) -> Iterator[Candidate]:
    if not shows:
        return
    free = tuple(_number(key, r) for r in range(scene.runs))
    if key == AMBIENT_OFFSET and scene.runs == 1:
        free = (_room_of_the_only(scene),)
    still, moved = (1.0, 1.05) if key == DRIVE_GAIN else (0.0, 1.0)
    probes = tuple({f.key: moved if f is one else still for f in free} for one in free)
    # flexible: what is the array's own, and the same in all runs, comes first; the room of the only run is one number
    yield Candidate("each run its own", free, probes, signed=True, most=10.0, neutral=still, flexible=scene.runs > 1)
    if key == AMBIENT_OFFSET and scene.runs > 1:
        yield one_number(replace(free[0], key=key, run=None), 1.0, ALIKE, signed=True, most=10.0)


def _gains(numbers: Numbers, variant: str) -> str:
    each = [f"{percent(*number)} in run {name.partition('@')[2]}" for name, number in numbers.items()]
    return f"The drive gives each run a share of its own: {', '.join(each)}."


def _surroundings(numbers: Numbers, variant: str) -> str:
    each = [_off(number, "warmer", "colder", name) for name, number in numbers.items()]
    return f"The surroundings are not as warm as ambient_c says: {', '.join(each)}."


def _readings(numbers: Numbers, variant: str) -> str:
    each = [_off(number, "too much", "too little", name) for name, number in numbers.items()]
    return f"The thermometers read {', '.join(each)}."


def _off(number: tuple[float, float | None], more: str, less: str, name: str) -> str:
    value, error = number
    size, bracket, rest = sized(abs(value), error, "K").partition(" (")
    run = name.partition("@")[2]
    return f"{size} {more if value > 0 else less}{bracket}{rest} in {f'run {run}' if run else 'all runs'}"


EFFECTS = (
    # the gain of all is in the heat capacity, the losses or the command's power; the offset of one run is `sensor_gain`'s
    Effect(RUN_DRIVE, lambda one: _each_run(one, DRIVE_GAIN, one.runs > 1), says=_gains),
    Effect(RUN_AMBIENT, lambda one: _each_run(one, AMBIENT_OFFSET, one.ambient_logged), says=_surroundings),
    Effect(RUN_SENSOR, lambda one: _each_run(one, SENSOR_OFFSET, one.ambient_logged and one.runs > 1), says=_readings),
)


def candidates(scene: Scene) -> list[Candidate]:
    """Return what of these may be a run's own in these logs."""
    return [one for effect in EFFECTS for one in effect.candidates_for(scene)]
