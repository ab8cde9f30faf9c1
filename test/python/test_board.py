"""The whole chain on the simulated board, the flashed ELF in simavr: measure, fit, export, upload, and the chip knows.

Needs `ninespring-sim` and the firmware's ELF: NINESPRING_SIM and NINESPRING_AVR_DIR, or build/host and build/avr.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import command
import numpy as np
import pytest
from made import SIM, needs_board, simulated_board
from ninespring.io.board import Board
from ninespring.io.logs import read_log, read_table
from websockets.sync.client import connect

LAB = """
[scenario]
duration_s = 600
log_interval_s = 1
seed = {seed}
policy = open
[plant]
effects = latent_heat, resistance_phase, edge_loss
edge_loss_fraction = 0.25
[chip]
open_current_a = 1.6
[noise]
temperature_c = 0.3
[events]
at {begin} = pattern 100010001
at 120 = pattern 010101010
at 200 = on 5
at 240 = off 2
at 300 = pattern 001110100
at 330 = fan 100
at 420 = pattern 110000011
at 520 = off all
"""


def run(*words: object) -> str:
    done = subprocess.run(list(map(str, words)), capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def ninespring(*words: object) -> str:
    done = command.ninespring(*words)
    assert done.returncode == 0, done.stderr
    return done.stdout


def measured(folder: Path, name: str, **values: object) -> Path:
    """Return the log of a laboratory whose array loses more at its edge than the chip knows."""
    (folder / f"{name}.ini").write_text(LAB.format(**values))
    run(SIM, "run", folder / f"{name}.ini", "-o", folder / f"{name}.csv")
    return folder / f"{name}.csv"


@pytest.fixture
def board(request: pytest.FixtureRequest) -> Iterator[str]:
    """Return the port of a simulated board with its plant, ended at the end; its speed may be asked for."""
    with simulated_board("--speed", getattr(request, "param", "max")) as (port,):
        yield port


def settings_of(port: str) -> dict[str, float]:
    with Board(port) as connection:
        return {name: float(value) for name, value in connection.settings().items()}


@pytest.mark.nightly
@needs_board
def test_an_effect_found_in_a_log_is_in_the_model_of_the_chip_that_it_was_uploaded_to(
    board: str, tmp_path: Path
) -> None:
    log, held_out = measured(tmp_path, "lab", seed=1, begin=10), measured(tmp_path, "held", seed=2, begin=30)
    ninespring("fit", log, "-o", tmp_path / "before.toml")
    ninespring("diagnose", log, "-o", tmp_path / "d")
    effects = json.loads((tmp_path / "d" / "diagnosis.json").read_text())["effects"]
    assert [one["name"] for one in effects] == ["edge_loss"]
    model = tmp_path / "d" / "model.toml"

    # the fixed-point model on a log that the fit never saw: before, and with the effect
    error = {}
    for name, one in (("before", tmp_path / "before.toml"), ("after", model)):
        run(SIM, "replay", held_out, "--model", one, "-o", tmp_path / "r.csv", "--json", tmp_path / "r.json")
        error[name] = json.loads((tmp_path / "r.json").read_text())["rmse_c"]
        said = ninespring("predict", "--chip", "--model", one, held_out, "-o", tmp_path / "p.csv")
        assert f"error {error[name]:.3f} K" in said
    assert error["after"] < 0.4 < 1.5 < error["before"]

    # onto the board: what was sent is what `$$` shows, and not what it had (`verify --port`: test_walk)
    before = settings_of(board)
    ninespring("export", "--model", model, "-o", tmp_path / "s.txt", "--json", tmp_path / "s.json")
    ninespring("upload", "--port", board, tmp_path / "s.txt")
    sent = json.loads((tmp_path / "s.json").read_text())["settings"]
    after = settings_of(board)
    assert {name: after[name] for name in sent} == sent
    # edge loss is a scale of each spring's loss on the chip: corners 2 free sides, edges 1
    scale = [after[f"loss_scale_{k}"] for k in (1, 2, 5)]
    assert np.divide(scale, scale[2]) == pytest.approx([1.5, 1.25, 1.0], abs=0.02)
    assert scale != [before[f"loss_scale_{k}"] for k in (1, 2, 5)]

    # and the chip's model does what the model does: its telemetry, recorded, against a replay of what it measured
    (tmp_path / "steps.txt").write_text("policy open\nmodel cold\nat 2 = pattern 111101111\nat 45 = off all\n")
    record = ("record", "--port", board, "--hz", 2, "--duration", 60, "--run", tmp_path / "steps.txt")
    ninespring(*record, "-o", tmp_path / "board.csv")
    got = read_table(tmp_path / "board.csv").frame
    assert len(got) > 15
    assert read_log(tmp_path / "board.csv", 9, temperatures=False).current_a is not None
    run(SIM, "replay", tmp_path / "board.csv", "--model", model, "-o", tmp_path / "again.csv")
    again = read_table(tmp_path / "again.csv").frame
    wrong = tmp_path / "wrong.csv"
    run(SIM, "replay", tmp_path / "board.csv", "--model", tmp_path / "before.toml", "-o", wrong)
    other = read_table(wrong).frame
    columns = [f"m{k}_c" for k in range(1, 10)]
    told, by_model, by_other = (frame[columns].to_numpy(float) for frame in (got, again, other))
    assert (rise := told.max() - 20.0) > 3.0
    assert (apart := np.abs(told - by_model).max()) < 0.1 * rise
    assert apart < np.abs(told - by_other).max()


def known_in(connection: Board) -> list[str]:
    """Return the lines of `learnt` that tell something of a spring."""
    lines = [line for line in connection.ask("learnt") if line.startswith("spring ")]
    assert len(lines) == 9
    return [line for line in lines if not line.endswith("nothing yet")]


@needs_board
def test_an_upload_makes_the_board_forget_what_it_has_learnt(board: str, tmp_path: Path) -> None:
    def learnt() -> list[str]:
        with Board(board, off_at_end=False) as connection:
            return known_in(connection)

    assert learnt() == []
    with Board(board) as connection:
        for line in ("policy precompensate", "model cold", "on 5"):
            connection.ask(line)
        until = time.monotonic() + 120.0
        while not known_in(connection):
            assert time.monotonic() < until, "spring 5 transforms, and shows nothing"
    (known,) = learnt()
    assert known.startswith("spring 5: 0.")
    (tmp_path / "s.txt").write_text("$loss_w_per_k=0.006000\n")
    ninespring("upload", "--port", board, tmp_path / "s.txt")
    assert learnt() == []


def faults_of(port: str) -> list[str]:
    with Board(port, off_at_end=False) as connection:
        return connection.ask("faults")


@needs_board
@pytest.mark.parametrize("board", ["4"], indirect=True)
@pytest.mark.parametrize("program", ["record", "dashboard", "script"])
def test_a_program_that_is_killed_leaves_no_spring_on(board: str, tmp_path: Path, program: str) -> None:
    with Board(board) as connection:
        connection.ask("model cold")  # else it waits for as long as springs could still be warm from before
    (tmp_path / "steps.txt").write_text("at 1 = on all 50\n")
    words = {
        "record": ["record", "--run", tmp_path / "steps.txt", "-o", tmp_path / "log.csv"],
        "dashboard": ["dashboard", "--listen", "127.0.0.1:0", "--folder", tmp_path],
        "script": [],
    }[program]
    script = "from ninespring import Board; import sys, time; b = Board(sys.argv[1]); b.on(5, 50); print('on', flush=True); time.sleep(99)"
    own = [sys.executable, "-c", script, board] if program == "script" else command.process(*words, "--port", board)
    with subprocess.Popen(own, stdout=subprocess.PIPE, text=True) as process:
        if program == "dashboard":
            url = process.stdout.readline().split()[0].rstrip("/")
            with connect(f"{url.replace('http', 'ws')}/ws", additional_headers={"origin": url}) as page:
                while not (state := json.loads(page.recv(30))).get("connected"):
                    pass
                page.send('{"do": "all", "level": 50}')
                while (state := json.loads(page.recv(30))).get("sum_a", 0.0) < 5.0:
                    assert state.get("connected", True)
        elif program == "script":
            assert process.stdout is not None and process.stdout.readline() == "on\n"
        else:
            until = time.monotonic() + 60.0
            while not flows(tmp_path / "log.csv.part"):
                assert time.monotonic() < until, "nothing was driven"
                time.sleep(0.05)
        process.kill()
    for _ in range(12):
        time.sleep(2.0)  # nobody says anything: to ask would keep it alive
        if faults := faults_of(board):
            break
    assert any("host_silent" in line for line in faults)


@needs_board
@pytest.mark.parametrize("board", ["4"], indirect=True)
def test_a_script_that_sleeps_keeps_its_springs_and_gives_the_timeout_back(board: str) -> None:
    with Board(board) as connection:
        connection.ask("echo on")  # as a user's terminal may have left it
        assert connection.ask("$host_timeout_s") == ["$host_timeout_s=0"]
        connection.ask("policy open")
        connection.on(5, 30)
        time.sleep(3.0)
        assert connection.ask("$host_timeout_s") == ["$host_timeout_s=5"]
        assert connection.ask("faults") == []
        assert connection.read().duty[4] > 0
    with Board(board) as connection:
        assert connection.version[0].startswith("ninespring ") and "echo off" not in connection.version
        assert connection.ask("$host_timeout_s") == ["$host_timeout_s=0"]


def flows(part: Path) -> bool:
    """Return whether a log that is being written has a row with a current."""
    rows = (
        [line.split(",") for line in part.read_text().splitlines() if not line.startswith("#")] if part.exists() else []
    )
    return any(float(one) > 0.5 for row in rows[1:] for name, one in zip(rows[0], row, strict=False) if name == "i1_a")
