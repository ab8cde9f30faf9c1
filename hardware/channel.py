"""One of the nine channels in ngspice: switch, driver, inductor, diode, shunt, spring, supply and its wires.

What docs/hardware.md and sim_host/electrics claim of current, ripple, heat and loss is printed from here:

    .venv/bin/python hardware/channel.py              # every table, some seconds each
    .venv/bin/python hardware/channel.py --write      # into docs/hardware-figures.md

Values and ratings of the parts come from hardware/parts.toml. Needs `ngspice` on the PATH (script/setup installs it on Debian).
"""

from __future__ import annotations

import argparse
import dataclasses
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
PAGE = HERE.parent / "docs" / "hardware-figures.md"
PARTS = tomllib.loads((HERE / "parts.toml").read_text(encoding="utf-8"))
PERIOD_S = 50e-6  # 20 kHz: firmware/board_mega.c, 800 steps of 16 MHz
STEPS = 800
CONVERSION_S = 532e-6  # of an INA219, 12 bit: data sheet SBOS448, table 5
SETTLED_S = 4e-3  # sixteen time constants of the inductor
MARTENSITE_OHM, AUSTENITE_OHM = 0.175, 0.219


@dataclasses.dataclass(frozen=True)
class Channel:
    """What is simulated: a duty, a spring, the others that load the same supply, and what is broken."""

    duty: float = 0.1
    spring_ohm: float = MARTENSITE_OHM
    supply_v: float = 5.0
    others: int = 0  # channels of the same duty, switched by the same clock
    welded: bool = False
    diode_open: bool = False
    gate_floats: bool = False
    saturates_at_a: float = PARTS["inductor"]["saturation_a"]
    off_at_s: float | None = None  # the duty is 0 from there on


@dataclasses.dataclass(frozen=True)
class Waves:
    """Node voltages (V) and branch currents (A) over time (s), all of shape (samples,)."""

    time_s: np.ndarray
    supply_v: np.ndarray  # at the channel's switch
    switch_v: np.ndarray  # switch, diode and inductor
    bus_v: np.ndarray  # INA219, IN- to ground: the spring with its leads
    spring_v: np.ndarray  # of the spring alone
    current_a: np.ndarray  # of inductor, shunt and spring
    switch_a: np.ndarray
    diode_a: np.ndarray
    drawn_a: np.ndarray  # from the supply's terminals, all channels
    capacitor_a: np.ndarray

    def mean(self, values: np.ndarray, begin_s: float, end_s: float) -> float:
        """Mean of values between two times, by the trapezoidal rule on the simulator's own steps."""
        inside = (self.time_s >= begin_s) & (self.time_s <= end_s)
        time, part = self.time_s[inside], values[inside]
        return float(np.trapezoid(part, time) / (time[-1] - time[0]))

    def last(self, values: np.ndarray, periods: int = 20) -> float:
        """Mean over the last whole periods."""
        end_s = float(self.time_s[-1])
        return self.mean(values, end_s - periods * PERIOD_S, end_s)


