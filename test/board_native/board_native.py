"""The same scenario on the native loop and on the flashed ELF: usage board_native.py NINESPRING_SIM AVR_DIR TEST."""

from __future__ import annotations

import csv
import subprocess
import sys
import tempfile
from pathlib import Path

SKIPPED = 77
SPRINGS = 9
# Stated tolerances. The two loops have their ticks and their sensors' windows at different phases: an edge may fall into
# another row, so the rows of an event and the one after are compared with what an edge can make of a mean.
CURRENT_A = 0.015
EDGE_CURRENT_A = 0.15
TEMPERATURE_C = 0.5
MODEL_C = 0.5


def run(program: str, avr: Path, scenario: Path, board: str, output: Path, *more: str) -> None:
    command = [program, "run", str(scenario), "--board", board, "-o", str(output), *more]
    if board == "avr":
        command += ["--elf", str(avr / "firmware.elf")]
    result = subprocess.run(command, check=False, capture_output=True, text=True)
    assert result.returncode == 0, result.stderr


def rows(path: Path) -> list[dict[str, float]]:
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    return [{key: float(value) for key, value in row.items()} for row in csv.DictReader(lines)]


def event_times(scenario: Path) -> list[float]:
    return [float(line.split()[1]) for line in scenario.read_text().splitlines() if line.startswith("at ")]


def equal(program: str, avr: Path, folder: Path) -> None:
    scenario = Path(__file__).with_name("five_minutes.ini")
    run(program, avr, scenario, "native", folder / "native.csv")
    run(program, avr, scenario, "avr", folder / "avr.csv")
    native, avr_rows = rows(folder / "native.csv"), rows(folder / "avr.csv")
    assert list(native[0]) == list(avr_rows[0]), "the logs have different columns"
    assert len(native) == len(avr_rows) == 301
    edges = {round(time) + step for time in event_times(scenario) for step in (-1, 0, 1)}
    worst = {"current": 0.0, "edge current": 0.0, "temperature": 0.0, "model": 0.0}
    for one, other in zip(native, avr_rows, strict=True):
        edge = round(one["time_s"]) in edges
        for k in range(1, SPRINGS + 1):
            current = abs(one[f"i{k}_a"] - other[f"i{k}_a"])
            name = "edge current" if edge else "current"
            worst[name] = max(worst[name], current)
            worst["temperature"] = max(worst["temperature"], abs(one[f"p{k}_c"] - other[f"p{k}_c"]))
            worst["model"] = max(worst["model"], abs(one[f"m{k}_c"] - other[f"m{k}_c"]))
    print("largest differences:", worst)
    assert max(row["p1_c"] for row in avr_rows) > 60.0, "the scenario heats nothing"
    assert worst["current"] <= CURRENT_A
    assert worst["edge current"] <= EDGE_CURRENT_A
    assert worst["temperature"] <= TEMPERATURE_C
    assert worst["model"] <= MODEL_C


def determinism(program: str, avr: Path, folder: Path) -> None:
    scenario = folder / "short.ini"
    scenario.write_text(
        "[scenario]\nduration_s = 12\nlog_interval_s = 0.1\n[noise]\ncurrent_a = 0.001\nvoltage_v = 0.002\n"
        "temperature_c = 0.1\n[events]\nat 0.5 = on all\nat 3 = fail open 5\nat 5 = fail sda_low\nat 6 = repair sda_low\n"
        "at 7 = clear\nat 7.5 = on 1\nat 8 = fail brown_out\nat 9 = unlock\nat 9.5 = pattern 101010101\n"
    )
    names = [folder / f"{k}.csv" for k in range(3)]
    run(program, avr, scenario, "avr", names[0])
    run(program, avr, scenario, "avr", names[1])
    run(program, avr, scenario, "avr", names[2], "--seed", "2")
    first, second, third = (name.read_bytes() for name in names)
    assert first == second, "two runs differ"
    assert first != third, "the seed changes nothing: is the noise on?"


def main() -> int:
    program, avr, what = sys.argv[1], Path(sys.argv[2]), sys.argv[3]
    if not (avr / "firmware.elf").exists():
        print(f"SKIPPED: {avr / 'firmware.elf'} is not there: build the avr target first")
        return SKIPPED
    with tempfile.TemporaryDirectory() as folder:
        {"equal": equal, "determinism": determinism}[what](program, avr, Path(folder))
    print("PASS")
    return 0


if __name__ == "__main__":
    sys.exit(main())
