"""What the live page costs: states a second that a page gets, and processor time, on the simulated board at 10 Hz.

.venv/bin/python bench/dashboard/run.py [SECONDS]     prints a few lines; script/build first
"""

from __future__ import annotations

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


def cpu_s(pid: int) -> float:
    """Return the processor time that a process has had, s."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) * TICK_S


def main() -> int:
    """Measure with no page, one and four."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 15.0
    words = [sys.executable, "-m", "ninespring", "dashboard", "--simulate", "--listen", "127.0.0.1:0"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        url = process.stdout.readline().split()[0].rstrip("/")
        own = {"origin": url}
        with contextlib.ExitStack() as stack:
            open_one = partial(connect, url.replace("http", "ws") + "/ws", additional_headers=own)
            first = stack.enter_context(open_one())
            while json.loads(first.recv()).get("time_s") is None:
                pass
        for count in (0, 1, 4):
            with contextlib.ExitStack() as stack:
                pages = [stack.enter_context(open_one()) for _ in range(count)]
                begun, before, states, bytes_ = time.monotonic(), cpu_s(process.pid), 0, 0
                while time.monotonic() - begun < seconds:
                    if not pages:
                        time.sleep(0.1)
                    for page in pages:
                        text = page.recv()
                        states += json.loads(text)["kind"] == "state"
                        bytes_ += len(text)
                passed = time.monotonic() - begun
            load = 100.0 * (cpu_s(process.pid) - before) / passed
            each = (
                f"{states / count / passed:.1f} states/s, {bytes_ / count / passed / 1e3:.1f} kB/s each"
                if count
                else ""
            )
            print(f"{count} pages: {load:.1f} % of one core; {each}")
        process.terminate()
    return 0


if __name__ == "__main__":
    sys.exit(main())
