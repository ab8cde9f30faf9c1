"""The first power-up of a board as a conversation: each step says what to do, measures, and judges with numbers."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import jinja2
import msgspec
import numpy as np

from .. import __version__
from ..errors import InputError, RefusedError, WorkError
from . import results
from .board import Board, Reading, reading
from .logs import check_folder, write_atomically

DUMMY_OHM, DUMMY_TOLERANCE = 0.22, 0.15
"""A resistor of 5 %, two leads of 10 mohm, and the sensor's share."""
TEST_A = 1.5
LOW_PERCENT = 70
"""Of TEST_A: two currents tell the supply from the diode's drop. With less, a drop that nobody has declared takes all."""
TEST_S = 0.4
LOOP_OHM = 0.18
"""Of a stage beyond its load: shunt 0.10, inductor, switch and board 0.08 (docs/hardware.md)."""
ROWS_HZ = 25
NOTHING_A = 0.05
"""What a sensor shows of a channel that is off: its offset and noise are a few mA."""
QUIET_A = 0.01
SUPPLY_SHARE, DROP_V = 0.1, 0.15
"""What a board may differ from `supply_v` and `freewheel_v`."""
COLD_SHARE = (0.75, 1.6)
"""Of the declared resistance, as the board itself judges it (fault 15)."""
APART = 0.1
"""By which share a spring may differ from the others."""
HEATING_S, WARM_C = 12.0, 60.0
JUMPERS = ("GND", "V+", "SDA", "SCL")
PINS = (5, 2, 3, 6, 7, 8, 46, 45, 44)
"""The Mega's, of channels 1 to 9."""

Hands = Callable[[str], bool]
"""Asks whoever is at the bench, and waits: True where it is done, or so."""


class Step(msgspec.Struct):
    """What a step found: numbers as (what, value, what it should be), findings in words, none where all is well."""

    name: str
    numbers: list[tuple[str, str, str]] = []
    found: list[str] = []
    at: str = ""

    def tell(self, what: str, value: str, wanted: str) -> None:
        """Note a number."""
        self.numbers.append((what, value, wanted))

    @property
    def passed(self) -> bool:
        """Whether nothing was found."""
        return not self.found


class Kept(msgspec.Struct, kw_only=True, tag_field="schema", tag="ninespring.bringup/1"):
    """What lies beside the page: the steps that a conversation has done."""

    tool: str = results.TOOL
    steps: list[Step]


@dataclass(frozen=True)
class Driven:
    """One channel driven by itself at two currents, whatever stopped it: arrays (rows, springs), and of the settled rows."""

    current_a: np.ndarray
    settled: list[Reading]
    """At TEST_A; empty where nothing settled."""
    low: list[Reading]
    """At LOW_PERCENT of it."""
    faults: list[str]

    def mean(self, name: str, spring: int, low: bool = False) -> float:
        """Return a mean of that channel over the settled rows."""
        own = [float(getattr(one, name)[spring - 1]) for one in (self.low if low else self.settled)]
        return float(np.mean(own)) if own else 0.0

    def ohm(self, spring: int) -> float:
        """Return its resistance; NaN where nothing flows."""
        current = self.mean("current_a", spring)
        return self.mean("voltage_v", spring) / current if current > NOTHING_A else float("nan")

    def others(self, spring: int) -> set[int]:
        """Return the other springs that had a current."""
        flowing = np.flatnonzero(self.current_a.max(axis=0) > NOTHING_A) + 1
        return ({int(k) for k in flowing} | springs_with(self.faults, 11)) - {spring}

    def swapped_with(self, spring: int) -> int:
        """Return the channel whose sensor shows that one's current, 0 where none does in its place."""
        instead = self.current_a[:, spring - 1].max() < NOTHING_A
        return min(self.others(spring), default=0) if instead else 0


def springs_with(faults: Iterable[str], *numbers: int) -> set[int]:
    """Return the springs with one of these faults (left out: any), of the board's words."""
    told = (re.match(r"spring (\d+): fault (\d+)\b", one) for one in faults)
    return {int(one[1]) for one in told if one and (not numbers or int(one[2]) in numbers)}


