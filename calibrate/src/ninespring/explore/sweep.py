"""A sweep on Dask: which lots of points are under way, and what is done with their rows.

Dask distributes, watches its workers and does again what a lost worker had; a lot's rows are kept once, here, when they come.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError
from dataclasses import replace
from typing import Any

import numpy as np

from ..errors import WorkError
from .point import run_point
from .results import Results
from .spec import METRICS, Spec

LOT_S = 2.0
"""A lot of points takes about so long: Dask's own work for it is some milliseconds."""
LARGEST_LOT = 500
AHEAD = 3
"""Lots under way for each core: memory does not grow with the points."""
LOSSES = 50
"""A lot whose worker was lost so often is the lot's own fault."""
Say = Callable[[int], None]


def run_lot(spec: Spec, lot: list[tuple[int, dict[str, Any]]]) -> tuple[list[dict[str, Any]], float]:
    """Run points one after the other; return their rows, and s a point. In a worker."""
    begin = time.perf_counter()
    rows = [run_point(spec, index, point) for index, point in lot]
    return rows, (time.perf_counter() - begin) / len(lot)


def local_cluster(workers: int) -> Any:
    """Return Dask's own cluster on this machine: a process a core."""
    import dask
    from distributed import LocalCluster

    dask.config.set(
        {
            "distributed.scheduler.allowed-failures": LOSSES,
            # what Dask does all the time beside the work
            "distributed.worker.profile.enabled": False,
            "distributed.admin.tick.interval": "1s",
            "distributed.admin.system-monitor.interval": "2s",
        }
    )
    return LocalCluster(
        n_workers=workers, threads_per_worker=1, dashboard_address="127.0.0.1:0", silence_logs="ERROR", memory_limit=0
    )


def run_points(
    client: Any,
    spec: Spec,
    wanted: Iterator[tuple[int, dict[str, Any]]],
    left: int,
    keep: Callable[[list[dict[str, Any]]], None],
) -> None:
    """Run the `left` points of an iterator; hand over the rows of each lot once, in the order in which they end."""
    from distributed import KilledWorker, as_completed

    slim = replace(spec, text="")
    cores = max(1, sum(client.nthreads().values()))
    per_point_s = LOT_S
    flying: Any = as_completed([])
    under_way = 0

    def send() -> bool:
        nonlocal left
        # towards the end lots get smaller, so that all cores end at the same time
        size = int(np.clip(min(LOT_S / per_point_s, left / (AHEAD * cores)), 1, LARGEST_LOT))
        lot = list(itertools.islice(wanted, size))
        left -= len(lot)
        if lot:
            flying.add(client.submit(run_lot, slim, lot, pure=False, retries=LOSSES))
        return bool(lot)

    while under_way < cores and send():
        under_way += 1
    for future in flying:
        try:
            rows, took_s = future.result()
        except (KilledWorker, CancelledError) as error:
            raise WorkError(f"the cluster gave up ({type(error).__name__}): the same command carries on") from None
        future.release()
        under_way -= 1
        per_point_s = took_s
        keep(rows)
        while under_way < AHEAD * cores and send():
            under_way += 1


def sweep(client: Any, spec: Spec, results: Results, done: np.ndarray, say: Say) -> None:
    """Run what is not done of a spec."""
    count = int(done.sum())

    def keep(rows: list[dict[str, Any]]) -> None:
        nonlocal count
        results.add(rows)
        count += len(rows)
        say(count)

    if spec.method == "optimise":
        _optimise(client, spec, results, done, keep)
        return
    wanted = ((k, point) for k, point in enumerate(spec.all_points()) if not done[k])
    run_points(client, spec, wanted, int((~done).sum()), keep)


BATCH = 8
"""Points that the optimiser asks for before it is told: the same on any machine, so that a sweep can be resumed."""


def _optimise(client: Any, spec: Spec, results: Results, done: np.ndarray, keep: Callable[..., None]) -> None:
    import optuna

    optuna.logging.set_verbosity(optuna.logging.ERROR)
    study = optuna.create_study(
        direction="minimize" if spec.goal == "min" else "maximize", sampler=optuna.samplers.TPESampler(seed=spec.seed)
    )
    before = {} if not done.any() else {row["point"]: row for row in results.read().to_dict("records")}
    for first in range(0, spec.points, BATCH):
        trials = [study.ask() for _ in range(min(BATCH, spec.points - first))]
        points = [spec.table([_suggest(trial, axis) for axis in spec.axes]) for trial in trials]
        rows = {k: before[k] for k in range(first, first + len(trials)) if k in before}
        missing = [(first + k, point) for k, point in enumerate(points) if first + k not in rows]

        def take(lot: list[dict[str, Any]], rows: dict[int, Any] = rows) -> None:
            rows |= {row["point"]: row for row in lot}
            keep(lot)

        run_points(client, spec, iter(missing), len(missing), take)
        for k, trial in enumerate(trials):
            value = worth(spec, rows[first + k])
            study.tell(trial, value, optuna.trial.TrialState.FAIL if value is None else None)


def _suggest(trial: Any, axis: Any) -> Any:
    if axis.values:
        return trial.suggest_categorical(axis.key, axis.values)
    if isinstance(axis.low, int) and isinstance(axis.high, int):
        return trial.suggest_int(axis.key, axis.low, axis.high)
    return trial.suggest_float(axis.key, axis.low, axis.high)


def worth(spec: Spec, row: dict[str, Any]) -> float | None:
    """Return a row's metric, None where it has none or a limit is not kept."""
    for name, (least, most) in spec.limits.items():
        value = row[name]
        if not np.isfinite(value) or (least is not None and value < least) or (most is not None and value > most):
            return None
    value = row[spec.metric]
    return float(value) if np.isfinite(value) else None


def best_of(spec: Spec, table: Any) -> dict[str, Any] | None:
    """Return the best row of an optimiser's results."""
    scored = [(worth(spec, row), row) for row in table.to_dict("records")]
    kept = [(value, row) for value, row in scored if value is not None]
    if not kept:
        return None
    return (min if spec.goal == "min" else max)(kept, key=lambda one: one[0])[1]


def indices_of(spec: Spec, table: Any) -> dict[str, dict[str, dict[str, float]]]:
    """Return the Sobol indices of every metric that every point has: first order, total, each with its 95 % half width."""
    from SALib.analyze import sobol

    problem = {
        "num_vars": len(spec.axes),
        "names": [axis.key for axis in spec.axes],
        "bounds": [[0, 1]] * len(spec.axes),
    }
    out: dict[str, dict[str, dict[str, float]]] = {}
    for metric in METRICS:
        values = table[metric].to_numpy()
        if not np.isfinite(values).all() or np.ptp(values) == 0.0:
            continue
        with np.errstate(all="ignore"):
            found = sobol.analyze(problem, values, calc_second_order=False, seed=1)  # 0 is no seed
        out[metric] = {
            axis.key: {name: float(found[name][k]) for name in ("S1", "S1_conf", "ST", "ST_conf")}
            for k, axis in enumerate(spec.axes)
        }
    return out
