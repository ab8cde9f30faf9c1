"""What a page may wish: one table, by which every wish is read before anything is done."""

from __future__ import annotations

import json
import re
from typing import Any

import jsonschema

from ..errors import InputError

LARGEST_ID = 2**53
OFF_LINE = re.compile(r"off\s+(all|\d{1,2})(\.0*)?", re.IGNORECASE)
"""An off that was typed is an off."""
SWITCHING = ("on", "off", "pattern", "clear", "selftest")
"""Words of the console that switch springs."""

_LEVEL = {"type": "integer", "minimum": 0, "maximum": 100, "description": "0 to 100 percent"}
_PATTERN = {"type": "string", "pattern": r"^[01]{1,64}\Z", "description": "0 and 1, one for each spring"}


def _number(low: float, high: float, unit: str = "") -> dict[str, Any]:
    description = f"a number from {low:g} to {high:g}{unit and ' ' + unit}"
    return {"type": "number", "minimum": low, "maximum": high, "description": description}


def _wish(**properties: Any) -> jsonschema.Draft202012Validator:
    return jsonschema.Draft202012Validator(
        {
            "properties": {"do": True, "id": True} | properties,
            "required": ["do", *properties],
            "additionalProperties": False,
        }
    )


WISHES = {
    **{
        name: _wish()
        for name in ("stop", "clear", "unlock", "cold", "record", "end_recording", "end_play", "settings", "pause")
    },
    "level": _wish(
        spring={"type": "integer", "minimum": 1, "maximum": 64, "description": "the number of a spring"}, level=_LEVEL
    ),
    "all": _wish(level=_LEVEL),
    "pattern": _wish(springs=_PATTERN),
    "play": _wish(
        patterns={
            "type": "array",
            "items": _PATTERN,
            "minItems": 1,
            "maxItems": 100,
            "description": "1 to 100 patterns",
        },
        seconds=_number(0.5, 3600, "s"),
    ),
    "policy": _wish(policy={"enum": ["open", "precompensate"], "description": "open or precompensate"}),
    "fan": _wish(percent=_LEVEL),
    "ambient": _wish(celsius=_number(-40, 85, "degC")),
    "set": _wish(
        name={"type": "string", "pattern": r"^[a-z0-9_]{1,40}\Z", "description": "the name of a setting"},
        value={
            "type": "string",
            "pattern": r"^-?[0-9]{1,9}(\.[0-9]{1,9})?\Z",
            "description": "a number with a point and without an exponent, as 0.006",
        },
    ),
    "say": _wish(
        line={
            "type": "string",
            "pattern": r"^[!-~][ -~]{0,62}\Z",
            "description": "one line of at most 63 plain characters",
        }
    ),
    "seek": _wish(time_s=_number(-1e9, 1e9, "s")),
    "speed": _wish(speed=_number(0.1, 1000)),
}
"""Everything that a page may wish, exactly; what is not one of these changes nothing."""


def _no_number(text: str) -> float:
    raise ValueError(text)


def read(text: str) -> tuple[int | None, dict[str, Any]]:
    """Return what came as a wish's id and its JSON object, not validated yet: so also a refusal finds its way."""
    try:
        wish = json.loads(text, parse_constant=_no_number)
    except (ValueError, RecursionError):
        wish = None
    if not isinstance(wish, dict):
        return None, {}
    number = wish.get("id")
    return (number if type(number) is int and 0 <= number <= LARGEST_ID else None), wish


def validated(wish: dict[str, Any]) -> dict[str, Any]:
    """Return a wish that is one of the table; InputError, in words that say what would be right, where it is none."""
    do = wish.get("do")
    if not isinstance(do, str) or do not in WISHES:
        raise InputError("not a wish that this page can have")
    if error := next(WISHES[do].iter_errors(wish), None):
        what = next((one for one in error.absolute_path if isinstance(one, str)), None)
        if what is None:
            raise InputError(f"not a wish that this page can have: {do} has {_names(do)}")
        shown = json.dumps(wish[what]) if not isinstance(wish[what], str) else f"'{wish[what]}'"
        described = WISHES[do].schema["properties"][what]["description"]
        raise InputError(f"{shown[:40]} is not {described}" if shown != "''" else f"nothing is not {described}")
    return _typed(wish["line"].strip()) if do == "say" else wish


def _typed(line: str) -> dict[str, Any]:
    """Return what a typed line is: what acts at once on the console does so here, and an off is an off."""
    if "!" in line:
        return {"do": "stop"}
    if "?" in line and line != "?":
        raise InputError("? acts at once, in the middle of a line, too: alone, please")
    if line.split()[0].lower() == "telemetry":
        raise InputError("the page needs the telemetry as it is")
    if off := OFF_LINE.fullmatch(line):
        if off[1].lower() == "all":
            return {"do": "all", "level": 0}
        if 1 <= int(off[1]) <= 64:
            return {"do": "level", "spring": int(off[1]), "level": 0}
    return {"do": "say", "line": line}


def _names(do: str) -> str:
    names = [one for one in WISHES[do].schema["required"] if one != "do"]
    return " and ".join(names) if names else "nothing with it"


def switches_off(wish: dict[str, Any]) -> bool:
    """Return whether a wish only switches off: such a one waits behind nothing."""
    do = wish["do"]
    return (do in ("level", "all") and wish["level"] == 0) or (do == "pattern" and "1" not in wish["springs"])


def drives(wish: dict[str, Any], spring: int | None = None) -> bool:
    """Return whether a wish may switch that spring (None: any)."""
    do = wish["do"]
    if do == "level":
        return spring is None or wish["spring"] == spring
    return do in ("all", "pattern") or (do == "say" and wish["line"].split()[0].lower() in SWITCHING)
