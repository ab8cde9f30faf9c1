"""The pictures of docs/hardware.md and docs/building.md, from hardware/circuit.py and hardware/parts.toml.

.venv/bin/python hardware/pictures.py      # into docs/hardware/
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import schemdraw
import schemdraw.elements as elm
import schemdraw.flow as flow
import schemdraw.logic as logic
from circuit import ENABLE_PIN, FAN_PIN, HERE, PARTS, SCL_PIN, SDA_PIN, THERMISTOR_PIN, WIRING

schemdraw.use("svg")
OUT = HERE.parent / "docs" / "hardware"
NO_BREAK = "\u00a0"
"""A blank that a browser does not make one of many of."""
STYLE: dict[str, Any] = {"fontsize": 11, "bgcolor": "white", "margin": 0.4}


def value(ohm: float) -> str:
    """Return a resistance as it is written on a schematic."""
    for scale, unit in ((1e6, " MΩ"), (1e3, " kΩ"), (1.0, " Ω"), (1e-3, " mΩ")):
        if ohm >= scale:
            return f"{ohm / scale:g}{unit}"
    return f"{ohm:g} Ω"


def channel() -> schemdraw.Drawing:
    """One of the nine: from the Mega's pin to the spring."""
    w = WIRING[0]
    drawing = schemdraw.Drawing(show=False)
    drawing.config(**STYLE)
    drawing += (pin := elm.Tag(width=2.4, height=0.8).left().label(f"{w.pin}  {w.output}", fontsize=9))
    drawing += elm.Line().at(pin.start).right().length(1)
    drawing += (joint := elm.Dot())
    drawing.push()
    drawing += elm.Resistor().down().label(value(PARTS["gate_resistor"]["ohm"]), loc="bottom")
    drawing += elm.Ground()
    drawing.pop()
    drawing += elm.Line().at(joint.center).right().length(1)
    drawing += (
        driver := logic.Not()
        .right()
        .label("driver (inverts), P-channel switch", loc="bottom", ofst=(1.5, -0.6), fontsize=9)
    )
    drawing += elm.Resistor().right().at(driver.out).label(value(PARTS["series_gate_resistor"]["ohm"]))
    drawing += (switch := elm.PFet(bulk=False).reverse().anchor("gate").theta(0))
    drawing += elm.Line().at(switch.source).up().length(0.7)
    drawing += (feed := elm.Dot())
    drawing.push()
    drawing += elm.Line().right().length(2.2)
    drawing += elm.Capacitor().down().length(1.3).label("10 µF", loc="bottom")
    drawing += elm.Ground()
    drawing.pop()
    drawing += elm.Fuse().at(feed.center).up().label("5 A", loc="bottom")
    drawing += elm.Vdd().label("STAGES, 5 V\nbehind the cut-off")
    drawing += elm.Line().at(switch.drain).down().length(0.6)
    drawing += (node := elm.Dot())
    drawing.push()
    drawing += elm.Schottky().down().reverse().length(2.6).label("5 A\n40 V", loc="top")
    drawing += elm.Ground()
    drawing.pop()
    drawing += (
        elm.Inductor2()
        .at(node.center)
        .right()
        .length(4)
        .label(f"{PARTS['inductor']['henry'] * 1e6:g} µH, 5 A", loc="bottom", ofst=0.3)
    )
    drawing += (above := elm.Dot())
    drawing += elm.Resistor().right().length(3.4).label(f"shunt {value(PARTS['shunt']['ohm'])}, 1 W")
    drawing += (below := elm.Dot())
    drawing += elm.Line().right().length(1.4)
    drawing += elm.Inductor2(loops=6).down().length(3.2).label("spring\n0.175 to\n0.219 Ω", loc="bottom")
    drawing += elm.Ground()
    middle = (0.5 * (above.center[0] + below.center[0]), above.center[1] - 1.7)
    drawing += (
        chip := flow.Box(w=4.2, h=1.6)
        .theta(0)
        .anchor("N")
        .at(middle)
        .label(f"INA219  0x{w.address:02X}\nIN+{14 * NO_BREAK}IN−\nSDA, SCL to the bus")
    )
    for dot in (above, below):
        drawing += elm.Line().at(dot.center).to((dot.center[0], chip.N[1]))
    return drawing


