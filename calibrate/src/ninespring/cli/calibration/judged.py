"""A drive that was measured, judged like those that `export` tries: what held, how hot it got, what the chip believed."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...export import drive as tried
from ...export.settings import best_plant
from ...io.logs import Run, read_log
from ...io.statistics import rms
from ...model import native
from ...model.models import Model
from ...model.simulate import started
from ...say.plotting import believed

FLOWING_A = 0.3
"""From the first row with this much a spring counts as driven: after power-on a board first waits until it knows its springs."""


@dataclass
class Judged(tried.Drive):
    """A measured drive."""

    error_c: float
    """The chip's temperatures less the thermometers', K rms."""
    worst_spring: int
    """1 = top left: the one that the chip knows worst."""
    worst_c: float
    """Its error, K rms."""


def austenite_of(model: Model, run: Run) -> np.ndarray:
    """Return the phase along a board's log, (rows, springs): each spring as hot as its thermometer says, or else the chip."""
    plant = best_plant(model)
    started(plant, run, run.ambient_c, 0)
    seen = np.where(np.isfinite(run.temperature_c), run.temperature_c, believed(run))
    ahead = np.vstack([seen[1:], seen[-1:]])  # what a row's interval ends at
    return plant.trace(run.time_s, native.TEMPERATURE, ahead, run.fan, run.ambient_c)[..., 1]


def judge(model: Model, log: Path, springs_on: str) -> Judged:
    """Return what a recorded drive of a pattern (`111101111`) did."""
    pattern = np.array([one == "1" for one in springs_on])
    run = read_log(log, len(pattern))
    austenite = austenite_of(model, run)
    current = run.current_a if run.current_a is not None else run.drive
    flowing = np.flatnonzero((current > FLOWING_A).any(axis=1))
    first = int(flowing[0]) if flowing.size else 0
    left = believed(run) - run.temperature_c
    each = np.sqrt(np.nanmean(left**2, axis=0))
    return Judged(
        **tried.Drive.phases(austenite, pattern, run.time_s[first:] - run.time_s[first], run.duration_s),
        hottest_c=float(np.nanmax(run.temperature_c)),
        enough_c=best_plant(model).get("austenite_finish_c") + tried.ENOUGH_K,
        error_c=rms([left]),
        worst_spring=int(np.nanargmax(each)) + 1,
        worst_c=float(np.nanmax(each)),
    )


def worse_than(before: Judged, after: Judged, noise_c: float) -> list[str]:
    """Return in what a measured drive is worse than the one before it, in words.

    By the measures of `export`, without those of which one drive tells nothing; and by the chip's error, where it grew by
    more than a thermometer's noise.
    """
    found = [one for one in tried.worse_than(before, after) if not tried.WORSE[one].chance]
    out = [tried.WORSE[one].words.format(old=getattr(before, one), new=getattr(after, one)) for one in found]
    if after.error_c > before.error_c + noise_c:
        out.append(
            f"the chip was {before.error_c:.2f} K wrong (rms), and is {after.error_c:.2f} K with the new settings"
        )
    return out
