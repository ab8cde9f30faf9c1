"""docs/calibrating.md and docs/exploring.md, walked to their ends with nothing plugged in, by their own commands."""

from __future__ import annotations

import json
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from made import ELF, ROOT, SIM, needs_board, needs_simulator

pytestmark = pytest.mark.nightly

PROGRAMS = {
    ".venv/bin/ninespring": [sys.executable, "-m", "ninespring"],
    ".venv/bin/python": [sys.executable],
    "build/host/ninespring-sim": [str(SIM)],
}
WALKED = ("board", "plan", "record", "diagnose", "verify", "export", "upload", "replay", "predict")


def commands(page: str) -> list[list[str]]:
    """Return a page's commands in their order, as a shell splits them."""
    text = (ROOT / "docs" / page).read_text().replace("\\\n", " ")
    lines = re.findall(rf"^    ((?:{'|'.join(map(re.escape, PROGRAMS))}) .*)$", text, re.MULTILINE)
    return [shlex.split(line, comments=True) for line in lines]


@needs_board
def test_the_page_is_walked_to_its_end(tmp_path: Path) -> None:
    said: dict[str, str] = {}
    board, *walk = (words for words in commands("calibrating.md") if words[1] in WALKED)
    assert board[1] == "board" and [words[1] for words in walk].count("record") == 3
    with subprocess.Popen(
        [*PROGRAMS[board[0]], *board[1:], "--elf", str(ELF)], stdout=subprocess.PIPE, text=True
    ) as simulated:
        try:
            ports = {name: simulated.stdout.readline().strip() for name in ("/dev/ttyACM0", "/dev/ttyUSB0")}
            for program, *words in walk:
                done = subprocess.run(
                    [*PROGRAMS[program], *(ports.get(word, word) for word in words)],
                    capture_output=True,
                    text=True,
                    cwd=tmp_path,
                    check=False,
                    timeout=600,
                )
                assert done.returncode == 0, (words, done.stdout, done.stderr)
                said[" ".join(words[:1] + ["--port"] * ("--port" in words))] = done.stdout
        finally:
            simulated.terminate()
    found = json.loads((tmp_path / "diagnosis" / "diagnosis.json").read_text())
    assert {one["name"] for one in found["effects"]} == {"edge_loss", "latent_heat"}
    assert not found["unexplained"], found["residual"]["note"]
    before, after = (float(one) for one in re.findall(r"([\d.]+) K", said["verify"]))
    assert before > 3.0 and after < 0.3  # noise is 0.1 K
    on_board, again = (float(one) for one in re.findall(r"([\d.]+) K", said["verify --port"]))
    assert on_board == pytest.approx(after, abs=0.02) == again
    assert len((tmp_path / "predicted.csv").read_text().splitlines()) > 890


SMALL = (
    ("rows = 3\ncols = 3", "rows = 1\ncols = 2"),
    ("[cooling]\n", "[cooling]\nmargin_mm = 5\n"),
    ("margin_mm = 15", ""),
    ("steps = 4", "steps = 2"),
    ("size = [3, 4, 8, 16]", "size = [3, 4]"),
    ("points = 48", "points = 8"),
    ("duration_s = 400\non_s = 240", "duration_s = 200\non_s = 120"),
)
"""The arrays and sweeps of docs/exploring.md, smaller: what it says of them stands in docs/results-tables.md."""


def smaller(text: str) -> str:
    for what, small in SMALL:
        text = text.replace(what, small)
    return text


@needs_simulator
def test_exploring_is_walked_to_its_end(tmp_path: Path) -> None:
    import pandas as pd
    from ninespring.explore.spec import read_spec

    for name in ("skfem", "gmsh", "distributed", "pyarrow", "optuna"):
        pytest.importorskip(name, reason=f"SKIPPED: {name} is missing: script/setup", exc_type=Exception)
    shutil.copytree(ROOT / "bench" / "explore", tmp_path / "bench" / "explore")  # it looks for docs/ from there
    (tmp_path / "docs" / "exploring").mkdir(parents=True)
    for spec in (ROOT / "docs" / "exploring").glob("*.toml"):
        (tmp_path / "docs" / "exploring" / spec.name).write_text(smaller(spec.read_text()))
    # the two files that the page prints: an array to save, and a sweep with all its keys
    page = (ROOT / "docs" / "exploring.md").read_text()
    printed = [
        re.sub("^    ", "", one, flags=re.MULTILINE) for one in re.findall(r"(?:^(?:    .*)?\n)+", page, re.MULTILINE)
    ]
    array, spec = (next(one for one in printed if one.strip().startswith(head)) for head in ("[array]\n", "[sweep]\n"))
    (tmp_path / "array.toml").write_text(smaller(array.strip() + "\n"))
    (tmp_path / "printed.toml").write_text(spec)
    assert read_spec(tmp_path / "printed.toml").points == 8
    walk = commands("exploring.md")
    assert [words[1] for words in walk[:6]] == ["couplings", "couplings", "scenario", "run", "plot", "plot"]
    *walk, (_, everything) = walk
    assert everything == "bench/explore/pictures.py"  # twenty minutes: not here
    for program, *words in walk:
        words = [word.replace("111101111/000010000", "10/01") for word in words]
        more = ["--mesh", "coarse"] if words[0] == "couplings" and "--mesh" not in words else []
        done = subprocess.run(
            [*PROGRAMS[program], *words, *more], capture_output=True, text=True, cwd=tmp_path, check=False, timeout=600
        )
        assert done.returncode == 0, (words, done.stdout, done.stderr)
    assert "best pictures_per_min" in done.stdout
    table = pd.read_parquet(tmp_path / "pitch" / "points")
    assert len(table) == 8 and (table["error"] == "").all()
    assert table.undriven_c[table.fan == 1].max() < table.undriven_c[table.fan == 0].max()
    for made in ("model.toml", "stack.png", "layers.png", "exploring_pitch.svg"):
        assert (tmp_path / made).stat().st_size > 500
