"""`ninespring-sim hil` against a simulated board that runs firmware_hil: usage board_hil.py NINESPRING_SIM AVR_DIR.

The board runs slower than real time here, so that a busy machine is still fast enough for the frames.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

SKIPPED = 77
SIMULATED_S = 3.0

try:
    from board_pty import Board
except ImportError:
    sys.exit(SKIPPED)


def hil(program: str, elf: Path, *more: str, waits_s: float = 0.0) -> tuple[subprocess.CompletedProcess, dict]:
    """A board in the loop with a 1 x 2 array: what was said, and its summary."""
    with tempfile.TemporaryDirectory() as folder, Board(program, elf, "--speed", "0.1") as board:
        time.sleep(waits_s)
        result = Path(folder) / "hil.json"
        command = [program, "hil", "--port", board.port, "--json", str(result)]
        command += ["--set", "array.rows=1", "--set", "array.cols=2", *more]
        run = subprocess.run(command, check=False, capture_output=True, text=True, timeout=120)
        print(run.stdout, run.stderr)
        return run, json.loads(result.read_text())


def sent(*lines: str) -> list[str]:
    return [word for line in lines for word in ("--send", line)]


def goes_on_between_the_frames(program: str, elf: Path) -> None:
    lines = sent("policy open", "on 1", "on 3", "model", "frobnicate")
    run, summary = hil(program, elf, "--duration", str(SIMULATED_S), *lines)
    assert run.returncode == 0, run
    assert summary["schema"] == "ninespring.hil/1"
    assert summary["simulated_s"] >= SIMULATED_S
    assert summary["ticks"] + summary["lost_frames"] >= SIMULATED_S * 50
    assert summary["bad_frames"] == 0, summary
    assert summary["max_lag_ticks"] <= summary["allowed_lag_ticks"], summary
    # The console goes on between the frames, and the board reads what the plant does.
    assert "error:1 " in run.stdout
    assert "spring 1:" in run.stdout
    # Of a 1 x 2 array nothing is connected to channel 3.
    assert summary["final_current_a"][0] > 1.0, summary
    assert summary["final_current_a"][1:3] == [0.0, 0.0], summary


def a_closed_switch_is_found(program: str, elf: Path) -> None:
    lines = sent("policy open", "on 1", "on 2", "faults")
    run, summary = hil(program, elf, "--duration", "2.6", "--closed", "1", "--closed-at", "1.2", *lines)
    assert "board: fault 11 stuck_on: cut the supply" in run.stdout, run
    assert summary["final_current_a"][0] > 10.0, summary
    assert summary["final_current_a"][1] == 0.0, summary


def what_piled_up_before_is_left_out(program: str, elf: Path) -> None:
    run, summary = hil(program, elf, "--duration", "1", *sent("clear"), waits_s=3.0)  # some fifteen ticks
    assert (run.returncode, "ok\n" in run.stdout) == (0, True), run
    assert summary["max_lag_ticks"] <= summary["allowed_lag_ticks"], summary


def a_port_that_is_not_there_is_said(program: str, elf: Path) -> None:
    command = [program, "hil", "--port", "/no/such/port"]
    missing = subprocess.run(command, check=False, capture_output=True, text=True, timeout=20)
    assert missing.returncode == 2
    assert missing.stderr.count("\n") == 1


def main() -> int:
    program, avr = sys.argv[1], Path(sys.argv[2])
    elf = avr / "firmware_hil.elf"
    if not elf.exists():
        print(f"SKIPPED: {elf} is not there: build the avr target first")
        return SKIPPED
    tests = (
        goes_on_between_the_frames,
        a_closed_switch_is_found,
        what_piled_up_before_is_left_out,
        a_port_that_is_not_there_is_said,
    )
    with ThreadPoolExecutor(len(tests)) as pool:  # each has a board of its own, that goes slowly
        for done in [pool.submit(test, program, elf) for test in tests]:
            done.result()
    print("PASS")
    return 0


if __name__ == "__main__":
    sys.exit(main())
