"""The reference board as a netlist in code: nine channels, Mega, bus, fan, thermistor, supply and cut-off.

    .venv/bin/python hardware/circuit.py -o build/hardware     # netlist, list of parts, report of the electrical rules

One source: parts and ratings stand in hardware/parts.toml, what connects them here; the list, the wiring table and the pictures of
docs/hardware.md are made from both, and test/python/test_hardware.py holds the pins and addresses to the firmware.
"""

from __future__ import annotations

import argparse
import contextlib
import csv
import dataclasses
import io
import logging
import sys
import tomllib
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
PARTS: dict[str, dict[str, Any]] = tomllib.loads((HERE / "parts.toml").read_text(encoding="utf-8"))
SPRINGS = 9


@dataclasses.dataclass(frozen=True)
class Wiring:
    """Where one spring is connected: Mega pin, timer output, the sensor's address and what its A1 and A0 are tied to."""

    spring: int
    pin: str
    output: str
    port: str
    address: int
    a1: str
    a0: str


WIRING = tuple(
    Wiring(spring, pin, output, port, 0x3F + spring, a1, a0)
    for spring, (pin, output, port, a1, a0) in enumerate(
        (
            ("D5", "OC3A", "PE3", "GND", "GND"),
            ("D2", "OC3B", "PE4", "GND", "V+"),
            ("D3", "OC3C", "PE5", "GND", "SDA"),
            ("D6", "OC4A", "PH3", "GND", "SCL"),
            ("D7", "OC4B", "PH4", "V+", "GND"),
            ("D8", "OC4C", "PH5", "V+", "V+"),
            ("D46", "OC5A", "PL3", "V+", "SDA"),
            ("D45", "OC5B", "PL4", "V+", "SCL"),
            ("D44", "OC5C", "PL5", "SDA", "GND"),
        ),
        start=1,
    )
)
FAN_PIN, THERMISTOR_PIN, ENABLE_PIN, SDA_PIN, SCL_PIN = "D11", "A0", "D12", "D20", "D21"
# INA219, data sheet table 1: what A1 and A0 are tied to, as the address' bits 3..2 and 1..0
ADDRESS_BITS = {"GND": 0, "V+": 1, "SDA": 2, "SCL": 3}


def address_of(a1: str, a0: str) -> int:
    """Return the I2C address of an INA219 whose A1 and A0 are tied to GND, V+, SDA or SCL."""
    return 0x40 + 4 * ADDRESS_BITS[a1] + ADDRESS_BITS[a0]


def _skidl() -> Any:
    """Import SKiDL without what it writes and says at its import: logs beside whoever imports it, KiCad libraries that nothing here needs."""
    with contextlib.redirect_stderr(io.StringIO()):
        import skidl

    skidl.logger.stop_log_file_output()
    for logger in (skidl.logger.active_logger, skidl.erc_logger):
        for handler in list(logger.handlers):
            logger.removeHandler(handler)
        logger.addHandler(logging.NullHandler())
    return skidl


