"""Writes docs/results.md, which is read in two minutes, and docs/results-tables.md: every figure beside its target.

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
TABLES = ROOT / "docs" / "results-tables.md"
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
    Section("scale", "Arrays up to 32 x 32", f"{HOST}/bench/plant/bench_scale"),
    Section("loop", "Controller and array, natively", f"{HOST}/bench/loop/bench_loop"),
    Section("firmware", "The firmware's size", f"{PYTHON} bench/firmware/firmware.py"),
    Section("board", "The firmware on the simulated Mega", f"{HOST}/bench/board/bench_board"),
    Section(
        "policy", "Driving with the neighbours in mind", f"{HOST}/bench/policy/bench_policy --quick", markdown=True
    ),
    Section(
        "worlds",
        "Worlds that are not as declared: the first start ever",
        f"{HOST}/bench/worlds/bench_worlds --seed 2037",
        markdown=True,
    ),
    Section(
        "worlds_learnt",
        "Worlds that are not as declared: later starts",
        f"{HOST}/bench/worlds/bench_worlds --seed 2037 --learnt",
        markdown=True,
    ),
    Section(
        "swarm",
        "Worlds that nobody listed: everything drawn at once",
        f"{HOST}/bench/worlds/bench_worlds --swarm 2000 --seed 2923",
        markdown=True,
    ),
    Section(
        "swarm_knows",
        "The same, driven by whoever knows all that is true",
        f"{HOST}/bench/worlds/bench_worlds --swarm 2000 --seed 2918 --knows",
        markdown=True,
    ),
    Section(
        "board_swarm",
        "The board in everything at once",
        f"{HOST}/bench/swarm/bench_swarm --runs 190 --seed 7407537 --resume build/results/board_swarm.txt",
    ),
    Section(
        "lies",
        "A sensor that begins to lie, or a supply that moves",
        f"{PYTHON} bench/lies/lies.py --runs 4000 --seed 7105",
    ),
    Section("flips", "Bits that turn over", f"{HOST}/bench/swarm/bench_flips --runs 50 --boards 40 --seed 8001"),
    Section("mutate", "What the tests notice", "script/mutate"),
    Section("replay", "Measured logs through the on-chip model", f"{PYTHON} script/replay_fit.py"),
    Section("measured", "Measured data", f"{PYTHON} bench/diagnose/measured.py", json=False, markdown=True),
    Section(
        "diagnose",
        "Undeclared effects",
        f"{PYTHON} bench/diagnose/run.py --seeds 1 --first 300830 --processes 1 --cases build/results/diagnose.json",
        markdown=True,
    ),
    Section(
        "hours",
        "Hours of log",
        f"{PYTHON} bench/diagnose/hours.py --cases 10 --first 341403 --processes 1 --resume build/results/hours.json "
        "--parts unseen,wander,half_a_day",
    ),
    Section(
        "halves",
        "The second half of a run by its first",
        f"{PYTHON} bench/diagnose/hours.py --parts halves --processes 1",
    ),
    Section(
        "finned",
        "Finned boards in a box",
        f"{PYTHON} bench/diagnose/hours.py --cases 6 --first 341220 --processes 1 --resume build/results/finned.json --parts finned",
    ),
    Section(
        "camera",
        "A camera's blur",
        f"{PYTHON} bench/diagnose/camera.py --sets 15 --first 700300 --processes 1 --cases build/results/camera.json",
        markdown=True,
    ),
    Section("closed_forms", "The field against closed forms", f"{PYTHON} bench/explore/closed_forms.py"),
    Section(
        "explore_paper", "The paper's temperatures from geometry", f"{PYTHON} bench/explore/paper.py --mesh coarse"
    ),
    Section("stiffness", "The stiffness layer", f"{PYTHON} bench/explore/stiffness.py"),
    Section("worst", "The worst patterns of 8 x 8", f"{PYTHON} bench/explore/worst.py"),
    Section("field_logs", "Logs of the field, diagnosed", f"{PYTHON} bench/diagnose/field.py", markdown=True),
    Section("sweep", "Sweeps", f"{PYTHON} bench/explore/sweep.py"),
    Section(
        "real_logs",
        "What real logs bring",
        f"{PYTHON} bench/diagnose/real_logs.py --first 311500 --resume build/results/real_logs.json",
    ),
    Section("actuator", "A real actuator, each run alone", f"{PYTHON} bench/diagnose/actuator.py"),
    Section("size", "How much there is to read", f"{PYTHON} bench/size.py"),
    Section("dashboard", "The live page", f"{PYTHON} bench/dashboard/run.py"),
)


def measure(section: Section) -> None:
    """Runs a benchmark and keeps what it wrote; raises CalledProcessError if it is broken.

    One that ends with 1 and has written all that it was asked for says that something misses its target: so does the page.
    """
    print(f"results: {section.name}: {section.command}", file=sys.stderr, flush=True)
    with tempfile.TemporaryDirectory() as directory:
        written: list[tuple[Path, Path]] = []
        arguments = shlex.split(section.command)
        for wanted, option, suffix in ((section.json, "--json", ".json"), (section.markdown, "--markdown", ".md")):
            if wanted:
                path = Path(directory) / f"{section.name}{suffix}"
                arguments += [option, str(path)]
                written.append((path, KEPT / path.name))
        done = subprocess.run(arguments, cwd=ROOT, check=False, stdout=sys.stderr)
        if done.returncode != 1 or not all(path.exists() for path, _ in written):
            done.check_returncode()
        for path, kept in written:  # only once all of it is there
            kept.write_text(path.read_text(encoding="utf-8").rstrip() + "\n", encoding="utf-8")
    code = of_git("rev-parse", "--short", "HEAD")
    code += "-dirty" if of_git("status", "--porcelain", "--untracked-files=no", "--", ":!docs") else ""
    measured_on = when()
    measured_on[section.name] = f"{datetime.date.today().isoformat()}, {code}"
    (KEPT / "when.json").write_text(json.dumps(measured_on, indent=1, sort_keys=True) + "\n", encoding="utf-8")


def of_git(*words: str) -> str:
    return subprocess.run(("git", *words), cwd=ROOT, check=True, capture_output=True, text=True).stdout.strip()


def when() -> dict[str, str]:
    """Return on which day, of which commit the figures of each section are."""
    path = KEPT / "when.json"
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


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
    between = f" ({number(row['low'])} to {number(row['high'])})" if row.get("low") is not None else ""
    return f"{number(row['value'])}{unit}{between}"


def table(section: Section) -> list[str]:
    lines = ["| figure | measured | target | |", "|---|---|---|---|"]
    for row in figures_of(section):
        target = row.get("target")
        wanted = "" if target in (None, "") else number(target)
        verdict = {True: "met", False: "**missed**", None: ""}[meets(row)]
        lines.append(f"| {row['figure']} | {measured(row)} | {wanted} | {verdict} |")
    return [*lines, "", f"    {section.command}", ""]


HEADLINES: tuple[tuple[str, tuple[tuple[str, str, str], ...]], ...] = (
    (
        "Is driving by the model worth it? Beside each: springs kept at 105 degC, as the paper did (B105), and at 1.5 A (B1.5)",
        (
            (
                "rise of the undriven centre while its eight neighbours are held",
                "policy",
                "rise of the undriven centre",
            ),
            (
                "energy over ten minutes, of B105's, mean of 512 patterns",
                "policy",
                "energy over 10 min, of B105's, mean, 512",
            ),
            ("all nine from cold to austenite within 15 A", "policy", "all nine, within 15 A"),
            ("a spring that is switched off is martensite again after", "policy", "release: centre of eight held"),
            ("driven springs that never transform, of 2304", "policy", "driven springs that never reach 99 %, 512"),
        ),
    ),
    (
        "Does it believe what is true? The array as declared, from power-on, nothing told",
        (
            ("all nine transformed after", "worlds", "declared: latest start, nine"),
            (
                "temperature and phase within their bounds (99 % are promised)",
                "worlds",
                "declared: temperature and phase",
            ),
            ("half width of the temperature's bounds", "worlds", "declared: half width of the temperature"),
            ("hottest that any spring came", "worlds", "declared: hottest true"),
        ),
    ),
    (
        "Does it hold in worlds that nobody listed? Everything drawn at once, 2,000 runs of 15 minutes, 95 % intervals",
        (
            ("runs with any spring above 120 degC", "swarm", "all: runs with any spring above"),
            ("... of those with a user of levels, a quarter", "swarm", "levels: runs with any spring above"),
            ("driven springs below 90 % for more than a minute", "swarm", "all: driven springs below 90 %"),
            ("... and nothing said", "swarm", "all: the same, and nothing said for so long"),
            ("time at 95 % austenite or above", "swarm", "all: time at 95 %"),
            ("... where nothing steps", "swarm", "nothing steps: time at 95 %"),
            ("... of it said to be away for nothing", "swarm", "all: of that, said to be away"),
            ("back at 95 % two minutes after a draught, a door, a fan", "swarm", "all: after a lasting step"),
            ("temperature and phase within their bounds", "swarm", "all: time in which true"),
            ("whoever knows all that is true: springs below 90 %", "swarm_knows", "all: driven springs below 90 %"),
            ("... and runs above 120 degC", "swarm_knows", "all: runs with any spring above"),
        ),
    ),
    (
        "What if parts of it fail? The firmware on a simulated board, faults drawn from seeds",
        (
            ("lives in which something that must hold was broken", "board_swarm", "lives in which"),
            ("... over simulated hours", "board_swarm", "simulated hours"),
            ("a sensor begins to show less: above 120 degC", "lies", "a sensor begins to lie"),
            ("... and nothing said", "lies", "... and nothing said"),
            ("sound sensors, a supply that moves: a fault", "lies", "sound sensors"),
            ("bits turned over, RAM and registers", "flips", "flips"),
            ("... that leave a spring hotter by 10 K unsaid", "flips", "... that leave"),
        ),
    ),
    (
        "Does the diagnosis find what it is not told?",
        (
            ("one undeclared effect: named, or as a rival", "diagnose", "single effect adopted or named"),
            ("two undeclared effects: both named", "diagnose", "both effects of a pair"),
            ("nothing missing: nothing named", "diagnose", "nothing adopted where nothing"),
            (
                "an effect outside of the library: said to be unexplained",
                "diagnose",
                "flagged unexplained, effect outside",
            ),
            ("of those called certain, right", "diagnose", "of those called 0.8 to 1"),
            ("no thermometer at all: the chip's error before", "real_logs", "board alone, no thermometer"),
            ("... and after", "real_logs", "the same, after"),
        ),
    ),
    (
        "What does it cost?",
        (
            ("worst control tick, of 320,000 cycles", "firmware", "controller_tick, worst case, without"),
            ("flash, of 253,952 bytes", "firmware", "flash (integer"),
            ("RAM left in the worst case, of 8,192 bytes", "firmware", "RAM left in the worst case (integer"),
            (
                "chip's fixed-point model against double precision, rms",
                "thermal_model",
                "fixed point against double, 200 sets x 1 h, with",
            ),
            ("simulated array and controller", "loop", "controller + plant, native, 9"),
        ),
    ),
)
"""What the first page shows: words, section, and how the figure's name begins."""
WORLDS = ("worlds", "worlds_learnt")


