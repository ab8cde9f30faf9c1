"""What a page may wish: one table, by which every wish is read before anything is done."""

from __future__ import annotations

import json
import re
import typing
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from ..errors import InputError

LARGEST_ID = 2**53
OFF_LINE = re.compile(r"off\s+(all|\d{1,2})(\.0*)?", re.IGNORECASE)
"""An off that was typed is an off."""
SWITCHING = ("on", "off", "pattern", "clear", "selftest")
"""Words of the console that switch springs."""


def _number(low: float, high: float, unit: str = "") -> Any:
    description = f"a number from {low:g} to {high:g}{unit and ' ' + unit}"
    return Annotated[float, Meta(ge=low, le=high, description=description)]


def _text(pattern: str, description: str) -> Any:
    return Annotated[str, Meta(pattern=rf"^(?:{pattern})\Z", description=description)]


Level = Annotated[int, Meta(ge=0, le=100, description="0 to 100 percent")]
Spring = Annotated[int, Meta(ge=1, le=64, description="the number of a spring")]
Pattern = _text("[01]{1,64}", "0 and 1, one for each spring")
WISHES: dict[str, dict[str, Any]] = {
    **{name: {} for name in ("stop", "clear", "unlock", "cold", "record", "end_recording", "end_play", "settings")},
    "pause": {},
    "level": {"spring": Spring, "level": Level},
    "all": {"level": Level},
    "pattern": {"springs": Pattern},
    "play": {
        "patterns": Annotated[list[Pattern], Meta(min_length=1, max_length=100, description="1 to 100 patterns")],  # type: ignore[valid-type]
        "seconds": _number(0.5, 3600, "s"),
    },
    "policy": {"policy": Annotated[Literal["open", "precompensate"], Meta(description="open or precompensate")]},
    "fan": {"percent": Level},
    "set": {
        "name": _text("[a-z0-9_]{1,40}", "the name of a setting"),
        "value": _text(r"-?[0-9]{1,9}(\.[0-9]{1,9})?", "a number with a point and without an exponent, as 0.006"),
    },
    "say": {"line": _text("[!-~][ -~]{0,63}", "one line of at most 64 plain characters")},
    "seek": {"time_s": _number(-1e9, 1e9, "s")},
    "speed": {"speed": _number(0.1, 1000)},
}
"""Everything that a page may wish, exactly, and what goes with it; what is not one of these changes nothing."""


_KINDS = {
    do: msgspec.defstruct(do, [("do", str), *own.items(), ("id", Any, None)], forbid_unknown_fields=True)
    for do, own in WISHES.items()
}


def read(text: str) -> tuple[int | None, dict[str, Any]]:
    """Return what came as a wish's id and its JSON object, not validated yet: so also a refusal finds its way."""
    try:
        wish = msgspec.json.decode(text)
    except (msgspec.DecodeError, RecursionError):
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
    try:
        msgspec.convert(wish, _KINDS[do])
    except msgspec.ValidationError as error:
        where = re.search(r"`\$\.(\w+)", str(error))
        if not where:
            raise InputError(f"not a wish that this page can have: {do} has {_names(do)}") from None
        given = wish[where[1]]
        shown = "nothing" if given == "" else f"'{given}'" if isinstance(given, str) else json.dumps(given)
        raise InputError(f"{shown[:40]} is not {_described(WISHES[do][where[1]])}") from None
    return _typed(wish["line"].strip()) if do == "say" else wish


def _typed(line: str) -> dict[str, Any]:
    """Return what a typed line is: what acts at once on the console does so here, and an off is an off."""
    if "!" in line:
        return {"do": "stop", "supply": "!!" in line}
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
    return " and ".join(WISHES[do]) or "nothing with it"


def _described(kind: Any) -> str:
    return next(one.description for one in typing.get_args(kind) if isinstance(one, Meta))


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