def jumpers(spring: int) -> str:
    """Return the address of a spring's sensor and what its pads lead to."""
    return f"0x{0x3F + spring:02X} (A1 to {JUMPERS[(spring - 1) // 4]}, A0 to {JUMPERS[(spring - 1) % 4]})"


def tested_a(settings: Mapping[str, str]) -> float:
    """Return the current that this board's channels are tested with: TEST_A, or as much as one spring may have."""
    return min(TEST_A, float(settings["maximum_current_a"]))


def springs_of(board: Board) -> int:
    """Return how many springs the board is set for."""
    settings = board.settings()
    return int(settings["rows"]) * int(settings["columns"])


def rows(board: Board, seconds: float, line: str = "", early: list[Reading] | None = None) -> list[Reading]:
    """Return telemetry of so many of the board's seconds after a line was obeyed; what came before that goes to `early`."""
    names, out = board.telemetry(ROWS_HZ, again=True), []
    try:
        if line:
            board.ask(line)
            while (row := board.next_row(names, 0.0)) is not None:
                if early is not None:
                    early.append(reading(row))
        while (row := board.next_row(names, time.monotonic() + 5.0 * board.patience)) is not None:
            out.append(one := reading(row))
            if one.time_s - out[0].time_s >= seconds:
                return out
    finally:
        board.ask("telemetry off")  # its rate is given back at the end: what is driven goes off first
        while board.next_line(0.0) is not None:  # rows that came meanwhile are not the next one's
            pass
    raise WorkError(f"{board.port}: no telemetry came")


def clear(board: Board) -> None:
    """Forget faults: what was found before is told, and must not hinder what comes.

    A fault 11 or 15 of a spring that was cleared of one before stays until that has rested: the board says how long.
    """
    rests = [int(s) for one in board.ask("clear") for s in re.findall(r": clear again in (\d+) s$", one)]
    if rests:
        rows(board, max(rests) + 1)  # it counts whole turns
        board.ask("clear")


def make_ready(board: Board) -> None:
    """Forget faults and hold the supply."""
    clear(board)
    with suppress(RefusedError):  # a board without a cut-off
        board.ask("supply on")
    rows(board, 0.12)  # the relay


