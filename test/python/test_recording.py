"""Recording: nothing that came is lost and nothing stays on, whatever ends it; what is on a port is recognised."""

from __future__ import annotations

import errno
import io
import json
import os
import pty
import re
import shlex
import signal
import subprocess
import threading
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import serial
from click.testing import CliRunner
from command import alone, ninespring, process
from fake_board import TELEMETRY, FakeBoard, row
from hypothesis import example, given
from hypothesis import strategies as st
from ninespring.cli import main as cli
from ninespring.errors import WorkError
from ninespring.io import board as found_by
from ninespring.io import recording, thermometers
from ninespring.io.board import Board
from ninespring.io.logs import read_log, read_table
from ninespring.io.port import Port
from ninespring.io.recording import RowCheck
from ninespring.io.thermometers import Lines
from ninespring.io.words import FAULTS
from ninespring.say.monitoring import Screen
from rich.console import Console

STREAM = [row(0.5 * k) for k in range(1, 40)]


def record(board: FakeBoard, folder: Path, *more: object) -> subprocess.CompletedProcess[str]:
    return ninespring("record", "--port", board.port, "--hz", 2, "-o", folder / "log.csv", *more)


def recorded(board: FakeBoard, folder: Path, *more: object) -> Path:
    """Return the log of a recording that ended well."""
    done = record(board, folder, *more)
    assert done.returncode == 0, done.stderr
    return folder / "log.csv"


def times(log: Path) -> list[float]:
    return read_table(log).frame["time_s"].tolist()


def assert_off(board: FakeBoard) -> None:
    assert "off all" in board.sent()
    assert not any(line.startswith(("on ", "pattern ")) for line in board.sent()[board.sent().index("off all") :])


def test_the_log_says_what_board_it_was_and_how_it_was_set(tmp_path: Path) -> None:
    board = FakeBoard({"faults": ["board: fault 13 emergency_stop", "ok"]}, STREAM)
    board.settings = {"loss_w_per_k": "0.005800", "rows": "1"}
    log = recorded(board, tmp_path, "--duration", 3)
    text = log.read_text()
    head = text[: text.index(TELEMETRY)].splitlines()
    assert "# version: ninespring 9.9.9 mega2560, sensors fake" in head
    assert "# fault: board: fault 13 emergency_stop" in head
    assert "# $loss_w_per_k=0.005800" in head and "# $rows=1" in head
    assert text.endswith("# latched at the end: board: fault 13 emergency_stop\n")
    assert times(log) == [0.5 * k for k in range(1, 8)]
    assert read_log(log, 1, temperatures=False).current_a is not None
    assert_off(board)


