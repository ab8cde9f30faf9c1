"""What logs could show, which is all that the library of effects asks of them."""

from __future__ import annotations

import numpy as np

from ..io.logs import SENSORS
from ..model.effects import Scene
from . import room
from .problem import Problem

FAN_ROWS = 20
"""So many rows at a part of the fan's command say something of it: one or two are means across a switch."""


def scene_of(problem: Problem) -> Scene:
    """Return what a problem's runs could show."""
    runs = problem.runs
    fan = np.concatenate([run.fan for run in runs])
    return Scene(
        problem.array.rows,
        problem.array.cols,
        frozenset(run.mode for run in runs),
        bool((fan > 0.1).any()),
        # what half its command gives is a part of what all of it does: of one level alone nobody knows which
        bool(min((np.abs(fan - 0.5) < 0.35).sum(), (fan >= 0.85).sum()) >= FAN_ROWS),
        problem.hottest_c,
        float(np.median(np.diff(runs[0].time_s))),
        max(run.duration_s for run in runs),
        {key: tuple(one.shape[1] for one in hats) for key, hats in problem.hats.items()},
        problem.base_value,
        len(runs),
        all(run.ambient_c is not None for run in runs),
        room.above_logged(runs[0]) if len(runs) == 1 else None,
        any(run.load_n is not None and np.ptp(run.load_n) > 0.0 for run in runs),
        # of a kind that nobody has heard of anything may be
        any((problem.array.sensor.get("kind") or run.sensor) not in SENSORS[1:] for run in runs),
        problem.reads_ohm,
        () if problem.reads_ohm else tuple(r for r, run in enumerate(runs) if room.begins_warm(run)),
    )
