"""A board behind the page: one thread talks to it, finds it again when it was lost, and keeps a log when asked to."""

from __future__ import annotations

import contextlib
import datetime
import re
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import InputError, RefusedError, WorkError, in_words
from ..io import words
from ..io.belief import beliefs
from ..io.board import PATIENCE, SIMULATED, Board, reading, shape_of, springs_in
from ..io.port import pseudo_terminal
from ..io.recording import SILENT_S, LogFile, Row, RowCheck, RowSink, about, write_head
from ..io.thermometers import Thermometers
from ..model import tables
from .source import Source, at_once, plain
from .wishes import WISHES, drives, switches_off

LOOK_EVERY_S = 1.0
"""So often the board is asked what telemetry does not tell: phase, targets, faults."""
LATE_S = 1.0
"""Telemetry that does not come for so long is asked for again."""
ENDS_PLAYING = frozenset({"clear", "unlock", "cold", "end_play"})
"""What ends the list that is played, beside all that switches a spring."""
ALL_OFF = ("locked", "supply: off", "board: ")
"""How `faults` begins a line by which no spring is driven; what is no spring's and none of these is a remark."""


UNKNOWN = dict.fromkeys(("bounds_c", "phase", "unknown_s", "target_a", "measured_c"))
UNKNOWN |= dict.fromkeys(("current_a", "voltage_v", "temperature_c", "duty", "power_w"))
UNKNOWN |= {"level": 0, "doing": "", "limits": (), "cut_a": 0.0, "sights": 0}
"""What is shown of each spring before anything is known of it."""


@dataclass
class Play:
    """A list of patterns that is played in turn: which is on, and when the next one is due (monotonic)."""

    patterns: list[str]
    seconds: float
    at: int = -1
    next_s: float = 0.0


class OffFirst(Board):
    """A board that is asked nothing before what is to be switched off is off."""

    def __init__(self, port: str, stopped: Callable[[], bool], offs: Callable[[Board], None]) -> None:
        self._offs: Callable[[Board], None] | None = None
        super().__init__(port, stopped=stopped)
        self._offs = offs

    def ask(self, line: str, timeout_s: float = 3.0) -> list[str]:
        """Ask as any board, after the offs that wait."""
        if offs := self._offs:
            self._offs = None  # an off waits for no other
            try:
                offs(self)
            finally:
                self._offs = offs
        return super().ask(line, timeout_s)


