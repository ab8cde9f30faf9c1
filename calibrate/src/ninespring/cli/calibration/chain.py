"""The steps of a calibration, each from what the folder and the board have: done ones are told, the others are done.

Nothing is saved on the board unless the chip is less wrong with the new settings on a log that the fit never saw, drives no
worse with them in simulation, and drove no worse with them when it was measured; else the board has its own again.
"""

from __future__ import annotations

import contextlib
import math
import re
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import Any

import msgspec

from ...errors import InputError, WorkError
from ...export.drive import checked_settings
from ...export.settings import together
from ...find import diagnosis
from ...find.plan import make_plan
from ...infer.predict import chip_errors
from ...io import history, results
from ...io.board import Board, as_lines, give_back, send_settings, settings_that_differ
from ...io.logs import Run, read_bytes, read_log, write_atomically
from ...io.logs.mending import RUN_IN_S
from ...io.recording import LogFile, Recording, Step, about, record, script_lines, told_to_stop
from ...io.thermometers import Thermometers
from ...model.models import Array, Model, read_model
from ...say import page
from ..console import working
from . import judged
from .progress import Progress

RUNS = ("run1", "run2")
DIAGNOSIS = "diagnosis"
SETTINGS, OLD_SETTINGS = "settings.txt", "settings-before.txt"
OWN: tuple[str, ...] = ("policy", "open_current_a", "host_timeout_s", "telemetry_format", "telemetry_hz")
OWN += tuple(f"resistance_{one}_ohm" for one in ("maximum", "minimum", "martensite", "austenite"))
"""Settings that recording changes, and that are given back."""
COOLED_K, COOLED_S = 2.0, 60.0
"""A spring that falls by less than so much in so long is within 1 K of where it is going: that is more than a time constant (50 s)."""
COOLING_S = 1200.0
"""So long it is waited for that, by the board's clock."""
PATTERN_AT_S = 5.0
DRIVES = 2
"""So often a drive with new settings is looked at before it is called worse: `upload` has the board forget what it had learnt,
and in the first it lets every spring cool until it loses its phase, to find out where that is."""
SOON_S = 1.0
"""What was on is on again so long after the first row."""
FEWEST_ROWS = 3
"""Of a log, for it to be read."""
ONE = re.compile(r"(on|off) (\d+|all)(?: (\d+))?")

Ask = Callable[[str], bool]
Tell = Callable[[str, str], None]