def section_named(name: str) -> Section:
    return next(section for section in SECTIONS if section.name == name)


def headline(words: str, name: str, begins: str) -> list[str]:
    """Return a row: words, what was measured (baselines beside it), target and verdict."""
    rows = [row for row in figures_of(section_named(name)) if str(row["figure"]).startswith(begins)]
    if not rows:
        return [words, "not measured", "", ""]
    first, *others = rows
    beside = [
        f"{str(row['figure']).rpartition(' - ')[2]} {measured(row)}" for row in others if " - B" in str(row["figure"])
    ]
    verdict = {True: "met", False: "**missed**", None: ""}[meets(first)]
    target = first.get("target")
    return [words, "; ".join([measured(first), *beside]), "" if target in (None, "") else str(target), verdict]


def worlds_in_words() -> list[str]:
    """Return in how many worlds every target is met, and which ones miss what."""
    lines = []
    for name in WORLDS:
        section = section_named(name)
        worlds: set[str] = set()
        missed: dict[str, list[str]] = {}
        for row in figures_of(section):
            world, colon, what = str(row["figure"]).partition(": ")
            if colon and meets(row) is not None:
                worlds.add(world)
                missed.setdefault(f"{what}, {row['target']}", []).extend([world] if meets(row) is False else [])
        if worlds:
            met = len(worlds - {world for missing in missed.values() for world in missing})
            lines += [f"{section.title}: every target is met in {met} of {len(worlds)}.", ""]
            lines += ["| target | missed in |", "|---|---|"]
            lines += [f"| {what} | {', '.join(missing)} |" for what, missing in missed.items() if missing]
            lines.append("")
    return lines


