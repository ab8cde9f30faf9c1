"""The first power-up of a board as a conversation: each step says what to do, measures, and judges with numbers."""

from __future__ import annotations

import html
import json
import re
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from . import __version__
from .board import Board, Reading, reading
from .errors import InputError, RefusedError, WorkError
from .logs import write_atomically

DUMMY_OHM, DUMMY_TOLERANCE = 0.22, 0.15
"""A resistor of 5 %, two leads of 10 mohm, and the sensor's share."""
TEST_A = 1.0
TEST_S = 0.5
NOTHING_A = 0.05
"""What a sensor shows of a channel that is off: its offset and noise are a few mA."""
COLD_SHARE = (0.75, 1.6)
"""Of the declared resistance, as the board itself judges it (fault 15)."""
WARM_C = 60.0
SCHEMA = "ninespring.bringup/1"
JUMPERS = ("GND", "VS", "SDA", "SCL")


@dataclass
class Step:
    """What a step found: numbers as (what, value, what it should be), findings in words, none where all is well."""

    name: str
    title: str
    numbers: list[tuple[str, str, str]] = field(default_factory=list)
    found: list[str] = field(default_factory=list)
    at: str = ""

    @property
    def passed(self) -> bool:
        """Whether nothing was found."""
        return not self.found


@dataclass(frozen=True)
class Driven:
    """One channel driven by itself: means of the rows in which it was, arrays (springs,)."""

    current_a: np.ndarray
    voltage_v: np.ndarray
    duty: np.ndarray
    noise_a: float
    """Of that channel, from row to row."""
    faults: list[str]


def jumpers(spring: int) -> str:
    """Return the address of a spring's sensor and what its pads lead to."""
    return f"0x{0x3F + spring:02X}: A1 to {JUMPERS[(spring - 1) // 4]}, A0 to {JUMPERS[(spring - 1) % 4]}"


def make_ready(board: Board) -> None:
    """Forget faults and hold the supply: what the step before found is told, and must not hinder this one."""
    board.ask("clear")
    with suppress(RefusedError):  # a board without a cut-off
        board.ask("supply on")
    rows(board, 0.2)


def rows(board: Board, seconds: float, line: str = "") -> list[Reading]:
    """Return telemetry of so many of the board's seconds, from the moment that a line was obeyed."""
    names = next((one.split(",") for one in board.ask("telemetry csv 50") if one.startswith("time_s,")), [])
    if line:
        board.ask(line)
    out: list[Reading] = []
    until = time.monotonic() + 20.0
    while (text := board.next_line(until)) is not None:
        cells = text.split(",")
        if text[:1].isdigit() and len(cells) == len(names):
            out.append(reading(dict(zip(names, cells, strict=True))))
            if out[-1].time_s - out[0].time_s >= seconds:
                break
    board.ask("telemetry off")
    if not out:
        raise WorkError(f"{board.port}: no telemetry came")
    return out


def drive(board: Board, spring: int, seconds: float = TEST_S) -> Driven:
    """Drive one channel with TEST_A, and switch off."""
    make_ready(board)
    got = rows(board, seconds, f"on {spring}")
    faults = board.ask("faults")
    board.ask("off all")
    on = [one for one in got if one.duty[spring - 1] > 0.0][5:] or got  # without the current loop's rise
    mean = lambda name: np.mean([getattr(one, name) for one in on], axis=0)  # noqa: E731
    each = np.array([one.current_a[spring - 1] for one in on])
    return Driven(mean("current_a"), mean("voltage_v"), mean("duty"), float(np.std(np.diff(each)) / 2**0.5), faults)


