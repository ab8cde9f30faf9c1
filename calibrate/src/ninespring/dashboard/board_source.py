"""A board behind the page: one thread talks to it, finds it again when it was lost, and keeps a log when asked to."""

from __future__ import annotations

import contextlib
import datetime
import queue
import re
import sys
import threading
import time
import traceback
from collections.abc import Iterator
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import numpy as np

from .. import __version__
from ..belief import beliefs
from ..board import SIMULATED, Board, reading
from ..console import err
from ..errors import InputError, RefusedError, WorkError
from ..recording import SILENT_S, LogFile, Row, RowCheck, RowSink, telemetry_names, write_head
from ..thermometers import Thermometers
from . import words
from .source import Source, at_once

LOOK_EVERY_S = 1.0
"""So often the board is asked what telemetry does not tell: phase, targets, faults."""


class BoardSource(Source):
    """A board at a port, real or simulated."""

    def __init__(self, port: str, hz: int, folder: Path, thermometers: str | None = None) -> None:
        super().__init__()
        self.kind = "simulated" if port == SIMULATED else "board"
        self._port, self._hz, self._folder = port, hz, folder
        self._wishes: queue.Queue[tuple[str, Future[str]]] = queue.Queue()
        self._board: Board | None = None
        self._settings: dict[str, str] = {}
        self._thermometers_port = thermometers
        self._thermometers: Thermometers | None = None
        self._log: LogFile | None = None
        self._sink: RowSink | None = None
        self._check: RowCheck | None = None
        self._play: tuple[list[str], float] | None = None
        self._played, self._play_next_s = 0, 0.0
        self._change(name="simulated board" if port == SIMULATED else port, recording=None, said="")
        self._thread = threading.Thread(target=self._run, name="board")

    # from the pages' side

    def start(self) -> None:
        """Begin to look for the board."""
        self._thread.start()

    def close(self) -> None:
        """Switch everything off, finish the log, and end."""
        self.closing.set()
        self._thread.join(20)

    def stop_now(self) -> None:
        """Send the stop that the board obeys from its receive interrupt; whatever was wished before is dropped."""
        self._play = None
        self._drop_wishes("dropped by the stop")
        board = self._board
        if board is None:
            raise WorkError("the board is not there")
        board.stop_now()

    def settings(self) -> list[dict[str, Any]]:
        """Return the board's settings with value, unit and range."""
        from .. import tables

        known = tables.settings()
        out = []
        for name, value in self._settings.items():
            row = known.get(name) or known.get(re.sub(r"_\d+$", "_K", name)) or known.get(re.sub(r"_\d+$", "", name))
            one: dict[str, Any] = {"name": name, "value": value}
            if row:
                one |= {"unit": row.unit, "low": row.minimum, "high": row.maximum, "default": row.default}
                one["what"] = row.sentence
            out.append(one)
        return out

    def do(self, wish: dict[str, Any]) -> Future[str]:
        """Have the board's thread carry out a wish as a console line; what the board answers comes later."""
        what = wish["do"]
        if what not in ("play", "record", "end_recording", "set", "ambient", "policy"):
            self._play = None
        springs = int(self._state.get("springs", 0))
        if "spring" in wish and wish["spring"] > springs:
            raise InputError(f"there are {springs} springs")
        for pattern in [wish["springs"]] if what == "pattern" else wish.get("patterns", []):
            if len(pattern) != springs:
                raise InputError(f"a pattern of {springs} springs has {springs} digits")
        if what == "play":
            self._play, self._played, self._play_next_s = (wish["patterns"], wish["seconds"]), 0, 0.0
            return at_once("playing")
        if what == "say":
            if wish["line"].split()[0].lower() == "telemetry":
                raise InputError("the page needs the telemetry as it is")
            return self._ask(wish["line"])
        line = {
            "level": lambda: (
                f"on {int(wish['spring'])} {int(wish['level'])}" if wish["level"] else f"off {int(wish['spring'])}"
            ),
            "all": lambda: f"on all {int(wish['level'])}" if wish["level"] else "off all",
            "pattern": lambda: f"pattern {wish['springs']}",
            "policy": lambda: f"policy {wish['policy']}",
            "fan": lambda: f"fan {int(wish['percent'])}",
            "ambient": lambda: f"ambient {wish['celsius']:.2f}",
            "set": lambda: f"${wish['name']}={wish['value']}",
            "clear": lambda: "clear",
            "unlock": lambda: "unlock",
            "record": lambda: "record",
            "end_recording": lambda: "end_recording",
        }[what]()
        return self._ask(line)

    def _ask(self, line: str) -> Future[str]:
        if self._board is None:
            raise WorkError("the board is not there")
        answer: Future[str] = Future()
        self._wishes.put((line, answer))
        return answer

    def _next_wish(self) -> tuple[str, Future[str]] | None:
        """Return the next wish that somebody still waits for, None where there is none."""
        with contextlib.suppress(queue.Empty):
            while True:
                line, answer = self._wishes.get_nowait()
                if answer.set_running_or_notify_cancel():
                    return line, answer
        return None

    def _drop_wishes(self, why: str) -> None:
        while wish := self._next_wish():
            wish[1].set_exception(WorkError(why))

    # from the board's side

    def _run(self) -> None:
        lost = ""
        """How the board was lost: it is shown until there is one again, before what the attempts to find it say."""
        while not self.closing.is_set():
            trouble, found = "", False
            try:
                with Board(self._port, stopped=self.closing.is_set) as board:
                    found = True
                    try:
                        self._converse(board)
                    finally:
                        self._board = None
                        self._end_recording("")
                        if self._thermometers:
                            self._thermometers.close()
                            self._thermometers = None
            except KeyboardInterrupt:
                break
            except WorkError as error:
                trouble = str(error)
            except Exception as error:
                traceback.print_exc(file=sys.stderr)
                trouble = f"a defect of the tool: {type(error).__name__}: {error}"
            self._play = None
            self._drop_wishes("the board went away")
            if found:
                lost = trouble
            elif lost:
                trouble = f"{lost}. Since then: {trouble}"
            if trouble and trouble != self._state.get("trouble"):
                err.print(f"ninespring: {trouble}", soft_wrap=True, markup=False)
            self._change(connected=False, trouble=trouble)
            self.closing.wait(1.0)

    def _converse(self, board: Board) -> None:
        self._read_settings(board)
        board.guard(self._settings)
        if logger := self._thermometers_port or board.thermometers:
            self._thermometers = Thermometers(logger)
        names = next(filter(None, map(telemetry_names, board.ask(f"telemetry csv {self._hz}"))), None)
        if not names:
            raise WorkError(f"{board.port}: the board's telemetry has no header that can be read")
        self._names, self._check = names, RowCheck(names, self._hz)
        rows, columns = (int(float(self._settings.get(one, 0))) for one in ("rows", "columns"))
        springs = sum(re.fullmatch(r"i\d+_a", name) is not None for name in names)
        if rows * columns != springs:
            rows, columns = 1, springs
        self._change(
            connected=True,
            trouble="",
            version=board.version,
            rows=rows,
            cols=columns,
            springs=springs,
            level=[0] * springs,
            bounds_c=[None] * springs,
            phase=[None] * springs,
            doing=[""] * springs,
            target_a=[None] * springs,
            limits=[[] for _ in range(springs)],
            cut_a=[0.0] * springs,
            measured_c=[None] * springs,
            faults=[],
            policy="precompensate" if self._settings.get("policy") == "1" else "open",
        )
        self._board = board
        heard_s = look_s = time.monotonic()
        looked_at = self._state.get("state")
        """The board's state when it was last asked for its faults."""
        while not self.closing.is_set():
            now = time.monotonic()
            self._play_on(board, now)
            if wish := self._next_wish():
                self._obey(board, *wish)
            elif now >= look_s or self._state.get("state") != looked_at:
                look_s, looked_at = now + LOOK_EVERY_S, self._state.get("state")
                with contextlib.suppress(RefusedError):  # a stop drops what is being answered: the next look tells
                    self._look(board)
            got = board.next_line(time.monotonic() + 0.05)
            if got:
                heard_s = time.monotonic()
                self._take(got)
            elif (silent_s := time.monotonic() - heard_s) > SILENT_S * board.patience:
                raise WorkError(f"{board.port}: no telemetry for {silent_s:.0f} s")

    def _read_settings(self, board: Board) -> None:
        self._settings = board.settings()
        self._change(settings_read=time.time())

    def _obey(self, board: Board, line: str, answer: Future[str]) -> None:
        try:
            if line == "record":
                said = self._begin_recording(board)
            elif line == "end_recording":
                self._end_recording("")
                said = ""  # every page is told
            else:
                if line == "$save":
                    board.unguard()  # what is saved is what was set, not what this page needs
                said = "\n".join(board.ask(line, 10.0))
                self._note(board, line)
                if line == "$save":
                    board.guard(self._settings)
            answer.set_result(said)
        except (WorkError, InputError) as error:
            answer.set_exception(error)
            if not isinstance(error, (RefusedError, InputError)):
                raise  # no answer: look for the board anew
        except BaseException as error:
            answer.set_exception(WorkError(str(error)))
            raise

    def _note(self, board: Board, line: str) -> None:
        """Keep what the board took and telemetry does not tell."""
        word, *rest = line.lower().split()
        level = list(self._state["level"])
        if word in ("on", "off") and rest:
            percent = float(rest[1]) if word == "on" and len(rest) > 1 else 100.0 * (word == "on")
            for k in range(len(level)) if rest[0] == "all" else [int(rest[0]) - 1]:
                level[k] = percent
        elif word == "pattern":
            level = [100.0 * (one == "1") for one in rest[0]]
        elif word in ("clear", "selftest"):
            level = [0] * len(level)
        self._change(level=level)
        if word == "policy" and rest:
            self._change(policy=rest[0])
        if word.startswith("$") or word == "ambient":
            self._read_settings(board)
            self._change(policy="precompensate" if self._settings.get("policy") == "1" else "open")

    def _play_on(self, board: Board, now: float) -> None:
        if self._play and now >= self._play_next_s:
            patterns, seconds = self._play
            line = f"pattern {patterns[self._played % len(patterns)]}"
            self._played += 1
            self._play_next_s = now + seconds
            try:
                board.ask(line)
                self._note(board, line)
            except WorkError as error:
                self._play = None
                self._change(said=str(error))
                if not isinstance(error, RefusedError):
                    raise
        if (self._state.get("playing") or False) != (self._play is not None):
            self._change(playing=self._play is not None)

    def _look(self, board: Board) -> None:
        believed = beliefs(board.ask("model"))
        each = [believed.get(k) for k in range(1, self._state["springs"] + 1)]
        faults = board.ask("faults")
        level = list(self._state["level"])
        for one in faults:
            if spring := re.match(r"spring (\d+): ", one):
                level[int(spring[1]) - 1] = 0
            else:
                level = [0] * len(level)
        shown = [
            re.sub(r"fault (\d+) \w+", lambda match: f"{words.FAULTS.get(int(match[1]), match[0])}", one)
            for one in faults
        ]
        self._change(
            bounds_c=[one and [one.low_c, one.high_c] for one in each],
            phase=[one and one.austenite for one in each],
            doing=[one.why or one.doing if one else "" for one in each],
            target_a=[one and one.target_a for one in each],
            faults=shown,
            level=level,
        )

    def _take(self, line: str) -> None:
        """Take a line of telemetry: a row, or which limits act on a spring."""
        if match := words.ACTING.fullmatch(line):
            k = int(match[1]) - 1
            limits, cut = list(self._state["limits"]), list(self._state["cut_a"])
            if k < len(limits):
                limits[k] = [words.LIMITS.get(one, one) for one in match[2][1:].split("|") if one != "none"]
                cut[k] = float(match[3])
                self._change(limits=limits, cut_a=cut)
            with self._recording():
                if self._sink:
                    self._sink.comment(line)
            return
        assert self._check is not None
        for row in self._check.feed(line):
            with self._recording():
                self._log_row(row)
            now = reading(dict(zip(self._names, row.text.split(","), strict=True)))
            values: dict[str, Any] = {
                "time_s": now.time_s,
                "current_a": _plain(now.current_a),
                "voltage_v": _plain(now.voltage_v),
                "power_w": _plain(now.current_a * now.voltage_v),
                "temperature_c": _plain(now.temperature_c),
                "duty": _plain(now.duty),
                "fan": now.fan,
                "ambient_c": now.ambient_c,
                "state": now.state,
                "state_words": words.of_state(now.state),
                "sum_a": float(now.current_a.sum()),
                "supply_limit_a": float(limit) if (limit := self._settings.get("supply_limit_a")) else None,
                "corrupt": self._check.dropped,
                "measured_c": self._measured(len(now.current_a)),
            }
            self._change(**values)
            self._remember(self._state)
        if self._check.restarted:
            raise WorkError("the board has started again")

    # the log

    def _begin_recording(self, board: Board) -> str:
        if self._log:
            raise RefusedError(f"'record' refused: {self._log.path.name} is being recorded")
        now = datetime.datetime.now(datetime.UTC)
        path = self._folder / f"ninespring-{now:%Y%m%d-%H%M%S}.csv"
        try:
            log = LogFile(path)
        except InputError as error:
            raise RefusedError(f"'record' refused: {error}") from None
        keys = {"recorded": f"{now:%Y-%m-%dT%H:%M:%SZ}", "port": board.port, "tool": f"ninespring {__version__}"}
        self._log = log
        self._change(recording={"file": path.name, "rows": 0})
        try:
            write_head(board, log, keys)
            self._sink = RowSink(log, self._thermometers)
            self._sink.begin(self._names)
        except WorkError as error:
            self._end_recording(str(error))
            raise
        return str(path)

    def _measured(self, springs: int) -> list[float | None]:
        latest = self._thermometers.latest if self._thermometers else {}
        return [latest.get(k) for k in range(1, springs + 1)]

    def _log_row(self, row: Row) -> None:
        if self._sink:
            self._sink.row(row)
            self._change(recording={"file": self._log.path.name if self._log else "", "rows": self._sink.rows})
        elif self._thermometers:
            self._thermometers.row_came(row.time_s)

    @contextlib.contextmanager
    def _recording(self) -> Iterator[None]:
        """End the recording, not more, where its file cannot be written."""
        try:
            yield
        except WorkError as error:
            self._end_recording(str(error))

    def _end_recording(self, why: str) -> None:
        log, self._log = self._log, None
        if not log:
            return
        with contextlib.suppress(WorkError):
            if self._sink and not why:
                self._sink.flush()
        self._sink = None
        log.close()
        said = f"{log.rows} rows in {log.path}" if log.rows else f"nothing came for {log.path.name}"
        self._change(recording=None, said=f"{why}; {said}" if why else said)


def _plain(values: np.ndarray) -> list[float | None]:
    """Return numbers as JSON has them: it has no NaN."""
    return [None if np.isnan(one) else round(float(one), 4) for one in values]