def netlist(c: Channel, length_s: float, data: Path) -> str:
    """Return the channel as ngspice reads it; its waves are written to data."""
    p = PARTS
    high_s = c.duty * PERIOD_S
    # high: the driver's input; the driver inverts, the P-channel switch conducts while its gate is low
    gate = f"PULSE(0 5 0 5n 5n {max(high_s - 5e-9, 1e-9):.6g} {PERIOD_S:.6g})" if c.duty > 0 else "DC 0"
    pin = "" if c.gate_floats else f"Vpin pinsource 0 {gate}\nRpin pinsource pin 25\n"
    if c.off_at_s is not None:
        pin = (
            f"Vpin pinsource 0 {gate}\nBpin pingated 0 V = time < {c.off_at_s:.6g} ? v(pinsource) : 0\n"
            "Rpin pingated pin 25\n"
        )
    welded = "Rweld supply switched 5m\n" if c.welded else ""
    diode = "" if c.diode_open else "Vdiode 0 anode 0\nDfree anode switched schottky\n"
    clamp = "Davalanche switched supply avalanche\n" if c.diode_open else ""
    others = f"Fothers supply 0 Vswitch {c.others}\nFback 0 supply Vreturn 0\nVreturn dummy 0 0\nRdummy dummy 0 1\n"
    return f"""* one channel of nine
Vsupply terminals 0 {c.supply_v}
Vdrawn terminals wire 0
Rwire wire wirein {p["supply_wire"]["ohm"] + p["supply"]["ohm"] + p["channel_fuse"]["ohm"] / (1 + c.others)}
Lwire wirein supply {p["supply_wire"]["henry"]} ic=0
Vcapacitor supply capacitor 0
Cbulk capacitor bulk {2 * p["bulk_capacitor"]["farad"]} ic={c.supply_v}
Rbulk bulk 0 {p["bulk_capacitor"]["ohm"] / 2}
Vswitch supply source 0
Mswitch switched gate source source pswitch
{welded}{pin}Rpull pin 0 {p["gate_resistor"]["ohm"]}
* the driver: an inverter with hysteresis' middle as its threshold, and a source resistance
Bdriver driven 0 V = v(pin) > {p["driver"]["threshold_v"]} ? 0 : v(supply)
Rdriver driven drive {p["driver"]["ohm"]}
Rgate drive gate {p["series_gate_resistor"]["ohm"]}
{diode}{clamp}Vinductor switched winding 0
Rwinding winding core {p["inductor"]["ohm"]}
Lmain core shunt0 L='{p["inductor"]["henry"]}*(0.1+0.9/(1+pow(abs(i(Vinductor))/{c.saturates_at_a}, 8)))'
Rshunt shunt0 bus {p["shunt"]["ohm"]}
Rleads bus springend {p["spring_leads"]["ohm"] / 2}
Rspring springend springfar {c.spring_ohm}
Rback springfar 0 {p["spring_leads"]["ohm"] / 2}
{others}.model pswitch VDMOS(pchan Vto=-1.6 Kp={p["switch"]["kp"]} Rd={p["switch"]["drain_ohm"]} Rs=1m Rg=2 Cgdmax=0.6n Cgdmin=0.1n Cgs=1.2n a=0.4 Cjo=0.5n Is=1p Rb=10m)
.model schottky D(Is={p["diode"]["saturation_a"]} N={p["diode"]["emission"]} Rs={p["diode"]["ohm"]} Cjo=0.4n M=0.5)
.model avalanche D(Is=1p BV=30 Ibv=1m Rs=0.1)
.options reltol=1e-4 abstol=1e-6 vntol=1e-5 method=gear maxord=2
.control
set wr_singlescale
set numdgt=7
option noinit
tran 0.1u {length_s:.6g} 0 0.5u uic
wrdata {data} v(supply) v(switched) v(bus) v(springend) v(springfar) i(Vinductor) i(Vswitch) {"i(Vdiode)" if not c.diode_open else "i(Vreturn)"} i(Vdrawn) i(Vcapacitor)
.endc
.end
"""


def simulate(channel: Channel, length_s: float = SETTLED_S) -> Waves:
    """Run ngspice. RuntimeError with its last lines where it fails; FileNotFoundError where it is not there."""
    if shutil.which("ngspice") is None:
        raise FileNotFoundError("ngspice is not on the PATH: script/setup installs it on Debian and Ubuntu")
    with tempfile.TemporaryDirectory() as folder:
        data = Path(folder) / "waves.txt"
        deck = Path(folder) / "channel.cir"
        deck.write_text(netlist(channel, length_s, data), encoding="utf-8")
        done = subprocess.run(["ngspice", "-b", str(deck)], capture_output=True, text=True, check=False)
        if not data.is_file():
            raise RuntimeError("ngspice: " + " / ".join((done.stdout + done.stderr).strip().splitlines()[-6:]))
        columns = np.loadtxt(data).T
    time, supply, switched, bus, near, far, current, switch, diode, drawn, capacitor = columns
    return Waves(time, supply, switched, bus, near - far, current, switch, diode, drawn, capacitor)


