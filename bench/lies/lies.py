"""A sensor that begins to lie, and a supply that only moves: how hot, whether it is said, and who is blamed wrongly.

    .venv/bin/python bench/lies/lies.py [--runs N] [--seed S] [--sim FILE] [--verbose] [--json FILE]

Each run is a scenario of the native board, its numbers drawn from the distributions below: nothing is chosen
for what the firmware does. Half of the runs have a sensor that begins to show another part of its current and of
its voltage; the others have sound sensors and a supply that sags as springs heat, and steps.
"""

from __future__ import annotations

import argparse
import json
import random
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from scipy.stats import binomtest

ROOT = Path(__file__).resolve().parent.parent.parent
LIMIT_C = 120.0
DURATION_S = 420


def pattern(springs: list[int]) -> str:
    """Return the word of `pattern` for springs (0 to 8)."""
    return "".join("1" if spring in springs else "0" for spring in range(9))


def drawn(seed: int, run: int, lies: bool) -> str:
    """Return a scenario: up to eight springs on, off and on again, beside one lie or a supply that moves."""
    draw = random.Random(f"{seed} {run} {lies}")
    springs = draw.sample(range(9), draw.choice((1, 1, 2, 2, 3, 4, 6, 8)))
    drop_v = draw.choice((0.0, draw.uniform(0.25, 0.45)))
    declared_v = draw.choice((0.0, drop_v))
    events = [(1.0, f"pattern {pattern(springs)}")]
    if draw.random() < 0.3:
        events += [(250.0, "pattern 000000000"), (draw.uniform(252, 300), f"pattern {pattern(springs)}")]
    if lies:
        current = draw.uniform(0.6, 1.05)
        other = min(max(current + draw.uniform(-0.06, 0.06), 0.5), 1.1)  # one converter's reference
        pair = draw.choice(((current, other), (current, other), (current, 1.0), (1.0, current)))
        events.append((draw.uniform(3, 330), f"fail lie {springs[0] + 1} {pair[0]:.3f} {pair[1]:.3f}"))
    else:
        for _ in range(draw.choice((0, 1, 2))):
            events.append((draw.uniform(20, 400), f"set supply_v {draw.uniform(4.4, 5.4):.3f}"))
    lines = [
        "[scenario]",
        f"duration_s = {DURATION_S}",
        f"seed = {run}",
        "[plant]",
        "effects = latent_heat, resistance_phase, supply_sag",
        f"supply_v = {draw.uniform(4.6, 5.3):.3f}",
        f"supply_resistance_ohm = {draw.choice((0.01, 0.03, 0.06)):.3f}",
        *([f"freewheel_drop_v = {drop_v:.3f}"] if drop_v else []),
        "[chip]",
        "supply_v = 5.0",
        f"freewheel_v = {declared_v:.3f}",
        "[noise]",
        "current_a = 0.001",
        "voltage_v = 0.001",
        "[events]",
        *(f"at {at_s:.1f} = {word}" for at_s, word in sorted(events)),
    ]
    return "\n".join(lines) + "\n"


def outcome(sim: Path, folder: Path, seed: int, run: int, lies: bool) -> dict[str, Any]:
    """Return what came of a run: degC of its hottest spring, the springs with a fault."""
    scenario = folder / f"{run}_{lies}.ini"
    scenario.write_text(drawn(seed, run, lies))
    summary = scenario.with_suffix(".json")
    log = scenario.with_suffix(".csv")
    done = subprocess.run(
        [sim, "run", scenario, "-o", log, "--json", summary], capture_output=True, text=True, check=False
    )
    if done.returncode != 0:
        sys.exit(f"{scenario.read_text()}{done.stderr}")
    log.unlink()
    springs = json.loads(summary.read_text())["springs"]
    return {
        "run": run,
        "hottest_c": max(spring["highest_c"] for spring in springs),
        "faults": {spring["spring"]: spring["fault"] for spring in springs if spring["fault"] != "none"},
    }


def share(figure: str, count: int, of: int) -> tuple[str, float, str]:
    """Return a figure: per cent of the runs, with its interval of 95 % (Wilson)."""
    between = binomtest(count, of).proportion_ci(method="wilson")
    return f"{figure}, of {of} (95 %: {100 * between.low:.1f} to {100 * between.high:.1f} %)", 100 * count / of, "%"


def main() -> int:
    """Draw, run, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=1000, help="half of them with a lie (default 1000)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--sim", type=Path, default=ROOT / "build" / "host" / "ninespring-sim")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--verbose", action="store_true", help="each run that is too hot, or whose sensors are sound")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    command = f".venv/bin/python bench/lies/lies.py --runs {options.runs} --seed {options.seed}"
    half = options.runs // 2
    with tempfile.TemporaryDirectory() as name, ThreadPoolExecutor(options.jobs) as pool:
        folder = Path(name)

        def all_of(lies: bool) -> list[dict[str, Any]]:
            return list(pool.map(lambda run: outcome(options.sim, folder, options.seed, run, lies), range(half)))

        lying, sound = all_of(True), all_of(False)
        hot = [run for run in lying if run["hottest_c"] > LIMIT_C]
        blamed = [run for run in sound if run["faults"]]
        if options.verbose:
            for lies, run in [(True, run) for run in hot] + [(False, run) for run in blamed]:
                print(json.dumps(run), drawn(options.seed, run["run"], lies), sep="\n")
    figures = (
        share("a sensor begins to lie: above 120 degC", len(hot), half),
        share("... and nothing said", sum(not run["faults"] for run in hot), half),
        ("... hottest", max(run["hottest_c"] for run in lying), "degC"),
        share("sound sensors, a supply that sags and steps: a fault", len(blamed), half),
    )
    rows = [{"figure": f, "value": v, "unit": u, "target": "", "command": command} for f, v, u in figures]
    for row in rows:
        print(f"{row['figure']:85} {row['value']:8.2f} {row['unit']}")
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