@pytest.mark.parametrize("told", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_keeps_what_came_and_switches_off(tmp_path: Path, told: signal.Signals) -> None:
    board = FakeBoard(stream=STREAM, every_s=0.1)
    (tmp_path / "steps.txt").write_text("on 1\n")
    words = ("record", "--port", board.port, "--hz", 2, "--run", tmp_path / "steps.txt", "-o", tmp_path / "log.csv")
    with subprocess.Popen(process(*words), stderr=subprocess.PIPE, text=True) as running:
        part = tmp_path / "log.csv.part"
        while running.poll() is None and not (part.exists() and "\n2.0," in part.read_text()):
            time.sleep(0.02)
        while running.poll() is None:  # an impatient user's do not cut it short, however late they come
            running.send_signal(told)
            time.sleep(0.005)
        assert running.returncode == 0, running.stderr
    assert times(tmp_path / "log.csv")[:4] == [0.5, 1.0, 1.5, 2.0]
    assert not part.exists()
    assert_off(board)


def test_a_recording_that_is_killed_leaves_its_rows_readable_and_the_next_one_keeps_them(tmp_path: Path) -> None:
    board = FakeBoard(stream=STREAM, every_s=0.1)
    part = tmp_path / "log.csv.part"
    words = ("record", "--port", board.port, "--hz", 2, "-o", tmp_path / "log.csv")
    with subprocess.Popen(process(*words)) as running:
        while running.poll() is None and not (part.exists() and "\n2.0," in part.read_text()):
            time.sleep(0.02)
        running.kill()
    assert times(part)[:4] == [0.5, 1.0, 1.5, 2.0]
    kept = part.read_bytes()
    board = FakeBoard(stream=STREAM)
    assert record(board, tmp_path, "--duration", 2).returncode == 0
    assert part.read_bytes() == kept
    assert times(tmp_path / "log.csv") == [0.5, 1.0, 1.5, 2.0, 2.5]


def test_a_pulled_cable_keeps_what_came(tmp_path: Path) -> None:
    board = FakeBoard(stream=[*STREAM[:6], "PULL"], every_s=0.02)
    done = record(board, tmp_path, "--json", tmp_path / "r.json")
    assert done.returncode == 1
    assert "went away" in done.stderr and "cut their supply" in done.stderr
    assert times(tmp_path / "log.csv")[-1] >= 2.5
    assert "went away" in json.loads((tmp_path / "r.json").read_text())["ended"]


def test_a_full_disk_keeps_what_fitted_and_switches_off(small_disk: Path, tmp_path: Path) -> None:
    board = FakeBoard(stream=[row(0.5 * k) for k in range(1, 2000)])
    (tmp_path / "steps.txt").write_text("on 1\n")
    done = record(board, small_disk, "--duration", 5000, "--run", tmp_path / "steps.txt")
    assert done.returncode == 1
    assert "No space left on device" in done.stderr
    assert [one.name for one in small_disk.iterdir()] == ["log.csv"]
    assert (small_disk / "log.csv").read_text().endswith("\n")
    assert len(times(small_disk / "log.csv")) > 100
    assert_off(board)


def test_a_full_device_is_said_and_switches_off(tmp_path: Path) -> None:
    board = FakeBoard(stream=STREAM)
    (tmp_path / "steps.txt").write_text("on 1\n")
    done = ninespring("record", "--port", board.port, "-o", "/dev/full", "--run", tmp_path / "steps.txt")
    assert done.returncode == 1
    assert "No space left on device" in done.stderr
    assert Path("/dev/full").is_char_device()
    assert "on 1" not in board.sent() or board.sent().index("off all") > board.sent().index("on 1")


@pytest.mark.parametrize(
    ("stream", "said", "kept"),
    [
        ([row(7.0), row(7.5), row(8.0), row(0.5), row(1.0), row(1.5)], "started again", [7.0, 7.5, 8.0]),
        (STREAM[:3], "no telemetry for 1 s", [0.5, 1.0, 1.5]),
        (STREAM[:3] + [">i1:500:1.0"] * 30, "21 lines in a row that are no rows", [0.5, 1.0, 1.5]),
    ],
)
def test_a_board_that_starts_again_or_falls_silent_ends_the_recording(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, stream: list[str], said: str, kept: list[float]
) -> None:
    monkeypatch.setattr(recording, "SILENT_S", recording.SILENT_S / 5)
    board = FakeBoard(stream=stream)
    done = record(board, tmp_path)
    assert done.returncode == 1
    assert said in done.stderr
    assert times(tmp_path / "log.csv") == kept
    assert_off(board)


CORRUPT = [
    "2.0,1.0x0,0.200,20.00,0.00,20.00,ok",  # a wrong character
    "2.0,1.00,0.200,20.00,0.00,20.00,ok",  # a lost digit
    "2.0,1.000,0.200,20.00,0.00,20.00",  # a lost cell
    "2.0,1.000,0.20",  # cut off
    "2.0,1.000,0.2,00,20.00,0.00,20.00,ok",  # a comma for a point
    "82.0,1.000,0.200,20.00,0.00,20.00,ok",  # a time that would make all that follow old
    "0.1,1.000,0.200,20.00,0.00,20.00,ok",  # a time that looks like a reset
    "2.0,71.000,0.200,20.00,0.00,20.00,ok",  # a current that would have the log refused
    "2.0,1.000,0.200,nan,0.00,20.00,ok",
    "2.0,1.000,0.200,20.00,0.00,20.00,fault_",
    "2.0,1.000,0.200,20.00,0.00,\x80\x00.00,ok",
    "<limits|spr",
]


@pytest.mark.parametrize("bad", CORRUPT)
def test_a_corrupt_line_is_dropped_and_counted_and_the_log_is_readable(tmp_path: Path, bad: str) -> None:
    board = FakeBoard(stream=[*STREAM[:3], bad, *STREAM[4:8]])
    log = recorded(board, tmp_path, "--duration", 3)
    assert "# dropped_lines: 1" in log.read_text()
    assert times(log) == [0.5, 1.0, 1.5, 2.5, 3.0, 3.5]
    read_log(log, 1, temperatures=False)


@example(7, 0, "5")  # it follows, so that what is true afterwards does not
@given(st.integers(0, 19), st.integers(0, 40), st.characters(min_codepoint=32, max_codepoint=126))
def test_one_wrong_character_costs_at_most_two_rows(number: int, at: int, wrong: str) -> None:
    rows = [row(0.5 * k) for k in range(1, 21)]
    at %= len(rows[number])
    lines = list(rows)
    lines[number] = lines[number][:at] + wrong + lines[number][at + 1 :]
    check = RowCheck(TELEMETRY.split(","), 2)
    good = [one for line in lines for one in check.feed(line)]
    assert not check.restarted
    stamps = [one.time_s for one in good]
    assert stamps == sorted(set(stamps))
    # the last row, if held, waits for one that follows it
    assert len(good) >= 20 - 2 - (number >= 18)


def test_values_that_really_changed_are_kept() -> None:
    check = RowCheck(TELEMETRY.split(","), 2)
    lines = [row(0.5), row(1.0), row(1.5, -3.0), row(2.0, -3.0), row(60.0, -3.0), row(60.5, -3.0)]
    assert [one.time_s for line in lines for one in check.feed(line)] == [0.5, 1.0, 1.5, 2.0, 60.0, 60.5]


def test_a_header_that_came_corrupt_is_asked_for_again(tmp_path: Path) -> None:
    board = FakeBoard(stream=iter(STREAM), every_s=0.05)
    real, said = board.say, []

    def corrupt_once(*lines: str) -> None:
        first = bool(lines) and lines[0] == TELEMETRY and not said
        said.extend(lines[:1] if first else ())
        real(*((TELEMETRY.replace("i1_a", "i\x011_a"), "ok") if first else lines))

    board.say = corrupt_once
    assert record(board, tmp_path, "--duration", 2).returncode == 0
    assert board.sent().count("telemetry csv 20") == 2
    assert len(times(tmp_path / "log.csv")) >= 3


def test_steps_are_sent_in_their_time_and_status_is_kept_between_the_rows(tmp_path: Path) -> None:
    status = "<limits|spring:1|t:8.000|supply|cut_a:2.610>"
    board = FakeBoard(stream=[*STREAM[:3], status, *STREAM[3:8]])
    (tmp_path / "steps.txt").write_text("ambient 21.5\nat 0.5 = on 1   ; the first\nat 1.5 = fan 100\n")
    log = recorded(board, tmp_path, "--duration", 3, "--run", tmp_path / "steps.txt")
    lines = log.read_text().splitlines()
    at = lines.index(f"# {status}")
    assert lines[at - 1 : at + 2] == [row(1.5), f"# {status}", row(2.0)]
    sent = board.sent()
    order = [sent.index(word) for word in ("ambient 21.5", "$$", "telemetry csv 20", "on 1", "fan 100", "off all")]
    assert order == sorted(order)


def test_a_step_that_the_board_refuses_ends_the_recording(tmp_path: Path) -> None:
    board = FakeBoard({"on 9": ["error:11 a fault is latched"]}, stream=STREAM)
    (tmp_path / "steps.txt").write_bytes(b"\xef\xbb\xbf# a text as editors write it\r\nat 1 = on 9\r\n")
    done = record(board, tmp_path, "--run", tmp_path / "steps.txt")
    assert done.returncode == 1
    assert "steps.txt:2:1: 'on 9' refused: error 11" in done.stderr
    assert times(tmp_path / "log.csv")[0] == 0.5


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("at 5 pattern 1\n", ":1:1: "),
        ("on 1\nat 5 = on 2\non 3\n", ":3:1: "),
        ("at 5 = on 1\nat 4 = on 2\n", ":2:1: "),
        ("fan ä\n", ":1:1: "),
        ("on 1\nat 5 = on\t2\n", ":2:1: 'on\\t2' is not one line of plain ASCII"),
        ("at 5 = !\n", ":1:1: '!': ! and ? act at once"),
        ("at 5 = on 1\nat 900 = off all\n", ":2:1: "),
        ("# later\n", ": no step in it\n"),
    ],
)
def test_a_wrong_script_is_refused_with_its_line(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "steps.txt").write_text(text)
    done = ninespring("record", "--port", "x", "--run", tmp_path / "steps.txt", "-o", tmp_path / "x.csv")
    assert done.returncode == 2
    assert done.stderr.startswith(f"ninespring: {tmp_path / 'steps.txt'}{said}")


