"""What a calibration has done so far: one file in its folder, written whole after each step, from which it goes on."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ...errors import InputError
from ...io import results
from ...io.logs import read_bytes, sha256_of, write_atomically

FILE = "calibration.json"


class Progress:
    """The steps that are done, each with what was found, and the digests of the files that belong to them."""

    def __init__(self, folder: Path, options: Mapping[str, Any]) -> None:
        """Open a folder's progress, or begin it; `options` that were given (not None) must be those it was begun with."""
        self.folder = folder
        self._path = folder / FILE
        given = {name: value for name, value in options.items() if value is not None}
        if self._path.exists():
            self.data = self._read()
            begun = self.data["options"]
            other = [name for name, value in given.items() if begun.get(name) != value]
            if other:
                told = "; ".join(f"--{name.replace('_', '-')} was {begun.get(name)}" for name in other)
                raise InputError(
                    f"was begun otherwise: {told}. Leave that out to go on, or begin another folder", folder
                )
            self._check_files()
        else:
            self.data = results.plain(results.Calibrate(options=given, board={}, done={}, refused=""))

    def _read(self) -> dict[str, Any]:
        try:
            data = json.loads(read_bytes(self._path))
            results.read(results.Calibrate, data)
        except (ValueError, TypeError):
            raise InputError(
                "is no progress that `ninespring calibrate` wrote: give another folder", self._path
            ) from None
        return dict(data)

    def _check_files(self) -> None:
        for step in self.done.values():
            for name, digest in step.get("files", {}).items():
                path = self.folder / name
                if not path.is_file():
                    raise InputError("is gone, and the steps after it stand on it: begin another folder", path)
                if sha256_of(path) != digest:
                    raise InputError("is another one than was written here: begin another folder", path)

    @property
    def done(self) -> dict[str, Any]:
        """What was found, by step."""
        return dict(self.data["done"])

    def option(self, name: str) -> Any:
        """Return an option as it was begun with."""
        return self.data["options"][name]

    def board(self, version: list[str], settings: Mapping[str, str]) -> None:
        """Keep what the board was before anything was done to it."""
        self.data["board"] = {"version": version, "settings": dict(settings)}
        self._write()

    def keep(self, step: str, found: Mapping[str, Any], *files: str) -> None:
        """Keep what a step found, and the digests of its files (of all that belong to it)."""
        self.data["done"][step] = dict(found) | {"files": {name: sha256_of(self.folder / name) for name in files}}
        self._write()

    def refuse(self, why: str) -> None:
        """Keep why nothing is written to the board ('': nothing speaks against it)."""
        self.data["refused"] = why
        self._write()

    def text(self) -> str:
        """Return it as it is written."""
        results.read(results.Calibrate, self.data)
        return json.dumps(self.data, indent=1, allow_nan=False) + "\n"

    def _write(self) -> None:
        write_atomically({self._path: self.text()})