def drive(board: Board, spring: int, low: bool = True) -> Driven:
    """Drive one channel, first with LOW_PERCENT of TEST_A and then with it, and switch off."""
    make_ready(board)
    seen: list[Reading] = []
    first = rows(board, TEST_S, f"on {spring} {LOW_PERCENT}", seen) if low else []
    seen += first
    second: list[Reading] = []
    with suppress(RefusedError):  # it has its fault already
        second = rows(board, TEST_S, f"on {spring}", seen)
    faults = board.ask("faults")
    board.ask("off all")

    def settled(of: list[Reading]) -> list[Reading]:
        on = [one for one in of if one.duty[spring - 1] > 0.0]
        return on[len(on) // 2 :]

    return Driven(np.array([one.current_a for one in seen + second]), settled(second), settled(first), faults)


def judge_channel(spring: int, got: Driven) -> str:
    """Say what is wrong with a channel that was driven by itself, on a resistor of DUMMY_OHM; '': nothing is."""
    own = got.current_a[:, spring - 1]
    if other := got.swapped_with(spring):
        return swap(spring, other)
    if others := got.others(spring):
        return f"channels {spring} and {min(others)} are connected: {spring} is driven, and both sensors show current"
    if own.min() < -NOTHING_A or (own.max() < NOTHING_A and springs_with(got.faults, 15)):
        return (
            f"sensor {spring} is reversed: it shows {own.min():.3f} A. IN+ belongs at the inductor, IN- at the spring"
        )
    if own.max() < NOTHING_A:
        volt = max((float(one.voltage_v[spring - 1]) for one in got.settled), default=0.0)
        what = f"the gate's wire (D{PINS[spring - 1]}), its driver, the channel's fuse or the resistor"
        return f"no current in channel {spring} ({volt:.3f} V though it is driven): {what} is open"
    ohm = got.ohm(spring)
    share = ohm / DUMMY_OHM
    reads = f"channel {spring} reads {ohm:.3f} ohm"
    for factor, shunt in ((2.0, "R050"), (10.0, "R010"), (0.5, "R200")):
        if abs(share / factor - 1.0) < DUMMY_TOLERANCE:
            return (
                f"{reads}, {factor:g} times {DUMMY_OHM:g}: its shunt says {shunt}, not R100 (or another resistor is in)"
            )
    if not abs(share - 1.0) < DUMMY_TOLERANCE:
        within = f"{DUMMY_OHM:g} within {100 * DUMMY_TOLERANCE:.0f} %"
        return f"{reads}, not {within}: leads, crimps or another resistor"
    return ""


def swap(spring: int, other: int) -> str:
    """Say that two channels are swapped, and how to find out which way."""
    return (
        f"channels {spring} and {other} are swapped: {spring} is driven, and sensor {other} shows the current. Either their sensors' addresses or "
        f"their gates' wires: take resistor {spring} out and drive {spring} again. If the current stays, it is the gates"
    )


def which_swap(board: Board, spring: int, other: int, hands: Hands) -> str:
    """Find out which way two channels are swapped: by a resistor that is taken out."""
    board.ask("off all")
    if not hands(f"Channels {spring} and {other} are swapped. Take resistor {spring} out, to tell which way"):
        return swap(spring, other)
    got = drive(board, spring, low=False)
    stays = other in got.others(spring)
    make_ready(board)
    hands(f"Put resistor {spring} back")
    if stays:
        return (
            f"the gates' wires of channels {spring} and {other} are swapped: with resistor {spring} out, driving {spring} still sends current through "
            f"{other}. D{PINS[spring - 1]} belongs to channel {spring}, D{PINS[other - 1]} to {other}"
        )
    return (
        f"the addresses of sensors {spring} and {other} are swapped: with resistor {spring} out, no current is left. Sensor {spring} is "
        f"{jumpers(spring)}, sensor {other} {jumpers(other)}"
    )


def ask(step: Step, hands: Hands | None, what: str, question: str, wrong: str) -> None:
    """Ask what no sensor tells, where somebody is there to be asked; note the answer, and what is wrong where it is no."""
    answer = None if hands is None else hands(question)
    step.tell(what, "nobody was asked" if answer is None else "yes" if answer else "no", "yes")
    step.found += [wrong] * (answer is False)


def step_board(board: Board, step: Step, hands: Hands | None) -> None:
    """What it is, and whether it may drive."""
    with suppress(RefusedError):
        board.ask("unlock")
    step.numbers += [
        (("firmware", "start", "load")[k] if k < 3 else "", one, "") for k, one in enumerate(board.version)
    ]
    step.tell("fuses", "cannot be read over USB: a programmer reads them", "as docs/flashing.md has them")
    if "mega2560" not in board.version[0]:
        step.found.append(f"this is no Mega 2560: {board.version[0]}")


def step_sensors(board: Board, step: Step, hands: Hands | None) -> None:
    """Each address answers, and nothing flows."""
    springs = springs_of(board)
    clear(board)
    rows(board, 0.3)
    faults = board.ask("faults")
    bad, silent = springs_with(faults), springs_with(faults, 5)
    step.tell("sensors that answer", f"{springs - len(bad)}", f"{springs}")
    if any("fault 6 " in one for one in faults):
        step.found.append(
            "the bus hangs: SDA (D20) or SCL (D21) has no pull-up (4.7 k from each to 5 V), is held low, or the two are exchanged"
        )
        return
    if len(silent) == springs:
        step.found.append("no sensor answers: their 5 V, their ground, or SDA (D20) and SCL (D21) are not connected")
        return
    for k in range(1, springs + 1):
        step.tell(f"sensor {k}", "silent" if k in bad else "answers", jumpers(k))
    step.found += [f"sensor {k} does not answer at {jumpers(k)}: its jumpers, or its wires" for k in sorted(silent)]
    step.found += [one for one in faults if one.startswith("spring") and "fault 5 " not in one]
    if step.found:
        return
    still = np.array([one.current_a for one in rows(board, 1.0)])
    for what, values, most in (
        ("noise", still.std(axis=0), QUIET_A),
        ("current with nothing on", abs(still.mean(axis=0)), NOTHING_A),
    ):
        step.tell(f"{what}, the largest", f"{1e3 * values.max():.1f} mA", f"below {1e3 * most:.0f}")
        if values.max() > most:
            step.found.append(
                f"sensor {int(values.argmax()) + 1}: {what} is {1e3 * values.max():.0f} mA: its ground, long wires"
            )


def step_supply(board: Board, step: Step, hands: Hands | None) -> None:
    """The cut-off opens and closes by a word."""
    if float(board.settings().get("cut_off", 0)) == 0.0:
        step.tell("cut-off", "not fitted ($cut_off=0)", "fitted")
        return
    for word in ("off", "on"):
        clear(board)
        try:
            board.ask(f"supply {word}")
        except RefusedError as error:
            step.found.append(f"supply {word}: {error}")
            return
        rows(board, 0.5)
        said = re.search(r"supply:(\w+)", board.status())
        step.tell(f"after `supply {word}`", said[1] if said else "not told", word)
        if not said or said[1] != word:
            step.found.append(f"the supply is {said[1] if said else 'not told'} after `supply {word}`: see `faults`")
    question = "Did the relay click twice, and did a meter at STAGES show 0 V and then 5 V"
    wrong = "the relay does not follow: D12, the pump's diodes and capacitors, its transistor (docs/hardware.md)"
    ask(step, hands, "the relay's clicks, and 0 V and 5 V at STAGES", question, wrong)


def supply_and_drop(driven: list[tuple[int, Driven]]) -> tuple[float, float]:
    """Return the stages' supply and the diode's drop, V, by duty and current: duty supply - (1 - duty) drop = current (load + loop)."""
    left, right = [], []
    for k, one in driven:
        for low in (False, True):
            duty, current, volt = (one.mean(name, k, low) for name in ("duty", "current_a", "voltage_v"))
            if duty > 0.0 and current > NOTHING_A:
                left.append((duty, duty - 1.0))
                right.append(volt + current * LOOP_OHM)
    if len(right) < 2:
        return float("nan"), float("nan")
    (supply, drop), *_ = np.linalg.lstsq(np.array(left), np.array(right), rcond=None)
    return float(supply), float(drop)


def step_channels(board: Board, step: Step, hands: Hands | None) -> None:
    """Each channel by itself, on its resistor."""
    springs = springs_of(board)
    settings = board.settings()
    wanted_a = tested_a(settings)
    make_ready(board)
    rest = np.array([one.current_a for one in rows(board, 0.2)])
    for k in sorted(Driven(rest, [], [], board.ask("faults")).others(0)):
        step.found.append(
            f"current flows in channel {k} with everything off ({rest[:, k - 1].max():.2f} A): its switch is welded, or its gate is held high"
        )
    if step.found:
        return
    driven = [(k, drive(board, k)) for k in range(1, springs + 1)]
    for k, got in driven:
        own = [got.mean(name, k) for name in ("current_a", "voltage_v", "duty")]
        noise = 1e3 * float(np.std([one.current_a[k - 1] for one in got.settled] or [0.0]))
        text = f"{own[0]:.3f} A, {own[1]:.3f} V, {got.ohm(k):.3f} ohm, duty {own[2]:.3f}, noise {noise:.0f} mA"
        text = text if own[0] > NOTHING_A else "no current"
        step.tell(f"channel {k}", text, f"{wanted_a:g} A, {wanted_a * DUMMY_OHM:.3f} V, {DUMMY_OHM:g} ohm")
    if all(got.current_a.max() < NOTHING_A and not springs_with(got.faults, 11, 15) for _, got in driven):
        step.found.append(
            "no channel has current: the supply is off, its fuse is open, or the relay does not hold (D12 to the pump; docs/hardware.md)"
        )
        return
    told: set[int] = set()
    for k, got in driven:
        if k in told:  # from the other one's side
            continue
        told.add(other := got.swapped_with(k))
        if wrong := which_swap(board, k, other, hands) if other and hands else judge_channel(k, got):
            step.found.append(wrong)
    alike = {one.partition(" ohm, ")[2] for one in step.found}
    if len(step.found) == springs and len(alike) == 1 and alike != {""}:
        ohm = float(np.median([got.ohm(k) for k, got in driven]))
        step.found = [f"all channels read {ohm:.3f} ohm, {alike.pop()}"]
    whole = [(k, got) for k, got in driven if not judge_channel(k, got)]
    if not whole:
        return
    supply, drop = supply_and_drop(whole)
    declared, declared_drop = float(settings["supply_v"]), float(settings["freewheel_v"])
    step.numbers += [
        ("supply, by duty and current", f"{supply:.2f} V", f"{declared:.2f} V within {100 * SUPPLY_SHARE:.0f} %"),
        ("the diode's drop, likewise", f"{round(drop, 2) + 0.0:.2f} V", f"{declared_drop:.2f} V within {DROP_V:g}"),
    ]
    if abs(supply - declared) > SUPPLY_SHARE * declared:
        step.found.append(
            f"the stages have {supply:.2f} V, not {declared:.2f}: the supply, its wires, or the setting supply_v"
        )
    if abs(drop - declared_drop) > DROP_V:
        step.found.append(
            f"the diodes drop {drop:.2f} V, not {declared_drop:.2f}: `$freewheel_v={max(drop, 0.0):.2f}`, then `$save`"
        )
    if not step.found:  # what was found explains the faults
        step.found += [f"channel {k}: {one}" for k, got in whole for one in got.faults]
    make_ready(board)


def step_air(board: Board, step: Step, hands: Hands | None) -> None:
    """Fan and thermistor."""
    rows(board, 2.0, "fan 100")
    board.ask("fan 0")
    wrong = "the fan does not follow D11: its transistor, its own supply, its diode (docs/hardware.md)"
    ask(step, hands, "the fan blows", "Did the fan blow, and has it stopped", wrong)
    settings = board.settings()
    source, believed = settings["ambient_source"], float(settings["ambient_c"])
    board.ask("$ambient_source=1")
    try:
        air = rows(board, 0.2)[-1].ambient_c
        other = believed + (1.0 if believed < 20.0 else -1.0)  # within the limits of ambient_c
        board.ask(f"ambient {other:g}")  # where nothing is read, the setting is what is shown
        follows = abs(rows(board, 0.2)[-1].ambient_c - air - other + believed) < 0.2
    finally:
        board.ask(f"ambient {believed:g}")
        board.ask(f"$ambient_source={source}")
    if not follows:
        step.tell("thermistor", f"{air:.1f} degC", "as a thermometer says, within 2")
        if not 0.0 <= air <= 50.0:
            step.found.append(
                f"the thermistor says {air:.1f} degC: it is not 10 k at 25 degC, or its 10 k to 5 V is another one"
            )
        elif source == "0":
            step.tell("ambient_source", "0: it is not used", "1: `$ambient_source=1`, `$save`")
    else:
        step.tell("thermistor", "none is read", f"none, or one at A0 (`ambient_c` {believed:g} is believed)")
        if source != "0":
            step.found.append("no thermistor is read at A0: its wire is open or shorted, or `$ambient_source=0`")


def judge_spring(spring: int, got: Driven, declared_ohm: float) -> list[str]:
    """Say what is wrong with a cold spring."""
    if got.current_a[:, spring - 1].max() < NOTHING_A:
        return [f"no current in spring {spring}: it, a crimp or a lead is open"]
    ohm = got.ohm(spring)
    low, high = (declared_ohm * share for share in COLD_SHARE)
    if not low <= ohm <= high:
        outside = f"outside {low:.3f} to {high:.3f}: a crimp, or another wire: then set resistance_martensite_ohm"
        return [f"spring {spring} has {ohm:.3f} ohm cold, {outside}"]
    return [f"spring {spring}: {one}" for one in got.faults]


def step_one_spring(board: Board, step: Step, hands: Hands | None) -> None:
    """Spring 1: cold resistance, then one heating that stays below WARM_C."""
    make_ready(board)
    board.ask("learnt clear")  # of resistors
    board.ask("model cold")  # what this board has heated since power-on stays as warm as it is
    settings = board.settings()
    declared = float(settings["resistance_martensite_ohm"])
    got = drive(board, 1, low=False)
    step.tell("spring 1 cold", f"{got.ohm(1):.3f} ohm", f"{declared:.3f} ohm")
    step.found += judge_spring(1, got, declared)
    if step.found:
        return
    make_ready(board)
    seen = rows(board, 0.2, "on 1")
    begun = seen[0]
    while seen[-1].time_s < begun.time_s + HEATING_S and seen[-1].temperature_c[0] < WARM_C - 10.0:
        seen += rows(board, 0.5)
    faults = board.ask("faults")
    board.ask("off all")
    heat = [one for one in seen if one.current_a[0] > NOTHING_A]
    power = float(np.mean([one.current_a[0] * one.voltage_v[0] for one in heat] or [0.0]))
    seconds = seen[-1].time_s - begun.time_s
    ohms = np.array([one.voltage_v[0] / one.current_a[0] for one in heat][5:] or [float("nan")])
    wanted = tested_a(settings) ** 2 * declared
    step.numbers += [
        ("heated with", f"{power:.3f} W for {seconds:.1f} s", f"{wanted:.3f} W within a third"),
        (
            "warmer by, as the board reckons",
            f"{seen[-1].temperature_c[0] - begun.temperature_c[0]:.1f} K, to {seen[-1].temperature_c[0]:.1f} degC",
            f"{power * seconds / float(settings['heat_capacity_j_per_k']):.1f} K without losses; below {WARM_C:g} degC",
        ),
        ("resistance meanwhile", f"{ohms.min():.3f} to {ohms.max():.3f} ohm", "within 10 %"),
    ]
    step.found += [f"spring 1: {one}" if one.startswith("board") else one for one in faults]
    if not faults and not abs(power / wanted - 1.0) < 1 / 3:
        step.found.append(f"spring 1 gets {power:.3f} W, not {wanted:.3f}")
    if not ohms.max() < 1.1 * ohms.min():
        step.found.append(
            f"the resistance of spring 1 moves from {ohms.min():.3f} to {ohms.max():.3f} ohm: a crimp that is loose"
        )
    question = "Is spring 1 warm, and only spring 1 (a thermometer, or a hand near it)"
    ask(step, hands, "spring 1 is warm", question, "another spring is warm, or none: the springs' wires are exchanged")


def step_all_springs(board: Board, step: Step, hands: Hands | None) -> None:
    """Each spring's cold resistance, then all of them together."""
    settings, springs = board.settings(), springs_of(board)
    declared = float(settings["resistance_martensite_ohm"])
    driven = [(k, drive(board, k, low=False)) for k in range(1, springs + 1)]
    ohms = np.array([got.ohm(k) for k, got in driven])
    middle = float(np.nanmedian(ohms)) if np.isfinite(ohms).any() else float("nan")
    for k, got in driven:
        step.tell(f"spring {k} cold", f"{ohms[k - 1]:.3f} ohm", f"{declared:.3f} ohm; the others {middle:.3f}")
        wrong = judge_spring(k, got, declared)
        if not wrong and abs(ohms[k - 1] / middle - 1.0) > APART:
            wrong = [
                f"spring {k} has {ohms[k - 1]:.3f} ohm, the others {middle:.3f}: its crimps, its leads, or another length"
            ]
        step.found += wrong
    if step.found:
        return
    make_ready(board)
    together = rows(board, 3.0, "on all")
    faults = board.ask("faults")
    board.ask("off all")
    last = np.mean([one.current_a for one in together[-ROWS_HZ:]], axis=0)
    wanted_a = min(tested_a(settings), float(settings["supply_limit_a"]) / springs)
    step.tell(
        "all together", f"{last.sum():.2f} A, {last.min():.3f} to {last.max():.3f} A each", f"{wanted_a:.2f} A each"
    )
    step.found += faults
    if not faults and abs(last - wanted_a).max() > 0.1:
        k = int(abs(last - wanted_a).argmax())
        step.found.append(
            f"with all of them on, spring {k + 1} gets {last[k]:.3f} A, not {wanted_a:.2f}: the supply's wires"
        )


@dataclass(frozen=True)
class Deed:
    """A step: what it is called, what to do before it, and what it does."""

    title: str
    what: str
    do: Callable[[Board, Step, Hands | None], None]


STEPS = {
    "board": Deed("The Mega alone", "Flash the Mega; all else is unplugged but USB.", step_board),
    "sensors": Deed(
        "Sensors on the bus",
        "All sensors on SDA (D20) and SCL (D21), one pair of pull-ups, 5 V from the Mega; the stages' supply is off.",
        step_sensors,
    ),
    "supply": Deed(
        "The cut-off",
        "Supply on, its fuse in, the channels' fuses out. Listen for the relay, a meter at STAGES: off, half a second later on.",
        step_supply,
    ),
    "channels": Deed(
        "Resistors in the springs' places",
        f"Supply off, a resistor of {DUMMY_OHM:g} ohm and 10 W in each channel, all fuses in, supply on. "
        f"Each is driven by itself, with at most {TEST_A:g} A for a second. "
        "One that has current without a duty for the second time rests for up to a minute after it.",
        step_channels,
    ),
    "air": Deed("Fan and thermistor", "The fan blows for two seconds.", step_air),
    "spring": Deed(
        "One spring",
        f"Supply off, resistor 1 out, spring 1 in, as cold as the room, supply on. It is heated once, to less than {WARM_C:g} degC: a hand at the supply's switch.",
        step_one_spring,
    ),
    "springs": Deed(
        "All springs",
        "Supply off, all springs in, supply on. Each by itself, then all for three seconds.",
        step_all_springs,
    ),
}


def load(output: Path) -> dict[str, Step]:
    """Return the steps that an earlier conversation has done, from what lies beside its page."""
    kept = output.with_suffix(".json")
    check_folder(output, kept, force=True)
    if not kept.exists():
        if output.exists():
            raise InputError("this is not a page that bringup has begun: name another one", output)
        return {}
    try:
        before = results.read(Kept, kept.read_bytes())
    except msgspec.MsgspecError:
        raise InputError("this is no conversation that bringup has begun: name another page", kept) from None
    return {one.name: one for one in before.steps if one.name in STEPS}


def page(steps: dict[str, Step]) -> str:
    """Return bringup.html."""
    pages = jinja2.Environment(
        loader=jinja2.PackageLoader("ninespring.io"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
    )
    return pages.get_template("bringup.html").render(steps=steps, deeds=STEPS, version=__version__)


def save(output: Path, steps: dict[str, Step]) -> None:
    """Write the page and, beside it, what the next conversation goes on from."""
    kept = results.checked(Kept(steps=list(steps.values())))
    write_atomically({output: page(steps), output.with_suffix(".json"): kept}, force=True)


def do_step(board: Board, name: str, hands: Hands | None) -> Step:
    """Do one step, all springs off before and after it; settings that it needs are given back, and none is saved."""
    step = Step(name, at=time.strftime("%Y-%m-%d %H:%M"))
    settings = board.settings()
    board.ask("off all")
    board.ask("policy open")
    board.ask(f"$open_current_a={tested_a(settings)}")
    try:
        STEPS[name].do(board, step, hands)
    finally:
        board.ask("off all")
        for one in ("open_current_a", "policy"):
            board.ask(f"${one}={settings[one]}")
    return step


def converse(
    board: Board, output: Path, hands: Hands | None, say: Callable[[str], None] = print, again: str | None = None
) -> dict[str, Step]:
    """Go through the steps that were not right before; stop at the first in which something is wrong, or where `hands` says no.

    `again`: from that step on, though it was right. Without `hands` nobody is asked anything. Returns what is known now.
    """
    names = list(STEPS)
    if again is not None and again not in names:
        raise InputError(f"there is no step '{again}': {', '.join(names)}")
    done = load(output)
    if again is not None:
        done = {name: step for name, step in done.items() if names.index(name) < names.index(again)}
    for name in names:
        if name in done and done[name].passed:
            continue
        say(f"\n{STEPS[name].title}. {STEPS[name].what}")
        if hands is not None and not hands("Ready"):
            break
        step = done[name] = do_step(board, name, hands)
        save(output, done)
        for what, value, wanted in step.numbers:
            say(f"  {what}: {value}" + (f"   (should be {wanted})" if wanted else ""))
        if not step.passed:
            break
        say("  right")
    return done
