"""The sweep's own cost: throughput against bare loops, workers killed every 20 s, memory at 10^5 points.

.venv/bin/python bench/explore/sweep.py [throughput killed memory] [--json FILE]
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import resource
import signal
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
from ninespring.explore import sweep as engine
from ninespring.explore.point import run_point
from ninespring.explore.results import Results
from ninespring.explore.spec import Spec, read_spec

KILL_S = 20.0
COUNT = 500
TEXT = """[sweep]
method = "latin"
points = {points}
duration_s = {duration}
on_s = {on}
[fixed]
pattern = "random"
tolerance = 0.05
[vary]
pitch_mm = {{ from = 4.5, to = 8 }}
fan = {{ from = 0, to = 1 }}
ambient_c = {{ from = 10, to = 30 }}
"""


def spec_of(folder: Path, points: int, duration: int) -> Spec:
    """Return a spec of so many points of so many simulated seconds."""
    path = folder / "spec.toml"
    path.write_text(TEXT.format(points=points, duration=duration, on=duration * 2 // 3))
    return read_spec(path)


def bare(job: tuple[Spec, int, int]) -> float:
    """Run every so many-th point in a plain loop; return the seconds of processor."""
    spec, first, step = job
    begin = time.process_time()
    for index, point in enumerate(spec.all_points()):
        if index % step == first:
            run_point(spec, index, point)
    return time.process_time() - begin


def swept(spec: Spec, folder: Path, cores: int, disturb: Any = None) -> tuple[float, float, Any]:
    """Run a sweep with a cluster that is up; return the seconds, the seconds of all its processors, and the rows."""
    from distributed import Client

    results = Results(folder, spec)
    done = results.open()
    with engine.local_cluster(cores) as cluster, Client(cluster) as client:
        client.wait_for_workers(cores)
        import pyarrow.parquet  # noqa: F401 - loaded before the clock runs

        client.run(lambda: __import__("ninespring.explore.point"))
        stop = threading.Event()
        if disturb:
            threading.Thread(target=disturb, args=(client, stop), daemon=True).start()
        begin, worked = time.perf_counter(), time.process_time() + sum(client.run(time.process_time).values())
        engine.sweep(client, spec, results, done, lambda _: None)
        took = time.perf_counter() - begin
        stop.set()
        worked = time.process_time() + sum(client.run(time.process_time).values()) - worked
    return took, worked, results.read()


def throughput(folder: Path, cores: int) -> list[dict[str, Any]]:
    """Compare a sweep with plain loops over the same points, one a core.

    By the time on the clock, and by that of the processors: on a machine that others use only the second says something.
    """
    out = []
    for duration, each in ((400, 150), (3000, 25)):
        spec = spec_of(folder, each * cores, duration)
        with multiprocessing.get_context("spawn").Pool(cores) as pool:
            jobs = [(spec, k, cores) for k in range(cores)]
            pool.map(bare, [(spec, k, spec.points // 2) for k in range(cores)])  # all is loaded
            begin = time.perf_counter()
            alone_cpu = sum(pool.map(bare, jobs))
            alone = time.perf_counter() - begin
        took, worked, table = swept(spec, folder / f"throughput-{duration}", cores)
        assert len(table) == spec.points
        name = f"throughput against bare loops, {1e3 * alone_cpu / spec.points:.0f} ms a point"
        print(f"{name}: clock {100 * alone / took:.0f} %, processors {100 * alone_cpu / worked:.0f} %", flush=True)
        out.append(
            {"figure": f"{name}, processors", "value": round(100 * alone_cpu / worked), "unit": "%", "target": ">= 85"}
        )
        out.append(
            {
                "figure": f"  by the clock, {cores} cores",
                "value": round(100 * alone / took),
                "unit": "%",
                "target": ">= 85",
            }
        )
    return out


def killer(client: Any, stop: threading.Event) -> None:
    """Kill a worker every KILL_S."""
    rng = np.random.default_rng(1)
    client.kills = 0
    while not stop.wait(KILL_S):
        pids = list(client.run(os.getpid).values())
        os.kill(int(rng.choice(pids)), signal.SIGKILL)
        client.kills += 1
        print(f"killed {client.kills}", file=sys.stderr, flush=True)


def killed(folder: Path, cores: int) -> list[dict[str, Any]]:
    """Compare a disturbed sweep with an undisturbed one."""
    spec = spec_of(folder, COUNT, 2400)
    _, _, calm = swept(spec, folder / "calm", cores)
    kills = []

    def disturb(client: Any, stop: threading.Event) -> None:
        killer(client, stop)
        kills.append(client.kills)

    took, _, table = swept(spec, folder / "killed", cores, disturb)
    same = table.equals(calm)
    once = len(table) == COUNT == table["point"].nunique()
    print(f"{COUNT} points, a worker killed every {KILL_S:g} s ({took:.0f} s): all once {once}, equal {same}")
    return [
        {"figure": f"{COUNT} points, a worker killed every 20 s: lost or twice", "value": 0 if once else 1}
        | {"unit": "points", "target": "0"},
        {
            "figure": "  rows that differ from the undisturbed run's",
            "value": 0 if same else 1,
            "unit": "",
            "target": "0",
        },
    ]


def memory(folder: Path, cores: int) -> list[dict[str, Any]]:
    """Measure what the process of scheduler and client needs more for 10^5 points than for 10^3."""
    out, peaks = [], []
    for points in (1000, 100_000):
        spec = spec_of(folder, points, 10)
        swept(spec, folder / f"memory-{points}", cores)
        peaks.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
        print(f"{points} points: peak {peaks[-1]:.0f} MB", flush=True)
    out.append(
        {
            "figure": "10^5 points: peak memory of scheduler and client",
            "value": round(peaks[1]),
            "unit": "MB",
            "target": None,
        }
    )
    out.append({"figure": "  more than for 10^3", "value": round(peaks[1] - peaks[0]), "unit": "MB", "target": None})
    return out


PARTS = {"throughput": throughput, "killed": killed, "memory": memory}


def main() -> None:
    """Measure, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("part", nargs="*", choices=[*PARTS, []], default=[])
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    cores = os.cpu_count() or 1
    figures = []
    with tempfile.TemporaryDirectory() as folder:
        for name in options.part or PARTS:
            figures += [one | {"command": "bench/explore/sweep.py"} for one in PARTS[name](Path(folder), cores)]
            if options.json:  # after each: what is measured is not lost
                options.json.write_text(json.dumps(figures, indent=1) + "\n")


if __name__ == "__main__":
    main()