def duty_for(current_a: float, channel: Channel) -> float:
    """Return the duty that brings a mean current, by secant steps on the simulation: within 2 mA."""
    ohm = sum(PARTS[name]["ohm"] for name in ("inductor", "shunt", "spring_leads")) + channel.spring_ohm
    duty = (current_a * ohm + 0.4) / (channel.supply_v + 0.4)
    for _ in range(4):
        wave = simulate(dataclasses.replace(channel, duty=duty))
        missing_a = current_a - wave.last(wave.current_a)
        if abs(missing_a) < 2e-3:
            break
        duty += missing_a * ohm / (channel.supply_v + 0.4)
    return duty


def ripple_a(wave: Waves) -> float:
    """Return the peak-to-peak current of the last period."""
    last = wave.time_s > wave.time_s[-1] - PERIOD_S
    return float(np.ptp(wave.current_a[last]))


def buck_current_a(duty: float, channel: Channel, drop_v: float) -> float:
    """sim_host/electrics' formula, with every resistance of the loop."""
    loop_ohm = sum(PARTS[name]["ohm"] for name in ("inductor", "shunt", "spring_leads")) + duty * PARTS["switch"]["ohm"]
    mean_v = duty * channel.supply_v - (1 - duty) * drop_v
    return max(mean_v, 0.0) / (channel.spring_ohm + loop_ohm)


# ---- the tables of docs/hardware-figures.md: each a title, what is said of it, a head and rows ----

Table = tuple[str, str, list[str], list[list[str]]]


def heat_table() -> Table:
    """Mean v times mean i against the true heat, and the ripple that is between them."""
    rows = []
    for ohm, current in ((MARTENSITE_OHM, 0.5), (MARTENSITE_OHM, 1.5), (AUSTENITE_OHM, 1.5), (0.15, 3.0), (0.25, 3.0)):
        channel = Channel(spring_ohm=ohm)
        duty = duty_for(current, channel)
        wave = simulate(dataclasses.replace(channel, duty=duty))
        told_w = wave.last(wave.bus_v) * wave.last(wave.current_a)
        true_w = wave.last(wave.spring_v * wave.current_a)
        leads = PARTS["spring_leads"]["ohm"] / (ohm + PARTS["spring_leads"]["ohm"])
        rows.append(
            [
                f"{ohm:.3f}",
                f"{current:.1f}",
                f"{100 * duty:.1f}",
                f"{1000 * ripple_a(wave):.0f}",
                f"{true_w:.4f}",
                f"{told_w:.4f}",
                f"{100 * (told_w / true_w - 1):+.2f}",
                f"{100 * (told_w * (1 - leads) / true_w - 1):+.2f}",
            ]
        )
    head = [
        "spring, ohm",
        "mean current, A",
        "duty, %",
        "ripple, mA peak to peak",
        "true heat, W",
        "mean v x mean i, W",
        "error, %",
        "without the leads, %",
    ]
    return (
        "Heat that is told and heat that is there",
        "The INA219 measures v at the leads' end, so their loss counts as the spring's; what ripple hides is the last column.",
        head,
        rows,
    )


def duty_table() -> Table:
    """Duty to current, against the formula that sim_host and the firmware use."""
    rows = []
    drop_v = freewheel_v()
    for ohm in (MARTENSITE_OHM, AUSTENITE_OHM):
        for step in (40, 80, 104, 160, 240):
            channel = Channel(duty=step / STEPS, spring_ohm=ohm)
            wave = simulate(channel)
            more = simulate(dataclasses.replace(channel, duty=(step + 1) / STEPS))
            current = wave.last(wave.current_a)
            formula = buck_current_a(channel.duty, channel, drop_v)
            rows.append(
                [
                    f"{ohm:.3f}",
                    f"{step}",
                    f"{current:.3f}",
                    f"{formula:.3f}",
                    f"{100 * (formula / current - 1):+.1f}" if current > 0.05 else "",
                    f"{1000 * (more.last(more.current_a) - current):.1f}",
                ]
            )
    head = ["spring, ohm", "duty, of 800", "current, A", "formula, A", "its error, %", "one step more, mA"]
    return (
        "Duty and current",
        f"Formula: (duty x supply - (1 - duty) x drop) / resistance, with the diode's drop of {drop_v:.2f} V as `freewheel_v`.",
        head,
        rows,
    )


