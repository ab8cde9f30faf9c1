"""Faults and limits in words (docs/codes.csv, docs/driving.md)."""

from __future__ import annotations

import re

ACTING = re.compile(r"<limits\|spring:(\d+)\|t:[\d.]+((?:\|[a-z]+)+)\|cut_a:([\d.]+)>")
"""What telemetry says of the limits that act on a spring: its number, their names, the current that they cut."""

SIGHT = re.compile(r"<sight\|spring:(\d+)\|t:[\d.]+\|[a-z_]+(?:\|[a-z_]+(?::-?[\d.]+)?)*>")
"""What telemetry says of a sight of a spring (`why` in docs/console.md): its number."""

FAULTS = {
    1: "current above over_current_a",
    2: "driven and no current: a broken spring or wire; or a sensor that hung while it was off; or no supply",
    3: "resistance below resistance_minimum_ohm",
    4: "resistance above resistance_maximum_ohm: a bad contact",
    5: "the current sensor does not acknowledge",
    6: "I2C bus stuck or timed out",
    7: "the current sensor finishes no conversions",
    8: "the current sensor lost its configuration and did not take it again",
    9: "the model or the power it was given makes it hotter than temperature_trip_c",
    10: "on for longer than maximum_on_s",
    11: "current in a spring that is off: cut the supply",
    12: "sum of currents above supply_limit_a",
    13: "stopped",
    14: "held at no current by a temperature limit for trip_time_s",
    15: "what its sensor reads cannot be the circuit of its output: frozen or swapped or of another shunt; or supply_v or the declared resistance is wrong; or the supply swings",
    16: "the host has been silent for host_timeout_s",
    17: "no current sensor answers and nothing shows that current is off: cut the supply",
}
LIMITS = {
    "safety": "off: a fault is latched",
    "current": "as much as one spring may have",
    "supply": "the supply gives no more",
    "temperature": "near its own temperature limit",
    "undriven": "a neighbour that is off would transform",
    "overload": "the supply has been overloaded for long",
    "trip": "off until cleared: held at no current for too long",
    "blind": "its resistance shows no phase",
    "cooling": "it may still be hot from before power-on: it waits",
    "away": "not where it was asked to be, or that cannot be seen",
}
STATES = {"ok": "ready", "locked": "locked after a reset: unlock it"}


def of_state(state: str) -> str:
    """Return the board's state in words."""
    if state.startswith("fault_") and state[6:].isdigit():
        return FAULTS.get(int(state[6:]), state.replace("_", " "))
    return STATES.get(state, state)