def test_the_example_in_its_help_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = CliRunner().invoke(cli.cli, ["record", "--help"]).output
    words = shlex.split(re.search(r"^ +(ninespring record .*)$", text, re.MULTILINE)[1])
    steps = text.partition("steps.txt (")[2].partition("\n")[2]
    (tmp_path / "steps.txt").write_text(steps)
    board = FakeBoard(stream=(f"{k}.0,1.000,0.200,20.00,0.00,20.00,ok" for k in range(1, 2000)))
    words[words.index("--port") + 1] = board.port
    monkeypatch.chdir(tmp_path)
    done = ninespring(*words[1:])
    assert done.returncode == 0, done.stderr
    assert {"ambient 21.5", "pattern 101000101", "fan 100", "off all"} <= set(board.sent())
    assert times(tmp_path / "board1.csv")[-1] == 901.0


def test_the_log_can_go_to_standard_output(tmp_path: Path) -> None:
    board = FakeBoard(stream=STREAM)
    done = alone("record", "--port", board.port, "--hz", 2, "--duration", 2, "-o", "-")
    assert done.returncode == 0, done.stderr
    (tmp_path / "log.csv").write_text(done.stdout)
    assert times(tmp_path / "log.csv") == [0.5, 1.0, 1.5, 2.0, 2.5]
    assert "5 rows" in done.stderr


