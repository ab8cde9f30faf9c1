"""`ninespring console`: what it completes, what it sends, what it prints; at a terminal and from a pipe."""

from __future__ import annotations

import os
import pty
import re
import select
import subprocess
import time
from pathlib import Path

import pytest
from command import alone, process
from fake_board import FakeBoard, row
from made import needs_board
from ninespring.cli.terminal import Known, words_of
from prompt_toolkit.completion import CompleteEvent
from prompt_toolkit.document import Document

HELP = [
    "help  this list",
    "on K|all [0..100]  drive a spring or all, at a level in percent",
    "off K|all",
    "policy open|precompensate",
    "model [cold]  what is believed of each spring",
    "telemetry off|csv|teleplot [1..50]  lines per second",
    "$$  all settings   $NAME  one   $NAME=VALUE  set it",
    "!  all springs off at once, at any moment; !! their supply, too",
]
SETTINGS = {"rows": "1", "columns": "2", "loss_w_per_k": "0.005800", "loss_scale_1": "1.000"}


def completed(text: str) -> dict[str, str]:
    """Return what a line may become, and what is said beside it."""
    known = Known(words_of(HELP), SETTINGS)
    found = known.get_completions(Document(text), CompleteEvent())
    return {text[: len(text) + one.start_position] + one.text: one.display_meta_text for one in found}


@pytest.mark.parametrize(
    ("text", "becomes"),
    [
        ("o", ["on", "off"]),
        ("on ", ["on all", "on 1", "on 2"]),
        ("on 1 ", []),
        ("policy p", ["policy precompensate"]),
        ("model ", ["model cold"]),
        ("telemetry c", ["telemetry csv"]),
        ("nothing ", []),
        ("$sa", ["$save"]),
        ("$scale", ["$loss_scale_1"]),
        ("$loss_w", ["$loss_w_per_k"]),
        ("$loss_w_per_k=", []),
    ],
)
def test_words_and_settings_are_completed(text: str, becomes: list[str]) -> None:
    assert list(completed(text)) == becomes


def test_help_stands_beside_what_is_typed() -> None:
    assert completed("$loss_w")["$loss_w_per_k"].startswith(
        "0.000001 .. 0.065535 W/K, built in 0.005800: one spring to the air"
    )
    known = Known(words_of(HELP), SETTINGS)
    assert known.beside("on 1") == "on K|all [0..100]  drive a spring or all, at a level in percent"
    assert known.beside("$loss_scale_1=").startswith("$loss_scale_1=1.000  0.001 .. 8.000")
    assert "! everything off" in known.beside("")


def at_a_terminal(port: str, typed: list[str], until: str, seconds: float = 40.0) -> tuple[int, str]:
    """Type at `ninespring console` in a terminal of its own, each text when the last was answered; return how it ended."""
    master, slave = pty.openpty()
    environment = os.environ | {"TERM": "xterm", "COLUMNS": "120", "LINES": "40"}
    command = process("console", "--port", port)
    with subprocess.Popen(command, stdin=slave, stdout=slave, stderr=slave, env=environment) as running:
        os.close(slave)
        seen, ends = "", time.monotonic() + seconds

        def read() -> None:
            nonlocal seen
            while select.select([master], [], [], 0.3)[0]:
                try:
                    came = os.read(master, 4096).decode("utf-8", "replace")
                except OSError:
                    return
                seen += came
                for _ in range(came.count("\x1b[6n")):  # where the cursor is, a terminal tells
                    os.write(master, b"\x1b[1;1R")

        while "Tab completes" not in seen and time.monotonic() < ends:
            read()
        for text in typed:
            os.write(master, text.encode())
            read()
        while not re.search(until, seen) and time.monotonic() < ends:
            read()
        os.write(master, b"\x04")
        while running.poll() is None and time.monotonic() < ends:
            read()
        read()
        if running.poll() is None:
            running.kill()
    os.close(master)
    return running.returncode, seen


