"""The tables of parameters and effects that firmware, simulation and tools share (lib/parameters)."""

from __future__ import annotations

import ctypes
import functools
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeVar

from .native import fields_of, library

PARTS = ("model", "current", "safety", "policy", "board")
ACTS = ("array", "supply", "measurement")
_Row = TypeVar("_Row", bound=ctypes.Structure)


class _Parameter(ctypes.Structure):
    _fields_ = (
        ("name", ctypes.c_char * 40),
        ("unit", ctypes.c_char * 5),
        ("effect", ctypes.c_char_p),
        ("sentence", ctypes.c_char_p),
        ("minimum", ctypes.c_double),
        ("maximum", ctypes.c_double),
        ("default", ctypes.c_double),
        ("resolution", ctypes.c_double),
        ("part", ctypes.c_int),
        ("decimals", ctypes.c_int),
        ("id", ctypes.c_int),
        ("per_spring", ctypes.c_bool),
    )


class _Effect(ctypes.Structure):
    _fields_ = (
        ("name", ctypes.c_char_p),
        ("sentence", ctypes.c_char_p),
        ("not_on_chip", ctypes.c_char_p),
        ("acts", ctypes.c_int),
    )


@dataclass(frozen=True)
class Setting:
    """One row of parameters.def as the chip holds it; numbers are in `unit`."""

    name: str
    unit: str
    effect: str | None
    sentence: str
    minimum: float
    maximum: float
    default: float
    resolution: float
    part: str
    decimals: int
    id: int
    per_spring: bool


@dataclass(frozen=True)
class TableEffect:
    """One row of effects.def; `not_on_chip` says why, None where the chip carries the effect."""

    name: str
    sentence: str
    not_on_chip: str | None
    acts: str


def _rows(function: str, kind: type[_Row]) -> Iterator[_Row]:
    call = getattr(library(), function)
    call.restype = ctypes.c_bool
    call.argtypes = (ctypes.c_size_t, ctypes.POINTER(kind))
    row = kind()
    k = 0
    while call(k, ctypes.byref(row)):
        yield row
        k += 1


@functools.cache
def settings() -> dict[str, Setting]:
    """Return the chip's settings by name, in the order of `$$`."""
    rows = map(fields_of, _rows("table_parameter", _Parameter))
    return {one["name"]: Setting(**one | {"part": PARTS[one["part"]]}) for one in rows}


def setting(name: str) -> Setting | None:
    """Return the row of a setting as a board names it (`name`, or of one spring `name_3`), None where it is not known."""
    known, bare = settings(), re.sub(r"_\d+$", "", name)
    return known.get(name) or known.get(f"{bare}_K") or known.get(bare)


@functools.cache
def effects() -> dict[str, TableEffect]:
    """Return the effects by name, in the plant's order."""
    rows = map(fields_of, _rows("table_effect", _Effect))
    return {one["name"]: TableEffect(**one | {"acts": ACTS[one["acts"]]}) for one in rows}