def anchor(title: str) -> str:
    """Return a heading's anchor as the site and the forge make it."""
    return re.sub(r"[^a-z0-9 _-]", "", title.lower()).replace(" ", "-")


def first_page() -> str:
    """What a reader wants to know, in two minutes."""
    lines = [
        "# Results",
        "",
        "Written by `script/results`, like the [tables](results-tables.md) that it is taken from.",
        "",
    ]
    for question, rows in HEADLINES:
        if not any(figures_of(section_named(name)) for _, name, _ in rows):
            continue  # a new benchmark, of which nothing is kept yet
        lines += [f"## {question}", "", "| | measured | target | |", "|---|---|---|---|"]
        lines += [f"| {' | '.join(headline(*row))} |" for row in rows]
        lines.append("")
    lines += ["## Does it hold where the array is not as declared?", "", "[Worlds](worlds.md) says what each is.", ""]
    lines += worlds_in_words()
    measured_on = when()
    lines += ["## All targets", "", "| section | met | missed | measured on, of commit |", "|---|---|---|---|"]
    for section in SECTIONS:
        verdicts = [meets(row) for row in figures_of(section)]
        counts = f"{verdicts.count(True)} | {verdicts.count(False)}" if figures_of(section) else " | "
        row = f"[{section.title}](results-tables.md#{anchor(section.title)}) | {counts} | {measured_on.get(section.name, '')}"
        lines.append(f"| {row} |")
    return "\n".join([*lines, "", written()])


