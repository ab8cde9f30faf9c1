"""A long log made short enough to be fitted, and how."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd

from .mending import mask_run_in
from .run import Run

FINEST_S = 1.0
"""Rows closer than this are averaged where a log is too long to be simulated row by row."""
STRETCH_S = 1500.0
"""Length of the stretches that are taken of a log that is still too long, about."""


def condense(run: Run, max_rows: int = 4000) -> Run:
    """Return the run with at most about `max_rows` rows, and say how.

    First rows are averaged to FINEST_S. What is then still too long is cut to stretches, evenly spread from beginning to
    end, at full rate: averaging further would blur what the springs were given. Each stretch starts from the measured
    temperatures, as after a gap; between two of them one row holds the mean of what was given, for air and plate.
    """
    run = _averaged(run, max_rows)
    n = len(run.time_s)
    usual = float(np.median(np.diff(run.time_s)))
    pieces = max(2, round(max_rows * usual / STRETCH_S))
    each = max_rows // pieces
    if n <= max_rows or each < 50:
        return run
    begins = np.linspace(0, n - each, pieces).round().astype(int)
    rows: list[np.ndarray] = []
    starts: list[int] = []
    bridges: list[tuple[int, int, int]] = []
    total = 0
    for begin, following in zip(begins, [*begins[1:], n], strict=True):
        end = int(begin) + each
        starts += [total, *(total + one - int(begin) for one in run.starts if begin < one < end)]
        rows.append(np.arange(begin, min(end + 1, following)))
        total += len(rows[-1])
        if following > end and following < n:
            bridges.append((total - 1, end, int(following)))
    pick = np.concatenate(rows)
    out = replace(
        run,
        time_s=run.time_s[pick],
        drive=run.drive[pick],
        temperature_c=run.temperature_c[pick],
        fan=run.fan[pick],
        load_n=None if run.load_n is None else run.load_n[pick],
        ambient_c=None if run.ambient_c is None else run.ambient_c[pick],
        current_a=None if run.current_a is None else run.current_a[pick],
        voltage_v=None if run.voltage_v is None else run.voltage_v[pick],
        starts=starts,
        notes=[
            *run.notes,
            f"{n} rows: the fit takes {pieces} stretches of {each * usual / 60.0:.0f} min, evenly spread; "
            "what was given between them counts as its mean",
        ],
    )
    weight = np.diff(run.time_s, append=run.time_s[-1] + usual)
    for at, begin, end in bridges:
        span = slice(begin, end)
        out.temperature_c[at] = np.nan
        out.drive[at] = weight[span] @ run.drive[span] / weight[span].sum()
        out.fan[at] = weight[span] @ run.fan[span] / weight[span].sum()
        if out.ambient_c is not None and run.ambient_c is not None:
            out.ambient_c[at] = weight[span] @ run.ambient_c[span] / weight[span].sum()
    for begin in starts[1:]:
        mask_run_in(out, begin)
    return out


def _averaged(run: Run, max_rows: int) -> Run:
    """Return the run with rows averaged to at most FINEST_S, no more than `max_rows` asks for.

    A row's drive and fan are the means over the time until the next one; its temperature is the mean of an odd number of
    readings around its time, none of them used twice: nothing is shifted, and the noise stays white.
    """
    n = len(run.time_s)
    usual = float(np.median(np.diff(run.time_s)))
    factor = min(-(-n // max_rows), int(FINEST_S / usual + 1e-9))
    if factor <= 1:
        return run
    weight = np.diff(run.time_s, append=run.time_s[-1] + usual)
    pieces: dict[str, list[np.ndarray]] = {"row": [], "drive": [], "fan": [], "temperature": []}
    starts: list[int] = []
    for begin, end in zip(run.starts, [*run.starts[1:], n], strict=True):
        starts.append(sum(map(len, pieces["row"])))
        rows = np.arange(begin, end, factor)
        span = np.add.reduceat(weight[begin:end], rows - begin)
        pieces["row"].append(rows)
        pieces["drive"].append(
            np.add.reduceat(weight[begin:end, None] * run.drive[begin:end], rows - begin, axis=0) / span[:, None]
        )
        pieces["fan"].append(np.add.reduceat(weight[begin:end] * run.fan[begin:end], rows - begin) / span)
        measured = pd.DataFrame(run.temperature_c[begin:end])
        smooth = measured.rolling(factor - (factor + 1) % 2, center=True, min_periods=1).mean().to_numpy()
        pieces["temperature"].append(smooth[rows - begin])
    row = np.concatenate(pieces["row"])
    current = voltage = None
    if run.current_a is not None and run.voltage_v is not None:
        # the voltage weighted by the current, as the board averages it: their product stays the mean power
        begins = [np.arange(a, b, factor) for a, b in zip(run.starts, [*run.starts[1:], n], strict=True)]
        at = np.concatenate(begins)
        span = np.add.reduceat(weight, at)
        current = np.add.reduceat(weight[:, None] * run.current_a, at, axis=0) / span[:, None]
        power = np.add.reduceat(weight[:, None] * run.current_a * run.voltage_v, at, axis=0) / span[:, None]
        voltage = np.where(current > 0, power / np.where(current > 0, current, 1.0), 0.0)
    return replace(
        run,
        time_s=run.time_s[row],
        drive=np.ascontiguousarray(np.concatenate(pieces["drive"])),
        temperature_c=np.ascontiguousarray(np.concatenate(pieces["temperature"])),
        fan=np.concatenate(pieces["fan"]),
        load_n=None if run.load_n is None else run.load_n[row],
        ambient_c=None if run.ambient_c is None else run.ambient_c[row],
        current_a=current,
        voltage_v=voltage,
        starts=starts,
        notes=[*run.notes, f"{n} rows averaged {factor} by {factor} for the fit"],
    )
