"""Prints the firmware's sizes (flash, static RAM, each module's share, worst-case stack) and its worst tick.

.venv/bin/python bench/firmware/firmware.py [--avr-build build/avr] [--runner avr_runner] [--json FILE]
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

from stack import analyse

RAM_BYTES = 8192
COMMAND = "bench/firmware/firmware.py"
VARIANTS = {"firmware.elf": "integer driver", "firmware_adafruit.elf": "Adafruit driver", "firmware_hil.elf": "hil"}


def run(*command: str) -> str:
    """Output of a command."""
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def sections(elf: Path) -> dict[str, int]:
    """Bytes of each section."""
    rows = (line.split() for line in run("avr-size", "-A", str(elf)).splitlines())
    return {row[0]: int(row[1]) for row in rows if len(row) == 3 and row[1].isdigit()}


def symbols(file: Path) -> list[tuple[str, int, bool, bool]]:
    """(name, bytes, in flash, in RAM) of each symbol that has a size."""
    found = []
    for line in run("avr-nm", "-S", str(file)).splitlines():
        row = line.split()
        if len(row) == 4:
            kind = row[2].lower()
            name = re.sub(r"\.(lto_priv|constprop|isra|part|cold)\.\d+", "", row[3])  # as it was before the optimiser
            found.append((name, int(row[1], 16), kind in "twrvd", kind in "bd"))
    return found


def modules(build: Path, elf: Path) -> dict[str, tuple[int, int]]:
    """(flash, RAM) of each module; what belongs to no object of ours is the core and the compiler's library.

    A function that the linker's optimiser puts into its only caller counts for the caller's module.
    """
    owner = {"main": "firmware"}  # the core's, with setup and loop put into it
    for file in sorted(build.glob("lib/*/CMakeFiles/*.dir/*.obj")):
        for name, _size, _flash, _ram in symbols(file):
            owner.setdefault(name, file.relative_to(build).parts[1])
    for file in (build / "firmware" / "CMakeFiles" / f"{elf.stem}.dir").glob("*.obj"):
        for name, _size, _flash, _ram in symbols(file):
            owner[name] = "firmware"
    total: dict[str, list[int]] = defaultdict(lambda: [0, 0])
    for name, size, flash, ram in symbols(elf):
        entry = total[owner.get(name, "core and compiler")]
        entry[0] += size if flash else 0
        entry[1] += size if ram else 0
    return {name: (flash, ram) for name, (flash, ram) in total.items()}


def measure(build: Path, elf: Path, label: str) -> list[dict[str, object]]:
    """Prints and returns the figures of one ELF."""
    size = sections(elf)
    flash = size.get(".text", 0) + size.get(".data", 0)
    ram = size.get(".data", 0) + size.get(".bss", 0) + size.get(".noinit", 0)
    stack = analyse(elf)
    rows = [
        ("flash", flash, "<= 163840"),
        ("static RAM", ram, "<= 6144"),
        ("worst-case stack", stack.worst, ""),
        ("RAM left in the worst case", RAM_BYTES - ram - stack.worst, "> 0"),
    ]
    print(f"{elf.name} ({label})")
    for name, value, target in rows:
        print(f"  {name:<32}{value:>8} bytes  {target}")
    print(f"  stack of main {stack.main}: {' > '.join(stack.main_path)}")
    print(f"  stack of the deepest interrupt {stack.interrupt}: {' > '.join(stack.interrupt_path)}")
    if elf.name == "firmware.elf":
        print(f"  {'module':<24}{'flash':>8}{'RAM':>8}")
        for name, (in_flash, in_ram) in sorted(modules(build, elf).items(), key=lambda item: -item[1][0]):
            print(f"  {name:<24}{in_flash:>8}{in_ram:>8}")
            rows.append((f"flash of {name}", in_flash, ""))
            rows.append((f"static RAM of {name}", in_ram, ""))
        print("  calls through pointers, and what can be behind them:")
        for caller, targets in stack.indirect:
            print(f"    {caller}: {', '.join(re.sub(r'^_ZL[0-9]+', '', t) for t in targets) or 'nothing'}")
    return [
        {"figure": f"{name} ({label})", "value": value, "unit": "bytes", "target": target, "command": COMMAND}
        for name, value, target in rows
    ]


def worst_tick(build: Path, runner: Path) -> list[dict[str, object]]:
    """Prints and returns the most cycles of a tick in the scenario of test/avr/controller; [] without a simulator.

    All nine springs transform, are switched, lose their sensors, break and short, under both policies. The ordinary
    tick, of the firmware at work, is bench_board's.
    """
    program = build / "test" / "avr" / "controller" / "controller_avr.elf"
    if not runner.exists() or not program.exists():
        print(f"worst tick: left out, no {runner if program.exists() else program}")
        return []
    names = {"tick_with_model_step": "with a model step", "tick_without_model_step": "without"}
    found = []
    print("worst tick of controller_tick, cycles")
    for line in run(str(runner), str(program)).splitlines():
        name, *counts = line.split()
        if name in names:
            print(f"  {names[name]:<32}{counts[-1]:>8}        <= 100000")
            found.append(
                {
                    "figure": f"controller_tick, worst case, {names[name]}",
                    "value": int(counts[-1]),
                    "unit": "cycles",
                    "target": "<= 100000",
                    "command": COMMAND,
                }
            )
    return found


def main() -> int:
    """Exit code: 0 done, 1 no bound was found, 2 no firmware there."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--avr-build", type=Path, default=Path("build/avr"), help="CMake's build folder for the Mega")
    parser.add_argument(
        "--runner",
        type=Path,
        default=Path("build/host/test/board_thermal_model/avr_runner"),
        help="the simulator that counts cycles",
    )
    parser.add_argument("--json", type=Path, help="also write the figures to this file")
    arguments = parser.parse_args()
    elves = [(arguments.avr_build / name, label) for name, label in VARIANTS.items()]
    present = [(elf, label) for elf, label in elves if elf.exists()]
    if not present:
        print(
            f"firmware.py: {arguments.avr_build}: no firmware.elf here: build it first (script/build)", file=sys.stderr
        )
        return 2
    figures: list[dict[str, object]] = []
    try:
        for elf, label in present:
            figures += measure(arguments.avr_build, elf, label)
    except ValueError as error:
        print(f"firmware.py: {error}", file=sys.stderr)
        return 1
    figures += worst_tick(arguments.avr_build, arguments.runner)
    if arguments.json:
        new = arguments.json.with_suffix(".new")
        new.write_text(json.dumps(figures, indent=2) + "\n")
        new.replace(arguments.json)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
