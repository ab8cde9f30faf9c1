"""What a release is made of: its workflow names what is there, its version is one, its wheel finds the simulator in itself."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from ninespring.errors import WorkError
from ninespring.io import simulated

ROOT = Path(__file__).resolve().parents[2]
WORKFLOW = (ROOT / ".github" / "workflows" / "release.yml").read_text()


def test_the_workflow_names_jobs_scripts_and_presets_that_are_there() -> None:
    jobs = yaml.safe_load(WORKFLOW)["jobs"]
    for job in jobs.values():
        needs = job.get("needs", [])
        assert set([needs] if isinstance(needs, str) else needs) <= set(jobs)
    scripts = re.findall(r"\bscript/([\w-]+)", WORKFLOW)
    assert {"wheel", "release-version"} <= set(scripts)
    for name in scripts:
        assert os.access(ROOT / "script" / name, os.X_OK), name
    presets = (ROOT / "CMakePresets.json").read_text()
    for name in re.findall(r"--preset (\w+)", WORKFLOW):
        assert f'"name": "{name}"' in presets
    firmware = (ROOT / "firmware" / "CMakeLists.txt").read_text()
    for name in ("firmware", "firmware_hil"):
        assert f"ninespring_add_firmware({name}" in firmware


def release_version(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([ROOT / "script" / "release-version", *words], capture_output=True, text=True, check=False)


def test_a_tag_is_of_the_version_that_the_tree_has() -> None:
    version = release_version().stdout.strip().removeprefix("version=")
    assert re.fullmatch(r"\d+\.\d+\.\d+", version)
    assert release_version(f"v{version}").returncode == 0
    other = release_version("v99.0.0")
    assert other.returncode == 2
    assert f"is not v{version}" in other.stderr


def test_the_package_is_loaded_where_posix_is_not() -> None:
    # what it stands on, first: that has its own ways there
    code = (
        "import click, plotly, prompt_toolkit.shortcuts, rich.live, serial, starlette.routing, uvicorn, websockets\n"
        "import signal, sys\n"
        "sys.modules['termios'] = sys.modules['fcntl'] = sys.modules['pwd'] = sys.modules['resource'] = None\n"
        "del signal.SIGHUP\n"
        "import ninespring.cli.main, ninespring.io.board, ninespring.explore.results, ninespring.dashboard.server\n"
        "from ninespring.io.recording import told_to_stop\n"
        "with told_to_stop() as stopped: print(stopped())\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False)
    assert (done.returncode, done.stdout) == (0, "False\n"), done.stderr


def test_a_wheel_finds_the_simulator_in_itself_and_never_its_own_script(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    home, scripts = tmp_path / "site" / "ninespring", tmp_path / "bin"
    for folder in (home, scripts):
        folder.mkdir(parents=True)
    script = scripts / "ninespring-sim"
    script.write_text("#!/usr/bin/python3\n")  # what pip makes of the package's entry
    script.chmod(0o755)
    monkeypatch.delenv("NINESPRING_SIM", raising=False)
    monkeypatch.setenv("PATH", str(scripts))
    monkeypatch.setattr(simulated, "__file__", str(home / "io" / "simulated.py"))
    with pytest.raises(WorkError, match="this wheel came without it"):
        simulated.simulator()
    program = home / "simulator" / "bin" / "ninespring-sim"
    program.parent.mkdir(parents=True)
    program.write_bytes(b"\x7fELF")
    program.chmod(0o755)
    assert simulated.simulator() == program