class Calibration:
    """One board, one folder."""

    def __init__(self, progress: Progress, array: Array, board: Board, thermometers: str, ask: Ask, tell: Tell) -> None:
        self.progress, self.array, self.board = progress, array, board
        self.folder = progress.folder
        self._thermometers, self._ask, self._tell = thermometers, ask, tell
        self._may_heat = False

    def run(self) -> None:
        """Do what is left. WorkError where it ends without new settings on the board."""
        self._look_at_the_board()
        self._plan()
        self._measure("run1")
        self._diagnose()
        self._measure("run2")
        self._verify()
        self._export()
        self._drive_before_and_after()

    @property
    def had(self) -> dict[str, str]:
        """The board's settings before anything was done to it."""
        return dict(self.progress.data["board"]["settings"])

    def model(self) -> Model:
        """Return the model that was found."""
        return read_model(self.folder / DIAGNOSIS / "model.toml")

    # ---- the board

    def _look_at_the_board(self) -> None:
        board, version = self.board, self.board.version
        if faults := board.ask("faults"):
            raise WorkError(
                f"{board.port}: nothing is heated while this stands: {'; '.join(faults)} "
                "(docs/console.md says what it is; `clear`, `supply on`, then the same command goes on)"
            )
        if board.status().startswith("<locked"):
            raise WorkError(f"{board.port}: the board is locked after a reset: type `unlock`, then the same command")
        if self.progress.data["board"]:
            self._give_back_its_own()
            self._same_board(board.settings())
            return
        settings = board.settings()
        shape = tuple(int(float(settings.get(name, "0"))) for name in ("rows", "columns"))
        if shape != (self.array.rows, self.array.cols):
            raise InputError(
                f"the board drives {shape[0]} x {shape[1]} springs, the array is {self.array.rows} x {self.array.cols}: "
                "give the array that is there, --array array.toml, or set $rows and $columns"
            )
        write_atomically(
            {self.folder / OLD_SETTINGS: "# from the board, before anything was done\n" + as_lines(settings)}
        )
        self.progress.board(version, settings)
        self._tell("board", f"{version[0]}; {len(settings)} settings kept, no fault")

    def _same_board(self, now: dict[str, str]) -> None:
        """Refuse a board that is neither as it was nor as this calibration has set it."""
        sent = self.progress.done.get("export", {}).get("settings", {})
        apart = [
            f"${name} is {now.get(name, 'not there')}, not {value}"
            for name, value in self.had.items()
            if name not in now or float(now[name]) not in {float(value), float(sent.get(name, value))}
        ]
        if apart:
            raise WorkError(
                f"the board's settings are not those that this calibration began with ({'; '.join(apart[:3])}): what was "
                "measured was measured beside others. Give them back, or begin another folder"
            )

    def _give_back_its_own(self) -> None:
        for name in OWN:
            if name in self.had:
                self.board.ask(f"${name}={self.had[name]}")

    # ---- measuring

    def _plan(self) -> None:
        option = self.progress.option
        if "plan" in self.progress.done:
            return
        files, most, hottest = {}, 0.0, 0.0
        for seed, name in enumerate(RUNS, start=1):
            made = make_plan(
                self.array, option("duration"), option("current"), option("supply"), option("hottest"), seed
            )
            files[f"{name}-steps.txt"] = "\n".join([f"# ninespring record --run {name}-steps.txt", *made.steps]) + "\n"
            most, hottest = max(most, made.most_a), max(hottest, made.hottest_c)
        write_atomically({self.folder / name: text for name, text in files.items()})
        self.progress.keep("plan", {"most_a": most, "hottest_c": hottest}, *files)
        self._tell(
            "plan",
            f"two runs of {option('duration'):g} s: at most {most:.1f} A together, {hottest:.0f} degC "
            "if the array is as declared",
        )

    def _asks_to_heat(self) -> None:
        if self._may_heat:
            return
        plan, option = self.progress.done["plan"], self.progress.option
        left = [name for name in RUNS if not self.progress.done.get(name, {}).get("complete")]
        times = "twice" if len(left) == 2 else "once"
        if not self._ask(
            f"Now the springs are heated {times}, for up to {option('duration') / 60:.0f} min, with at most "
            f"{plan['most_a']:.1f} A together, to about {plan['hottest_c']:.0f} degC. Is everybody's hand off, may it begin?"
        ):
            raise WorkError("stopped before anything was heated; the same command goes on from here")
        self._may_heat = True

    def _measure(self, name: str) -> None:
        done = self.progress.done.get(name, {"pieces": [], "complete": False})
        if done["complete"]:
            return
        self._asks_to_heat()
        pieces, duration = list(done["pieces"]), self.progress.option("duration")
        text = read_bytes(self.folder / f"{name}-steps.txt").decode()
        steps = script_lines(text, f"{name}-steps.txt")
        for part in sorted(self.folder.glob(f"{name}*.csv.part")):  # a killed program left it
            log = self.free(name)
            part.rename(self.folder / log)
            self._keep(name, pieces, log, Recording())
        if from_s := _until(pieces):
            self._tell(name, f"goes on at {from_s:.0f} s of {duration:g}: what was measured until then is kept")
        if duration - from_s > 1.0:
            log = self.free(name)
            got = self._record(log, left_of(steps, from_s, self.array.springs), duration - from_s, f"{name}: measuring")
            self._keep(name, pieces, log, got)
        if not self.progress.done[name]["complete"]:
            if last := pieces[-1]["ended"]:
                raise WorkError(f"{last}; {pieces[-1]['log']} is kept: the same command goes on from there")
            raise KeyboardInterrupt
        rows = sum(one["rows"] for one in pieces)
        self._tell(name, f"{rows} rows in {', '.join(one['log'] for one in pieces)}")

    def _keep(self, name: str, pieces: list[dict[str, Any]], log: str, got: Recording) -> None:
        """Keep what came of a recording: a part of a plan that is shorter than a log's run-in tells nothing."""
        rows = sum(line[:1].isdigit() for line in read_bytes(self.folder / log).splitlines())
        from_s, lasted, duration = _until(pieces), 0.0, self.progress.option("duration")
        if rows >= FEWEST_ROWS:
            run = read_log(self.folder / log, self.array.springs, temperatures=False)
            rows, ends_s = len(run.time_s), [one.time_s for one in got.faults if one.time_s is not None]
            lasted = min([float(run.time_s[-1]), *ends_s]) - float(run.time_s[0])
        to_s = from_s + lasted
        used = lasted >= RUN_IN_S or (not from_s and lasted >= duration - 2.0)
        pieces.append({"log": log, "rows": rows, "from_s": from_s, "to_s": to_s, "ended": got.ended, "used": used})
        complete = to_s >= duration - 2.0 and not got.ended
        self.progress.keep(name, {"pieces": pieces, "complete": complete}, *(one["log"] for one in pieces))

    def free(self, stem: str) -> str:
        """Return the next name of a log in the folder."""
        taken = {path.name for path in self.folder.iterdir()}
        names = (f"{stem}.csv" if k == 1 else f"{stem}-{k}.csv" for k in range(1, 1000))
        return next(one for one in names if one not in taken)

    def _record(self, log: str, steps: Sequence[Step], duration_s: float, words: str) -> Recording:
        """Record into the folder; the springs are off afterwards and the board has its own settings."""
        with (
            told_to_stop() as stopped,
            working(words, duration_s) as say,
            self._logger() as logger,
            contextlib.closing(LogFile(self.folder / log)) as file,
        ):
            left = lambda rows, seconds: say(f"{words}, {max(0.0, duration_s - seconds):.0f} s left", seconds)  # noqa: E731
            self.board.stopped = stopped
            got = record(self.board, file, 1, duration_s, steps, left, about(self.board.port, " calibrate"), logger)
            self.board.stopped = lambda: False
            told = stopped()
        if not file.rows:
            if told:
                raise KeyboardInterrupt
            raise WorkError(got.ended or "no row came")
        with contextlib.suppress(WorkError):
            self._give_back_its_own()
        return got

    @contextlib.contextmanager
    def _logger(self) -> Iterator[Thermometers]:
        with contextlib.closing(Thermometers(self._thermometers)) as logger:
            missing = set(range(1, self.array.springs + 1)) - set(logger.springs)
            if missing:
                raise WorkError(
                    f"{self._thermometers}: no temperature of spring {', '.join(map(str, sorted(missing)))}: "
                    "the logger's columns are t1_c, t2_c, ... (docs/calibrating.md)"
                )
            yield logger

    def _cool(self) -> None:
        """Wait until the thermometers have stopped falling, and the board, by the heat that it gave, calls its springs cold, too.

        Two drives are only alike from the same temperature; and what is declared of springs that the board holds to be warm is
        not believed where it makes them colder: a loss that is half as much again ends the drive with fault 9.
        """
        seen: list[tuple[float, float]] = []
        with self._logger() as logger, working("waiting until the springs are cold") as say:
            names = self.board.telemetry(1)
            try:
                while row := self.board.next_row(names, time.monotonic() + 10.0 * self.board.patience):
                    now_s, hottest = float(row["time_s"]), max(logger.latest.values())
                    seen.append((now_s, hottest))
                    say(f"waiting until the springs are cold: the hottest is at {hottest:.0f} degC")
                    before = [one for at_s, one in seen if at_s <= now_s - COOLED_S]
                    if before and before[-1] - hottest < COOLED_K and not self.board.ask("model cold"):
                        return
                    if now_s - seen[0][0] > COOLING_S:
                        break
            finally:
                self.board.telemetry_off()
        raise WorkError(f"the springs do not cool: still {seen[-1][1] if seen else float('nan'):.0f} degC")

    # ---- what they tell

    def _runs(self, name: str) -> list[Run]:
        pieces = [one for one in self.progress.done[name]["pieces"] if one["used"]]
        return [read_log(self.folder / one["log"], self.array.springs) for one in pieces]

    def _diagnose(self) -> None:
        if "diagnose" not in self.progress.done:
            with working("diagnosing") as say:
                found = diagnosis.diagnose(self.array, self._runs("run1"), progress=say)
                say("writing its report")
                folder = self.folder / DIAGNOSIS
                folder.mkdir(exist_ok=True)
                report = page.html_report(found, DIAGNOSIS)
                write_atomically(page.files_of(folder, found.told, report, found.model))
            told = found.told
            self.progress.keep(
                "diagnose",
                {
                    "verdict": page.verdict(told),
                    "findings": [list(one) for one in page.findings(told)],
                    "doubts": told.doubts,
                    "noise_c": told.baseline.noise_c,
                    "experiments": [one.separating_experiment for one in told.rivals],
                },
                f"{DIAGNOSIS}/model.toml",
            )
            self._tell("diagnose", page.verdict(told))
            for name, text in page.findings(told):
                self._tell("", f"{name}: {text}")
        if doubts := self.progress.done["diagnose"]["doubts"]:
            self._refuse(f"the log is doubted: {'; '.join(doubts)}. Mend that, and begin another folder")

    def _refuse(self, why: str) -> None:
        self.progress.refuse(why)
        raise WorkError(f"nothing is saved on the board: {why}")

    def _verify(self) -> None:
        if "verify" not in self.progress.done:
            with working("verifying on the second run"):
                each = chip_errors(self.model(), as_lines(self.had), self._runs("run2"))
            errors = {when: results.plain(one) for when, one in zip(("before", "after"), each, strict=True)}
            self.progress.keep("verify", errors)
            self._tell(
                "verify",
                f"on the second run, which the fit never saw, the chip's model is {errors['before']['rmse_c']:.2f} K wrong "
                f"(rms) as it is, {errors['after']['rmse_c']:.2f} K with what was found",
            )
        errors = self.progress.done["verify"]
        if errors["after"]["rmse_c"] > errors["before"]["rmse_c"]:
            self._refuse("the chip would be more wrong with the new settings on a log that the fit never saw")

    def _export(self) -> None:
        if "export" not in self.progress.done:
            with working("driving the old and the new settings in simulation") as say:
                made, worse, _ = checked_settings(self.model(), as_lines(self.had), True, say)
            head = ["# from model.toml, by `ninespring calibrate`"]
            write_atomically({self.folder / SETTINGS: "\n".join([*head, made.lines])})
            kept = together(made.kept, made.written)
            self.progress.keep("export", {"settings": made.written, "kept": kept, "worse": worse}, SETTINGS)
            self._tell(
                "export",
                f"{len(made.written)} settings were determined, {len(settings_that_differ(self._found(), self.had))} of "
                "them are others than the board has; in simulation they drive "
                + ("worse: " + "; ".join(worse) if worse else "no worse"),
            )
        if worse := self.progress.done["export"]["worse"]:
            self._refuse(f"the new settings would drive worse: {'; '.join(worse)}")

    def _found(self) -> dict[str, str]:
        return self.progress.done["export"]["settings"]

    # ---- onto the board

    def _drive(self, name: str, pattern: str) -> tuple[str, Recording]:
        """Drive the pattern from cold and return its log; one that was interrupted stays, and is driven again."""
        self._cool()
        seconds = self.progress.option("drive_for")
        lines = ["policy precompensate", "off all", "fan 0", f"at {PATTERN_AT_S:g} = pattern {pattern}"]
        log = self.free(name)
        got = self._record(log, script_lines("\n".join(lines), "drive"), seconds, f"{name}: driving")
        run = read_log(self.folder / log, self.array.springs)
        if run.duration_s < seconds - 2.0 and not got.faults:
            if got.ended:
                raise WorkError(f"{got.ended}; the same command drives again")
            raise KeyboardInterrupt
        return log, got

    def _drive_before_and_after(self) -> None:
        if "after" in self.progress.done:
            self._say_how_it_ended()
            return
        settings = self._found()
        pattern, seconds = self.progress.option("pattern"), self.progress.option("drive_for")
        changed = settings_that_differ(settings, self.had)
        if not changed:
            self.progress.keep("after", {"saved": False, "worse": [], "drives": []})
            self._tell("upload", "the board has these settings already: nothing is written")
            return
        if not self._ask(
            f"Now {pattern} is driven for {seconds / 60:.0f} min as the board is, {len(changed)} settings are sent, and it "
            "is driven again; they are saved only if it drives no worse. What the board has learnt of its springs it forgets. "
            "May it?"
        ):
            raise WorkError("stopped before anything was written; the same command goes on from here")
        model, noise = self.model(), self.progress.done["diagnose"]["noise_c"]
        if "before" not in self.progress.done:
            log, got = self._drive("before", pattern)
            made = judged.judge(model, self.folder / log, pattern)
            self.progress.keep("before", {"log": log, "faults": list(map(str, got.faults)), **asdict(made)}, log)
            self._tell("drive", _words("as the board was", asdict(made), got.faults))
            if got.faults:
                raise WorkError(
                    f"{got.ended}: `clear` the fault, then the same command goes on (the drive is kept as it was)"
                )
        before = self.progress.done["before"]
        if before["faults"]:
            noise = math.inf  # of springs that a fault kept cold the chip's error is small, and tells nothing
        self._cool()
        saved = False
        try:
            with working("sending the settings", len(settings)) as say:
                send_settings(self.board, settings, False, say)
            self._tell("upload", f"{len(settings)} settings sent and read back, not yet saved")
            drives, worse = [], []
            for _ in range(DRIVES):
                log, got = self._drive("after", pattern)
                made = judged.judge(model, self.folder / log, pattern)
                worse = judged.worse_than(msgspec.convert(before, judged.Judged), made, noise)
                if got.faults and not before["faults"]:
                    worse.append(f"it ended in {got.faults[0]}")
                drives.append({"log": log, "faults": list(map(str, got.faults)), "worse": worse, **asdict(made)})
                self._tell("drive", _words("with the new settings", asdict(made), got.faults))
                if not worse or got.faults:
                    break
            if not worse:
                self.board.ask("$save", 10.0)
                saved = True
                by = f"calibrate -o {self.folder.name}"
                history.keep(self.board.port, self.board.version[0], by, self.had, settings)
        finally:
            if not saved:
                self._take_back(settings)
        self.progress.keep("after", {"saved": saved, "worse": worse, "drives": drives}, *(one["log"] for one in drives))
        self._say_how_it_ended()

    def _say_how_it_ended(self) -> None:
        after = self.progress.done["after"]
        if after["worse"]:
            self._refuse(
                f"the board drove worse with the new settings: {'; '.join(after['worse'])}. It has its own again"
            )
        self._tell("upload", "the new settings are saved" if after["saved"] else "there was nothing to write")

    def _take_back(self, settings: Mapping[str, str]) -> None:
        """Give the board back the settings that it had in place of these: nothing of them was saved."""
        try:
            wrong = give_back(self.board, settings, self.had)
        except KeyboardInterrupt:
            wrong = ["it does not answer"]
        if wrong:
            self._tell(
                "", f"the board could not be given back its settings ({wrong[0]}): a reset does it, none was saved"
            )
        else:
            self._tell("", "the board has its own settings again; none was saved")


