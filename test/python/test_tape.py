"""A tape: recorded by `ninespring record --tape`, again by `ninespring-sim rerun`, to the same belief."""

from __future__ import annotations

import subprocess
import threading
from pathlib import Path

import pytest
from command import ninespring as run
from fake_board import FakeBoard, row
from ninespring.io.simulated import simulator
from test_dashboard import needs_board


def rerun(tape: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(simulator()), "rerun", str(tape), *words], capture_output=True, text=True, timeout=120, check=False
    )


@needs_board
def test_a_day_that_was_recorded_is_believed_again_to_the_last_bit_and_says_why(tmp_path: Path) -> None:
    """From power-on, with the README's words and one that the board refuses nothing of."""
    tape, script = tmp_path / "day.tape", tmp_path / "day.txt"
    script.write_text("pattern 111101111\nat 4 = fan 20\nat 6 = model\nat 8 = off 2\n")
    recorded = run("record", "--port", "simulated", "--tape", "--duration", "12", "--run", script, "-o", tape)
    assert recorded.returncode == 0, recorded.stderr
    again = rerun(tape, "--ask", "model", "--ask", "why 3", "--at", "9")
    assert again.returncode == 0, again.stderr
    assert "4 lines typed" in again.stdout and again.stdout.endswith("the same to the last bit\n"), again.stdout
    assert "spring 9: " in again.stdout and "waits " in again.stdout
    assert "[nothing was seen of spring 3 in the last 4 hours]" in again.stdout

    text = tape.read_text()
    ticks = [line for line in text.splitlines() if line.startswith("~S")]
    tape.write_text(text.replace(ticks[100] + "\n", ""))
    less = rerun(tape)
    assert less.returncode == 1
    assert "1 ticks are missing, the first at 2.00 s" in less.stdout and "whole until 2.00 s" in less.stderr
    tape.write_text(text.replace("<typed|pattern 111101111>", "<typed|pattern 111101110>"))
    other = rerun(tape)
    assert other.returncode == 1 and "the belief is not the board's" in other.stderr


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("~S0001\n", "day.tape:1:1: '~S0001' comes before <start|...>: the tape has no beginning"),
        ("# $no_such_setting=1\n", "day.tape:1:1: '# $no_such_setting=1' is a setting that this version does not have"),
        ("# nothing\n", "no readings; a tape is what `ninespring record --tape` writes"),
    ],
)
def test_what_is_no_tape_is_refused_with_its_line(tmp_path: Path, text: str, says: str) -> None:
    tape = tmp_path / "day.tape"
    tape.write_text(text)
    got = rerun(tape)
    assert got.returncode == 2 and says in got.stderr, got.stderr


def test_a_board_with_a_spring_on_gives_no_tape_and_says_why(tmp_path: Path) -> None:
    board = FakeBoard({"telemetry inputs": ["error:16 switch all springs off first"]})
    got = run("record", "--port", board.port, "--tape", "-o", tmp_path / "day.tape")
    assert got.returncode == 1
    assert "a tape begins with all springs off and no fault" in got.stdout + got.stderr
    assert board.sent()[-2:] != [] and "off all" in board.sent()


def test_ticks_that_are_lost_on_the_way_are_said(tmp_path: Path) -> None:
    board = FakeBoard({"telemetry inputs": ["<start|ambient_c7:2560|fan:0|warm:0>", "ok"]})
    tape = tmp_path / "day.tape"
    numbers = [0xFFFE, 0xFFFF, 0, 1, 5, 6, 9, *range(10, 200)]
    lines = [f"~S{number:04X}0A00" for number in numbers]
    lines.insert(8, "~Sz0A00")  # what is left of a tick is none
    threading.Timer(1.5, lambda: board.say(*lines)).start()
    got = run("record", "--port", board.port, "--tape", "--duration", "1", "-o", tape)
    assert got.returncode == 1
    assert "5 ticks were lost on the way here, the first after 0.1 s" in got.stdout + got.stderr
    assert "\n# ended: 5 ticks were lost" in tape.read_text()


def test_what_is_no_tape_does_not_go_on_for_ever(tmp_path: Path) -> None:
    board = FakeBoard({"telemetry inputs": ["<start|ambient_c7:2560|fan:0|warm:0>", "ok"]})
    threading.Timer(1.5, lambda: board.say("~S00010A00", *[row(1.0)] * 260)).start()
    got = run("record", "--port", board.port, "--tape", "--duration", "1", "-o", tmp_path / "day.tape")
    assert got.returncode == 1
    assert "251 lines in a row that are no ticks of the tape" in got.stderr
    assert "off all" in board.sent()
