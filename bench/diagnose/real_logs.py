"""What real logs bring: heat of unknown origin, resistance as a second witness, and whether export helps or harms.

    .venv/bin/python bench/diagnose/real_logs.py [--cases N] [--first SEED] [--json FILE]

The data are of `world.py`, which shares nothing with the product, but for the last part: there arrays of the product's own
plant, with other numbers, are driven by the chip's controller with the settings before and after.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import elsewhere
import numpy as np
from cases import REPORTING_SEEDS, SPRINGS, Case, effect_numbers, make_case, write_logs
from kept import Kept
from ninespring.export import drive
from ninespring.export.settings import settings_of
from ninespring.find import board_alone as verdict_of_board
from ninespring.find import diagnosis, plan
from ninespring.find.evidence import excess
from ninespring.infer import from_resistance
from ninespring.infer import problem as fitting
from ninespring.io.logs import log_text, read_log
from ninespring.io.logs.run import Run
from ninespring.io.recording import script_lines
from ninespring.model import native
from ninespring.model.models import Array
from tell import Figures, tell
from world import Inputs, World, random_inputs, simulate

FIGURES = Figures("python bench/diagnose/real_logs.py")
row, percent = FIGURES.row, FIGURES.percent


def diagnosed(case: Case) -> tuple[diagnosis.Diagnosis, float]:
    """Write a case's logs, diagnose the first two; return what was found, and the hours of log."""
    with tempfile.TemporaryDirectory() as folder:
        train, _, _ = write_logs(case, Path(folder))
        runs = [read_log(path, SPRINGS) for path in train]
        return diagnosis.diagnose(Array(), runs), sum(run.duration_s for run in runs) / 3600.0


def unknown_heat(seed: int) -> dict[str, Any]:
    """Inject a step of heat that nothing logs; return whether it was found, and what else was."""
    rng = np.random.default_rng([seed, 11])
    case = make_case("none", (), seed)
    case.columns = "iv"
    case.world.effects.pop("_command", None)
    spring, begin, length = int(rng.integers(9)), float(rng.integers(150, 600)), float(rng.integers(120, 280))
    power = case.runs[0].current[:, spring] ** 2 * case.world.resistance
    watt = float(rng.uniform(0.15, 0.4) * power[power > 0].mean())
    case.world.effects["_heat"] = {"spring": spring, "from": begin, "to": begin + length, "watt": watt}
    found, hours = diagnosed(case)
    events = found.result["unknown_heat"]["events"]
    hits = [
        e
        for e in events
        if e["kind"] == "heat"
        and e["spring"] == spring + 1
        and e["run"] == 1
        and abs(e["from_s"] - begin) <= 30.0
        and abs(e["to_s"] - begin - length) <= 30.0
        and abs(e["size"] - watt) <= 0.25 * watt
    ]
    names = [e["name"] for e in found.result["effects"]]
    return {"found": bool(hits), "others": len(events) - len(hits), "hours": hours, "names": names, "events": events}


def quiet(seed: int) -> dict[str, Any]:
    """Return the events told where nothing acts."""
    case = make_case("none", (), seed)
    found, hours = diagnosed(case)
    return {"others": len(found.result["unknown_heat"]["events"]), "hours": hours}


def second_witness(seed: int) -> dict[str, Any]:
    """Let resistance rise with temperature, or a contact step, or neither; return what v / i named."""
    rng = np.random.default_rng([seed, 13])
    what = ("resistance_temperature", "contact_resistance", "")[seed % 3]
    case = make_case("none", (), seed)
    case.columns, case.sensors = "iv", True
    case.world.effects = {"latent_heat": {"joule": 8.0}, "resistance_phase": {"ratio": 1.25}}
    if what == "resistance_temperature":
        case.world.effects[what] = {"rise": float(rng.uniform(0.0004, 0.0012))}
    if what == "contact_resistance":
        ohm, begin = float(rng.uniform(0.005, 0.02)), float(rng.integers(150, 700))
        case.world.effects[what] = {"spring": float(rng.integers(9)), "from": begin, "ohm": ohm}
    found, _ = diagnosed(case)
    names = {e["name"] for e in found.result["effects"] if e.get("seen_by")}
    return {"what": what, "names": sorted(names)}