def judge_channel(spring: int, got: Driven) -> list[str]:
    """Say what is wrong with a channel that was driven by itself, on a resistor of DUMMY_OHM."""
    own_a, own_v = float(got.current_a[spring - 1]), float(got.voltage_v[spring - 1])
    others = [k for k in range(1, len(got.current_a) + 1) if k != spring and abs(got.current_a[k - 1]) > NOTHING_A]
    stuck = [int(one) for fault in got.faults for one in re.findall(r"^spring (\d+): fault 11\b", fault)]
    others = sorted({*others, *(k for k in stuck if k != spring)})
    if others:
        other = others[0]
        return [
            f"channels {spring} and {other} are swapped: {spring} is driven, and sensor {other} shows the current. Either the sensors' addresses "
            f"({spring} is {jumpers(spring)}; {other} is {jumpers(other)}) or the wires to the gates. Pull resistor {spring}: if the current stays, it is the gates"
        ]
    if spring in stuck and not own_a < -NOTHING_A:
        return [f"current flows in {spring} that its duty does not give: its switch is welded or its gate is held high"]
    if own_a < -NOTHING_A:
        return [f"sensor {spring} is reversed: it shows {own_a:.3f} A. IN+ belongs at the inductor, IN- at the spring"]
    if own_a < NOTHING_A:
        what = (
            "the resistor or its wire"
            if own_v > 0.5
            else "the gate's wire or its driver, the channel's fuse, the resistor"
        )
        return [
            f"no current in {spring} ({1e3 * own_a:.0f} mA, {own_v:.3f} V, duty {got.duty[spring - 1]:.3f}): {what} is open"
        ]
    ohm = own_v / own_a
    share = ohm / DUMMY_OHM
    for factor, shunt in ((2.0, "R050"), (10.0, "R010"), (0.5, "R200")):
        if abs(share / factor - 1.0) < DUMMY_TOLERANCE:
            return [
                f"channel {spring} reads {ohm:.3f} ohm, {factor:g} times {DUMMY_OHM:g}: its shunt is {shunt}, not R100, or the resistor is another one"
            ]
    if abs(share - 1.0) > DUMMY_TOLERANCE:
        return [
            f"channel {spring} reads {ohm:.3f} ohm, not {DUMMY_OHM:g} within {100 * DUMMY_TOLERANCE:.0f} %: leads, crimps, or another resistor"
        ]
    if got.faults:
        return [f"channel {spring}: {one}" for one in got.faults]
    return []


def step_board(board: Board, step: Step) -> None:
    """What it is, and whether it may drive."""
    board.ask("unlock")
    step.numbers += [("version", one, "") for one in board.version]
    version = " ".join(board.version)
    if "mega2560" not in version:
        step.found.append(f"this is no Mega 2560: {version}")


def step_sensors(board: Board, step: Step) -> None:
    """Nine addresses answer."""
    board.ask("clear")
    rows(board, 0.3)
    faults = board.ask("faults")
    springs = int(board.settings()["rows"]) * int(board.settings()["columns"])
    silent = {int(k): int(number) for one in faults for k, number in re.findall(r"^spring (\d+): fault (\d+)", one)}
    step.numbers.append(("sensors that answer", f"{springs - len(silent)}", f"{springs}"))
    if len(silent) == springs:
        step.found.append(
            "no sensor answers: SDA (D20) or SCL (D21) is held low or has no pull-up (4.7 k from each to 5 V), or the sensors have no supply"
        )
        return
    step.found += [f"sensor {k} does not answer at {jumpers(k)}" for k, number in silent.items() if number in (5, 6)]
    step.found += [one for one in faults if one.startswith("spring") and not re.search(r"fault [56]\b", one)]
    noise = np.std([one.current_a for one in rows(board, 1.0)], axis=0)
    step.numbers.append(("noise at rest, mA, the largest", f"{1e3 * float(noise.max()):.1f}", "below 10"))
    if noise.max() > 0.01:
        step.found.append(f"sensor {int(noise.argmax()) + 1} is noisy: {1e3 * float(noise.max()):.0f} mA")


def step_supply(board: Board, step: Step) -> None:
    """The cut-off opens and closes by a word."""
    for word in ("off", "on"):
        try:
            board.ask("clear")
            board.ask(f"supply {word}")
        except RefusedError as error:
            step.found.append(f"supply {word}: {error}")
            return
        rows(board, 0.2)
        said = re.search(r"supply:(\w+)", board.status())
        step.numbers.append((f"after `supply {word}`", said[1] if said else "not said", word))
        if not said or said[1] != word:
            step.found.append(f"the supply is {said[1] if said else 'not told'} after `supply {word}`")