def written() -> str:
    today = datetime.date.today().isoformat()
    return f"Page written {today} on {platform.system()} {platform.machine()}.\n"


def tables() -> str:
    """Every figure."""
    lines = [
        "# Results: the tables",
        "",
        "Written by `script/results`: every figure below was measured by the command under its table; [Results](results.md) is the short of it.",
        "Times are of one machine and are given as ratios where they can be; cycles and bytes are exact.",
        "",
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
    return "\n".join([*lines, "---", written()])


def write_pages() -> None:
    PAGE.write_text(first_page(), encoding="utf-8")
    TABLES.write_text(tables(), encoding="utf-8")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    names = [section.name for section in SECTIONS]
    parser.add_argument("--pages", action="store_true", help="only write the pages anew from what is kept")
    parser.add_argument("sections", nargs="*", metavar="SECTION", help=f"one of: {', '.join(names)}; default all")
    arguments = parser.parse_args()
    unknown = sorted(set(arguments.sections) - set(names))
    if unknown:
        parser.error(f"no such section: {', '.join(unknown)}; there are {', '.join(names)}")
    KEPT.mkdir(parents=True, exist_ok=True)
    if arguments.pages:
        write_pages()
        return 0
    failed = []
    for section in SECTIONS:
        if arguments.sections and section.name not in arguments.sections:
            continue
        try:
            measure(section)
        except (subprocess.CalledProcessError, OSError) as error:
            print(f"results: {section.name} failed: {error}", file=sys.stderr)
            failed.append(section.name)
        write_pages()  # after each: what is measured is not lost
    print(f"results: wrote {PAGE.relative_to(ROOT)} and {TABLES.relative_to(ROOT)}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