def freewheel_v() -> float:
    """Drop of the diode while it conducts 1.5 A: what the setting freewheel_v should be."""
    wave = simulate(Channel(duty=0.16))
    inside = (wave.time_s > wave.time_s[-1] - PERIOD_S) & (wave.diode_a > 0.5 * wave.current_a) & (wave.switch_v < 0)
    return float(-np.median(wave.switch_v[inside]))


def sensor_table() -> Table:
    """What windows of one INA219 conversion read: they are 10.64 periods long and begin anywhere."""
    rows = []
    for current in (0.5, 1.5, 3.0):
        channel = Channel(duty=duty_for(current, Channel()))
        wave = simulate(channel, 12e-3)
        begins = SETTLED_S + np.linspace(0, 12e-3 - SETTLED_S - CONVERSION_S * 8 - 1e-6, 40)
        one = [wave.mean(wave.current_a, b, b + CONVERSION_S) for b in begins]
        eight = [wave.mean(wave.current_a, b, b + 8 * CONVERSION_S) for b in begins]
        rows.append(
            [f"{current:.1f}", f"{np.mean(one):.4f}", f"{1000 * np.ptp(one):.1f}", f"{1000 * np.ptp(eight):.2f}"]
        )
    return (
        "What the INA219 reads",
        "Its converter integrates: a conversion of 532 us holds 10 periods and a part of one. Spread of the means over where the window begins.",
        ["current, A", "mean of windows, A", "one conversion, mA peak to peak", "8 averaged, mA peak to peak"],
        rows,
    )


def supply_table() -> Table:
    """Nine stages switch on in the same clock: what the wires and capacitors see."""
    rows = []
    for others, current in ((0, 3.0), (4, 3.0), (8, 1.5)):
        channel = Channel(others=others)
        duty = duty_for(current, channel)
        wave = simulate(dataclasses.replace(channel, duty=duty))
        last = wave.time_s > wave.time_s[-1] - PERIOD_S
        drawn = wave.last(wave.drawn_a)
        ripple_rms = np.sqrt(max(wave.last(wave.capacitor_a**2), 0.0)) / PARTS["bulk_capacitor"]["count"]
        rows.append(
            [
                f"{1 + others} x {current:.1f} A",
                f"{100 * duty:.1f}",
                f"{drawn:.2f}",
                f"{channel.supply_v - wave.last(wave.supply_v):.3f}",
                f"{1000 * np.ptp(wave.supply_v[last]):.0f}",
                f"{ripple_rms:.2f}",
            ]
        )
    return (
        "The supply's side",
        "The spring's current is not the supply's: a buck stage draws its duty's share of it. All stages switch on in the same clock, so the capacitors carry the peaks.",
        [
            "springs",
            "duty, %",
            "drawn from the supply, A",
            "sag at the stages, V",
            "ripple there, mV peak to peak",
            "ripple current of each capacitor, A rms",
        ],
        rows,
    )


def off_table() -> Table:
    """Switched off in the middle of a cycle: the inductor goes on through the diode."""
    rows = []
    for current in (1.5, 3.0):
        duty = duty_for(current, Channel())
        off_s = SETTLED_S + 0.3 * duty * PERIOD_S
        wave = simulate(Channel(duty=duty, off_at_s=off_s), SETTLED_S + 3e-3)
        after = wave.time_s > off_s
        below = wave.time_s[after & (wave.current_a < 0.01)]
        heat = wave.mean(wave.spring_v * wave.current_a, off_s, float(wave.time_s[-1])) * (wave.time_s[-1] - off_s)
        rows.append([f"{current:.1f}", f"{1e3 * (below[0] - off_s):.2f}" if len(below) else "-", f"{1e3 * heat:.3f}"])
    return (
        "Switched off",
        "From the pin's falling edge, in mid-pulse. 0.3 J warm a spring by 1 K.",
        ["current before, A", "below 10 mA after, ms", "heat into the spring meanwhile, mJ"],
        rows,
    )


