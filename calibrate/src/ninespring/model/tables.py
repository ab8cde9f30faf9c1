"""The tables of parameters and effects that firmware, simulation and tools share (lib/parameters)."""

from __future__ import annotations

import ctypes
import functools
import itertools
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from .native import fields_of, library, structure

PARTS = ("model", "current", "safety", "policy", "board")
ACTS = ("array", "supply", "measurement")


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


def _rows(function: str, kind: type[ctypes.Structure]) -> Iterator[dict[str, Any]]:
    call, row = getattr(library(), function), kind()
    call.restype = ctypes.c_bool
    call.argtypes = (ctypes.c_size_t, ctypes.POINTER(kind))
    for k in itertools.count():
        if not call(k, ctypes.byref(row)):
            return
        yield fields_of(row)


@functools.cache
def settings() -> dict[str, Setting]:
    """Return the chip's settings by name, in the order of `$$`."""
    rows = _rows(
        "table_parameter", structure(Setting, name=ctypes.c_char * 40, unit=ctypes.c_char * 5, part=ctypes.c_int)
    )
    return {one["name"]: Setting(**one | {"part": PARTS[one["part"]]}) for one in rows}


def setting(name: str) -> Setting | None:
    """Return the row of a setting as a board names it (`name`, or of one spring `name_3`), None where it is not known."""
    known, bare = settings(), re.sub(r"_\d+$", "", name)
    return known.get(name) or known.get(f"{bare}_K") or known.get(bare)


@functools.cache
def effects() -> dict[str, TableEffect]:
    """Return the effects by name, in the plant's order."""
    rows = _rows("table_effect", structure(TableEffect, acts=ctypes.c_int))
    return {one["name"]: TableEffect(**one | {"acts": ACTS[one["acts"]]}) for one in rows}
