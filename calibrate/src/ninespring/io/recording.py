"""Recording a board's telemetry as a log: what comes is checked line by line, kept whatever ends it, and nothing stays on."""

from __future__ import annotations

import contextlib
import datetime
import math
import os
import re
import signal
import stat
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from .. import __version__
from ..errors import InputError, RefusedError, WorkError
from . import results
from .board import AT_ONCE, LINE, Board
from .logs import LIMITS, check_folder
from .thermometers import Thermometers
from .words import FAULTS

FINER = 10
"""So many rows of telemetry become one of the log, where the line has room for them."""
FINEST_HZ = 20
"""Nine springs' rows fill half the line at this rate."""
LONGEST_WAIT_S = 15.0
"""So long, by the board's clock, a row waits for a thermometer's reading after it."""
SILENT_S = 5.0
"""Telemetry that does not come for so long has ended."""
STATE = re.compile(r"ok|locked|fault_\d+")
NUMBER = re.compile(r"-?\d+(?:\.(\d+))?")
COMMENT = re.compile(r"[<\[][ -~]*[>\]]")
FAULT = re.compile(r"(?:board|spring (\d+)): fault (\d+) (\w+)")
SWITCHED_OFF = "|safety"
"""In a status line: the limit that acts on a spring with a fault."""


@dataclass
class Step:
    """A console line to send so many seconds after the first row (None: before the recording)."""

    line: str
    at_s: float | None = None
    place: str = field(default="", compare=False)
    """File, line and column where it stands."""

    def send(self, board: Board) -> list[str]:
        """Return the board's answer; a refusal says where the line stands."""
        try:
            return board.ask(self.line)
        except RefusedError as error:
            raise RefusedError(f"{self.place}{error.refusal}", error.said) from None


class Fault(results.Fault):
    """A fault that the board has latched, in words."""

    def __str__(self) -> str:
        when = "at the end" if self.time_s is None else f"at {self.time_s:.1f} s"
        where = "board" if self.spring is None else f"spring {self.spring}"
        words = f" ({FAULTS[self.number]})" if self.number in FAULTS else ""
        return f"{when}: {where}: fault {self.number} {self.name}{words}"


@dataclass
class Recording:
    """What came of a recording."""

    dropped: int = 0
    """Lines that were corrupt."""
    offset_s: float | None = None
    """What was added to the thermometers' clock to have the board's, s."""
    ended: str = ""
    """Why it ended early, or drove less than it was asked to, where that was nobody's wish."""
    faults: list[Fault] = field(default_factory=list)
    latched: list[str] = field(default_factory=list)
    """What the board still had when all was off, in its words."""


def script_lines(text: str, name: str, duration_s: float = math.inf) -> list[Step]:
    """Return the steps of a script: console lines, or `at SECONDS = line` as in scenarios; # and ; begin comments."""
    steps: list[Step] = []
    for number, raw in enumerate(text.splitlines(), start=1):
        line = re.split("[#;]", raw, maxsplit=1)[0].strip()
        if not line:
            continue
        match = re.fullmatch(r"at\s+(\d+(?:\.\d*)?)\s*=\s*(\S.*)", line)
        at_s, before_s = float(match[1]) if match else None, steps[-1].at_s if steps else None
        sent = match[2] if match else line
        wrong = ""
        if not LINE.fullmatch(sent):
            wrong = f"{sent[:40]!r} is not one line of plain ASCII, as the console takes it"
        elif AT_ONCE.search(sent):
            wrong = f"'{sent[:40]}': ! and ? act at once, as they are typed: they are no step"
        elif at_s is None and re.match(r"at\b", line):
            wrong = f"'{line[:40]}' is not `at SECONDS = console line`"
        elif at_s is None and before_s is not None:
            wrong = f"'{line[:40]}' comes after timed lines: give it a time, `at SECONDS = ...`"
        elif at_s is not None and at_s < (before_s or 0.0):
            wrong = "times of a script must not fall"
        elif at_s is not None and at_s >= duration_s:
            wrong = f"{at_s:g} s is not before the end of the recording, `--duration {duration_s:g}`"
        if wrong:
            raise InputError(wrong, name, number, 1)
        steps.append(Step(sent, at_s, f"{name}:{number}:1: "))
    return steps


