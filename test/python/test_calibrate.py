"""`ninespring calibrate`: the whole way on the simulated board, gone on with after interrupts; what it refuses; what it takes back."""

from __future__ import annotations

import json
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import asdict
from pathlib import Path
from types import SimpleNamespace

import pytest
from command import alone, ended, process
from fake_board import FakeBoard, row
from made import needs_board, simulated_board
from ninespring.cli.calibrate import FROM
from ninespring.cli.calibration import chain, judged
from ninespring.cli.calibration.chain import Calibration, left_of
from ninespring.cli.calibration.progress import Progress
from ninespring.errors import InputError, WorkError
from ninespring.io.board import Board
from ninespring.io.recording import Fault, Recording, Step
from ninespring.model.models import Array

HAD = {"rows": "3", "columns": "3", "loss_w_per_k": "0.005800", "policy": "1", "open_current_a": "1.500"}
FOUND = {"loss_w_per_k": "0.006100"}


def refused(*words: object) -> str:
    """Return what is said of arguments that are wrong."""
    code, said = ended("calibrate", *words)
    assert code == 2
    return said


@pytest.fixture
def ports() -> Iterator[tuple[str, str]]:
    """Yield the ports of a simulated board, whose array loses more at its edge than its chip knows, and of its thermometers."""
    words = ["--set", "plant.effects=latent_heat,resistance_phase,edge_loss", "--set", "plant.edge_loss_fraction=0.25"]
    with simulated_board("--speed", "max", "--thermometers", "pty", *words) as (board, thermometers):
        yield board, thermometers


def rows_in(folder: Path, name: str) -> int:
    """Return how many rows a log that grows has."""
    parts = [*folder.glob(f"{name}.csv.part"), *folder.glob(f"{name}.csv")]
    return sum(line[:1].isdigit() for line in parts[0].read_text().splitlines()) if parts else 0


def interrupted(folder: Path, name: str, rows: int, how: signal.Signals, *words: object) -> tuple[int, str]:
    """Begin a calibration, and end it by a signal once a log has so many rows; return how it ended and what it said."""
    with subprocess.Popen(
        process("calibrate", *words), stderr=subprocess.PIPE, text=True, stdin=subprocess.DEVNULL
    ) as running:
        until = time.monotonic() + 600
        while rows_in(folder, name) < rows:
            assert running.poll() is None and time.monotonic() < until
            time.sleep(0.1)
        running.send_signal(how)
        said = running.communicate(timeout=120)[1]
    return running.returncode, said


@needs_board
def test_a_simulated_board_has_the_array_that_is_declared_and_a_wrong_port_is_no_beginning(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Calibration, "run", Calibration._look_at_the_board)
    (tmp_path / "a.toml").write_text("[array]\nrows = 1\ncols = 4\n[spring]\nwire_diameter_mm = 0.5\n")
    words = ("--yes", "--array", tmp_path / "a.toml", "-o", tmp_path / "folder")
    code, said = ended("calibrate", "--port", "/dev/none", "--thermometers", "/dev/none2", *words)
    assert (code, "/dev/none: cannot be opened" in said) == (1, True), said
    code, said = ended("calibrate", "--simulate", *words)
    assert code == 0, said