def loss_table() -> Table:
    """Loss and temperature rise of each part at 3 A, and at nine times 1.5 A."""
    rows = []
    waves = {}
    for name, others, current in (("3 A", 0, 3.0), ("nine at 1.5 A", 8, 1.5)):
        channel = Channel(others=others, spring_ohm=AUSTENITE_OHM)
        waves[name] = simulate(dataclasses.replace(channel, duty=duty_for(current, channel)))
    losses: dict[str, Callable[[Waves], float]] = {
        "switch": lambda w: w.last((w.supply_v - w.switch_v) * w.switch_a),
        "diode": lambda w: w.last(-w.switch_v * w.diode_a),
        "inductor": lambda w: w.last(PARTS["inductor"]["ohm"] * w.current_a**2),
        "shunt": lambda w: w.last(PARTS["shunt"]["ohm"] * w.current_a**2),
        "spring_leads": lambda w: w.last(PARTS["spring_leads"]["ohm"] * w.current_a**2),
        "channel_fuse": lambda w: PARTS["channel_fuse"]["ohm"] * w.last(w.switch_a) ** 2,
    }
    for part, loss in losses.items():
        row = [part.replace("_", " ")]
        for wave in waves.values():
            watts = loss(wave)
            rise = PARTS[part].get("thermal_k_per_w")
            row += [f"{watts:.3f}", f"{watts * rise:.0f}" if rise else ""]
        rows.append(row)
    head = ["part", "loss at 3 A, W", "rise, K", "loss at nine x 1.5 A, W each", "rise, K"]
    return (
        "Losses and how warm parts become",
        "Rise above the air around the part, by its data sheet's thermal resistance to air.",
        head,
        rows,
    )


def fault_table() -> Table:
    """What happens when a part fails while the spring is held at 1.5 A."""
    duty = duty_for(1.5, Channel())
    rows = []

    def row(what: str, wave: Waves, says: str) -> None:
        heat = wave.last(wave.spring_v * wave.current_a)
        rows.append(
            [
                what,
                f"{wave.last(wave.current_a):.2f}",
                f"{wave.current_a.max():.2f}",
                f"{heat:.2f}",
                f"{wave.switch_v.min():.1f}",
                says,
            ]
        )

    row("nothing", simulate(Channel(duty=duty)), "")
    row(
        "switch welded (whatever the duty)",
        simulate(Channel(duty=0.0, welded=True)),
        "current while off: fault 11; the channel's fuse and the cut-off end it",
    )
    row(
        "diode open",
        simulate(Channel(duty=duty, diode_open=True), 2e-3),
        "the switch breaks down in each period: less current than the duty says",
    )
    row(
        "inductor saturates at 1 A",
        simulate(Channel(duty=duty, saturates_at_a=1.0)),
        "more ripple, the mean stays: seen as nothing but heat in the ripple",
    )
    row("the Mega's pin floats", simulate(Channel(duty=0.5, gate_floats=True)), "off: 10 k to ground")
    return (
        "When a part fails",
        "A spring held at 1.5 A (0.39 W). Heat into the spring; a spring of 0.3 J/K warms by 3.3 K/s for each watt that it does not give off.",
        ["what", "mean current, A", "highest, A", "heat, W", "lowest voltage at the switch, V", "what is seen"],
        rows,
    )


TICK_S, PULSE_S = 20e-3, 100e-6  # the enable pin is high for so long at the end of each control tick
GATE_ON_V, GATE_OFF_V = 1.8, 0.4  # of the cut-off's switch: carries the coil; is off