def exported(seed: int) -> dict[str, Any]:
    """Diagnose and export the log of a random array; drive that array with the settings before and after."""
    rng = np.random.default_rng([seed, 17])
    plant = native.Plant(3, 3)
    plant.set_effects(["latent_heat", "resistance_phase"])
    numbers = ("heat_capacity_j_per_k", "loss_w_per_k", "loss_fan_w_per_k", "orthogonal_w_per_k", "diagonal_w_per_k")
    for name in (*numbers, "latent_heat_j"):
        plant.set(name, plant.get(name) * rng.uniform(0.8, 1.2))
    cold = bool(seed % 2)
    rows = 900
    time_s = np.arange(float(rows))
    current = np.zeros((rows, 9))
    for k in range(9):
        at = int(rng.integers(5, 60))
        while at < rows:
            hold = int(rng.integers(30, 150))
            current[at : at + hold, k] = 0.0 if rng.random() < 0.4 else rng.uniform(0.8, 1.4 if cold else 2.1)
            at += hold
    fan = ((time_s // 250) % 2 == 1).astype(float)
    twin = plant.copy()
    twin.reset()
    shown = twin.simulate(time_s, native.CURRENT, current, fan, np.full(rows, 20.0))
    twin = plant.copy()
    twin.reset()
    traced = twin.trace(time_s, native.CURRENT, current, fan, np.full(rows, 20.0))
    ohm = (
        plant.get("resistance_martensite_ohm") * (1 - traced[:, :, 1])
        + plant.get("resistance_austenite_ohm") * traced[:, :, 1]
    )
    on = current > 0
    columns = {f"i{k + 1}_a": current[:, k] + 5e-4 * on[:, k] * rng.standard_normal(rows) for k in range(9)}
    columns |= {f"v{k + 1}_v": (current * ohm)[:, k] + 5e-4 * on[:, k] * rng.standard_normal(rows) for k in range(9)}
    columns |= {f"t{k + 1}_c": shown[:, k] + rng.normal(0.0, 0.3, rows) for k in range(9)}
    columns |= {"fan": fan, "ambient_c": np.full(rows, 20.0)}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.csv"
        path.write_text(log_text(time_s, columns))
        found = diagnosis.diagnose(Array(), [read_log(path, 9)])
    made = settings_of(found.model)
    refused = bool(drive.compare(found.model, "", made.lines)[0])
    worse, gains = [], []
    for pattern in drive.patterns(9):
        old, new = (drive.drive(plant, lines, pattern) for lines in ("", made.lines))
        worse += drive.worse_than(old, new)
        gains.append(new.held - old.held)
    return {
        "cold": cold,
        "refused": refused,
        "worse": [] if refused else worse,
        "held": float(np.mean(gains)),
        "names": [e["name"] for e in found.result["effects"]],
        "hottest": float(shown.max()),
    }


SHOWN_BY_BOARD = ("edge_loss", "spring_mismatch", "shared_air", "plate_conduction", "fan_wake", "radiation")
"""Undeclared effects of the array that may act where nothing but v and i is logged."""
FULL_A = 2.6
MATTERS = 0.5
"""Structure, rms in units of the noise of v / i, from which an effect counts as one that v / i can show."""


def planned(array: Array, seed: int) -> Inputs:
    """Return what `ninespring plan --no-thermometer` drives an array with, its steps read as the board reads them."""
    duration_s = 1800
    current, fan = np.zeros((duration_s, SPRINGS)), np.zeros(duration_s)
    made = plan.make_plan(array, duration_s, FULL_A, 14.0, 105.0, seed, board_alone=True)
    for step in script_lines("\n".join(made.steps), "steps.txt", duration_s):
        at, (word, *rest) = int(step.at_s or 0), step.line.split()
        if word == "fan":
            fan[at:] = float(rest[0]) / 100.0
        elif word == "on":
            current[at:, slice(None) if rest[0] == "all" else int(rest[0]) - 1] = float(rest[1]) / 100.0 * FULL_A
    room = np.random.default_rng([seed, 23]).uniform(18.0, 24.0)
    return Inputs(np.arange(float(duration_s)), current, current / FULL_A, fan, np.full(duration_s, room))


def board_alone(seed: int) -> dict[str, Any]:
    """Diagnose half an hour of a board's v and i, no thermometer, as planned; array +-15 %, every second one with an effect
    that nothing declares. Return the chip's error in a later drive with settings before and after, and what was named."""
    rng = np.random.default_rng([seed, 19])
    case = make_case("none", (), seed)
    case.columns, case.sensors = "iv", True
    world = case.world
    for name in ("heat_capacity", "loss", "loss_fan", "orthogonal", "orthogonal_fan", "diagonal", "diagonal_fan"):
        setattr(world, name, getattr(World(), name) * rng.uniform(0.85, 1.15))
    world.effects = {"latent_heat": {"joule": 8.65 * rng.uniform(0.85, 1.15)}, "resistance_phase": {"ratio": 1.25}}
    what = SHOWN_BY_BOARD[seed // 2 % len(SHOWN_BY_BOARD)] if seed % 2 else ""
    if what:
        world.effects[what] = effect_numbers(what, rng)
    case.runs = [planned(Array(), seed), random_inputs(rng, 1800, True)]
    truth = simulate(world, case.runs)["shown"][1]
    with tempfile.TemporaryDirectory() as folder:
        paths, _ = write_logs(replace(case, runs=[*case.runs, case.runs[1]]), Path(folder))[:2]
        board, later = (read_log(path, SPRINGS) for path in paths)
    board = replace(board, temperature_c=np.full_like(board.temperature_c, np.nan))
    told, model = verdict_of_board.diagnose(Array(), [board])
    structure = 0.0
    if what:
        problem, alone, _ = from_resistance.fit(Array(), [board])
        structure = math.sqrt(excess(problem, alone))
    errors = []
    for settings in ("", settings_of(model).lines):
        ambient = later.ambient_c
        assert ambient is not None
        first = np.full(SPRINGS, ambient[0])
        power = np.zeros(SPRINGS)  # of a command: these logs have none
        shown, _ = native.chip_simulate(
            settings, (3, 3), later.time_s, native.POWER, later.drive, power, later.fan, ambient, first
        )
        errors.append(float(np.sqrt(np.mean((shown - truth) ** 2))))
    names = [one.name for one in told.effects]
    return {"what": what, "names": names, "before": errors[0], "after": errors[1], "structure": structure}


def _read(log: dict[str, np.ndarray]) -> Run:
    """Write a log and read it."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.csv"
        path.write_text(log_text(np.arange(float(len(log["fan"]))), log))
        return read_log(path, SPRINGS)


def hides(known: str, runs: list[Run], without: list[Run]) -> float:
    """Return what a cause leaves beside the declared numbers and a known effect's, if any, rms in units of the noise.

    By the truth, no diagnosis: the readings with the cause less those without it, noise and all else the same; what the
    numbers of a fit could take up is projected out.
    """
    problem, fit, _ = diagnosis.fit_effects(Array(), runs, [known] if known else [])
    differs = [one.temperature_c - other.temperature_c for one, other in zip(runs, without, strict=True)]
    vector = problem.vector([np.nan_to_num(one) for one in differs])
    slopes = problem.jacobian(fit.spec, fit.values, problem.predictions(fit.spec, fit.values))
    basis = np.linalg.qr(slopes[:, np.linalg.norm(slopes, axis=0) > 1e-6])[0]
    return float(np.linalg.norm(vector - basis @ (basis.T @ vector)) / math.sqrt(problem.count))


def apart(seed: int) -> dict[str, Any]:
    """Diagnose a case of the other world, a known effect beside a cause without a name; every eighth without the known."""
    known = (*elsewhere.KNOWN, "")[seed % 8]
    unknown = list(elsewhere.UNKNOWN)[(3 * seed + seed // 8) % len(elsewhere.UNKNOWN)]
    acting = ((known, unknown), (known, ""), ("", unknown))
    runs, without, plain = ([_read(log) for log in elsewhere.make(seed, *both).logs] for both in acting)
    begun = time.process_time()
    result = diagnosis.diagnose(Array(), runs).result
    names = [e["name"] for e in result["effects"]]
    said = {"names": names, "rivals": [r["name"] for r in result["rivals"]], "unexplained": result["unexplained"]}
    # rounding is white: it is no structure, and a warning tells it
    said["left"] = hides(known, runs, without)
    said["shown"] = hides("", runs, plain) if known else 0.0
    said["told"] = unknown == "coarse" and any(" step by " in one for one in result["warnings"])
    return {"known": known, "unknown": unknown, "cpu_s": time.process_time() - begun} | said


def _all(job: tuple[Callable[[int], dict[str, Any]], int]) -> dict[str, Any]:
    begun = time.monotonic()
    out = job[0](job[1])
    return out | {"part": job[0].__name__, "seed": job[1], "seconds": time.monotonic() - begun}


def figures(done: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the figures of all parts."""
    part = {name: [one for one in done if one["part"] == name] for name in {one["part"] for one in done}}
    out = []
    if heat := part.get("unknown_heat"):
        out.append(
            percent(
                "unknown heat: a step of 15 to 40 % found at its spring, within 30 s and 25 %",
                [h["found"] for h in heat],
                ">= 90",
            )
        )
        every = [*heat, *part.get("quiet", [])]
        out.append(
            row(
                "other events, an hour of log",
                sum(h["others"] for h in every) / sum(h["hours"] for h in every),
                "1/h",
                "<= 1",
            )
        )
    if seen := part.get("second_witness"):
        for what in ("resistance_temperature", "contact_resistance"):
            out.append(
                percent(f"{what} named from v / i", [what in s["names"] for s in seen if s["what"] == what], ">= 90")
            )
        false = [bool(set(s["names"]) - {s["what"], "resistance_phase"}) for s in seen]
        out.append(percent("v / i named what is not there", false, "<= 10"))
    if boards := part.get("board_alone"):
        before, after = (float(np.median([b[key] for b in boards])) for key in ("before", "after"))
        out.append(row("board alone, no thermometer: the chip's error later, before", before, "K", ""))
        out.append(row("the same, after (median)", after, "K", f"<= {before / 3:.2f}"))
        out.append(percent("the same: at most a third of before", [b["after"] <= b["before"] / 3 for b in boards], ""))
        shown = [b for b in boards if b["structure"] >= MATTERS]
        out.append(
            percent(
                "the same: an undeclared effect named, where it leaves half the noise in v / i",
                [b["what"] in b["names"] for b in shown],
                ">= 80",
            )
        )
        out.append(percent("the same: a false name", [bool(set(b["names"]) - {b["what"]}) for b in boards], ""))
    if others := part.get("apart"):
        beside = [o for o in others if o["known"]]
        out.append(
            percent("another world: the known effect named", [o["known"] in o["names"] for o in beside], ">= 90")
        )
        named = [o["known"] in o["names"] for o in beside if o["shown"] >= MATTERS]
        out.append(percent("the same, where by the truth it leaves half the noise", named, ""))
        out.append(percent("another world: flagged (`unexplained`)", [o["unexplained"] for o in others], ">= 95"))
        told = [o["unexplained"] or o["told"] for o in others]
        out.append(percent("another world: flagged, or the cause told in a warning", told, ""))
        loud = [o["unexplained"] or o["told"] for o in others if o["left"] >= MATTERS]
        out.append(percent("the same, where by the truth the unknown cause leaves half the noise", loud, ""))
        false = [bool(set(o["names"]) - {o["known"]}) for o in others]
        out.append(percent("another world: a false name", false, "<= 10"))
        seconds = [o["cpu_s"] for o in others]
        out.append(row("another world: a diagnosis, longest", max(seconds), "s of one core", "<= 30"))
    if done_exports := part.get("exported"):
        out.append(percent("export: drive worse than before", [bool(e["worse"]) for e in done_exports], "0"))
        out.append(percent("export: refused", [e["refused"] for e in done_exports], ""))
        out.append(
            row(
                "export: change of what is held, mean",
                100.0 * float(np.mean([e["held"] for e in done_exports])),
                "% austenite",
                "",
            )
        )
    return out


def main() -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=12, help="of each part")
    parser.add_argument("--first", type=int, default=REPORTING_SEEDS.start)
    parser.add_argument("--parts", default="unknown_heat,quiet,second_witness,board_alone,exported,apart")
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 2)
    parser.add_argument("--json", type=Path)
    parser.add_argument(
        "--resume", type=Path, help="keep each case here; what it has of this very code is not done again"
    )
    options = parser.parse_args()
    parts = {f.__name__: f for f in (unknown_heat, quiet, second_witness, board_alone, exported, apart)}
    jobs = [
        (parts[name], seed)
        for name in options.parts.split(",")
        for seed in range(options.first, options.first + options.cases)
    ]
    fitting.WORKERS = 1
    kept = Kept(options.resume)
    wanted = {f"{part.__name__} {seed}": (_all, (part, seed)) for part, seed in jobs}
    done = kept.all_of(wanted, options.processes, unsaid="events")
    out = figures(done)
    out = [one for one in out if "(0 of 0)" not in one["figure"]]
    tell(out, options.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
