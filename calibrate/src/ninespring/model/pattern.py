"""Which springs are on, as the console and scenarios write it: `111101111`, of two layers `111101111/000010000`."""

from __future__ import annotations

from ..errors import InputError
from .models import Array
from .stiffness import LAYERS


def pattern_of(text: str, array: Array) -> list[bool]:
    """Return a pattern's springs, elongation first; refused as `ninespring-sim` refuses it."""
    parts = text.split("/")
    if len(parts) != array.layers:
        if array.layers == 1:
            raise InputError(f"pattern '{text}' is of {len(parts)} layers, the array has one")
        raise InputError(
            f"pattern '{text}' is of {len(parts)} layer{'s' * (len(parts) > 1)}, the array has two; "
            f"write elongation/stiffness, with {array.springs // 2} digits each"
        )
    for part, layer in zip(parts, LAYERS, strict=False):
        where = f"{layer} " if array.layers == 2 else ""
        if set(part) - {"0", "1"}:
            raise InputError(f"{where}pattern '{part}' holds something else than 0 and 1")
        if len(part) != array.rows * array.cols:
            raise InputError(f"{where}pattern has {len(part)} digits for {array.rows * array.cols} springs")
    return [one == "1" for part in parts for one in part]