def bus() -> schemdraw.Drawing:
    """The I2C bus with the jumpers of each sensor."""
    drawing = schemdraw.Drawing(show=False)
    drawing.config(**STYLE)
    length = 2.9 * len(WIRING)
    for row, (name, pin) in enumerate((("SDA", SDA_PIN), ("SCL", SCL_PIN))):
        y = -0.9 * row
        drawing += elm.Tag(width=2.4, height=0.8).left().at((0, y)).label(f"{pin} {name}")
        drawing += elm.Line().at((0, y)).right().length(length)
        drawing += elm.Dot().at((0.6 + 1.1 * row, y))
        drawing += (
            elm.Resistor()
            .at((0.6 + 1.1 * row, y))
            .up()
            .length(2.2 + 0.9 * row)
            .label(value(PARTS["bus_resistor"]["ohm"]), loc=("top", "bottom")[row], fontsize=8)
        )
        drawing += elm.Vdd().label("5 V")
    for index, w in enumerate(WIRING):
        x = 3.2 + 2.75 * index
        text = f"spring {w.spring}\n0x{w.address:02X}\nA1: {w.a1}\nA0: {w.a0}"
        drawing += (box := flow.Box(w=2.3, h=2.6).theta(0).anchor("N").at((x, -2.1)).label(text, fontsize=10))
        for offset, y in ((-0.5, 0.0), (0.5, -0.9)):
            drawing += elm.Line().at((x + offset, y)).to((x + offset, box.N[1]))
            drawing += elm.Dot().at((x + offset, y))
    return drawing


