"""Writes docs/results.md: runs every benchmark and puts its figures beside their targets.

    script/results                 all of them
    script/results thermal_model   only that section is measured again; the others keep their last figures

A benchmark is one row of SECTIONS. It prints figures for a reader, writes them with ``--json FILE`` as
``[{"figure", "value", "unit", "target", "command"}, ...]``, and may write a Markdown fragment (tables,
pictures) with ``--markdown FILE``. What was measured is kept under docs/results/, so that the page is
always made of files that a command wrote.
"""

from __future__ import annotations

import argparse
import datetime
import json
import operator
import platform
import re
import shlex
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
KEPT = ROOT / "docs" / "results"
PAGE = ROOT / "docs" / "results.md"
TARGET = re.compile(r"(?P<sign><=|>=|<|>)\s*(?P<limit>[-+0-9.e]+)|(?P<none>0)")


@dataclass(frozen=True)
class Section:
    """One part of the page: ``command`` is run from the repository's root."""

    name: str
    title: str
    command: str
    json: bool = True
    markdown: bool = False  # tables of its own; its figures are then kept for programs, but shown there only


HOST = "build/host"
PYTHON = ".venv/bin/python"

SECTIONS: tuple[Section, ...] = (
    Section("thermal_model", "The model on the chip", f"{HOST}/bench/thermal_model/bench_thermal_model"),
    Section("plant", "The simulated array", f"{HOST}/bench/plant/bench_plant"),
    Section("loop", "Controller and array, natively", f"{HOST}/bench/loop/bench_loop"),
    Section("firmware", "The firmware's size", f"{PYTHON} bench/firmware/firmware.py"),
    Section("board", "The firmware on the simulated Mega", f"{HOST}/bench/board/bench_board"),
    Section(
        "policy", "Driving with the neighbours in mind", f"{HOST}/bench/policy/bench_policy --quick", markdown=True
    ),
    Section(
        "worlds",
        "Worlds that are not as declared: the first start ever",
        f"{HOST}/bench/worlds/bench_worlds --seed 2026",
        markdown=True,
    ),
    Section(
        "worlds_learnt",
        "Worlds that are not as declared: later starts",
        f"{HOST}/bench/worlds/bench_worlds --seed 2026 --learnt",
        markdown=True,
    ),
    Section("replay", "Measured logs through the on-chip model", f"{PYTHON} script/replay_fit.py"),
    Section("measured", "Measured data", f"{PYTHON} bench/diagnose/measured.py", json=False, markdown=True),
    Section("diagnose", "Undeclared effects", f"{PYTHON} bench/diagnose/run.py --seeds 4", markdown=True),
    Section("closed_forms", "The field against closed forms", f"{PYTHON} bench/explore/closed_forms.py"),
    Section(
        "explore_paper", "The paper's temperatures from geometry", f"{PYTHON} bench/explore/paper.py --mesh coarse"
    ),
    Section("sweep", "Sweeps", f"{PYTHON} bench/explore/sweep.py"),
    Section("real_logs", "What real logs bring", f"{PYTHON} bench/diagnose/real_logs.py"),
)


def measure(section: Section) -> None:
    """Runs a benchmark and keeps what it wrote; raises CalledProcessError if it fails."""
    print(f"results: {section.name}: {section.command}", file=sys.stderr, flush=True)
    with tempfile.TemporaryDirectory() as directory:
        written: list[tuple[Path, Path]] = []
        arguments = shlex.split(section.command)
        for wanted, option, suffix in (
            (section.json, "--json", ".json"),
            (section.markdown, "--markdown", ".md"),
        ):
            if wanted:
                path = Path(directory) / f"{section.name}{suffix}"
                arguments += [option, str(path)]
                written.append((path, KEPT / path.name))
        subprocess.run(arguments, cwd=ROOT, check=True, stdout=sys.stderr)
        for path, kept in written:  # only once all of it is there
            kept.write_text(path.read_text(encoding="utf-8").rstrip() + "\n", encoding="utf-8")