def step_channels(board: Board, step: Step) -> None:
    """Each channel by itself, on its resistor."""
    springs = int(board.settings()["rows"]) * int(board.settings()["columns"])
    told: set[str] = set()
    for k in range(1, springs + 1):
        got = drive(board, k)
        own_a, own_v = got.current_a[k - 1], got.voltage_v[k - 1]
        value = f"{own_a:.3f} A, {own_v:.3f} V, duty {got.duty[k - 1]:.3f}, noise {1e3 * got.noise_a:.1f} mA"
        step.numbers.append((f"channel {k}", value, f"{TEST_A:g} A, {TEST_A * DUMMY_OHM:.3f} V"))
        for one in judge_channel(k, got):
            pair = re.match(r"channels (\d+) and (\d+) are swapped", one)
            key = " ".join(sorted(pair.groups())) if pair else one
            if key not in told:
                step.found.append(one)
            told.add(key)
    make_ready(board)


def step_air(board: Board, step: Step) -> None:
    """Fan and thermistor."""
    board.ask("fan 100")
    now = rows(board, 0.3)[-1]
    board.ask("fan 0")
    step.numbers.append(("fan", f"{100 * now.fan:.0f} %", "100 %, and it blows"))
    step.numbers.append(("air", f"{now.ambient_c:.1f} degC", "as a thermometer says, within 3"))
    if not 0.0 <= now.ambient_c <= 50.0:
        step.found.append(f"the air is {now.ambient_c:.1f} degC: the thermistor is shorted, open or the wrong one")


def judge_spring(spring: int, got: Driven, declared_ohm: float) -> list[str]:
    """Say what is wrong with a cold spring."""
    own_a = float(got.current_a[spring - 1])
    if own_a < NOTHING_A:
        return [f"no current in spring {spring}: it, a crimp or a lead is open"]
    ohm = float(got.voltage_v[spring - 1]) / own_a
    low, high = (declared_ohm * share for share in COLD_SHARE)
    if not low <= ohm <= high:
        return [
            f"spring {spring} has {ohm:.3f} ohm cold, outside {low:.3f} to {high:.3f}: measure it, and set resistance_martensite_ohm"
        ]
    return [f"spring {spring}: {one}" for one in got.faults]


def step_one_spring(board: Board, step: Step) -> None:
    """Spring 1: cold resistance, then one heating below WARM_C."""
    declared = float(board.settings()["resistance_martensite_ohm"])
    got = drive(board, 1)
    step.numbers.append(
        ("spring 1 cold", f"{got.voltage_v[0] / max(got.current_a[0], 1e-3):.3f} ohm", f"{declared:.3f} ohm")
    )
    step.found += judge_spring(1, got, declared)
    if step.found:
        return
    make_ready(board)
    board.ask("model cold")
    first = rows(board, 0.1)[-1]
    board.ask("on 1")
    begun_s, last = first.time_s, first
    while last.time_s < begun_s + 15.0 and last.temperature_c[0] < WARM_C - 5.0:
        last = rows(board, 0.2)[-1]
    faults = board.ask("faults")
    board.ask("off all")
    rise = float(last.temperature_c[0] - first.temperature_c[0])
    step.numbers.append(
        (
            "spring 1 by the model",
            f"+{rise:.1f} K in {last.time_s - begun_s:.1f} s",
            f"below {WARM_C:g} degC; it is warm to a thermometer",
        )
    )
    if rise < 3.0:
        step.found.append(f"spring 1 warms by {rise:.1f} K only")
    step.found += faults


def step_all_springs(board: Board, step: Step) -> None:
    """Each spring's cold resistance."""
    declared = float(board.settings()["resistance_martensite_ohm"])
    springs = int(board.settings()["rows"]) * int(board.settings()["columns"])
    for k in range(1, springs + 1):
        got = drive(board, k)
        step.numbers.append(
            (
                f"spring {k} cold",
                f"{got.voltage_v[k - 1] / max(got.current_a[k - 1], 1e-3):.3f} ohm",
                f"{declared:.3f} ohm",
            )
        )
        step.found += judge_spring(k, got, declared)