def _until(pieces: Sequence[Mapping[str, Any]]) -> float:
    """Return how much of a plan these pieces have measured, s."""
    return max((one["to_s"] for one in pieces if one["used"]), default=0.0)


def _words(how: str, found: dict[str, float], faults: Sequence[Any]) -> str:
    said = (
        f"{how}: the chip {found['error_c']:.2f} K wrong (rms), springs that are on hold {found['held']:.0%} austenite, "
        f"hottest {found['hottest_c']:.0f} degC"
    )
    return said + (f"; {faults[0]}" if faults else "")


def left_of(steps: Sequence[Step], from_s: float, springs: int) -> list[Step]:
    """Return the steps that are left after `from_s` seconds of a plan; first, what was on then is switched on again."""
    if from_s <= 0.0:
        return list(steps)
    level, fan = ["0"] * springs, "0"
    head, after = [step for step in steps if step.at_s is None], []
    for step in steps:
        if step.at_s is None:
            continue
        if step.at_s > from_s:
            after.append(Step(step.line, step.at_s - from_s + SOON_S))
        elif match := ONE.fullmatch(step.line):
            value = "0" if match[1] == "off" else match[3] or "100"
            which = range(springs) if match[2] == "all" else [int(match[2]) - 1]
            for k in which:
                level[k] = value
        elif step.line.startswith("fan "):
            fan = step.line.split()[1]
    again = [Step(f"on {k + 1} {value}", SOON_S) for k, value in enumerate(level) if value != "0"]
    return [*head, *([Step(f"fan {fan}", SOON_S)] if fan != "0" else []), *again, *after]