def test_what_is_typed_is_completed_sent_and_answered_and_a_stop_acts_as_it_is_pressed() -> None:
    fake = FakeBoard(
        {"help": [*HELP, "ok"], "faults": ["spring 2: fault 2 open", "ok"], "model": ["spring 1: cold", "ok"]}
    )
    fake.settings = dict(SETTINGS)
    fake.stream = [row(1.0), row(2.0)]
    code, seen = at_a_terminal(
        fake.port, ["mod", "\t", "\r", "on 9!", "\x03", "telemetry csv 1\r", "$loss_w_per_k=0.006\r"], r"2\.0,1\.000"
    )
    assert code == 0, seen
    assert "spring 1: cold" in seen
    assert "2.0,1.000" in seen  # telemetry comes while nothing is asked
    sent = fake.sent()
    assert sent.index("model") < sent.index("!") < sent.index("telemetry csv 1") < sent.index("$loss_w_per_k=0.006")
    assert not any(line.startswith("on 9") for line in sent)
    assert not any(line.startswith(("off", "$host_timeout_s")) for line in sent)  # leaving switches nothing off
    history = Path(os.environ["NINESPRING_HOME"]) / "console-history"
    assert "+telemetry csv 1" in history.read_text()


def test_settings_are_read_anew_by_nobody_else_and_what_is_refused_is_none() -> None:
    fake = FakeBoard({"help": [*HELP, "ok"], "$loss_w_per_k=9": ["error:5 a number is out of range"]})
    fake.settings = SETTINGS | {f"scale_{k}": "1.000" for k in range(100)}
    typed = ["$defaults\r"] * 3 + ["$loss_w_per_k=9\r", "$loss_w_per_k", "\r", "faults\r"]
    code, seen = at_a_terminal(fake.port, typed, r"0\.005800(?s:.)*ok(?s:.)*ok")
    assert code == 0, seen
    assert "$scale_" not in seen  # the answer to `$$` is the completion's
    assert "$loss_w_per_k=0.005800" in seen and "error 5" in seen and "$loss_w_per_k=9  " not in seen
    assert fake.sent().count("$$") == 4 and fake.sent().count("faults") == 1


def test_lines_from_a_pipe_are_answered_one_after_the_other() -> None:
    fake = FakeBoard({"faults": ["spring 2: fault 2 open", "ok"], "on 99": ["error:5 out of range", "ok"][:1]})
    done = alone("console", "--port", fake.port, input="faults\n\n?\n")
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == ["spring 2: fault 2 open", "ok", *done.stdout.splitlines()[2:3]]
    assert done.stdout.splitlines()[2].startswith("<off|")
    done = alone("console", "--port", fake.port, input="on 99\nfaults\n")
    assert done.returncode == 1
    assert "refused: error 5" in done.stdout
    assert "1 of these lines was refused" in done.stderr


def test_what_the_board_says_before_it_refuses_is_shown() -> None:
    found = ["spring 1: sensor ok, 0.178 ohm", "spring 2: sensor absent, fault 5 sensor_absent"]
    fake = FakeBoard({"selftest": [*found, "error:17 selftest found the faults above"]})
    done = alone("console", "--port", fake.port, input="selftest\n")
    assert done.returncode == 1
    assert done.stdout.splitlines() == [*found, "'selftest' refused: error 17 selftest found the faults above"]


@needs_board
def test_the_words_of_the_board_itself_are_known() -> None:
    done = alone("console", "--simulate", input="help\n")
    assert done.returncode == 0, done.stderr
    words = words_of(done.stdout.splitlines())
    assert {"on", "off", "pattern", "model", "supply", "telemetry"} <= set(words)
    assert words["telemetry"].choices(0, 9) == ["off", "csv", "teleplot", "inputs"]
    assert words["on"].choices(0, 2) == ["all", "1", "2"]
    assert all(one.usage.split()[0] == name for name, one in words.items())
