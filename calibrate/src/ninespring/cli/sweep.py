"""`ninespring sweep`."""

from __future__ import annotations

import json
import os
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import click
from rich.table import Table

from ..errors import WorkError
from ..explore.results import Results
from ..explore.spec import UNITS, named, read_spec
from ..explore.sweep import best_of, indices_of, local_cluster
from ..explore.sweep import sweep as run
from ..io import ranges
from ..io.logs import write_atomically
from ..io.results import Sweep, checked
from .console import FILE, FOLDER, JSON, command, number, out, output, working, write
from .couplings import need

CONNECT_S = 10


@command("""\b
Examples:
  ninespring sweep pitch.toml -o pitch
  ninespring sweep pitch.toml -o pitch --check
  ninespring sweep pitch.toml -o pitch --scheduler tcp://192.168.1.5:8786
Read the results: pandas.read_parquet("pitch/points")
""")
@click.argument("spec_path", metavar="SPEC.TOML", type=FILE)
@output("folder to write", FOLDER)
@click.option("--scheduler", help="a Dask cluster as it stands, tcp://host:8786; left out: this machine's cores")
@number("--workers", ranges.WORKERS, "processes on this machine; left out: one a core")
@click.option("--check", is_flag=True, help="look at the spec and every point of it, and run nothing")
@JSON
def sweep(
    spec_path: Path, output: Path, scheduler: str | None, workers: int | None, check: bool, json_path: Path | None
) -> None:
    """Run controller and array at many points: a grid, a sample, or where an optimiser asks (docs/exploring.md).

    Stopped or killed, the same command carries on where it was: no point is lost or done twice.
    """
    spec = read_spec(spec_path)
    if check:
        out.print(f"{spec_path}: {spec.points} points, {', '.join(axis.key for axis in spec.axes)}", soft_wrap=True)
        return
    need("distributed", "pyarrow", *{"saltelli": ["SALib"], "optimise": ["optuna"]}.get(spec.method, []))
    if spec.couplings == "field":
        need("skfem", "gmsh")
    results = Results(output, spec)
    done = results.open()
    begin, before = time.monotonic(), int(done.sum())
    if before < spec.points:
        _run(spec, results, done, scheduler, workers or os.cpu_count() or 1)
    took = time.monotonic() - begin
    points, failed = results.count()
    out.print(
        f"{points} points in {output}/points ({before} were there), {took:.1f} s"
        + (f"; {failed} could not be run: column error says why" if failed else ""),
        soft_wrap=True,
    )
    result = Sweep(spec=spec_path.name, sha256=spec.sha256, points=points, done_before=before, failed=failed)
    _evaluate(spec, results, output, result)
    write({json_path: checked(result)})


def _run(spec: Any, results: Any, done: Any, scheduler: str | None, workers: int) -> None:
    from distributed import Client

    with ExitStack() as stack:
        where = scheduler or stack.enter_context(local_cluster(workers))
        try:
            client = stack.enter_context(Client(where, timeout=CONNECT_S))
        except (OSError, ValueError) as error:
            raise WorkError(f"no Dask scheduler at {scheduler}: {error}") from None
        if not client.nthreads():
            raise WorkError(f"the Dask scheduler at {scheduler} has no workers: dask worker {scheduler}")
        out.print(f"Dask's dashboard: {client.dashboard_link}", soft_wrap=True)
        say = stack.enter_context(working("points", spec.points))
        tell = lambda count: say(f"{count} of {spec.points} points", count)  # noqa: E731
        tell(int(done.sum()))
        run(client, spec, results, done, tell)


def _evaluate(spec: Any, results: Any, output: Path, result: Sweep) -> None:
    """Tell the best point, or the indices, of a sweep that looks for them, and put them into its result."""
    if spec.method not in ("optimise", "saltelli"):
        return
    table = results.read()
    if spec.method == "optimise":
        best = best_of(spec, table)
        if best is None:
            raise WorkError(f"no point keeps the limits and has {spec.metric}: all {len(table)} are in {output}/points")
        words = named({axis.key: best[axis.key] for axis in spec.axes})
        out.print(f"best {spec.metric}: {best[spec.metric]:.4g} {UNITS[spec.metric]} at {words}", soft_wrap=True)
        result.best = {axis.key: best[axis.key] for axis in spec.axes} | {spec.metric: best[spec.metric]}
        return
    found = indices_of(spec, table)
    shown = Table("metric", *(axis.key for axis in spec.axes), title="Sobol indices, total (+- 95 %)")
    for metric, one in found.items():
        shown.add_row(metric, *(f"{v['ST']:.2f} +- {v['ST_conf']:.2f}" for v in one.values()))
    out.print(shown)
    write_atomically(
        {output / "indices.json": json.dumps(found, indent=1) + "\n"}, force=True
    )  # the folder is a sweep's
    result.indices = found
