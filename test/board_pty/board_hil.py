"""`ninespring-sim hil` against a simulated board that runs firmware_hil: usage board_hil.py NINESPRING_SIM AVR_DIR.

The board runs slower than real time here, so that a busy machine is still fast enough for the frames.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

SKIPPED = 77
SIMULATED_S = 3.0

try:
    from board_pty import Board
except ImportError:
    sys.exit(SKIPPED)


def goes_on_between_the_frames(program: str, elf: Path) -> None:
    result = Path.cwd() / "board_hil.json"
    with Board(program, elf, "--speed", "0.1") as board:
        run = subprocess.run(
            [
                program, "hil", "--port", board.port, "--duration", str(SIMULATED_S), "--json", str(result),
                "--set", "array.rows=1", "--set", "array.cols=2",
                "--send", "policy open", "--send", "on 1", "--send", "on 3", "--send", "model", "--send", "frobnicate",
            ],
            check=False, capture_output=True, text=True, timeout=120,
        )  # fmt: skip
    print(run.stdout, run.stderr)
    assert run.returncode == 0, run
    summary = json.loads(result.read_text())
    result.unlink()
    assert summary["schema"] == "ninespring.hil/1"
    assert summary["simulated_s"] >= SIMULATED_S
    assert summary["ticks"] + summary["lost_frames"] >= SIMULATED_S * 50
    assert summary["bad_frames"] == 0, summary
    assert summary["max_lag_ticks"] <= summary["allowed_lag_ticks"], summary
    # The console goes on between the frames, and the board reads what the plant does.
    assert "error:1 " in run.stdout
    assert "spring 1:" in run.stdout
    assert summary["final_current_a"][0] > 1.0, summary
    assert summary["final_current_a"][1] == 0.0, summary
    # A 1 x 2 array: nothing is connected to channel 3.
    assert summary["final_current_a"][2] == 0.0, summary


def a_closed_switch_is_found(program: str, elf: Path) -> None:
    result = Path.cwd() / "board_hil_closed.json"
    with Board(program, elf, "--speed", "0.1") as board:
        run = subprocess.run(
            [
                program, "hil", "--port", board.port, "--duration", "2.6", "--json", str(result),
                "--set", "array.rows=1", "--set", "array.cols=2", "--closed", "1", "--closed-at", "1.2",
                "--send", "policy open", "--send", "on 1", "--send", "on 2", "--send", "faults",
            ],
            check=False, capture_output=True, text=True, timeout=120,
        )  # fmt: skip
    print(run.stdout, run.stderr)
    assert "board: fault 11 stuck_on: cut the supply" in run.stdout, run
    summary = json.loads(result.read_text())
    result.unlink()
    assert summary["final_current_a"][0] > 10.0, summary
    assert summary["final_current_a"][1] == 0.0, summary


def what_piled_up_before_is_left_out(program: str, elf: Path) -> None:
    result = Path.cwd() / "board_hil_piled_up.json"
    with Board(program, elf, "--speed", "0.1") as board:
        time.sleep(3)  # some fifteen ticks
        run = subprocess.run(
            [
                program, "hil", "--port", board.port, "--duration", "1", "--json", str(result),
                "--set", "array.rows=1", "--set", "array.cols=2", "--send", "clear",
            ],
            check=False, capture_output=True, text=True, timeout=120,
        )  # fmt: skip
    print(run.stdout, run.stderr)
    assert (run.returncode, "ok\n" in run.stdout) == (0, True), run
    summary = json.loads(result.read_text())
    result.unlink()
    assert summary["max_lag_ticks"] <= summary["allowed_lag_ticks"], summary


def a_port_that_is_not_there_is_said(program: str, elf: Path) -> None:
    missing = subprocess.run(
        [program, "hil", "--port", "/no/such/port"],
        check=False,
        capture_output=True,
        text=True,
        timeout=20,
    )
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
