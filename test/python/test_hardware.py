"""hardware/: the circuit's rules can be broken, its pins are the firmware's, and the channel does what the pages claim."""

from __future__ import annotations

import dataclasses
import re
import shutil
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from ninespring.io import bringup

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "hardware"))

import channel  # noqa: E402

circuit = pytest.importorskip("circuit", reason="SKIPPED: SKiDL is not installed (script/setup)")

needs_ngspice = pytest.mark.skipif(shutil.which("ngspice") is None, reason="SKIPPED: no ngspice on the PATH")


def built() -> circuit.Board:
    """Return a board, built in a thread: SKiDL reads the source of all callers for each part, and a test has a hundred of them."""
    with ThreadPoolExecutor(1) as thread:
        return thread.submit(circuit.Board).result()


@pytest.fixture(scope="module")
def board() -> circuit.Board:
    return built()


def test_no_electrical_rule_is_broken(board) -> None:
    assert board.rules() == []


def test_every_part_of_the_list_is_used_and_has_a_second_source(board) -> None:
    for row in board.bill():
        assert int(row["number"]) == circuit.PARTS[row["part"]].get(
            "count", 9 if circuit.PARTS[row["part"]]["each"] == "spring" else 1
        ), row
        assert row["for example"] and row["second source"] and row["for example"] != row["second source"], row


@pytest.mark.parametrize(
    ("break_it", "said"),
    [
        (lambda b: b.net("5V").connect(b.parts["U31"]["a0"]), "GND and 5V are one net"),  # a jumper beside its resistor
        (
            lambda b: (b.parts["U32"]["a0"].disconnect(), b.net("GND").connect(b.parts["U32"]["a0"])),
            "0x40 is spring 1's",
        ),
        (lambda b: b.net("GATE1").connect(b.parts["U12"]["input"]), "GATE1"),  # two drivers at one pin
        (lambda b: b.part("R99", "bus_resistor", a="passive:5V", b="passive:SDA"), "SDA: 2 pull-ups"),
        (lambda b: b.part("F99", "channel_fuse", a="passive:FUSED", b="passive:STAGES"), "STAGES"),  # past the cut-off
        (lambda b: b.net("DRIVE1").connect(b.parts["U1"]["D5"]), "OUTPUT"),  # two outputs on a net: SKiDL's own rule
    ],
)
def test_a_broken_board_is_found(break_it, said) -> None:
    broken = built()
    break_it(broken)
    assert any(said in line for line in broken.rules())


def test_pins_and_addresses_are_the_firmwares() -> None:
    source = (ROOT / "firmware" / "board_mega.c").read_text()
    comment = re.sub(r"[\s*]+", " ", source)
    # the mask of each port, and what its pins are
    assert "#define PWM_PINS (_BV(3) | _BV(4) | _BV(5))" in source
    assert f"{circuit.ENABLE_PIN} PB6: to the cut-off" in source
    assert re.search(r"#define SUPPLY_PIN +_BV\(6\)", source)
    assert float(re.search(r"#define SUPPLY_PULSE_US +(\d+)", source)[1]) * 1e-6 == pytest.approx(channel.PULSE_S)
    ports = re.search(r"Of ports (E \(.*?\)), (H \(.*?\)) and (L \(.*?\));", comment).groups()
    for w in circuit.WIRING:
        port = next(text for text in ports if text[0] == w.port[1])
        assert f"{w.output} {w.pin}" in port, w
        assert f"DDR{w.port[1]} |= PWM_PINS" in source, w
    assert [w.port[2] for w in circuit.WIRING] == ["3", "4", "5"] * 3
    sensors = (ROOT / "firmware" / "current_sensor.h").read_text()
    first = int(re.search(r"CURRENT_SENSOR_FIRST_ADDRESS (0x[0-9A-F]+)u", sensors)[1], 16)
    for w in circuit.WIRING:
        assert w.address == first + w.spring - 1 == circuit.address_of(w.a1, w.a0)


def test_what_bringup_names_is_the_circuits() -> None:
    assert [f"D{pin}" for pin in bringup.PINS] == [w.pin for w in circuit.WIRING]
    for w in circuit.WIRING:
        assert bringup.jumpers(w.spring) == f"0x{w.address:02X} (A1 to {w.a1}, A0 to {w.a0})"


def test_the_wiring_table_of_the_page_is_the_circuits() -> None:
    rows = re.findall(
        r"^\| (\d) \| (D\d+) \| (OC\d.) \| (0x\d+) \| (\S+) \| (\S+) \|$",
        (ROOT / "docs" / "hardware.md").read_text(),
        re.MULTILINE,
    )
    assert rows == [(str(w.spring), w.pin, w.output, f"0x{w.address:02X}", w.a1, w.a0) for w in circuit.WIRING]


@needs_ngspice
def test_mean_voltage_times_mean_current_is_the_heat() -> None:
    wave = channel.simulate(channel.Channel(duty=channel.duty_for(1.5, channel.Channel())))
    leads = channel.PARTS["spring_leads"]["ohm"]
    told = wave.last(wave.bus_v) * wave.last(wave.current_a) * channel.MARTENSITE_OHM / (channel.MARTENSITE_OHM + leads)
    assert told == pytest.approx(wave.last(wave.spring_v * wave.current_a), rel=0.01)
    assert 0.2 < channel.ripple_a(wave) < 0.5


@needs_ngspice
def test_the_formula_of_electrics_holds_above_an_ampere() -> None:
    for step in (120, 200):
        at = channel.Channel(duty=step / channel.STEPS)
        wave = channel.simulate(at)
        assert channel.buck_current_a(at.duty, at, 0.39) == pytest.approx(wave.last(wave.current_a), rel=0.06)


@needs_ngspice
def test_what_fails_is_what_the_page_says() -> None:
    welded = channel.simulate(channel.Channel(duty=0.0, welded=True))
    assert welded.last(welded.current_a) > 10.0
    floating = channel.simulate(dataclasses.replace(channel.Channel(duty=0.5), gate_floats=True))
    assert floating.last(floating.current_a) < 0.02


@needs_ngspice
def test_the_cut_off_lets_go_without_pulses() -> None:
    _, _, _, rows = channel.cutoff_table()
    held, low, high, shorted = rows
    assert float(held[2]) > channel.GATE_ON_V
    electrics = (ROOT / "sim_host" / "electrics" / "electrics.h").read_text()  # what the simulated board goes by
    for row, name in ((low, "GATE"), (high, "HIGH")):
        seconds = re.search(rf"#define ELECTRICS_CUT_OFF_{name}_S +([0-9.]+)", electrics)[1]
        assert float(re.search(r"after ([0-9.]+) s", row[3])[1]) == pytest.approx(float(seconds), abs=0.005)
    assert float(re.search(r"after ([0-9.]+) s", low[3])[1]) < 0.09  # and the relay's 10 ms: within 0.1 s
    assert float(re.search(r"after ([0-9.]+) s", high[3])[1]) < 0.3
    assert float(re.search(r"for ([0-9.]+) s", shorted[3])[1]) < 0.05