def test_a_reader_that_goes_away_ends_the_recording(tmp_path: Path) -> None:
    board = FakeBoard(stream=[row(0.5 * k) for k in range(1, 2000)], every_s=0.002)
    words = shlex.join(process("record", "--port", board.port, "--hz", 2, "--duration", 5000, "-o", "-"))
    done = subprocess.run(f"{words} | head -3", shell=True, capture_output=True, text=True, timeout=60, check=False)
    assert len(done.stdout.splitlines()) == 3
    assert_off(board)


def test_a_link_stays_a_link(tmp_path: Path) -> None:
    board = FakeBoard(stream=STREAM)
    (tmp_path / "real.csv").touch()
    (tmp_path / "log.csv").symlink_to("real.csv")
    assert record(board, tmp_path, "--duration", 2).returncode == 0
    assert (tmp_path / "log.csv").is_symlink()
    assert times(tmp_path / "real.csv")[0] == 0.5


def faulty(time_s: float) -> str:
    return row(time_s, 0.0).replace(",ok", ",fault_2")


def test_a_fault_is_said_as_it_comes_in_the_log_and_at_the_end(tmp_path: Path) -> None:
    comes = ["FAULT spring 1: fault 2 open_spring", *(faulty(0.5 * k) for k in range(7, 12))]
    comes += ["<limits|spring:1|t:6.0|safety|cut_a:0.000>", faulty(6.0)]
    board = FakeBoard(stream=[*STREAM[:6], *comes], every_s=0.01)
    done = record(board, tmp_path, "--duration", 5, "--json", tmp_path / "r.json")
    assert done.returncode == 1
    words = f"at 3.5 s: spring 1: fault 2 open_spring ({FAULTS[2]})"
    assert done.stderr.splitlines()[0] == f"fault {words}"
    assert done.stderr.splitlines()[-1].startswith(f"ninespring: a fault cut this run short, {words}; what came is in")
    result = json.loads((tmp_path / "r.json").read_text())
    assert result["faults"] == [{"time_s": 3.5, "spring": 1, "number": 2, "name": "open_spring"}]
    assert words in result["ended"]
    lines = (tmp_path / "log.csv").read_text().splitlines()
    assert f"# fault {words}" in lines and f"# ended: {result['ended']}" in lines
    assert times(tmp_path / "log.csv")[-1] == 5.5  # it went on
    assert_off(board)


