"""A serial port, taken for this program alone: lines in, lines out, and one error for every way that it can go away."""

from __future__ import annotations

import errno
import os
import re
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import serial

from ..errors import InputError, WorkError

terminal_error: type[Exception]
try:
    from termios import error as terminal_error
except ImportError:  # Windows
    terminal_error = OSError

BAUD = 115200
LONGEST_LINE = 8192
"""Bytes: what is longer has no line ends and is no console."""
GONE = (serial.SerialException, OSError, terminal_error)
"""What pyserial raises when a cable is pulled; the error of termios is no OSError."""


class Port:
    """An open serial port, locked against a second program."""

    def __init__(self, name: str) -> None:
        """Open and lock the port; a Mega resets when it is opened."""
        self.name = name
        self._arrived = b""
        self._writes = threading.Lock()
        try:
            self._serial = serial.Serial(name, BAUD, timeout=0.1, write_timeout=2.0, exclusive=True)
        except (*GONE, ValueError) as error:
            if "exclusively lock" in str(error) or getattr(error, "errno", None) == errno.EBUSY:
                raise WorkError(f"{name}: another program has the port{_who_has(name)}: end it first") from None
            number = getattr(error, "errno", None)
            if number in (errno.EACCES, errno.EPERM):
                raise WorkError(f"{name}: this user may not open it: {_how_to_be_allowed(name)}") from None
            reason = os.strerror(number) if number else "not a serial port"
            raise WorkError(f"{name}: cannot be opened ({reason}): is it plugged in, is the port free?") from None

    @property
    def resets_the_board(self) -> bool:
        """Whether opening it pulled a modem line, which restarts a Mega; a pseudo-terminal has none."""
        try:
            _ = self._serial.cts
        except GONE:
            return False
        return True

    @contextmanager
    def _still_there(self) -> Iterator[None]:
        try:
            yield
        except GONE:
            raise WorkError(f"{self.name}: the board went away{_who_has(self.name)}") from None

    def read_line(self, until_s: float, stopped: Callable[[], bool] = lambda: False) -> str | None:
        """Return the next line without its end (an indent is part of it); None where none came until that monotonic time, or when stopped."""
        while b"\n" not in self._arrived:
            if len(self._arrived) > LONGEST_LINE:
                raise WorkError(f"{self.name}: {len(self._arrived)} bytes without a line end: this is no board")
            late = time.monotonic() >= until_s
            with self._still_there():
                waiting = self._serial.in_waiting
                if stopped() or (late and not waiting):  # what came while this program was held up has come
                    return None
                self._arrived += self._serial.read(max(1, waiting))
        line, _, self._arrived = self._arrived.partition(b"\n")
        return line.decode("ascii", "replace").rstrip()

    def write(self, text: str) -> None:
        """Send text as it is."""
        try:
            raw = text.encode("ascii")
        except UnicodeEncodeError:
            raise InputError(f"'{text.strip()}' is not plain ASCII") from None
        with self._writes, self._still_there():
            self._serial.write(raw)

    def close(self) -> None:
        """Close the port, whatever became of it."""
        with suppress(*GONE):
            self._serial.close()


def _how_to_be_allowed(name: str) -> str:
    """Return what gives a user the port: on Debian its group is dialout."""
    try:
        group = Path(name).group()
    except (OSError, KeyError, NotImplementedError):
        group = "dialout"
    if group == "root":
        return "only root may"
    return f"`sudo usermod --append --groups {group} $USER`, then log in again"


def pseudo_terminal(name: str) -> tuple[int, ...] | None:
    """Return which pseudo-terminal a name stands for, None where it is none or not there.

    Its number does not tell: once it is gone, the next one that anybody opens gets it. When it was made does, and so does a link that was made anew.
    """
    if Path(os.path.realpath(name)).parent != Path("/dev/pts"):
        return None
    try:
        link, tty = os.lstat(name), os.stat(name)
    except OSError:
        return None
    made_ns = link.st_mtime_ns if Path(name).is_symlink() else 0
    return tty.st_dev, tty.st_ino, tty.st_ctime_ns, link.st_ino, made_ns


def _who_has(name: str) -> str:
    """Return ` (program, pid)` of another process that has the port open, as far as this system tells.

    The one at the server's end of a pseudo-terminal is no other program: it is the board.
    """
    port = os.path.realpath(name)
    with suppress(OSError):
        for process in Path("/proc").glob("[0-9]*"):
            with suppress(OSError):
                other = int(process.name) != os.getpid() and port in map(_target, (process / "fd").iterdir())
                if other and not _serves(process, port):
                    return f" ({(process / 'comm').read_text().strip()}, pid {process.name})"
    return ""


def _serves(process: Path, port: str) -> bool:
    """Return whether a process has the server's end of a pseudo-terminal /dev/pts/N."""
    ends = (one for one in (process / "fd").iterdir() if _target(one).endswith("/ptmx"))
    told = "".join((process / "fdinfo" / one.name).read_text() for one in ends)
    return re.search(rf"^tty-index:\s*{Path(port).name}$", told, re.MULTILINE) is not None


def _target(link: Path) -> str:
    try:
        return os.readlink(link)
    except OSError:
        return ""