@dataclass(frozen=True)
class Row:
    """One row of telemetry."""

    text: str
    time_s: float
    form: tuple[tuple[int, ...], frozenset[str]]
    """Digits after each point, and the columns that are out of range: the same in neighbours unless one is corrupt."""


class RowCheck:
    """Tells a board's rows from what a bad line made of them.

    A row has a cell per column, each a finite number, and it follows the row before: the same digits after each point,
    the same columns in range, a time that goes on. One that does not follow is held until the next one follows it (then
    something really changed) or not (then it was corrupt).
    """

    def __init__(self, names: Sequence[str], hz: float) -> None:
        self.names = names
        self.dropped = 0
        self.restarted = False
        """Time began anew: the board was reset."""
        self._longest_step_s = max(1.0, 3.0 / hz)
        self._before: Row | None = None
        """The row before the last."""
        self._last: Row | None = None
        self._held: Row | None = None

    def feed(self, line: str) -> list[Row]:
        """Return the rows that are now known to be good, in order."""
        row = self._parse(line)
        if row is None:
            self.dropped += 1
            return []
        if self._last and self._follows(self._last, row):
            self.dropped += self._held is not None
            good = [row]
        elif self._held and self._follows(self._held, row):
            if self._last and self._held.time_s <= self._last.time_s:
                self.dropped += 1
                self.restarted = not (self._before and self._follows(self._before, self._held))
                self._held = row  # that the last was corrupt is seen too late: what follows waits for its time
                return []
            good = [self._held, row]
        else:
            self.dropped += self._held is not None
            self._held = row
            return []
        self._before = (self._last, *good)[-2]
        self._held, self._last = None, row
        return good

    def _parse(self, line: str) -> Row | None:
        cells = line.split(",")
        if len(cells) != len(self.names):
            return None
        digits: list[int] = []
        out: set[str] = set()
        for name, cell in zip(self.names, cells, strict=True):
            if name == "state":
                if not STATE.fullmatch(cell):
                    return None
                continue
            if not (match := NUMBER.fullmatch(cell)):
                return None
            digits.append(len(match[1] or ""))
            low, high = LIMITS.get(name if name in LIMITS else name[0], (-math.inf, math.inf))[:2]
            if not low <= float(cell) <= high:
                out.add(name)
        return Row(line, float(cells[self.names.index("time_s")]), (tuple(digits), frozenset(out)))

    def _follows(self, before: Row, row: Row) -> bool:
        return row.form == before.form and 0.0 < row.time_s - before.time_s <= self._longest_step_s


