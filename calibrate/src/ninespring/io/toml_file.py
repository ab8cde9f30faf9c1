"""TOML files: read whole, or refused with line and column; and where in the file each value stands."""

from __future__ import annotations

import difflib
import functools
import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

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

    def get(self, at: At) -> Any:
        """Return the value there, None where there is none."""
        value: Any = self.data
        for step in at:
            value = value[step] if isinstance(step, int) else value.get(step)
            if value is None:
                return None
        return value

    def table(self, at: At, names: Iterable[str]) -> dict[str, Any]:
        """Return the table there ({} where there is none) that has no other keys than these."""
        where = f"[{'.'.join(str(one) for one in at if isinstance(one, str))}]" if at else "the file"
        table = self.get(at) if at else self.data
        if table is None:
            return {}
        if not isinstance(table, dict):
            raise self.refuse(f"{where} must be a table", at)
        known = list(names)
        for key in table:
            if key not in known:
                raise self.refuse(
                    f"{where} has no key '{key}'{did_you_mean(key, known)}; it has {', '.join(known)}", (*at, key), True
                )
        return table

    def values(
        self, at: At, numbers: Mapping[str, tuple[float, float]], words: Mapping[str, Sequence[str]] | None = None
    ) -> dict[str, Any]:
        """Return the table there: numbers within their limits, and keys whose value is one of some words."""
        words = words or {}
        where = f"[{'.'.join(map(str, at))}]"
        out = dict(self.table(at, (*numbers, *words)))
        for key, value in out.items():
            if key in numbers:
                out[key] = self.number((*at, key), *numbers[key], f"{where} {key}")
            elif value not in words[key]:
                has = f"{did_you_mean(str(value), words[key])}; it has {', '.join(words[key])}"
                raise self.refuse(f"{where} {key} has no '{value}'{has}", (*at, key))
        return out

    def tables(self, at: At) -> list[At]:
        """Return where the tables of a list stand."""
        many = self.get(at)
        if not isinstance(many, list | None):
            raise self.refuse(f"{at[-1]} must be a list", at)
        return [(*at, k) for k in range(len(many or []))]

    def need(self, at: At) -> Any:
        """Return the value there; refused where there is none."""
        value = self.get(at)
        if value is None:
            table = at[:-1]
            where = f"[{table[0]}]" if table else "the file"
            raise self.refuse(f"{where} is without {at[-1]}; add it", table)
        return value

    def text_at(self, at: At) -> str:
        """Return the text there."""
        value = self.need(at)
        if not isinstance(value, str):
            raise self.refuse(f"{at[-1]} must be text in quotes", at)
        return value

    def number(self, at: At, low: float, high: float, called: str = "") -> float:
        """Return the number there."""
        value = self.need(at)
        called = called or f"[{at[0]}] {at[-1]}"
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.refuse(f"{called} must be a number, without quotes", at)
        if not low <= value <= high:
            raise self.refuse(f"{called} is {value:g}; it must be {low:g} to {high:g}", at)
        return float(value)

    def whole(self, at: At, low: int, high: int) -> int:
        """Return the whole number there."""
        value = self.need(at)
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            raise self.refuse(f"[{at[0]}] {at[-1]} must be a whole number, {low} to {high}", at)
        return value


def did_you_mean(wrong: str, names: Iterable[str]) -> str:
    """Return ` (did you mean X?)`, or nothing where no name is near."""
    close = difflib.get_close_matches(wrong, list(names), 1)
    return f" (did you mean {close[0]}?)" if close else ""