def number(value: object) -> str:
    """A figure with four significant digits, an integer whole."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return str(value)
    if float(value).is_integer() and abs(value) < 1e9:
        return f"{int(value):,}"
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.4g}"


def figures_of(section: Section) -> list[dict[str, object]]:
    path = KEPT / f"{section.name}.json"
    return json.loads(path.read_text(encoding="utf-8")) if section.json and path.exists() else []


def meets(row: dict[str, object]) -> bool | None:
    """Whether the figure meets its target: ``<= 5``, ``>= 5``, ``< 5``, ``> 5`` or ``0``; None: only for scale."""
    match = TARGET.fullmatch(str(row.get("target")))
    if match is None or not isinstance(row["value"], (int, float)):
        return None
    if match["none"]:
        return row["value"] == 0
    compare = {"<=": operator.le, ">=": operator.ge, "<": operator.lt, ">": operator.gt}
    return compare[match["sign"]](row["value"], float(match["limit"]))


def measured(row: dict[str, object]) -> str:
    unit = "" if row["unit"] == "1" else f" {row['unit']}"
    return f"{number(row['value'])}{unit}"


def table(section: Section) -> list[str]:
    lines = ["| figure | measured | target | |", "|---|---|---|---|"]
    for row in figures_of(section):
        target = row.get("target")
        wanted = "" if target in (None, "") else number(target)
        verdict = {True: "met", False: "**missed**", None: ""}[meets(row)]
        lines.append(f"| {row['figure']} | {measured(row)} | {wanted} | {verdict} |")
    return [*lines, "", f"    {section.command}", ""]


def summary() -> list[str]:
    """How many targets are met, and each that is missed."""
    verdicts = [(section, row, meets(row)) for section in SECTIONS for row in figures_of(section)]
    met = sum(verdict is True for _, _, verdict in verdicts)
    missed = [(section, row) for section, row, verdict in verdicts if verdict is False]
    lines = [f"Of {met + len(missed)} figures with a target, {met} meet it." + (" Missed:" if missed else ""), ""]
    if missed:
        lines += ["| missed | measured | target | section |", "|---|---|---|---|"]
        lines += [f"| {row['figure']} | {measured(row)} | {row['target']} | {at.title} |" for at, row in missed]
        lines.append("")
    return lines


def page() -> str:
    lines = [
        "# Results",
        "",
        "Written by `script/results`: every figure below was measured by the command under its table.",
        "Times are of one machine and are given as ratios where they can be; cycles and bytes are exact.",
        "",
        *summary(),
    ]
    for section in SECTIONS:
        lines += [f"## {section.title}", ""]
        found = False
        if figures_of(section) and not section.markdown:
            lines += table(section)
            found = True
        if section.markdown and (KEPT / f"{section.name}.md").exists():
            lines += [(KEPT / f"{section.name}.md").read_text(encoding="utf-8").rstrip(), ""]
            lines += [f"    {section.command}", ""]
            found = True
        if not found:
            lines += [f"Not measured yet: `{section.command}`.", ""]
    today = datetime.date.today().isoformat()
    lines += ["---", f"Page written {today} on {platform.system()} {platform.machine()}.", ""]
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    names = [section.name for section in SECTIONS]
    parser.add_argument("sections", nargs="*", metavar="SECTION", help=f"one of: {', '.join(names)}; default all")
    arguments = parser.parse_args()
    unknown = sorted(set(arguments.sections) - set(names))
    if unknown:
        parser.error(f"no such section: {', '.join(unknown)}; there are {', '.join(names)}")
    KEPT.mkdir(parents=True, exist_ok=True)
    failed = []
    for section in SECTIONS:
        if arguments.sections and section.name not in arguments.sections:
            continue
        try:
            measure(section)
        except (subprocess.CalledProcessError, OSError) as error:
            print(f"results: {section.name} failed: {error}", file=sys.stderr)
            failed.append(section.name)
        PAGE.write_text(page(), encoding="utf-8")  # after each: what is measured is not lost
    print(f"results: wrote {PAGE.relative_to(ROOT)}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
