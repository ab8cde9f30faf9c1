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
        if path is None:
            continue
        if not path.parent.is_dir():
            raise InputError(f"the folder {path.parent} does not exist: create it first", path)
        if not (path.exists() and not path.is_file()) and not os.access(path.parent, os.W_OK):
            raise InputError(f"the folder {path.parent} cannot be written", path)


def write_atomically(files: Mapping[Path, str]) -> None:
    """Write text files whole or not at all: temporary files beside them, all of them renamed at the end.

    Where a path is a link, what it points to is replaced, not the link. A device or a pipe is written as it is, `-` is
    standard output.
    """
    places = {path: path if str(path) == "-" or not path.is_symlink() else path.resolve() for path in files}
    check_folder(*places.values())
    umask = os.umask(0)
    os.umask(umask)
    made: list[tuple[str, Path]] = []
    try:
        for path, text in files.items():
            place = places[path]
            if str(place) == "-":
                sys.stdout.write(text)
                sys.stdout.flush()
                continue
            if place.exists() and not place.is_file() and not place.is_dir():
                with open(place, "w", encoding="utf-8", newline="\n") as stream:
                    stream.write(text)
                continue
            handle, temporary = tempfile.mkstemp(dir=place.parent, prefix=f".{place.name}.")
            made.append((temporary, place))
            with os.fdopen(handle, "w", encoding="utf-8", newline="\n") as stream:
                stream.write(text)
            os.chmod(temporary, 0o666 & ~umask)
        while made:
            os.replace(*made[0])
            made.pop(0)
    finally:
        for temporary, _ in made:
            os.unlink(temporary)


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