def test_what_the_board_remarks_on_a_step_is_said_and_stands_in_the_log(tmp_path: Path) -> None:
    remark = "[not active yet: over_current_a=0.200 does not fit open_current_a=1.500]"
    board = FakeBoard(
        {"$over_current_a=0.2": [remark, "ok"], "$open_current_a=9": [remark, "ok"]}, stream=STREAM, every_s=0.01
    )
    (tmp_path / "steps.txt").write_text("$open_current_a=9\nat 2 = $over_current_a=0.2\n")
    done = record(board, tmp_path, "--duration", 3, "--run", tmp_path / "steps.txt")
    assert done.returncode == 0, done.stderr
    assert [line.partition(": ")[0] for line in done.stderr.splitlines()] == [
        "'$open_current_a=9'",
        "'$over_current_a=0.2'",
    ]
    lines = (tmp_path / "log.csv").read_text().splitlines()
    assert lines.index(f"# '$open_current_a=9': {remark}") < lines.index(TELEMETRY)
    assert lines.index(f"# '$over_current_a=0.2': {remark}") > lines.index(TELEMETRY)


@pytest.mark.parametrize("commented", [True, False])
def test_whoever_uses_a_log_is_told_first_that_a_fault_cut_it_short(tmp_path: Path, commented: bool) -> None:
    log = tmp_path / "log.csv"
    rows = [
        f"{k}.0,{float(k < 20)},{0.2 * (k < 20)},{20 + min(k, 20)},0,20,{'ok' if k < 20 else 'fault_16'}"
        for k in range(60)
    ]
    comment = "# fault at 20.0 s: board: fault 16 host_silent (why)"
    rows[20:20] = [comment] * commented
    log.write_text("\n".join(["time_s,i1_a,v1_v,t1_c,fan,ambient_c,state", *rows]) + "\n")
    said = "a fault cut this run short, at 20.0 s: " + (
        "board: fault 16 host_silent (why)" if commented else "fault 16"
    )
    assert read_log(log).notes[0].startswith(said)
    array = tmp_path / "array.toml"
    array.write_text("[array]\nrows = 1\ncols = 1\n")
    plotted = ninespring("plot", log, "--array", array, "-o", tmp_path / "p.svg")
    assert plotted.stderr.startswith(f"log.csv: {said}"), plotted
    diagnosed = ninespring("diagnose", log, "--array", array, "-o", tmp_path / "d")
    assert diagnosed.stdout.startswith(f"note: log.csv: {said}"), diagnosed
    page = (tmp_path / "d" / "report.html").read_text()
    assert page.index(said) < page.index('<p class="lead">')