def hold_v(pin: str, length_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Return time (s) and voltage (V) that holds the cut-off, both of shape (samples,), for an enable pin as ngspice describes it."""
    p = PARTS
    with tempfile.TemporaryDirectory() as folder:
        data, deck = Path(folder) / "hold.txt", Path(folder) / "hold.cir"
        deck.write_text(
            f"""* the cut-off's charge pump
Vpin pin 0 {pin}
Rpin pin out 25
Rseries out in {p["cut_off_series"]["ohm"]}
Cpump in pump {p["cut_off_capacitor"]["farad"]}
Rdischarge pump 0 {p["cut_off_discharge"]["ohm"]}
D1 0 pump small
D2 pump held small
Chold held 0 {p["cut_off_reservoir"]["farad"]}
Rbleed held 0 {p["cut_off_bleed"]["ohm"]}
.model small D(Is=2.5n N=1.75 Rs=0.6)
.control
set wr_singlescale
option noinit
tran 10u {length_s:.6g} 0 20u uic
wrdata {data} v(held)
.endc
.end
""",
            encoding="utf-8",
        )
        subprocess.run(["ngspice", "-b", str(deck)], capture_output=True, check=False)
        time, held = np.loadtxt(data).T
    return time, held


def cutoff_table() -> Table:
    """The charge pump of docs/hardware/power.svg: how soon it holds, how soon it lets go."""
    pulses = f"PULSE(0 5 0 10u 10u {PULSE_S:.6g} {TICK_S:.6g})"
    time, held = hold_v(pulses, 0.6)
    on_s = float(time[np.argmax(held > GATE_ON_V)])
    lowest = float(held[time > 0.4].min())
    rows = [["ticks run", f"{on_s:.3f}", f"{lowest:.2f}", "held"]]
    for what, last in (("the program hangs with the pin low", "0"), ("the program hangs with the pin high", "5")):
        # ticks as above until 0.5 s, then for ever as it was
        points = ["0 0"]
        for tick in range(25):
            begin = tick * TICK_S
            points += [
                f"{begin + 1e-5:.5f} 5",
                f"{begin + PULSE_S:.5f} 5",
                f"{begin + PULSE_S + 1e-5:.5f} 0",
                f"{begin + TICK_S:.5f} 0",
            ]
        stop = 25 * TICK_S
        points.append(f"{stop + 1e-5:.5f} {last}")
        time, held = hold_v("PWL(" + " ".join(points) + ")", stop + 0.4)
        begin = stop - TICK_S + PULSE_S if last == "0" else stop  # the end of the last pulse; the pin's last rise
        after = time > begin + PULSE_S
        off = time[after][np.argmax(held[after] < GATE_OFF_V)] - begin
        rows.append(
            [what, "", f"{held[-1]:.2f}", f"gate below {GATE_OFF_V} V after {off:.3f} s, relay open 10 ms later"]
        )
    time, held = hold_v("DC 5", 0.6)
    rows.append(
        [
            "pin shorted to 5 V from power-on",
            "",
            f"{held[-1]:.2f}",
            f"above {GATE_ON_V} V for {float(np.trapezoid(held > GATE_ON_V, time)):.3f} s",
        ]
    )
    return (
        "The cut-off",
        "A pulse in each control tick pumps charge that holds the relay of the stages' supply; nothing else does.",
        ["what", "holds after, s", "least (or last) voltage at the gate, V", "then"],
        rows,
    )


TABLES: dict[str, Callable[[], Table]] = {
    "heat": heat_table,
    "duty": duty_table,
    "sensor": sensor_table,
    "supply": supply_table,
    "off": off_table,
    "losses": loss_table,
    "faults": fault_table,
    "cutoff": cutoff_table,
}


def markdown(table: Table) -> str:
    """Return a table as docs/hardware-figures.md has it."""
    title, text, head, rows = table
    lines = [f"## {title}", "", text, "", "| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    lines += ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def main() -> int:
    """Print the tables that are asked for, or write the page of them all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tables", nargs="*", metavar="TABLE", help=f"of {', '.join(TABLES)}; none: all")
    parser.add_argument("--write", action="store_true", help=f"write {PAGE.name}")
    arguments = parser.parse_args()
    unknown = [name for name in arguments.tables if name not in TABLES]
    if unknown or (arguments.write and arguments.tables):
        parser.error(f"no such table: {unknown[0]}" if unknown else "--write takes all tables")
    try:
        texts = []
        for name in arguments.tables or TABLES:
            if sys.stderr.isatty():
                print(f"{name} ...", file=sys.stderr)
            texts.append(markdown(TABLES[name]()))
    except FileNotFoundError as error:
        print(f"channel: {error}", file=sys.stderr)
        return 1
    page = (
        "# Figures of the channel\n\nPrinted by `.venv/bin/python hardware/channel.py --write`, an ngspice simulation of the parts in "
        "`hardware/parts.toml`.\n\n" + "\n".join(texts)
    )
    if arguments.write:
        PAGE.write_text(page, encoding="utf-8")
    else:
        print("\n".join(texts))
    return 0


if __name__ == "__main__":
    sys.exit(main())
