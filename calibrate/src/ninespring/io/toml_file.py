"""TOML files: read whole, or refused with line and column; and where in the file each value stands."""

from __future__ import annotations

import difflib
import functools
import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal, get_args, get_origin

import msgspec
from msgspec import Meta

from ..errors import DECIMAL_COMMA, InputError
from .logs import read_text

At = tuple[str | int, ...]
"""A value's way from the root: ("array", "rows"), ("parameter", 0, "value")."""

_TABLE = re.compile(r"\s*(\[\[?)\s*([^\[\]]+?)\s*\]")
_KEY = re.compile(r"""\s*(?P<key>[\w-]+|"[^"]*"|'[^']*')\s*=\s*""")


class TomlFile:
    """A TOML file: its data, and refusals that name the line and column of what they are about."""

    def __init__(self, path: str | Path) -> None:
        self.path = path
        try:
            self.text = read_text(path)
            self.data: dict[str, Any] = tomllib.loads(self.text)
        except tomllib.TOMLDecodeError as error:
            lines = self.text.split("\n")
            match = re.search(r"^(.*) \(at (?:line (\d+), column (\d+)|end of document)\)$", str(error))
            line, column = (int(match[2]), int(match[3])) if match and match[2] else (len(lines), len(lines[-1]) + 1)
            said = f"this is not TOML: {match[1] if match else error}"
            if re.search(r"=\s*-?\d+,\d", lines[line - 1]):
                said += f": {DECIMAL_COMMA}"
            raise InputError(said, path, line, column) from None

    @functools.cached_property
    def places(self) -> dict[At, tuple[int, int, int]]:
        """Of tables and keys: 1-based line, column of the name, column of the value."""
        found: dict[At, tuple[int, int, int]] = {}
        count: dict[str, int] = {}
        table: At = ()
        for number, line in enumerate(self.text.splitlines(), 1):
            if header := _TABLE.match(line):
                name = header[2]
                table = tuple(part.strip().strip("\"'") for part in name.split("."))
                if header[1] == "[[":
                    table = (*table, count.setdefault(name, 0))
                    count[name] += 1
                found.setdefault(table, (number, header.start(1) + 1, header.start(1) + 1))
            elif key := _KEY.match(line):
                at = (*table, key["key"].strip("\"'"))
                found.setdefault(at, (number, key.start("key") + 1, key.end() + 1))
        return found

    def place(self, at: At, name: bool = False, word: str = "") -> tuple[int, int]:
        """Return line and column of the value at `at` (`name`: of its key; `word`: where that stands in it)."""
        while at and at not in self.places:
            at = at[:-1]
        line, key, value = self.places.get(at, (1, 1, 1))
        for ahead, text in enumerate(self.text.splitlines()[line - 1 :] if word else ()):
            if (column := text.find(word, value - 1 if ahead == 0 else 0)) >= 0:
                return line + ahead, column + 1
        return line, key if name else value

    def refuse(self, message: str, at: At, name: bool = False, word: str = "") -> InputError:
        """Return a refusal at that place."""
        return InputError(message, self.path, *self.place(at, name, word))

    def read(self, kind: Any, at: At = (), called: str = "") -> Any:
        """Return what stands at `at`, where it is as `kind` says: Keys, a list of one kind, or a type that msgspec checks.

        Refused where it is otherwise; `called` is its name in a refusal.
        """
        value: Any = self.data
        for key in at:
            value = value[key]
        return self._read(kind, at, value, called)

    def _read(self, kind: Any, at: At, value: Any, called: str = "") -> Any:
        tables = [str(one) for one in at if isinstance(one, str)]
        if isinstance(kind, Keys):
            return self._table(kind, at, value, f"[{'.'.join(tables)}]" if at else "the file")
        if isinstance(kind, list):
            if not isinstance(value, list):
                raise self.refuse(f"{at[-1]} must be a list", at)
            return [self._read(kind[0], (*at, k), one) for k, one in enumerate(value)]
        try:
            return msgspec.convert(value, kind)
        except msgspec.ValidationError:
            where = f"[{'.'.join(tables[:-1])}] " if tables[1:] else ""
            raise self.refuse(f"{called or f'{where}{at[-1]}'} {_should_be(kind, value)}", at) from None

    def _table(self, keys: Keys, at: At, value: Any, where: str) -> dict[str, Any]:
        if not isinstance(value, dict):
            raise self.refuse(f"{where} must be a table", at)
        known = {key: keys.each for key in value} if keys.each else {**keys.must, **keys.may}
        for key in value:
            if key not in known:
                said = f"{where} has no key '{key}'{did_you_mean(key, known)}; it has {', '.join(known)}"
                raise self.refuse(said, (*at, key), True)
        for key in keys.must:
            if key not in value:
                raise self.refuse(f"{where} is without {key}; add it", at)
        return {key: self._read(known[key], (*at, key), one) for key, one in value.items()}


@dataclass(frozen=True)
class Keys:
    """What a table must have and may have, each with the kind of its value; `each`: any key, all of one kind."""

    may: Mapping[str, Any] = field(default_factory=dict)
    must: Mapping[str, Any] = field(default_factory=dict)
    each: Any = None


def number(low: float, high: float) -> Any:
    """Return the kind of a number within limits."""
    return Annotated[float, Meta(ge=low, le=high)]


def whole(low: int, high: int) -> Any:
    """Return the kind of a whole number within limits."""
    return Annotated[int, Meta(ge=low, le=high)]


def table(numbers: Mapping[str, tuple[float, float]], words: Mapping[str, Sequence[str]] | None = None) -> Keys:
    """Return the kind of a table that may have these numbers within their limits, and these keys of some words each."""
    kinds = {key: number(*limits) for key, limits in numbers.items()}
    return Keys(kinds | {key: Literal[tuple(names)] for key, names in (words or {}).items()})


def _should_be(kind: Any, value: Any) -> str:
    """Return what a value is, and what it should be, in words."""
    if get_origin(kind) is Literal:
        names = get_args(kind)
        return f"has no '{value}'{did_you_mean(str(value), names)}; it has {', '.join(names)}"
    base, limits = get_args(kind) or (kind, Meta())
    if base is int:
        return f"must be a whole number, {limits.ge} to {limits.le}"
    if base is not float:
        return f"must be {limits.description or 'text in quotes'}"
    if isinstance(value, bool) or not isinstance(value, int | float):
        return "must be a number, without quotes"
    shown = f"{value:g}" if isinstance(value, float) else str(value)[:20]  # a whole number may be beyond any float
    return f"is {shown}; it must be {limits.ge:g} to {limits.le:g}"


def did_you_mean(wrong: str, names: Iterable[str]) -> str:
    """Return ` (did you mean X?)`, or nothing where no name is near."""
    close = difflib.get_close_matches(wrong, list(names), 1)
    return f" (did you mean {close[0]}?)" if close else ""
