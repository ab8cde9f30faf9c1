"""docs/calibrating.md, walked to its end with nothing plugged in: its own commands, on the simulated board of its first lines."""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SIM = Path(os.environ.get("NINESPRING_SIM", ROOT / "build" / "host" / "ninespring-sim"))
ELF = Path(os.environ.get("NINESPRING_AVR_DIR", ROOT / "build" / "avr")) / "firmware.elf"
PROGRAMS = {".venv/bin/ninespring": [sys.executable, "-m", "ninespring"], "build/host/ninespring-sim": [str(SIM)]}
WALKED = ("board", "plan", "record", "diagnose", "verify", "export", "upload", "replay", "predict")


def commands() -> list[list[str]]:
    """Return the page's commands in their order, as a shell splits them."""
    text = (ROOT / "docs" / "calibrating.md").read_text().replace("\\\n", " ")
    lines = re.findall(rf"^    ((?:{'|'.join(map(re.escape, PROGRAMS))}) .*)$", text, re.MULTILINE)
    return [shlex.split(line, comments=True) for line in lines]


@pytest.mark.skipif(
    not (SIM.exists() and ELF.exists()), reason=f"SKIPPED: {SIM} or {ELF} is not there: script/build makes them"
)
def test_the_page_is_walked_to_its_end(tmp_path: Path) -> None:
    said: dict[str, str] = {}
    board, *walk = (words for words in commands() if words[1] in WALKED)
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
    before, after = (float(one) for one in re.findall(r"([\d.]+) K", said["verify"]))
    assert before > 3.0 and after < 0.3  # noise is 0.1 K
    on_board, again = (float(one) for one in re.findall(r"([\d.]+) K", said["verify --port"]))
    assert on_board == pytest.approx(after, abs=0.02) == again
    assert len((tmp_path / "predicted.csv").read_text().splitlines()) > 890
