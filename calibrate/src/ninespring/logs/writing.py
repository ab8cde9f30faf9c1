"""Text files: whole or not at all, their digests, and a log as text."""

from __future__ import annotations

import hashlib
import os
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from ..errors import InputError

STANDARD_OUTPUT = "-"


def sha256_of(path: str | Path) -> str:
    """Return the SHA-256 of a file, hexadecimal."""
    digest = hashlib.sha256()
    with open(path, "rb") as stream:
        while block := stream.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


def check_folder(*paths: Path | None) -> None:
    """Refuse output files whose folder is not there or cannot be written, before any work is done."""
    for path in paths:
        if path is None or str(path) == STANDARD_OUTPUT:
            continue
        if not path.parent.is_dir():
            raise InputError(f"the folder {path.parent} does not exist: create it first", path)
        if not os.access(Path(os.path.realpath(path)).parent, os.W_OK) and not _is_device(path):
            raise InputError(f"the folder {path.parent} cannot be written", path)


def _is_device(path: Path) -> bool:
    return path.exists() and not path.is_file()


def write_atomically(files: Mapping[Path, str]) -> None:
    """Write text files whole or not at all: temporary files beside them, all of them renamed at the end.

    A link stays a link: the file that it leads to is written. What is no file (a device, a pipe) is written into, and
    `-` is standard output; both last, when nothing else can fail.
    """
    check_folder(*files)
    umask = os.umask(0)
    os.umask(umask)
    made: list[tuple[str, Path]] = []
    streams = {path: text for path, text in files.items() if str(path) == STANDARD_OUTPUT or _is_device(path)}
    try:
        for path, text in files.items():
            if path in streams:
                continue
            target = Path(os.path.realpath(path))
            handle, temporary = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.")
            made.append((temporary, target))
            with os.fdopen(handle, "w", encoding="utf-8", newline="\n") as stream:
                stream.write(text)
            os.chmod(temporary, 0o666 & ~umask)
        while made:
            os.replace(*made[0])
            made.pop(0)
    finally:
        for temporary, _ in made:
            os.unlink(temporary)
    for path, text in streams.items():
        if str(path) == STANDARD_OUTPUT:
            sys.stdout.write(text)
            sys.stdout.flush()
        else:
            with path.open("w", encoding="utf-8", newline="\n") as stream:
                stream.write(text)


def read_bytes(path: str | Path) -> bytes:
    """Return the file's bytes, or refuse with what the system says."""
    try:
        with open(path, "rb") as stream:
            return stream.read()
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", path) from None


def log_text(
    time_s: np.ndarray,
    columns: dict[str, np.ndarray],
    keys: dict[str, str] | None = None,
    decimals: int = 4,
) -> str:
    """Return a log as text: `# key: value` lines, header, rows; NaN becomes an empty cell."""
    frame = pd.DataFrame({"time_s": np.round(time_s, 6)} | columns)
    head = "".join(f"# {key}: {value}\n" for key, value in (keys or {}).items())
    return head + frame.to_csv(index=False, float_format=f"%.{decimals}f", lineterminator="\n")
