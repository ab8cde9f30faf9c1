"""What the live page costs: states a second that a page gets, and processor time, on the simulated board at 10 Hz.

.venv/bin/python bench/dashboard/run.py [--seconds S] [--json FILE]     script/build first
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

from websockets.sync.client import connect

TICK_S = 1.0 / os.sysconf("SC_CLK_TCK")
ROWS_HZ = 10
"""Rows a second that the dashboard asks the board for: no page can get more states."""
PAGES = (0, 1, 4)


def cpu_s(pid: int) -> float:
    """Return the processor time that a process has had, s."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) * TICK_S


def child_of(pid: int) -> int:
    """Return the process that one of another's threads started: the simulated board."""
    (child,) = " ".join(one.read_text() for one in Path(f"/proc/{pid}/task").glob("*/children")).split()
    return int(child)


def figure(name: str, value: float, unit: str) -> dict[str, object]:
    """Return one row of the results."""
    return {
        "figure": name,
        "value": value,
        "unit": unit,
        "target": "",
        "command": ".venv/bin/python bench/dashboard/run.py",
    }


def measured(process: subprocess.Popen[str], seconds: float) -> list[dict[str, object]]:
    """Return the figures without a page, with one and with four."""
    assert process.stdout is not None
    url = process.stdout.readline().split()[0].rstrip("/")
    open_one = partial(connect, url.replace("http", "ws") + "/ws", additional_headers={"origin": url})
    with open_one() as first:
        while (state := json.loads(first.recv()))["kind"] != "state" or "time_s" not in state:
            pass
    board = child_of(process.pid)
    figures: list[dict[str, object]] = []
    simulation = 0.0
    for count in PAGES:
        with contextlib.ExitStack() as stack:
            pages = [stack.enter_context(open_one()) for _ in range(count)]
            shown: list[list[float]] = [[] for _ in pages]
            begun, before, simulated, bytes_ = time.monotonic(), cpu_s(process.pid), cpu_s(board), 0
            while time.monotonic() - begun < seconds:
                if not pages:
                    time.sleep(0.1)
                for page, times_s in zip(pages, shown, strict=True):
                    state = json.loads(text := page.recv())
                    if state["kind"] == "state":
                        bytes_ += len(text)
                        times_s += [state["time_s"]] * (state["time_s"] not in times_s[-1:])
            passed = time.monotonic() - begun
            load = 100.0 * (cpu_s(process.pid) - before) / passed
            simulation = 100.0 * (cpu_s(board) - simulated) / passed
        name = "no page" if not count else "1 page" if count == 1 else f"{count} pages"
        figures.append(figure(f"{name}: processor time of the dashboard", load, "% of one core"))
        if count:
            # by the board's clock: a simulated one has what the machine leaves it. What came while the board was asked for
            # what it believes, once a second, is shown as one: nine of ten remain
            rate = sum((len(one) - 1) / (one[-1] - one[0]) for one in shown) / count
            what = f"{name}: rows that each shows, of {ROWS_HZ} a second"
            figures.append(figure(what, rate, "1/s"))
            figures.append(figure(f"{name}: to each", bytes_ / count / passed / 1e3, "kB/s"))
    return [*figures, figure("the simulated board beside it, in real time", simulation, "% of one core")]


def main() -> int:
    """Measure, print and keep."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=15.0)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    words = [sys.executable, "-m", "ninespring", "dashboard", "--simulate", "--hz", str(ROWS_HZ), "--listen"]
    with subprocess.Popen([*words, "127.0.0.1:0"], stdout=subprocess.PIPE, text=True) as process:
        try:
            figures = measured(process, options.seconds)
        finally:
            process.terminate()
    for one in figures:
        print(f"{one['figure']}: {one['value']:.1f} {one['unit']}")
    if options.json:
        options.json.write_text(json.dumps(figures, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