@pytest.mark.nightly
@needs_board
def test_a_board_learns_its_array_in_one_command_that_is_stopped_and_killed_on_the_way(
    ports: tuple[str, str], tmp_path: Path
) -> None:
    board, thermometers = ports
    folder = tmp_path / "calibration"
    words = ("--port", board, "--thermometers", thermometers, "-o", folder, "--yes")
    short = ("--duration", 400, "--drive-for", 200)

    code, said = interrupted(folder, "run1", 150, signal.SIGTERM, *words, *short)
    assert code == 1
    assert "the same command goes on" in said
    with Board(board) as connection:
        had = connection.settings()
        assert "off" in connection.status()
    # killed so that it can do nothing more: the board switches its springs off by itself, the log stays
    code, _ = interrupted(folder, "run1-2", 130, signal.SIGKILL, *words)
    assert code == -signal.SIGKILL

    done = alone("calibrate", *words, "--json", tmp_path / "result.json", stdin=subprocess.DEVNULL)
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "result.json").read_text())["done"]
    pieces = found["run1"]["pieces"]
    assert [one["log"] for one in pieces][:2] == ["run1.csv", "run1-2.csv"]
    assert pieces[1]["from_s"] == pytest.approx(pieces[0]["to_s"])
    assert pieces[0]["used"]
    assert pieces[0]["to_s"] > 140
    assert any("edge_loss" in name for name, _ in found["diagnose"]["findings"])
    assert found["verify"]["after"]["rmse_c"] < 0.5 * found["verify"]["before"]["rmse_c"]
    assert found["after"]["saved"]
    assert found["after"]["drives"][-1]["error_c"] < 0.5 * found["before"]["error_c"]
    with Board(board) as connection:
        now = connection.settings()
    assert {name: float(now[name]) for name in found["export"]["settings"]} == {
        name: float(value) for name, value in found["export"]["settings"].items()
    }
    # what only recording needs is as it was, and what it had can be had again
    assert [now[name] for name in chain.OWN] == [had[name] for name in chain.OWN]
    assert f"$loss_scale_1={had['loss_scale_1']}" in (folder / "settings-before.txt").read_text()
    page = (folder / "report.html").read_text()
    assert "The new settings are on the board" in page
    assert page.count("<svg") == 1

    # done: nothing is heated again
    before = time.monotonic()
    again = alone("calibrate", *words, stdin=subprocess.DEVNULL)
    assert again.returncode == 0, again.stderr
    assert "saved" in again.stdout
    assert time.monotonic() - before < 60
    assert sorted(path.name for path in folder.glob("*.csv")) == sorted(
        {name for step in found.values() for name in step["files"] if name.endswith(".csv")}
    )


# ---- what is refused before anything is done