def power() -> schemdraw.Drawing:
    """Supply, fuse, cut-off and the nine stages, with the cross-sections of the wires."""
    drawing = schemdraw.Drawing(show=False)
    drawing.config(**STYLE)
    drawing += (source := elm.SourceV().up().length(4).label("5 V, 15 A", loc="top", ofst=0.2))
    drawing += elm.Line().at(source.end).right().length(2.4).label("4 mm²")
    drawing += elm.Fuse().right().label("20 A")
    drawing += (bulk := elm.Dot())
    drawing.push()
    drawing += elm.Capacitor(polar=True).down().label("2 x\n2200 µF", loc="bottom")
    drawing += elm.Ground()
    drawing.pop()
    drawing += elm.Line().at(bulk.center).right().length(1.4)
    drawing += elm.Switch().right().label("K1: cut-off, 16 A")
    drawing += elm.Line().right().length(0.8).label("STAGES")
    drawing += (star := elm.Dot())
    for index, w in enumerate((WIRING[0], WIRING[1], WIRING[8])):
        y = star.center[1] - 1.7 * index
        if index:
            drawing += elm.Line().at((star.center[0], y + 1.7)).to((star.center[0], y))
        drawing += elm.Fuse().at((star.center[0], y)).right().length(2.2).label("5 A")
        text = f"stage {w.spring}" + (" (3 to 8 alike)" if index == 1 else "")
        drawing += elm.Line().right().length(1.5).label("0.75 mm²", fontsize=8)
        drawing += flow.RoundBox(w=4.4, h=1.0).theta(0).anchor("W").label(text)
    drawing += elm.Ground().at(source.start)
    # the cut-off's own circuit below
    drawing += (
        pin := elm.Tag(width=4.6, height=0.8)
        .left()
        .at((4.6, -2.6))
        .label(f"{ENABLE_PIN}: a pulse in each tick", fontsize=9)
    )
    drawing += elm.Resistor().at(pin.start).right().length(2.2).label(value(PARTS["cut_off_series"]["ohm"]))
    drawing += elm.Capacitor().right().length(1.8).label(f"{PARTS['cut_off_capacitor']['farad'] * 1e9:g} nF")
    drawing += (pump := elm.Dot())
    drawing.push()
    drawing += elm.Diode().down().reverse().length(2.2)
    drawing += elm.Ground()
    drawing.pop()
    drawing += elm.Line().at(pump.center).right().length(1.3)
    drawing += (drained := elm.Dot())
    drawing.push()
    drawing += elm.Resistor().down().length(2.2).label(value(PARTS["cut_off_discharge"]["ohm"]), loc="bottom")
    drawing += elm.Ground()
    drawing.pop()
    drawing += elm.Diode().at(drained.center).right().length(2)
    drawing += (held := elm.Dot())
    drawing.push()
    drawing += (
        elm.Capacitor().down().length(2.2).label(f"{PARTS['cut_off_reservoir']['farad'] * 1e9:g} nF", loc="bottom")
    )
    drawing += elm.Ground()
    drawing.pop()
    drawing += elm.Line().at(held.center).right().length(1.8)
    drawing += (second := elm.Dot())
    drawing.push()
    drawing += elm.Resistor().down().length(2.2).label(value(PARTS["cut_off_bleed"]["ohm"]), loc="bottom")
    drawing += elm.Ground()
    drawing.pop()
    drawing += elm.Line().at(second.center).right().length(1.6)
    drawing += (switch := elm.NFet(bulk=False).anchor("gate").theta(0).reverse())
    drawing += elm.Ground().at(switch.source)
    drawing += elm.Line().at(switch.drain).right().length(1.6)
    drawing += (
        elm.Inductor2(loops=4)
        .right()
        .length(2.4)
        .label(f"coil of K1, {PARTS['cut_off_relay']['coil_ohm']:g} Ω,\na diode across it", loc="bottom")
    )
    drawing += elm.Vdd().label("5 V of the Mega")
    return drawing


def board() -> schemdraw.Drawing:
    """All nine channels and what they share, as blocks."""
    drawing = schemdraw.Drawing(show=False)
    drawing.config(**STYLE)
    pins = [elm.IcPin(f"{w.pin} {w.output}", side="right", slot=f"{9 - index}/9") for index, w in enumerate(WIRING)]
    left = [
        f"{FAN_PIN} fan",
        f"{THERMISTOR_PIN} thermistor",
        f"{ENABLE_PIN} cut-off",
        f"{SDA_PIN} SDA",
        f"{SCL_PIN} SCL",
    ]
    pins += [elm.IcPin(name, side="left", slot=f"{5 - index}/5") for index, name in enumerate(left)]
    drawing += (mega := elm.Ic(pins=pins, size=(8, 15), label="Arduino\nMega 2560", pinspacing=1.6))
    for w in WIRING:
        end = mega.absanchors[f"{w.pin} {w.output}"]
        drawing += elm.Line().at(end).right().length(1.2)
        drawing += (stage := flow.RoundBox(w=2.6, h=1.0).right().anchor("W").label("buck stage"))
        drawing += elm.Line().at(stage.E).right().length(0.7)
        drawing += (sensor := flow.RoundBox(w=3.0, h=1.0).right().anchor("W").label(f"INA219 0x{w.address:02X}"))
        drawing += elm.Line().at(sensor.E).right().length(0.5)
        drawing += elm.Inductor2(loops=5).right().length(2).label(f"spring {w.spring}", loc="right", ofst=(0.5, 0))
    return drawing


PICTURES = {"channel": channel, "board": board, "bus": bus, "power": power}


def main() -> int:
    """Draw them all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=OUT, help="folder (%(default)s)")
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    for name, draw in PICTURES.items():
        draw().save(str(arguments.output / f"{name}.svg"))
    print(f"{len(PICTURES)} pictures -> {arguments.output}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