class BoardSource(Source):
    """A board at a port, real or simulated."""

    words = "a board"
    takes = frozenset(WISHES) - {"stop", "settings", "pause", "seek", "speed"}

    def __init__(self, port: str, hz: int, folder: Path, thermometers: str | None = None) -> None:
        super().__init__()
        self.kind = "simulated" if port == SIMULATED else "board"
        self._port, self._hz, self._folder = port, hz, folder
        self._wishes: deque[tuple[dict[str, Any], Future[str]]] = deque()
        self._wishing = threading.Lock()
        self._board: Board | None = None
        self._settings: dict[str, str] = {}
        self._thermometers_port = thermometers
        self._thermometers: Thermometers | None = None
        self._log: LogFile | None = None
        self._sink: RowSink | None = None
        self._check: RowCheck | None = None
        self._play: Play | None = None
        if port == SIMULATED:
            self.off_within_s *= PATIENCE
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

    def stop_now(self, supply: bool = False) -> str:
        """Send the stop that the board obeys from its receive interrupt; whatever was wished before is dropped."""
        self._play = None
        self._drop("dropped by the stop")
        board = self._board
        if board is None:
            raise WorkError("the board is not there")
        board.stop_now(supply)
        if supply:
            return "STOP was sent, for the supply, too: when the state says so, all springs are off. Clear faults, then Supply on."
        return "STOP was sent: when the state says so, all springs are off. Clear faults to go on."

    def settings(self) -> list[dict[str, Any]]:
        """Return the board's settings with value, unit and range."""
        out = []
        for name, value in self._settings.items():
            one: dict[str, Any] = {"name": name, "value": value}
            if row := tables.setting(name):
                one |= {"unit": row.unit, "low": row.minimum, "high": row.maximum, "default": row.default}
                one["what"] = row.sentence
            out.append(one)
        return out

    def do(self, wish: dict[str, Any]) -> Future[str]:
        """Have the board's thread carry out a wish; what the board answers comes later."""
        springs = int(self._state.get("springs", 0))
        if wish.get("spring", 0) > springs:
            raise InputError(f"there are {springs} springs")
        for pattern in [wish["springs"]] if wish["do"] == "pattern" else wish.get("patterns", []):
            if len(pattern) != springs:
                raise InputError(f"a pattern of {springs} springs has {springs} digits")
        if self._board is None:
            raise WorkError("the board is not there")
        if wish["do"] == "play":
            self._play = Play(wish["patterns"], wish["seconds"])
            return at_once("")
        if drives(wish) or wish["do"] in ENDS_PLAYING:
            self._play = None
        if wish["do"] == "end_play":
            return at_once("")
        return self._queue({name: value for name, value in wish.items() if name != "id"})

    def _queue(self, wish: dict[str, Any]) -> Future[str]:
        """Queue a wish. An off comes first, and what was wished of its springs before it is dropped."""
        answer: Future[str] = Future()
        with self._wishing:
            same = next((one for queued, one in self._wishes if queued == wish), None)
            if not switches_off(wish):
                self._wishes.append((wish, answer))
                return answer
            if same:
                answer = same
            dropped = [one for one in self._wishes if drives(one[0], wish.get("spring")) and one[1] is not answer]
            self._wishes = deque(one for one in self._wishes if one not in dropped and one[1] is not answer)
            self._wishes.appendleft((wish, answer))
        for _, one in dropped:
            if one.set_running_or_notify_cancel():
                one.set_exception(RefusedError("dropped by an off that came after it"))
        return answer

    def _next_wish(self, *, off: bool = False) -> tuple[dict[str, Any], Future[str]] | None:
        """Return the next wish (or the next that only switches off) that somebody still waits for, None without one."""
        with self._wishing:
            while self._wishes and (not off or switches_off(self._wishes[0][0])):
                wish, answer = self._wishes.popleft()
                if answer.set_running_or_notify_cancel():
                    return wish, answer
        return None

    def _drop(self, why: str) -> None:
        while got := self._next_wish():
            got[1].set_exception(WorkError(why))

    # from the board's side

    def _run(self) -> None:
        terminal = pseudo_terminal(self._port)
        lost = ""
        """How the board was lost: it is shown until there is one again, before what the attempts to find it say."""
        while not self.closing.is_set():
            trouble, found = "", False
            try:
                terminal = self._same_terminal(terminal)
                with OffFirst(self._port, self.closing.is_set, self._switch_off) as board:
                    found = True
                    try:
                        self._converse(board)
                    finally:
                        self._board = None
                        self._change(connected=False)  # nothing can be wished while it is made safe
                        self._end_recording("")
                        if self._thermometers:
                            self._thermometers.close()
                            self._thermometers = None
            except KeyboardInterrupt:
                break
            except Exception as error:
                trouble = in_words(error)
            self._play = None
            self._drop("the board went away")
            if found:
                lost = trouble
            elif lost:
                trouble = f"{lost}. Since then: {trouble}"
            if trouble and trouble != self._state.get("trouble"):
                print(f"ninespring: {trouble}", file=sys.stderr)
            self._change(connected=False, trouble=trouble, play=None)
            self.closing.wait(1.0)

    def _same_terminal(self, terminal: tuple[int, ...] | None) -> tuple[int, ...] | None:
        """Return the pseudo-terminal that the port is, None where it is none; whose number another one has now is refused: that is not this board."""
        now = pseudo_terminal(self._port)
        if terminal and now and now != terminal and now[3:] == terminal[3:]:
            raise WorkError(
                f"{self._port}: its pseudo-terminal is gone, and another one has that number now: start the dashboard again"
            )
        return now or terminal

    def _converse(self, board: Board) -> None:
        self._read_settings(board)
        board.guard(self._settings)
        if logger := self._thermometers_port or board.thermometers:
            self._thermometers = Thermometers(logger)
        self._show(board.telemetry(self._hz))
        self._change(connected=True, trouble="", version=board.version)
        self._board = board
        heard_s = look_s = time.monotonic()
        again_s = heard_s + LATE_S * board.patience
        looked_at = self._state.get("state")
        """The board's state when it was last asked for its faults."""
        while not self.closing.is_set():
            now = time.monotonic()
            self._play_on(board, now)
            if got := self._next_wish():
                self._obey(board, *got)
            elif now >= look_s or self._state.get("state") != looked_at:
                look_s, looked_at = now + LOOK_EVERY_S, self._state.get("state")
                with contextlib.suppress(RefusedError):  # a stop drops what is being answered: the next look tells
                    self._look(board)
            if line := board.next_line(time.monotonic() + 0.05):
                heard_s = time.monotonic()
                again_s = heard_s + LATE_S * board.patience
                self._take(line)
            elif (silent_s := time.monotonic() - heard_s) > SILENT_S * board.patience:
                raise WorkError(f"{board.port}: no telemetry for {silent_s:.0f} s")
            elif time.monotonic() > again_s:
                again_s += LATE_S * board.patience
                with contextlib.suppress(RefusedError):
                    board.telemetry(self._hz)

    def _show(self, names: list[str]) -> None:
        """Show as many springs as these columns of telemetry are of, and nothing of them yet."""
        self._names, self._check = names, RowCheck(names, self._hz)
        springs = springs_in(names)
        rows, columns = shape_of(self._settings, springs)
        if springs != self._state.get("springs"):
            with self._lock:
                self._forget()
        self._change(
            rows=rows,
            cols=columns,
            springs=springs,
            every_s=1.0 / self._hz,
            faults=[],
            **{name: [empty] * springs for name, empty in UNKNOWN.items()},
        )

    def _read_settings(self, board: Board) -> None:
        self._settings = board.as_lent(board.settings())
        policy = "precompensate" if self._settings.get("policy") == "1" else "open"
        self._change(settings_read=time.time(), policy=policy)

    def _switch_off(self, board: Board) -> None:
        while got := self._next_wish(off=True):
            self._obey(board, *got)

    def _obey(self, board: Board, wish: dict[str, Any], answer: Future[str]) -> None:
        """Carry out a wish. Whatever is wrong with it ends it alone; only a board that is silent or gone ends more."""
        try:
            answer.set_result(self._carry_out(board, wish))
        except (WorkError, InputError) as error:
            answer.set_exception(error)
            if not isinstance(error, RefusedError | InputError):
                raise  # no answer: look for the board anew
        except BaseException as error:
            answer.set_exception(WorkError(in_words(error)))
            if not isinstance(error, Exception):
                raise

    def _carry_out(self, board: Board, wish: dict[str, Any]) -> str:
        do = wish["do"]
        if do == "record":
            return self._begin_recording(board)
        if do == "end_recording":
            self._end_recording("")
            return ""  # every page is told
        line = _line(wish)
        if line == "?":
            return board.status()
        said = board.ask(line, 10.0)
        self._note(board, line)
        return "\n".join(said)

    def _note(self, board: Board, line: str) -> None:
        """Keep what the board took and telemetry does not tell."""
        word, *rest = line.lower().split()
        level = list(self._state["level"])
        if word in ("on", "off") and rest:
            percent = float(rest[1].removesuffix("%")) if word == "on" and len(rest) > 1 else 100.0 * (word == "on")
            for k in range(len(level)) if rest[0] == "all" else [int(float(rest[0])) - 1]:
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
        if word.startswith("$"):  # it may have ended that
            self._need_of(board)

    def _need_of(self, board: Board) -> None:
        """Have the board do what this page needs of it."""
        board.guard(self._settings)
        if (names := board.telemetry(self._hz)) != self._names:
            self._play = None
            self._end_recording("")
            self._show(names)

    def _play_on(self, board: Board, now: float) -> None:
        play = self._play
        if not play and self._state.get("play"):
            self._change(play=None)
        if not play or now < play.next_s:
            return
        play.at, play.next_s = (play.at + 1) % len(play.patterns), now + play.seconds
        try:
            line = f"pattern {play.patterns[play.at]}"
            board.ask(line)
            self._note(board, line)
            self._change(play={"patterns": play.patterns, "seconds": play.seconds, "at": play.at})
        except WorkError as error:
            if self._play is play:
                self._play = None
            self._change(said=str(error))
            if not isinstance(error, RefusedError):
                raise

    def _look(self, board: Board) -> None:
        believed = beliefs(board.ask("model"))
        each = [believed.get(k) for k in range(1, self._state["springs"] + 1)]
        faults = board.ask("faults")
        level = list(self._state["level"])
        for one in faults:
            if spring := re.match(r"spring (\d+): ", one):
                level[int(spring[1]) - 1] = 0
            elif one.startswith(ALL_OFF):
                level = [0] * len(level)
        shown = [re.sub(r"fault (\d+) \w+", lambda it: words.FAULTS.get(int(it[1]), it[0]), one) for one in faults]
        self._change(
            bounds_c=[one and [one.low_c, one.high_c] for one in each],
            phase=[one and one.austenite for one in each],
            doing=[one.why or one.doing if one else "" for one in each],
            unknown_s=[one and one.unknown_s for one in each],
            target_a=[one and one.target_a for one in each],
            faults=shown,
            level=level,
        )

    def _take(self, line: str) -> None:
        """Take a line of telemetry: a row, which limits act on a spring, or that there is a new sight of it."""
        sight, acting = words.SIGHT.fullmatch(line), words.ACTING.fullmatch(line)
        if match := sight or acting:
            k = int(match[1]) - 1
            sights, limits, cut = (list(self._state[name]) for name in ("sights", "limits", "cut_a"))
            if k < len(sights) and sight:
                sights[k] += 1
            elif k < len(sights):
                limits[k] = [words.LIMITS.get(one, one) for one in match[2][1:].split("|") if one != "none"]
                cut[k] = float(match[3])
            self._change(sights=sights, limits=limits, cut_a=cut)
            with self._recording():
                if self._sink:
                    self._sink.comment(line)
            return
        assert self._check is not None
        for row in self._check.feed(line):
            with self._recording():
                self._log_row(row)
            now = reading(dict(zip(self._names, row.text.split(","), strict=True)))
            measured = self._thermometers.latest if self._thermometers else {}
            self._row_at_s = time.monotonic()
            self._change(
                **{name: getattr(now, name) for name in ("time_s", "fan", "ambient_c", "state")},
                **{name: plain(getattr(now, name)) for name in ("current_a", "voltage_v", "temperature_c", "duty")},
                power_w=plain(now.current_a * now.voltage_v),
                state_words=words.of_state(now.state),
                sum_a=float(now.current_a.sum()),
                supply_limit_a=float(limit) if (limit := self._settings.get("supply_limit_a")) else None,
                corrupt=self._check.dropped,
                measured_c=[measured.get(k) for k in range(1, len(now.current_a) + 1)],
            )
            bounds = [one or (None, None) for one in self._state["bounds_c"]]
            self._remember(self._state | {"low_c": [low for low, _ in bounds], "high_c": [high for _, high in bounds]})
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
        self._log = log
        self._change(recording={"file": path.name, "rows": 0})
        try:
            write_head(board, log, about(board.port))
            self._sink = RowSink(log, self._thermometers)
            self._sink.begin(self._names)
        except WorkError as error:
            self._end_recording(str(error))
            raise
        return f"recording into {path}"

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


LINES = {
    "pattern": "pattern {springs}",
    "policy": "policy {policy}",
    "fan": "fan {percent:.0f}",
    "set": "${name}={value}",
    "cold": "model cold",
    "say": "{line}",
}
"""Wishes as the console's lines; what is not here is its word (clear, unlock)."""


def _line(wish: dict[str, Any]) -> str:
    """Return a wish as the console's line."""
    if wish["do"] in ("level", "all"):
        where = int(wish["spring"]) if wish["do"] == "level" else "all"
        return f"on {where} {int(wish['level'])}" if wish["level"] else f"off {where}"
    return LINES.get(wish["do"], wish["do"]).format(**wish)