STEPS: dict[str, tuple[str, str, Callable[[Board, Step], None]]] = {
    "board": (
        "The Mega alone",
        "Flash the Mega, leave all else unplugged but USB. Fuses cannot be read from here: pio run -t fuses, once.",
        step_board,
    ),
    "sensors": (
        "Sensors on the bus",
        "Nine sensors on SDA and SCL, one pair of pull-ups, the stages' supply still off.",
        step_sensors,
    ),
    "supply": (
        "The cut-off",
        "Supply on, fuses in, nothing at the stages. The relay must click twice; a meter at STAGES shows 0 V, then 5 V.",
        step_supply,
    ),
    "channels": (
        "Nine resistors",
        f"A resistor of {DUMMY_OHM:g} ohm and 10 W in place of each spring: each is driven alone with {TEST_A:g} A for {TEST_S:g} s.",
        step_channels,
    ),
    "air": ("Fan and thermistor", "The fan must blow for a moment.", step_air),
    "spring": (
        "One spring",
        "Supply off, resistor 1 out, spring 1 in, supply on. A hand at the supply's switch.",
        step_one_spring,
    ),
    "springs": ("All springs", "The same with the other eight.", step_all_springs),
}


def load(path: Path) -> dict[str, Step]:
    """Return the steps that an earlier conversation has done."""
    if not path.exists():
        return {}
    try:
        kept = json.loads(path.read_text(encoding="utf-8"))
        if kept["schema"] != SCHEMA:
            raise ValueError
        return {one["name"]: Step(**one | {"numbers": [tuple(row) for row in one["numbers"]]}) for one in kept["steps"]}
    except (ValueError, KeyError, TypeError):
        raise InputError("this is no conversation that bringup has begun: name another page", str(path)) from None


def page(steps: dict[str, Step]) -> str:
    """Return bringup.html."""
    e = html.escape
    parts = []
    for name, (title, what, _) in STEPS.items():
        step = steps.get(name)
        state = "not done" if not step else "right" if step.passed else "wrong"
        parts.append(f"<h2>{e(title)}: <span class={state.split()[0]}>{state}</span></h2><p>{e(what)}</p>")
        if step:
            parts += [f"<p class=wrong>{e(one)}</p>" for one in step.found]
            body = "".join("<tr>" + "".join(f"<td>{e(cell)}</td>" for cell in row) + "</tr>" for row in step.numbers)
            parts.append(
                f"<table><tr><th>what</th><th>found</th><th>should be</th></tr>{body}</table><p><small>{e(step.at)}</small></p>"
            )
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">'
        "<title>First power-up</title><style>:root{color-scheme:light dark}body{font:16px/1.5 system-ui,sans-serif;max-width:56rem;margin:2rem auto;"
        "padding:0 1rem}table{border-collapse:collapse;font-size:14px;display:block;overflow-x:auto}td,th{padding:.2rem .6rem;text-align:left;"
        "border-bottom:1px solid #8884}.right{color:#2a8a3e}.wrong{color:#d03b2a}</style>"
        f"<h1>First power-up</h1><p>ninespring {e(__version__)}</p>{''.join(parts)}</html>\n"
    )


def save(output: Path, steps: dict[str, Step]) -> None:
    """Write the page and, beside it, what the next conversation goes on from."""
    kept = {"schema": SCHEMA, "tool": f"ninespring {__version__}", "steps": [asdict(one) for one in steps.values()]}
    write_atomically({output: page(steps), output.with_suffix(".json"): json.dumps(kept, indent=1) + "\n"}, force=True)


def prepared(board: Board) -> dict[str, str]:
    """Set what the measurements need; return what it was."""
    was = {name: board.settings()[name] for name in ("open_current_a", "policy")}
    board.ask("off all")
    board.ask("policy open")
    board.ask(f"$open_current_a={TEST_A}")
    return was


def given_back(board: Board, was: dict[str, str]) -> None:
    """Give back what `prepared` has changed; nothing is saved."""
    for name, value in was.items():
        board.ask(f"${name}={value}")


def do_step(board: Board, name: str) -> Step:
    """Do one step, all springs off before and after it."""
    step = Step(name, STEPS[name][0], at=time.strftime("%Y-%m-%d %H:%M"))
    STEPS[name][2](board, step)
    board.ask("off all")
    return step