def test_a_host_that_was_held_up_does_not_blame_the_board(tmp_path: Path) -> None:
    master, slave = pty.openpty()
    tty.setraw(slave)
    port = Port(os.ttyname(slave))
    os.write(master, b"1.0,ok\n2.0,ok\n")
    while port._serial.in_waiting < 14:  # the kernel hands it over in its own time
        time.sleep(0.001)
    assert port.read_line(time.monotonic() - 1.0) == "1.0,ok"
    assert port.read_line(time.monotonic() - 1.0) == "2.0,ok"
    assert port.read_line(time.monotonic() - 1.0) is None
    port.close()


def test_settings_of_the_board_that_recording_needs_otherwise_are_given_back(tmp_path: Path) -> None:
    board = FakeBoard(stream=STREAM, every_s=0.3)
    own = {"host_timeout_s": "0", "telemetry_hz": "7", "telemetry_format": "0"}
    board.settings = dict(own)
    (tmp_path / "steps.txt").write_text("at 1 = $Save\nat 2 = $loss_w_per_k\n")
    assert record(board, tmp_path, "--duration", 4, "--run", tmp_path / "steps.txt").returncode == 0
    assert board.saved == own  # what is kept is what was set, not what recording needs
    sent = board.sent()
    begins, ends = sent.index("$host_timeout_s=5"), sent.index("$host_timeout_s=0")
    assert begins < sent.index("telemetry csv 20") < ends < sent.index("$Save") < sent.index("off all")
    assert "$host_timeout_s=5" in sent[sent.index("$Save") : sent.index("$loss_w_per_k")]
    assert {"# $host_timeout_s=0", "# $telemetry_hz=7"} <= set((tmp_path / "log.csv").read_text().splitlines())
    assert board.settings == own
    # something goes to the board all the while, so that it knows that this end lives
    assert "" in board.seen[board.seen.index("telemetry csv 20") : board.seen.index("off all")]


def test_a_board_whose_clock_runs_faster_hears_that_this_end_lives(tmp_path: Path) -> None:
    """A simulated board at --speed max: its host_timeout_s is by its own clock."""
    board = FakeBoard(stream=[row(0.5 * k) for k in range(1, 200)], every_s=0.02)
    assert record(board, tmp_path, "--duration", 60).returncode == 0
    alive = board.seen[board.seen.index("telemetry csv 20") : board.seen.index("off all")].count("")
    assert alive >= 55, alive  # 60 s of its time, little more than 2 s here


# what is on the port


def other_thing(said: bytes) -> str:
    """Return the port of something else, which says the same again and again."""
    master, slave = pty.openpty()
    tty.setraw(slave)

    def speak() -> None:
        while said:
            os.write(master, said)
            time.sleep(0.2)

    threading.Thread(target=speak, daemon=True).start()
    return os.ttyname(slave)


@pytest.mark.parametrize(
    ("said", "message"),
    [
        (b"", "silent at 115200 baud"),
        (b"\r\nGrbl 1.1h ['$' for help]\r\nerror:1\r\nerror:1\r\n", "it says 'Grbl 1.1h"),
        (bytes(range(128, 256)) * 100, "no board"),
    ],
)
def test_a_silent_or_foreign_port_is_recognised_within_five_seconds(
    monkeypatch: pytest.MonkeyPatch, said: bytes, message: str
) -> None:
    assert found_by.FOUND_WITHIN_S <= 5.0
    monkeypatch.setattr(found_by, "FOUND_WITHIN_S", 1.5)  # two questions, and what is left
    port = other_thing(said)
    asked: list[tuple[float, float]] = []
    """When a line was waited for, and until when: by this, whatever the machine makes of it."""
    read_line = Port.read_line

    def watched(self: Port, until_s: float, stopped: Callable[[], bool] = lambda: False) -> str | None:
        asked.append((time.monotonic(), until_s))
        return read_line(self, until_s, stopped)

    monkeypatch.setattr(Port, "read_line", watched)
    with pytest.raises(WorkError, match=re.escape(message)):
        Board(port)
    assert max(until_s for _, until_s in asked) - asked[0][0] < 1.5