def test_a_folder_with_something_else_in_it_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    assert "no calibration was begun in it" in refused("--simulate", "--yes", "-o", tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


def test_a_calibration_goes_on_as_it_was_begun_and_with_its_own_files(tmp_path: Path) -> None:
    options = FROM | {"simulate": False, "pattern": "111101111"}
    begun = Progress(tmp_path, options)
    (tmp_path / "run1.csv").write_text("time_s\n")
    begun.keep("run1", {"pieces": [], "complete": True}, "run1.csv")
    assert Progress(tmp_path, {"duration": 900.0, "supply": None}).done["run1"]["complete"]
    with pytest.raises(InputError, match=r"--duration was 900\.0"):
        Progress(tmp_path, {"duration": 600.0})
    (tmp_path / "run1.csv").write_text("time_s\n1\n")
    with pytest.raises(InputError, match=r"run1\.csv: is another one than was written here"):
        Progress(tmp_path, {})
    (tmp_path / "run1.csv").unlink()
    with pytest.raises(InputError, match="is gone"):
        Progress(tmp_path, {})
    (tmp_path / "calibration.json").write_text('{"schema": "ninespring.calibrate/1"}')
    with pytest.raises(InputError, match="is no progress"):
        Progress(tmp_path, {})


# ---- the board


class Told:
    """What a calibration asked and told, and a board that it was about."""

    def __init__(self, folder: Path, answers: dict[str, list[str]] | None = None, yes: bool = True) -> None:
        self.fake = FakeBoard(answers)
        self.fake.settings = dict(HAD)
        self.asked: list[str] = []
        self.said: list[str] = []
        self.yes = yes
        self.progress = Progress(folder, FROM | {"simulate": False, "pattern": "111101111"})
        self.board = Board(self.fake.port, off_at_end=False)
        self.chain = Calibration(self.progress, Array(), self.board, "/dev/none", self._ask, self._tell)

    def _ask(self, text: str) -> bool:
        self.asked.append(text)
        return self.yes

    def _tell(self, step: str, text: str) -> None:
        self.said.append(text)

    def run(self) -> str:
        """Run it; return what it ended with."""
        try:
            self.chain.run()
        except WorkError as error:
            return str(error)
        finally:
            self.board.close()
        return ""


def test_a_board_with_a_fault_is_not_heated(tmp_path: Path) -> None:
    told = Told(tmp_path, {"faults": ["spring 3: fault 4 open", "ok"]})
    assert "spring 3: fault 4 open" in told.run()
    assert not told.asked


def test_a_board_of_another_shape_is_refused(tmp_path: Path) -> None:
    told = Told(tmp_path)
    told.fake.settings["columns"] = "2"
    with pytest.raises(InputError, match="drives 3 x 2 springs, the array is 3 x 3"):
        told.run()


def test_whoever_says_no_has_nothing_heated_and_is_asked_again(tmp_path: Path) -> None:
    told = Told(tmp_path, yes=False)
    assert "before anything was heated" in told.run()
    assert "with at most" in told.asked[0]
    assert not any(line.startswith(("on ", "pattern", "policy")) for line in told.fake.sent())
    again = Told(tmp_path, yes=False)
    assert "before anything was heated" in again.run()


def test_settings_that_became_others_meanwhile_are_refused(tmp_path: Path) -> None:
    Told(tmp_path, yes=False).run()
    told = Told(tmp_path)
    told.fake.settings["loss_w_per_k"] = "0.007000"
    assert "$loss_w_per_k is 0.007000, not 0.005800" in told.run()
    assert not told.asked


def measured(**more: float) -> judged.Judged:
    numbers = {"held": 0.95, "heating_s": 40.0, "hottest_c": 100.0, "enough_c": 110.0, "undriven": 0.0, "done": 0.9}
    error = more.pop("error_c", 2.0)
    return judged.Judged(**numbers | more, error_c=error, worst_spring=1, worst_c=error)


def until_export(
    folder: Path, drives: list[judged.Judged], monkeypatch: pytest.MonkeyPatch, fault: bool = False
) -> Told:
    """Return a calibration of which only the drives and the upload are left, whose drives do this."""
    told = Told(folder)
    keep = told.progress.keep
    told.progress.board(["ninespring 9.9.9"], HAD)
    keep("plan", {"most_a": 1.0, "hottest_c": 50.0})
    for name in ("run1", "run2"):
        keep(name, {"pieces": [], "complete": True})
    keep("diagnose", {"doubts": [], "noise_c": 0.3, "verdict": "", "findings": [], "experiments": []})
    keep("verify", {"before": {"rmse_c": 2.0}, "after": {"rmse_c": 0.5}})
    keep("export", {"settings": FOUND, "kept": {}, "worse": []})
    faults = [Fault(1.0, 2, 4, "open")] if fault else []

    def drive(self: Calibration, name: str, pattern: str) -> tuple[str, Recording]:
        log = self.free(name)
        (folder / log).write_text(self.board.settings()["loss_w_per_k"])
        return log, Recording(faults=faults if name == "after" else [])

    found = iter(drives)
    monkeypatch.setattr(Calibration, "_drive", drive)
    monkeypatch.setattr(Calibration, "_cool", lambda self: self.board.ask("model cold"))
    monkeypatch.setattr(Calibration, "model", lambda self: None)
    monkeypatch.setattr(judged, "judge", lambda model, log, pattern: next(found))
    return told


BETTER = {"error_c": 0.5}


@pytest.mark.parametrize(
    ("drives", "fault", "says"),
    [
        ([BETTER], False, ""),
        ([{"held": 0.85}, BETTER], False, ""),  # the first finds where the springs transform: it is not the last word
        ([BETTER], True, "spring 2: fault 4 open"),
        ([{"error_c": 2.4}] * 2, False, "was 2.00 K wrong (rms), and is 2.40 K"),
        ([BETTER | {"held": 0.9}] * 2, False, "hold 95% austenite as the chip is now, 90% with the new"),
        ([BETTER | {"hottest_c": 118.0}] * 2, False, "reaches 100 degC as the chip is now, 118"),
        ([BETTER | {"undriven": 0.2}] * 2, False, "springs that are off reach"),
    ],
)
def test_settings_are_saved_if_the_board_drives_no_worse_with_them_and_taken_back_if_it_does(
    drives: list[dict[str, float]], fault: bool, says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    told = until_export(tmp_path, [measured(), *(measured(**one) for one in drives)], monkeypatch, fault)
    ended = told.run()
    assert says in ended and bool(says) == bool(ended)
    assert told.fake.settings == (HAD if says else HAD | FOUND)
    sent = told.fake.sent()
    assert ("$save" in sent) == (not says)
    assert sent.index("model cold") < sent.index("learnt clear")  # of warm springs no larger loss is believed
    assert ((tmp_path / "before.csv").read_text(), (tmp_path / "after.csv").read_text()) == ("0.005800", "0.006100")
    assert bool(told.progress.data["refused"]) == bool(says)
    # asked again it says the same, and drives nothing
    again = Told(tmp_path)
    assert says in again.run() and not again.asked


def test_nothing_that_is_held_excuses_a_spring_above_what_is_safe(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cold = measured(held=0.0, hottest_c=60.0)
    told = until_export(tmp_path, [cold, measured(hottest_c=120.5), measured(hottest_c=120.5)], monkeypatch)
    assert "reaches 60 degC as the chip is now, 120 with" in told.run() and "$save" not in told.fake.sent()
    (warm := tmp_path / "warm").mkdir()
    told = until_export(warm, [cold, measured(hottest_c=119.5)], monkeypatch)
    assert told.run() == "" and "$save" in told.fake.sent()


def test_of_springs_that_a_fault_kept_cold_no_error_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    told = until_export(tmp_path, [measured()], monkeypatch)
    cold = asdict(measured(held=0.0, error_c=0.8))
    told.progress.keep("before", {"log": "before.csv", "faults": ["fault 15 sensor_mismatch"], **cold})
    assert told.run() == "" and "$save" in told.fake.sent()


def test_springs_are_cold_once_the_board_that_heated_them_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    told = Told(tmp_path)
    told.fake.stream = (row(float(k)) for k in range(1, 999))
    warm, asked, ask = ["[spring 1 was heated 199 s ago: 27 degC or more]"], [], told.board.ask

    def answer(line: str, timeout_s: float = 3.0) -> list[str]:
        if line != "model cold":
            return ask(line, timeout_s)
        asked.append(line)
        return warm if len(asked) < 4 else []

    monkeypatch.setattr(told.board, "ask", answer)
    monkeypatch.setattr(told.chain, "_logger", lambda: nullcontext(SimpleNamespace(latest={1: 20.0})))
    told.chain._cool()
    told.board.close()
    assert len(asked) == 4


def test_a_stop_between_upload_and_save_gives_the_board_its_own_settings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    told = until_export(tmp_path, [measured()], monkeypatch)
    drive = Calibration._drive

    def stopped(self: Calibration, name: str, pattern: str) -> tuple[str, Recording]:
        if name == "after":
            raise KeyboardInterrupt
        return drive(self, name, pattern)

    monkeypatch.setattr(Calibration, "_drive", stopped)
    with pytest.raises(KeyboardInterrupt):
        told.run()
    assert told.fake.settings == HAD
    assert "before" in told.progress.done
    assert "after" not in told.progress.done


def test_a_model_that_is_more_wrong_or_drives_worse_never_gets_to_the_board(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for number, (step, found) in enumerate(
        (
            ("verify", {"before": {"rmse_c": 0.5}, "after": {"rmse_c": 0.6}}),
            ("export", {"settings": FOUND, "kept": {}, "worse": ["springs hold less"]}),
            ("diagnose", {"doubts": ["columns 1 and 2 are swapped"], "noise_c": 0.3}),
        )
    ):
        folder = tmp_path / str(number)
        folder.mkdir()
        told = until_export(folder, [], monkeypatch)
        told.progress.keep(step, found)
        assert "nothing is saved on the board" in told.run()
        assert not told.asked
        assert not any(line.startswith("$loss") for line in told.fake.sent())


# ---- a plan that is gone on with


def test_what_is_left_of_a_plan_begins_with_what_was_on() -> None:
    steps = [
        Step("policy open"),
        Step("fan 0"),
        Step("on 1 100", 10.0),
        Step("on 2 75", 20.0),
        Step("fan 100", 30.0),
        Step("off 1", 40.0),
        Step("on 3 50", 60.0),
        Step("off all", 90.0),
    ]
    assert left_of(steps, 0.0, 9) == steps
    assert left_of(steps, 50.0, 9) == [
        Step("policy open"),
        Step("fan 0"),
        Step("fan 100", 1.0),
        Step("on 2 75", 1.0),
        Step("on 3 50", 11.0),
        Step("off all", 41.0),
    ]


def test_a_plan_goes_on_from_what_all_killed_programs_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    names = ",".join(["time_s", *(f"i{k}_a" for k in range(1, 10))])
    begins: list[float] = []
    lasts = [0, 2, 200, 300, 10]  # rows: killed by turns before the first, at once, and after minutes

    def killed(self: Calibration, log: str, steps: list[Step], duration_s: float, words: str) -> Recording:
        rows = [f"{k}.0" + ",0.1" * 9 for k in range(lasts[len(begins)])]
        (tmp_path / f"{log}.part").write_text("\n".join(["# port: x", *([names] if rows else []), *rows, ""]))
        begins.append(900.0 - duration_s)
        raise SystemExit

    monkeypatch.setattr(Calibration, "_record", killed)
    (tmp_path / "run1-steps.txt").write_text("at 5 = on 1\n")
    for _ in lasts:
        told = Told(tmp_path)
        told.progress.keep("plan", {"most_a": 1.0, "hottest_c": 50.0})
        with pytest.raises(SystemExit):
            told.chain._measure("run1")
        told.board.close()
    assert begins == [0.0, 0.0, 0.0, 199.0, 498.0]
