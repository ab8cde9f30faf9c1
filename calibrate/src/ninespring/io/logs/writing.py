"""Text files: whole or not at all, their digests, and a log as text."""

from __future__ import annotations

import functools
import hashlib
import json
import os
import re
import secrets
from collections.abc import Mapping
from pathlib import Path

import click
import numpy as np

from ...errors import InputError, WorkError

STANDARD_OUTPUT = "-"
KEPT = "what was measured is never written over"


def sha256_of(path: str | Path) -> str:
    """Return the SHA-256 of a file, hexadecimal."""
    return hashlib.sha256(read_bytes(path)).hexdigest()


_OF_TOOL = re.compile(rb"(?:#[^\n]*\n)*?# tool: ninespring \S+ (predict|replay)\n")
_MARKS = (
    ("a model", re.compile(rb'schema = "ninespring\.model/')),
    ("settings", re.compile(rb"# from [^\n]*\n(?:#[^\n]*\n)*(?:\$|\Z)")),
    ("a plan", re.compile(rb"(?:#[^\n]*\n)*?# ninespring record --run ")),
    ("a scenario", re.compile(rb"; from [^\n]*, by `ninespring scenario`")),
    ("a report", re.compile(rb"<!doctype html>.*</main></body></html>\s*\Z", re.DOTALL)),
    ("a picture of a log", re.compile(rb"(?:\x89PNG|<\?xml|%PDF|GIF8).*[Mm]atplotlib", re.DOTALL)),
)
"""What this package derives from logs, and how each begins; a picture says in itself who drew it."""


def kind_of(data: bytes) -> str | None:
    """Return what a file is that can be derived again; None where it is nothing such: measured, or somebody's own."""
    for kind, mark in _MARKS:
        if mark.match(data):
            return kind
    if found := _OF_TOOL.match(data):
        return f"what {found[1].decode()} wrote"
    if data.lstrip().startswith(b"{"):
        try:
            schema = json.loads(data).get("schema", "")
        except (ValueError, AttributeError):
            return None
        return f"a {schema} result" if str(schema).startswith("ninespring.") else None
    return None


def _refuse_to_lose(path: Path, new: bytes | None = None, measured: bool = False) -> None:
    """Refuse a file whose content would be lost: one that was measured or is somebody's own, or is derived otherwise.

    `new`: what would take its place, None where that is not known yet.
    """
    if not path.is_file() or path.stat().st_size == 0:
        return
    if measured:
        raise InputError(f"is there already, and {KEPT}: give another name, or --force", path)
    is_now = kind_of(read_bytes(path))
    if is_now is None:
        raise InputError("is there already, and not a result that ninespring can make again: give another name", path)
    if new is not None and (will_be := kind_of(new)) != is_now:
        raise InputError(
            f"is {is_now}, and {will_be or 'what was measured'} would take its place: give another name", path
        )


def check_folder(*paths: Path | None, measured: bool = False, force: bool = False) -> None:
    """Refuse output files that could not be written, or over which nothing may be, before any work is done.

    `measured`: what is written was measured, and takes the place of nothing. `force`: whatever is there may go.
    """
    for path in paths:
        if path is None or str(path) == STANDARD_OUTPUT:
            continue
        if not path.parent.is_dir():
            raise InputError(f"the folder {path.parent} does not exist: create it first", path)
        if path.is_dir():
            raise InputError("is a folder: name a file", path)
        if not os.access(Path(os.path.realpath(path)).parent, os.W_OK) and not _is_device(path):
            raise InputError(f"the folder {path.parent} cannot be written", path)
        if not force:
            _refuse_to_lose(path, measured=measured)


def _is_device(path: Path) -> bool:
    return path.exists() and not path.is_file()


def write_atomically(files: Mapping[Path, str | bytes], force: bool = False) -> None:
    """Write files whole or not at all: temporary files beside them, all of them renamed at the end.

    All that this package writes goes through here (a recording grows beside its name: LogFile). What is there already is
    replaced by its like alone: a model by a model, a picture of a log by another; anything else only by `force`. A link stays
    a link: the file that it leads to is written. What is no file (a device, a pipe) is written into, and `-` is standard
    output; both last, when nothing else can fail. WorkError with the file's name where the disk is full.
    """
    check_folder(*files, force=force)
    made: list[tuple[Path, Path]] = []
    whole = {path: text.encode() if isinstance(text, str) else text for path, text in files.items()}
    streams = {path: data for path, data in whole.items() if str(path) == STANDARD_OUTPUT or _is_device(path)}
    at: Path | None = None
    try:
        for path, data in whole.items():
            if path in streams:
                continue
            if not force:
                _refuse_to_lose(path, data)
            at, target = path, Path(os.path.realpath(path))
            temporary = target.with_name(f".{target.name}.{secrets.token_hex(4)}")
            made.append((temporary, target))
            with temporary.open("xb") as stream:
                stream.write(data)
        while made:
            at = made[0][1]
            os.replace(*made[0])
            made.pop(0)
        for at, data in streams.items():
            if str(at) == STANDARD_OUTPUT:
                click.echo(data.decode(), nl=False)
            else:
                at.write_bytes(data)
    except OSError as error:
        raise WorkError(f"{at}: cannot be written: {error.strerror}") from None
    finally:
        for temporary, _ in made:
            temporary.unlink(missing_ok=True)


PACKED = (b"PK\3\4", b"\x1f\x8b", b"BZh", b"\xfd7zXZ\0")
"""What a packed file begins with."""
_once = functools.cache(lambda path: Path(path).read_bytes())
"""What comes through a pipe, which can be read once, and is looked at several times."""


def read_bytes(path: str | Path) -> bytes:
    """Return the file's bytes, or refuse with what the system says."""
    try:
        return Path(path).read_bytes() if Path(path).is_file() else _once(str(path))
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", path) from None


def read_text(path: str | Path) -> str:
    """Return a text file, each line ended by a line feed; what is not UTF-8, with or without byte order mark, is refused."""
    raw = read_bytes(path)
    if raw.startswith(PACKED):
        raise InputError("is packed (.zip, .gz, .bz2, .xz, a spreadsheet's .xlsx): unpack it, or save it as CSV", path)
    if b"\0" in raw:
        kind = "UTF-16 text" if raw[:2] in (b"\xff\xfe", b"\xfe\xff") else "not a text file (it holds NUL bytes)"
        raise InputError(f"{kind}: save it as UTF-8 text", path, 1)
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        before = raw[: error.start].decode("utf-8-sig").rpartition("\n")[2]
        line = raw.count(b"\n", 0, error.start) + 1
        raise InputError("not UTF-8 text: save it as UTF-8", path, line, len(before) + 1) from None
    return text.replace("\r\n", "\n").replace("\r", "\n") if "\r" in text else text


def log_text(
    time_s: np.ndarray, columns: dict[str, np.ndarray], keys: dict[str, str] | None = None, decimals: int = 4
) -> str:
    """Return a log as text: `# key: value` lines, header, rows; NaN becomes an empty cell."""
    import pandas as pd

    frame = pd.DataFrame({"time_s": np.round(time_s, 6)} | columns)
    head = "".join(f"# {key}: {value}\n" for key, value in (keys or {}).items())
    return head + frame.to_csv(index=False, float_format=f"%.{decimals}f", lineterminator="\n")