class Board:
    """The circuit, and what its electrical rules say of it."""

    def __init__(self) -> None:
        skidl = self.skidl = _skidl()
        kinds = skidl.Pin.types
        self._kinds = {
            "in": kinds.INPUT, "out": kinds.OUTPUT, "open": kinds.OPENCOLL,
            "passive": kinds.PASSIVE, "power": kinds.PWRIN, "source": kinds.PWROUT,
        }  # fmt: skip
        self.circuit = skidl.Circuit(name="ninespring")
        self.circuit.no_files = True
        self.nets: dict[str, Any] = {}
        self.parts: dict[str, Any] = {}
        for name, drive in (
            ("GND", True),
            ("5V", True),
            ("SUPPLY", True),
            ("FUSED", False),
            ("STAGES", True),
            ("SDA", False),
            ("SCL", False),
        ):
            net = self.net(name)
            if drive:
                net.drive = skidl.POWER
        self._mega()
        self._power()
        self._cut_off()
        self._bus()
        self._fan()
        self._thermistor()
        for wiring in WIRING:
            self._channel(wiring)

    def net(self, name: str) -> Any:
        """Return the net of that name, made at its first use."""
        if name not in self.nets:
            self.nets[name] = self.skidl.Net(name, circuit=self.circuit)
        return self.nets[name]

    def part(self, ref: str, kind: str, **pins: str) -> Any:
        """Add a part of parts.toml; pins are name=kind:net, with kind one of in, out, open, passive, power, source."""
        row = PARTS[kind]
        made = self.skidl.Part(
            tool=self.skidl.SKIDL, name=kind, ref=ref, dest=self.skidl.NETLIST, circuit=self.circuit, footprint=row.get("footprint", "see:data_sheet"),
            pins=[self.skidl.Pin(num=str(number), name=name, func=self._kinds[spec.split(":")[0]]) for number, (name, spec) in enumerate(pins.items(), 1)],
        )  # fmt: skip
        made.value = row["part"]
        for name, spec in pins.items():
            self.net(spec.split(":", 1)[1]).connect(made[name])
        self.parts[ref] = made
        return made

    def _mega(self) -> None:
        pins = {w.pin: f"out:GATE{w.spring}" for w in WIRING}
        pins |= {
            FAN_PIN: "out:FAN_PWM",
            THERMISTOR_PIN: "in:AMBIENT",
            ENABLE_PIN: "out:ENABLE",
            SDA_PIN: "open:SDA",
            SCL_PIN: "open:SCL",
        }
        self.part("U1", "mega", **pins, V5="power:5V", GND="power:GND")

    def _power(self) -> None:
        self.part("PS1", "supply", plus="source:SUPPLY", minus="passive:GND")
        self.part("F1", "main_fuse", a="passive:WIRED", b="passive:FUSED")
        for number in range(1, PARTS["bulk_capacitor"]["count"] + 1):
            self.part(f"C{number}", "bulk_capacitor", plus="passive:FUSED", minus="passive:GND")
        self.part("W1", "supply_wire", a="passive:SUPPLY", b="passive:WIRED")

    def _cut_off(self) -> None:
        """A pulse in each control tick pumps charge that holds the relay: none, low or high for ever lets it go."""
        self.part("R1", "cut_off_series", a="passive:ENABLE", b="passive:PUMP_IN")
        self.part("C3", "cut_off_capacitor", a="passive:PUMP_IN", b="passive:PUMP")
        self.part("D1", "cut_off_diode", anode="passive:GND", cathode="passive:PUMP")
        self.part("D2", "cut_off_diode", anode="passive:PUMP", cathode="passive:HELD")
        self.part("R6", "cut_off_discharge", a="passive:PUMP", b="passive:GND")
        self.part("C4", "cut_off_reservoir", a="passive:HELD", b="passive:GND")
        self.part("R2", "cut_off_bleed", a="passive:HELD", b="passive:GND")
        self.part("Q1", "cut_off_switch", gate="in:HELD", drain="open:COIL", source="passive:GND")
        self.part("D3", "cut_off_diode", anode="passive:COIL", cathode="passive:5V")
        self.part(
            "K1",
            "cut_off_relay",
            coil_a="passive:5V",
            coil_b="passive:COIL",
            common="passive:FUSED",
            open="passive:STAGES",
        )
        self.net("HELD").drive = self.skidl.POWER

    def _bus(self) -> None:
        for number, line in enumerate(("SDA", "SCL"), start=3):
            self.part(f"R{number}", "bus_resistor", a="passive:5V", b=f"passive:{line}")

    def _fan(self) -> None:
        self.part("Q2", "fan_switch", gate="in:FAN_PWM", drain="open:FAN_LOW", source="passive:GND")
        self.part("D4", "fan_diode", anode="passive:FAN_LOW", cathode="passive:5V")
        self.part("M1", "fan", plus="passive:5V", minus="passive:FAN_LOW")

    def _thermistor(self) -> None:
        self.part("R5", "thermistor_resistor", a="passive:5V", b="passive:AMBIENT")
        self.part("RT1", "thermistor", a="passive:AMBIENT", b="passive:GND")

    def _channel(self, w: Wiring) -> None:
        k = w.spring
        self.part(f"F{10 + k}", "channel_fuse", a="passive:STAGES", b=f"passive:STAGE{k}")
        self.net(f"STAGE{k}").drive = self.skidl.POWER
        self.part(f"C{10 + k}", "decoupling", a=f"passive:STAGE{k}", b="passive:GND")
        self.part(f"R{10 + k}", "gate_resistor", a=f"passive:GATE{k}", b="passive:GND")
        self.part(
            f"U{10 + k}",
            "driver",
            input=f"in:GATE{k}",
            output=f"out:DRIVE{k}",
            supply=f"power:STAGE{k}",
            ground="power:GND",
        )
        self.part(f"R{20 + k}", "series_gate_resistor", a=f"passive:DRIVE{k}", b=f"passive:SWITCH_GATE{k}")
        self.part(
            f"Q{10 + k}", "switch", source=f"passive:STAGE{k}", gate=f"in:SWITCH_GATE{k}", drain=f"passive:SWITCHED{k}"
        )
        self.net(f"SWITCH_GATE{k}").drive = self.skidl.POWER
        self.part(f"D{10 + k}", "diode", anode="passive:GND", cathode=f"passive:SWITCHED{k}")
        self.part(f"L{10 + k}", "inductor", a=f"passive:SWITCHED{k}", b=f"passive:SHUNT{k}")
        self.part(f"R{30 + k}", "shunt", a=f"passive:SHUNT{k}", b=f"passive:SPRING{k}")
        tied = {"GND": "GND", "V+": "5V", "SDA": "SDA", "SCL": "SCL"}
        self.part(
            f"U{30 + k}", "sensor", plus=f"in:SHUNT{k}", minus=f"in:SPRING{k}", sda="open:SDA", scl="in:SCL",
            a1=f"passive:{tied[w.a1]}", a0=f"passive:{tied[w.a0]}", vs="power:5V", ground="power:GND",
        )  # fmt: skip
        for net in (f"SHUNT{k}", f"SPRING{k}"):
            self.net(net).drive = self.skidl.POWER
        self.part(f"W{10 + k}", "spring_leads", a=f"passive:SPRING{k}", b="passive:GND")

    # ---- rules ----

    def rules(self) -> list[str]:
        """Return what is wrong, a line each: SKiDL's electrical rules, and those of this board. Empty: nothing."""
        skidl = self.skidl
        found: list[str] = []

        class Collect(logging.Handler):
            def emit(self, record: logging.LogRecord) -> None:
                found.append(record.getMessage())

        collector = Collect(level=logging.WARNING)
        skidl.erc_logger.addHandler(collector)
        try:
            with contextlib.redirect_stderr(io.StringIO()):
                self.circuit.ERC()
        finally:
            skidl.erc_logger.removeHandler(collector)
        return found + self.own_rules()

    def pins_of(self, net: str) -> set[tuple[str, str]]:
        """Return (reference, pin name) of everything that a net connects."""
        return {(pin.part.ref, pin.name) for pin in self.nets[net].get_pins()}

    def own_rules(self) -> list[str]:
        """Return what SKiDL cannot know: addresses, pulls, who may drive a gate, how the supply reaches the stages."""
        rails = ("GND", "5V", "SUPPLY", "WIRED", "FUSED", "STAGES", "SDA", "SCL")
        wrong = [
            f"{a} and {b} are one net"
            for i, a in enumerate(rails)
            for b in rails[i + 1 :]
            if self.pins_of(a) & self.pins_of(b)
        ]
        addresses: dict[int, int] = {}
        for w in WIRING:
            sensor = f"U{30 + w.spring}"
            tied = {
                pin: next(name for name in ("GND", "5V", "SDA", "SCL") if (sensor, pin) in self.pins_of(name))
                for pin in ("a1", "a0")
            }
            address = address_of(*("V+" if tied[pin] == "5V" else tied[pin] for pin in ("a1", "a0")))
            if address != w.address:
                wrong.append(f"{sensor}: its jumpers say 0x{address:02X}, the firmware asks 0x{w.address:02X}")
            if address in addresses:
                wrong.append(f"{sensor}: 0x{address:02X} is spring {addresses[address]}'s")
            addresses[address] = w.spring
            gate = {ref for ref, _ in self.pins_of(f"GATE{w.spring}")}
            if gate != {"U1", f"R{10 + w.spring}", f"U{10 + w.spring}"}:
                wrong.append(
                    f"GATE{w.spring}: {', '.join(sorted(gate))}; wanted are the Mega, one resistor to ground, one driver"
                )
            if (f"R{30 + w.spring}", "b") not in self.pins_of(f"SPRING{w.spring}"):
                wrong.append(f"SPRING{w.spring}: the shunt is not on the spring's side of the inductor")
        for line in ("SDA", "SCL"):
            pulls = [
                ref for ref, _ in self.pins_of(line) if ref in self.parts and self.parts[ref].name == "bus_resistor"
            ]
            if len(pulls) != 1:
                wrong.append(f"{line}: {len(pulls)} pull-ups, wanted is one")
        feeds = {ref for ref, _ in self.pins_of("STAGES")}
        if feeds != {"K1"} | {f"F{10 + w.spring}" for w in WIRING}:
            wrong.append("STAGES: fed by the cut-off alone, feeding the nine fuses alone")
        return wrong

    # ---- what is made from it ----

    def netlist(self) -> str:
        """Return every net and what it connects, sorted: to read, and to compare two boards."""
        lines = []
        for name in sorted(self.nets):
            pins = " ".join(sorted(f"{ref}.{pin}" for ref, pin in self.pins_of(name)))
            lines.append(f"{name}: {pins}")
        return "\n".join(lines) + "\n"

    def bill(self) -> list[dict[str, str]]:
        """Return the list of parts: one row a kind, with how many, where, what it must do, one that does and a second source."""
        rows = []
        for kind, row in PARTS.items():
            refs = [ref for ref, part in self.parts.items() if part.name == kind]
            rows.append(
                {
                    "part": kind,
                    "number": str(len(refs)),
                    "references": " ".join(refs),
                    "needs": row["needs"],
                    "for example": row["part"],
                    "second source": row["second"],
                }
            )
        return rows


def main() -> int:
    """Write netlist and list of parts; 1 where an electrical rule is broken."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "-o", "--output", type=Path, default=HERE.parent / "build" / "hardware", help="folder (%(default)s)"
    )
    arguments = parser.parse_args()
    board = Board()
    wrong = board.rules()
    for line in wrong:
        print(f"circuit: {line}", file=sys.stderr)
    if wrong:
        return 1
    arguments.output.mkdir(parents=True, exist_ok=True)
    (arguments.output / "ninespring.net.txt").write_text(board.netlist(), encoding="utf-8")
    with (arguments.output / "parts.csv").open("w", encoding="utf-8", newline="") as file:
        rows = board.bill()
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    print(f"{len(board.parts)} parts, {len(board.nets)} nets, no rule broken -> {arguments.output}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
