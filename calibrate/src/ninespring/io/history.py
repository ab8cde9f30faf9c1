"""What a board had before each upload, kept on this computer, so that the last one can be taken back."""

from __future__ import annotations

import datetime
import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import click
from serial.tools import list_ports

from .. import __version__
from ..errors import InputError, WorkError
from .board import Board, as_lines, send_settings, settings_that_differ
from .logs import read_bytes, write_atomically

HOME = "NINESPRING_HOME"
"""Environment variable: the folder in place of the usual one."""
HEAD = "# ninespring settings "
UNDONE = ".undone"


@dataclass(frozen=True)
class Entry:
    """What a board had before something was sent to it, and what was sent."""

    path: Path
    when: str
    by: str
    """Who sent it: `upload settings.txt`."""
    before: dict[str, str]
    sent: dict[str, str]

    def words(self, back: bool = False) -> list[str]:
        """Return what it changed, or what taking it back does, a line each."""
        pairs = {name: (self.before.get(name, "not there"), value) for name, value in self.sent.items()}
        return [
            f"${name}: {' -> '.join(reversed(pair) if back else pair)}"
            for name, pair in pairs.items()
            if name not in self.before or float(pair[0]) != float(pair[1])
        ]


def home() -> Path:
    """Return the folder of what is kept on this computer: console history, settings that boards had."""
    return Path(os.environ.get(HOME) or click.get_app_dir("ninespring"))


def of_board(port: str) -> Path:
    """Return a board's folder: by its USB serial number, so that another port is the same board; else by its port."""
    real = os.path.realpath(port)
    number = next((one.serial_number for one in list_ports.comports() if one.device in (port, real)), None)
    return home() / "settings" / re.sub(r"[^\w.-]+", "_", number or port).strip("_")


def keep(port: str, version: str, by: str, before: Mapping[str, str], sent: Mapping[str, str]) -> Path:
    """Keep what a board had; return where."""
    folder = of_board(port)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise WorkError(f"{folder}: cannot be made ({error.strerror}): {HOME}=FOLDER names another") from None
    when = datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    count = 1 + max((int(one.name[:4]) for one in folder.glob("[0-9][0-9][0-9][0-9]-*")), default=0)
    path = folder / f"{count:04d}-{when.replace(':', '')}.txt"
    lines = [
        f"{HEAD}{when}, before `{by}`",
        f"# board: {version}",
        f"# port: {port}",
        f"# tool: ninespring {__version__}",
    ]
    lines += [f"# sent ${name}={value}" for name, value in sent.items()]
    write_atomically({path: "\n".join([*lines, as_lines(before)])})
    return path


def entries(port: str) -> list[Entry]:
    """Return what is kept of a board and not taken back, oldest first."""
    return [_read(path) for path in sorted(of_board(port).glob("[0-9][0-9][0-9][0-9]-*.txt"))]


def _read(path: Path) -> Entry:
    text = read_bytes(path).decode("utf-8", "replace")
    head = re.match(rf"{HEAD}(\S+), before `(.*)`\n", text)
    if not head:
        raise InputError("is no settings that ninespring kept: remove it", path)
    pairs = lambda begins: dict(re.findall(rf"^{begins}\$(\w+)=(\S+)$", text, re.MULTILINE))  # noqa: E731
    return Entry(path, head[1], head[2], pairs(""), pairs("# sent "))


def send(
    board: Board, settings: Mapping[str, str], by: str, say: Callable[[str, int], None] = lambda line, count: None
) -> None:
    """Send settings to a board, read them back, save them; what it had before is kept."""
    before = board.settings()
    send_settings(board, settings, say=say)
    keep(board.port, board.version[0], by, before, settings)


def undo(board: Board) -> Entry:
    """Give a board back what it had before the last upload; the settings that were not sent then stay as they are.

    WorkError where nothing is kept of it, or where it has something else than was sent.
    """
    kept = entries(board.port)
    if not kept:
        raise WorkError(f"{board.port}: no upload to this board is kept on this computer ({of_board(board.port)})")
    last = kept[-1]
    now = board.settings()
    if other := settings_that_differ(last.sent, now):
        raise WorkError(
            f"the board has not what `{last.by}` sent on {last.when}: {'; '.join(other[:3])}. It is another board, or was set "
            f"since; {last.path} holds what was kept, `ninespring upload` takes it"
        )
    send_settings(board, {name: last.before[name] for name in last.sent if name in last.before})
    last.path.rename(last.path.with_suffix(UNDONE))
    return last