class LogFile:
    """Takes a log line by line. Lines are in the file at once; the file has its name when it is finished.

    A regular file grows as NAME.part, which is a readable log at every moment. A device or a pipe is written as it is, `-`
    is standard output. A log that is there already is kept: InputError, unless `force`; where one has come while this one
    grew, this one stays as NAME.part, and `path` says so.
    """

    def __init__(self, path: Path, force: bool = False) -> None:
        self.path = path
        self._force = force
        self.part: Path | None = None
        self.rows = 0
        self._whole = 0
        """Bytes of whole lines."""
        try:
            if str(path) == "-":
                self._file = os.dup(sys.stdout.fileno())
            elif path.exists() and not stat.S_ISREG(path.stat().st_mode):
                self._file = os.open(path, os.O_WRONLY)
            else:
                check_folder(path, measured=True, force=force)
                self.path = path.resolve()
                self._file = self._new_part()
        except OSError as error:
            raise InputError(f"cannot be written: {error.strerror}", path) from None

    def _new_part(self) -> int:
        """Open a new file beside the log: an old .part is what a killed recording left, and is kept."""
        count = 1
        while True:
            self.part = self.path.with_name(f"{self.path.name}.part{'' if count == 1 else count}")
            with contextlib.suppress(FileExistsError):
                return os.open(self.part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
            count += 1

    def write(self, line: str) -> None:
        """Write one line. WorkError where the disk is full or the reader went away."""
        left = (line + "\n").encode()
        whole = self._whole + len(left)
        try:
            while left:
                left = left[os.write(self._file, left) :]
        except OSError as error:
            raise WorkError(f"{self.part or self.path}: {error.strerror}") from None
        self._whole = whole

    def write_row(self, line: str) -> None:
        """Write one row of numbers."""
        self.write(line)
        self.rows += 1

    def close(self) -> None:
        """Cut off a line that was not written whole, and give the file its name; without a row, remove it."""
        if self.part:
            with contextlib.suppress(OSError):
                os.ftruncate(self._file, self._whole)
                os.fsync(self._file)
        os.close(self._file)
        if self.part and self.rows:
            if self._force or not self.path.exists() or self.path.stat().st_size == 0:
                os.replace(self.part, self.path)
            else:  # it has come meanwhile
                self.path = self.part
        elif self.part:
            self.part.unlink()


@contextlib.contextmanager
def told_to_stop(last: bool = False) -> Iterator[Callable[[], bool]]:
    """Have SIGINT, SIGTERM and SIGHUP (a closed terminal) only be noted, and tell whether one came.

    What is under way is then ended in order. A signal that is ignored (nohup) stays so. `last`: nothing follows but the end of
    the program, which an impatient second signal does not turn into a failure.
    """
    told: list[int] = []
    before = {}
    for one in filter(None, (signal.SIGINT, signal.SIGTERM, getattr(signal, "SIGHUP", None))):  # Windows has no SIGHUP
        if signal.getsignal(one) != signal.SIG_IGN:
            before[one] = signal.signal(one, lambda number, frame: told.append(number))
    try:
        yield lambda: bool(told)
    finally:
        for one, handler in before.items():
            signal.signal(one, signal.SIG_IGN if told and last else handler)


def record(
    board: Board,
    log: LogFile,
    hz: int,
    duration_s: float,
    steps: Sequence[Step] = (),
    say: Callable[[int, float], None] = lambda rows, seconds: None,
    keys: Mapping[str, str] | None = None,
    thermometers: Thermometers | None = None,
    alarm: Callable[[Fault], None] = lambda fault: None,
    remark: Callable[[str], None] = lambda words: None,
) -> Recording:
    """Record a board's telemetry, `hz` rows a second; `duration_s` and the steps' times are by the board's clock, from the first row.

    Steps without a time are sent first. The log begins with what the board is and how it is set, ends with its faults,
    and has its status (which limits act on a spring) between the rows, all as comments. Whatever ends it, the springs are
    off afterwards, and `ended` says why where it was no wish. A fault does not end it; `alarm` is told of each as it comes, and
    `ended` begins with the first. `remark` is told what the board answers to a step beside `ok`. `thermometers` add columns t1_c ...: each row waits until a
    reading after it has come.
    """
    got = Recording()
    finer_hz = max(hz, min(FINER * hz, FINEST_HZ))
    sink = RowSink(log, thermometers, 1.0 / hz if finer_hz > hz else 0.0)
    under_way = _UnderWay(board, sink, got, alarm, remark)
    before: list[str] = []
    with switched_off_after(board, got):
        for step in steps:
            if step.at_s is None:
                under_way.send(step)
        board.guard(write_head(board, log, keys or {}))
        before = board.ask("faults")
        under_way.rows(finer_hz, duration_s, [step for step in steps if step.at_s is not None], say)
    with contextlib.suppress(WorkError):
        sink.flush()
        under_way.latched |= set(before)
        under_way.take_faults(got.latched, None)
    if got.faults:
        more = f" and {len(got.faults) - 1} more" if len(got.faults) > 1 else ""
        got.ended = f"a fault cut this run short, {got.faults[0]}{more}" + (f"; {got.ended}" if got.ended else "")
    with contextlib.suppress(WorkError):
        if thermometers:
            got.offset_s = thermometers.offset_s
            if got.offset_s is not None:
                log.write(f"# thermometers_offset_s: {got.offset_s:.3f}")
            got.ended = got.ended or thermometers.trouble
        if got.dropped:
            log.write(f"# dropped_lines: {got.dropped}")
        write_end(log, got)
    return got


@dataclass
class _UnderWay:
    """A recording under way: rows and remarks go to the log, steps to the board, new faults and remarks to whoever listens."""

    board: Board
    sink: RowSink
    got: Recording
    alarm: Callable[[Fault], None]
    remark: Callable[[str], None]
    latched: set[str] = field(default_factory=set)
    """The faults that the board told of last, in its words."""

    def send(self, step: Step) -> None:
        """Send a step's line."""
        for words in step.send(self.board):
            self.sink.comment(f"'{step.line}': {words}")
            self.remark(f"'{step.line}': {words}")

    def take_faults(self, lines: Sequence[str], time_s: float | None) -> None:
        """Take the answer to `faults`, and tell those that are new."""
        for line in lines:
            if line not in self.latched and (match := FAULT.fullmatch(line)):
                fault = Fault(time_s, int(match[1]) if match[1] else None, int(match[2]), match[3])
                self.got.faults.append(fault)
                self.sink.comment(f"fault {fault}")
                self.alarm(fault)
        self.latched = set(lines)

    def rows(self, hz: int, duration_s: float, steps: list[Step], say: Callable[[int, float], None]) -> None:
        """Take rows for so long, each step sent in its time; the board is asked for its faults where a row's state has changed."""
        names = self.board.telemetry(hz)
        self.sink.begin(names)
        check = RowCheck(names, hz)
        state, time_s, first_s = "ok", None, math.nan
        no_rows = 0
        """Lines in a row that were none of telemetry."""
        while True:
            line = self.board.next_line(time.monotonic() + SILENT_S)
            if line is None:
                raise WorkError(f"{self.board.port}: no telemetry for {SILENT_S:g} s")
            if COMMENT.fullmatch(line):
                self.sink.comment(line)
                if SWITCHED_OFF in line:
                    self.take_faults(self.board.ask("faults"), time_s)
                continue
            good = check.feed(line) if line else []
            self.got.dropped = check.dropped
            if check.restarted:
                raise WorkError("the board has started again")
            no_rows = 0 if good else no_rows + bool(line)
            if no_rows > SILENT_S * hz:
                raise WorkError(f"{self.board.port}: {no_rows} lines in a row that are no rows of its telemetry")
            for row in good:
                first_s = row.time_s if math.isnan(first_s) else first_s
                if row.time_s - first_s > duration_s:
                    return
                self.sink.row(row)
                before, time_s = state, row.time_s
                state = dict(zip(names, row.text.split(","), strict=True)).get("state", state)
                if state != before:
                    self.take_faults(self.board.ask("faults"), time_s)
                say(self.sink.rows, time_s - first_s)
                while steps and (steps[0].at_s or 0.0) <= time_s - first_s:
                    self.send(steps.pop(0))


class RowSink:
    """Rows on their way to the log, and comments between them.

    With `every_s`, rows that came faster become one: currents, voltages and the fan are means until the next one begins, as a
    log's inputs hold from its row on (the voltage is weighted with the current, so that their product is the mean power). A
    reading tells of the time before it, so they are means of the readings after the first, the next one's among them. The
    rest is that of the first. With thermometers, a row waits for the readings around it.
    """

    def __init__(self, log: LogFile, thermometers: Thermometers | None, every_s: float = 0.0) -> None:
        self.rows = 0
        self._log, self._thermometers, self._every_s = log, thermometers, every_s
        self._names: list[str] = []
        self._springs: list[int] = []
        """Those with a thermometer."""
        self._bucket: list[Row] = []
        self._comments: list[str] = []
        """What came since the bucket's first row."""
        self._waiting: deque[tuple[str, float, list[str]]] = deque()

    def begin(self, names: Sequence[str]) -> None:
        """Write the header; a thermometer of a spring that the array has not is left out."""
        self._names = list(names)
        if self._thermometers:
            self._springs = [k for k in self._thermometers.springs if f"i{k}_a" in names]
            if not self._springs:
                raise WorkError("the thermometers are of no spring of this array: their columns are t1_c, t2_c, ...")
        self._log.write(",".join([*names, *(f"t{k}_c" for k in self._springs)]))

    def row(self, row: Row) -> None:
        """Take one row."""
        if self._thermometers:
            self._thermometers.row_came(row.time_s)
        if self._bucket and row.time_s - self._bucket[0].time_s < (1.0 - 0.5 / FINER) * self._every_s:
            self._bucket.append(row)
            return
        self._end_bucket([row])
        self._bucket = [row]
        if not self._every_s:
            self._end_bucket()
        self._write(row.time_s)

    def comment(self, text: str) -> None:
        """Take a comment: it comes after the rows that were taken before it."""
        if self._bucket:
            self._comments.append(text)
        elif self._waiting:
            self._waiting[-1][2].append(text)
        else:
            self._log.write(f"# {text}")

    def flush(self) -> None:
        """Write all that was taken, with the temperatures that have come."""
        self._end_bucket()
        self._write(math.inf)

    def _end_bucket(self, following: Sequence[Row] = ()) -> None:
        if self._bucket:
            first, *rest = self._bucket
            inputs = [*rest, *following] if rest else []
            text = mean_row(self._names, first.text, [one.text for one in inputs])
            self.rows += 1
            self._waiting.append((text, first.time_s, self._comments))
            self._bucket, self._comments = [], []

    def _write(self, now_s: float) -> None:
        """Write those whose temperatures are known, and those that have waited too long for them."""
        while self._waiting:
            text, time_s, comments = self._waiting[0]
            if self._thermometers:
                values = self._thermometers.at(time_s)
                if values is None and now_s - time_s < LONGEST_WAIT_S and not self._thermometers.trouble:
                    return
                text = ",".join([text, *(f"{values[k]:.3f}" if k in (values or {}) else "" for k in self._springs)])
            self._waiting.popleft()
            self._log.write_row(text)
            for one in comments:
                self._log.write(f"# {one}")


def mean_row(names: Sequence[str], first: str, rows: Sequence[str]) -> str:
    """Return the first row with the currents, voltages and fan that these rows mean; as it is where there are none."""
    if not rows:
        return first
    out = dict(zip(names, first.split(","), strict=True))
    columns = dict(zip(names, zip(*(row.split(",") for row in rows), strict=True), strict=True))
    for name in names:
        if name == "fan":
            out[name] = f"{np.array(columns[name], float).mean():.2f}"
        if match := re.fullmatch(r"i(\d+)_a", name):
            current = np.array(columns[name], float)
            out[name] = f"{current.mean():.4f}"
            if (voltage := f"v{match[1]}_v") in out:
                weights = current if current.sum() > 0 else None
                out[voltage] = f"{np.average(np.array(columns[voltage], float), weights=weights):.4f}"
    return ",".join(out.values())


@contextlib.contextmanager
def switched_off_after(board: Board, got: Recording) -> Iterator[None]:
    """Switch all off when the block ends, whatever ends it; `got` has why, and what is latched then."""
    try:
        yield
    except KeyboardInterrupt:
        pass
    except WorkError as error:
        got.ended = str(error)
    finally:
        if board.make_safe():
            with contextlib.suppress(WorkError):
                got.latched = board.ask("faults")
        else:
            got.ended = got.ended or f"{board.port}: the board does not answer"
            got.ended += "; the springs could not be switched off from here: cut their supply"


def about(port: str, by: str = "") -> dict[str, str]:
    """Return what a log says of itself first: when, where and by what it was recorded."""
    now = datetime.datetime.now(datetime.UTC)
    return {"recorded": f"{now:%Y-%m-%dT%H:%M:%SZ}", "port": port, "tool": f"ninespring {__version__}{by}"}


def write_head(board: Board, log: LogFile, keys: Mapping[str, str]) -> dict[str, str]:
    """Write, as comments, what is known of a log and of the board: version, faults, settings. Return the settings."""
    for name, value in keys.items():
        log.write(f"# {name}: {value}")
    for line in board.version:
        log.write(f"# version: {line}")
    for line in board.ask("faults") or ["none"]:
        log.write(f"# fault: {line}")
    settings = board.settings()
    for name, value in settings.items():
        log.write(f"# ${name}={value}")
    return settings


def write_end(log: LogFile, got: Recording) -> None:
    """Write, as comments, why a log ended and what the board had latched then."""
    if got.ended:
        log.write(f"# ended: {got.ended}")
    for line in got.latched:
        log.write(f"# latched at the end: {line}")
