"""Is a camera's blur named, whatever its kernel? By a Gaussian, an exponential and a box, alone and beside one effect.

    .venv/bin/python bench/diagnose/camera.py [--sets N] [--processes N] [--cases FILE] [--json FILE] [--markdown [FILE]]

The picture is drawn: springs as round spots, between them something that is partly as warm as they are, beyond the array the
room; then blurred pixel by pixel. A reading is the mean of a spot in the middle of a spring. Nothing here knows the law that
explains it (`optical_mixing`), which weighs whole springs by their distance. Widths, in pitches, are the Gaussian's standard
deviation, the exponential's decay and half the box's side. Seeds 0 to 999 are for developing.
"""

from __future__ import annotations

import argparse
import concurrent.futures
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from cases import Case, make_case
from kept import Kept
from ninespring.infer import problem as fitting
from run import judge, named, ratio
from world import COLUMNS, EFFECTS, ROWS, SPRINGS

KERNELS = ("gaussian", "exponential", "box")
OTHERS = tuple(name for name in EFFECTS if name != "optical_mixing")
FIRST = 700_000
"""First of the seeds that are reported."""
PIXELS = 20
"""In a pitch."""
MARGIN = 6
"""Pitches of room drawn around the array."""


def kernel(name: str, width: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return what a pixel sees of those at (x, y) from it, in pitches; its sum is 1."""
    far = np.hypot(x, y)
    if name == "gaussian":
        seen = np.exp(-0.5 * (far / width) ** 2)
    elif name == "exponential":
        seen = np.exp(-far / width)
    else:
        seen = ((np.abs(x) <= width) & (np.abs(y) <= width)).astype(float)
    return seen / seen.sum()


def picture(name: str, width: float, spring: float, between: float, spot: float) -> np.ndarray:
    """Return the weight of each spring in each reading, (9, 9); what is missing to 1 is the room's.

    spring: diameter, pitches. between: share by which what lies between the springs is as warm as those around it.
    spot: radius of what is read of a spring, pitches.
    """
    side = (max(ROWS, COLUMNS) - 1 + 2 * MARGIN) * PIXELS + 1
    at = np.arange(side) / PIXELS - MARGIN
    x, y = np.meshgrid(at, at, indexing="ij")
    centre = (np.arange(side) - side // 2) / PIXELS
    blur = np.fft.rfft2(np.fft.ifftshift(kernel(name, width, *np.meshgrid(centre, centre, indexing="ij"))))
    row, column = np.divmod(np.arange(SPRINGS), COLUMNS)
    far = np.hypot(x - row[:, None, None], y - column[:, None, None])
    bare = (far.min(axis=0) > spring / 2) & (np.abs(x - (ROWS - 1) / 2) < ROWS / 2)
    bare &= np.abs(y - (COLUMNS - 1) / 2) < COLUMNS / 2
    weights = np.zeros((SPRINGS, SPRINGS))
    for k in range(SPRINGS):
        warm = (far[k] <= spring / 2).astype(float)
        # what lies between: bilinear between the springs around it, beside the outer ones as they are
        beside = np.maximum(0.0, 1.0 - np.abs(np.clip(x, 0, ROWS - 1) - row[k]))
        beside = beside * np.maximum(0.0, 1.0 - np.abs(np.clip(y, 0, COLUMNS - 1) - column[k]))
        shown = np.fft.irfft2(np.fft.rfft2(warm + between * beside * bare) * blur, s=x.shape)
        weights[:, k] = [shown[far[i] <= spot].mean() for i in range(SPRINGS)]
    return weights


def make(group: str, other: str | None, seed: int) -> Case:
    """Return a case whose thermometer is a camera: kernels in turn."""
    truth = ("optical_mixing",) if other is None else ("optical_mixing", other)
    case = make_case(group, truth, seed)
    rng = np.random.default_rng([seed, 4242])
    width, spring, between, spot = (rng.uniform(*ends) for ends in ((0.3, 1.0), (0.6, 0.9), (0.2, 0.8), (0.1, 0.3)))
    del case.world.effects["optical_mixing"]
    case.world.camera = picture(KERNELS[seed % len(KERNELS)], width, spring, between, spot)
    return case


def run_case(job: tuple[str, str | None, int]) -> dict[str, Any]:
    """Make one case, diagnose it, compare."""
    fitting.WORKERS = 1
    return judge(make(*job)) | {"kernel": KERNELS[job[2] % len(KERNELS)]}


def figures(cases: list[dict[str, Any]], command: str) -> list[dict[str, Any]]:
    """Return rows of docs/results.md: shares of the cases in which the blur leaves at least half the noise."""
    rows = []
    for group, place, target in (("single", "alone", ">= 95"), ("pair", "beside one effect", ">= 90")):
        some = [c for c in cases if c["group"] == group and "optical_mixing" in c["matters"]]
        for kind in (*KERNELS, None):
            of = [c for c in some if kind in (c["kernel"], None)]
            if of:
                share, hits, count = ratio(of, lambda c: named(c, "optical_mixing"))
                text = f"camera's blur named, {kind or 'any kernel'}, {place} ({hits} of {count})"
                rows.append((text, share, target if kind is None else ""))
        if some:
            share, hits, count = ratio(some, lambda c: bool(set(c["adopted"]) - set(c["truth"])))
            rows.append((f"a false name beside it, {place} ({hits} of {count})", share, ""))
            share, hits, count = ratio(some, lambda c: "edge_loss" in set(c["adopted"]) - set(c["truth"]))
            rows.append((f"of these edge_loss, {place} ({hits} of {count})", share, ""))
    return [
        {"figure": text, "value": round(share, 1), "unit": "%", "target": target, "command": command}
        for text, share, target in rows
    ]


def main() -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sets", type=int, default=30, help="cases alone, and as many beside one effect")
    parser.add_argument("--first", type=int, default=FIRST, help="first seed (default: the reporting range)")
    parser.add_argument("--groups", default="single,pair")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument(
        "--cases", type=Path, help="keep each case here; what it has of this very code is not done again"
    )
    parser.add_argument("--json", type=Path, help="write the figures here")
    parser.add_argument("--markdown", nargs="?", const="-", help="write them as a table")
    options = parser.parse_args()
    jobs: list[tuple[str, str | None, int]] = []
    for k in range(options.sets):
        seed = options.first + k
        jobs += [("single", None, seed)] if "single" in options.groups else []
        jobs += [("pair", OTHERS[seed % len(OTHERS)], seed)] if "pair" in options.groups else []
    kept = Kept(options.cases)
    keys = [f"camera {group} {other} {seed}" for group, other, seed in jobs]
    todo = [(key, job) for key, job in zip(keys, jobs, strict=True) if key not in kept.cases]
    with concurrent.futures.ProcessPoolExecutor(options.processes) as pool:
        for (key, _), case in zip(todo, pool.map(run_case, [job for _, job in todo]), strict=True):
            kept.add(key, case)
            print(
                f"{case['kernel']} {'+'.join(case['truth'])} s{case['seed']} -> {'+'.join(case['adopted']) or 'nothing'} "
                f"rivals {case['rivals']} matters {case['matters']} {case['baseline_rmse_c']:.2f} -> "
                f"{case['after_rmse_c']:.3f} third {case['third_log_c']:.3f} {'UNEXPLAINED' if case['unexplained'] else ''}"
                f" {case['seconds']:.0f} s",
                file=sys.stderr,
                flush=True,
            )
    command = f"python bench/diagnose/camera.py --sets {options.sets}"
    found = figures([kept.cases[key] for key in keys], command)
    lines = [f"### A camera's blur (seeds {options.first} up, {options.sets} alone, {options.sets} beside)", ""]
    lines += ["| figure | value | target |", "|---|---|---|"]
    lines += [f"| {one['figure']} | {one['value']} {one['unit']} | {one['target']} |" for one in found]
    text = "\n".join(lines) + "\n"
    if options.markdown and options.markdown != "-":
        Path(options.markdown).write_text(text, encoding="utf-8")
    else:
        print(text)
    if options.json:
        options.json.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