def test_a_second_program_on_the_port_is_named(tmp_path: Path) -> None:
    board = FakeBoard(stream=(row(0.1 * k) for k in range(10, 99999)), every_s=0.1)
    with subprocess.Popen(process("record", "--port", board.port, "-o", tmp_path / "log.csv")) as running:
        while "telemetry csv 10" not in board.seen:
            time.sleep(0.02)
        done = ninespring("monitor", "--port", board.port)  # this process is the board
        running.terminate()
    assert done.returncode == 1
    assert re.search(rf"another program has the port \(.*, pid {running.pid}\): end it first", done.stderr), done.stderr


def test_a_port_that_is_not_there_or_is_none_is_said(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for port in ("/dev/no-such-port", tmp_path / "file", tmp_path):
        done = ninespring("record", "--port", port, "-o", tmp_path / "x.csv")
        assert done.returncode == 1
        assert "cannot be opened" in done.stderr
        assert len(done.stderr.strip().splitlines()) == 1
    assert [one.name for one in tmp_path.iterdir()] == ["file"]


def test_a_port_that_is_not_this_users_says_how_to_be_allowed(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*arguments: object, **more: object) -> None:
        raise serial.SerialException(errno.EACCES, "could not open port")

    monkeypatch.setattr(serial, "Serial", refused)
    monkeypatch.setattr(Path, "group", lambda path: "dialout")
    with pytest.raises(WorkError, match="usermod --append --groups dialout"):
        Port("/dev/ttyACM0")


def test_telemetry_left_on_by_someone_else_does_not_confuse(tmp_path: Path) -> None:
    board = FakeBoard(stream=[row(0.01 * k) for k in range(9999)], every_s=0.01)
    with serial.Serial(board.port) as someone:
        someone.write(b"telemetry csv 50\n")
        time.sleep(0.3)
    with Board(board.port) as found:
        assert found.version[0].startswith("ninespring 9.9.9")
        board.settings = {"rows": "1"}
        assert found.settings() == {"rows": "1"}


# thermometers


@pytest.mark.parametrize(
    ("lines", "springs", "readings"),
    [
        (["time_s,t1_c,t3_c", "1.0,20.5,21"], [1, 3], [(1.0, {1: 20.5, 3: 21.0})]),
        (["21.0;22.0;23.0"] * 5, [1, 2, 3], [(None, {1: 21.0, 2: 22.0, 3: 23.0})]),
        ([f"{k}.00,21.{k},22.0" for k in range(5)], [1, 2], [(4.0, {1: 21.4, 2: 22.0})]),
        (["Time\tTemp1\tTC2\tbattery", "5\t20\t----\t3.3"], [1, 2], [(5.0, {1: 20.0})]),
        (["# logger 3", "t1_c t2_c", "20 900", "20 21 22", "x"], [1, 2], [(None, {1: 20.0})]),
    ],
)
def test_usual_loggers_lines_are_read(lines: list[str], springs: list[int], readings: list[object]) -> None:
    reader = Lines()
    got = [one for line in lines if (one := reader.read(line)) is not None]
    if readings:
        assert got == readings
        assert sorted(one for one in reader.springs if one) == springs


def test_thermometers_are_merged_onto_the_boards_clock_and_the_offset_is_said(tmp_path: Path) -> None:
    board, logger = FakeBoard(), FakeBoard()
    begun = time.monotonic()
    board_s, logger_s = 100.0, 7.0  # both clocks at the beginning

    def rows() -> Iterator[str]:
        while True:
            yield row(board_s + time.monotonic() - begun)

    def read() -> None:
        while not logger.gone:
            now = time.monotonic() - begun
            if int(now / 0.15) % 10 == 9:
                logger.say("time_s,t1_c,t9_c")
            logger.say(f"{logger_s + now:.3f},{20.0 + now:.3f},30.0")  # rises by 1 K/s
            time.sleep(0.15)

    board.stream, board.every_s = rows(), 0.5
    threading.Thread(target=read, daemon=True).start()
    done = record(board, tmp_path, "--duration", 5, "--thermometers", logger.port)
    logger.gone = True
    assert done.returncode == 0, done.stderr
    frame = read_table(tmp_path / "log.csv").frame
    assert "t9_c" not in frame
    left = (frame["t1_c"] - 20.0) - (frame["time_s"] - board_s)
    assert frame["t1_c"].notna().sum() >= len(frame) - 2
    assert left.abs().max() < 0.35
    offset = float(re.search(r"thermometers_offset_s: (.*)", (tmp_path / "log.csv").read_text())[1])
    assert offset == pytest.approx(board_s - logger_s, abs=0.3)


def test_a_port_without_thermometers_is_said_before_anything_is_driven(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(thermometers, "FOUND_WITHIN_S", 1.0)
    board = FakeBoard()
    done = record(board, tmp_path, "--thermometers", other_thing(b""))
    assert done.returncode == 1
    assert "no temperatures come" in done.stderr
    assert "telemetry csv 20" not in board.sent()


def test_monitor_shows_the_array_as_a_grid_with_totals_limits_and_trend() -> None:
    names = ["time_s", "i1_a", "v1_v", "m1_c", "d1", "i2_a", "v2_v", "m2_c", "d2", "fan", "ambient_c", "state"]
    screen = Screen({"rows": "1", "columns": "2", "supply_limit_a": "15.000"}, names)
    assert screen.take("1.000,1.500,0.300,20.00,0.100,0.000,0.000,20.00,0.000,0.50,21.00,ok")
    assert not screen.take("2.000,1.5x0,0.300")
    assert screen.take("<limits|spring:1|t:1.500|supply|cut_a:0.500>")
    assert screen.take("3.000,1.500,0.300,22.00,0.100,0.000,0.000,20.00,0.000,0.50,21.00,fault_13")
    console = Console(width=100, file=io.StringIO(), record=True)
    console.print(screen.picture())
    text = console.export_text()
    assert "3.0 s   1.50 A of 15 A   fan 50 %   ambient 21.0 degC   stopped" in text
    assert re.search(r"1  22\.0 ↗ *│ 2  20\.0 →", text)
    assert "1.50 A  0.45 W" in text and "supply -0.50 A" in text


def test_a_rows_inputs_are_their_means_until_the_next_row(tmp_path: Path) -> None:
    """A spring or the fan that is switched on between two rows is on for that part of the interval, not from a row on."""
    board = FakeBoard()
    board.stream = [
        f"{0.05 * k:.2f},{0.0 if k < 35 else 2.0:.3f},{0.0 if k < 35 else 0.4:.3f},20.00,{float(k >= 35):.2f},20.00,ok"
        for k in range(1, 90)
    ]
    log = recorded(board, tmp_path, "--duration", 3)
    assert "telemetry csv 20" in board.sent()
    frame = read_table(log).frame
    assert frame["time_s"].tolist() == pytest.approx(np.arange(0.05, 3.1, 0.5))
    # first read at 1.75 s, so on since 1.70 s: in the row of 1.55 s for 0.35 of 0.5 s, as mean current and as mean power
    assert frame["i1_a"].tolist() == pytest.approx([0, 0, 0, 1.4, 2, 2, 2], abs=1e-3)
    assert (frame["i1_a"] * frame["v1_v"]).tolist() == pytest.approx([0, 0, 0, 0.56, 0.8, 0.8, 0.8], abs=1e-3)
    assert frame["fan"].tolist() == pytest.approx([0, 0, 0, 0.7, 1, 1, 1])
