"""What a release is made of: its workflow names what is there, its version is one, its wheel finds the simulator in itself."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import yaml
from ninespring.errors import WorkError
from ninespring.io import simulated
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[2]
WORKFLOW = (ROOT / ".github" / "workflows" / "release.yml").read_text()


def test_the_workflow_names_jobs_scripts_and_presets_that_are_there() -> None:
    jobs = yaml.safe_load(WORKFLOW)["jobs"]
    for job in jobs.values():
        needs = job.get("needs", [])
        assert set([needs] if isinstance(needs, str) else needs) <= set(jobs)
    scripts = re.findall(r"\bscript/([\w-]+)", WORKFLOW)
    assert {"wheel", "release-version", "sbom"} <= set(scripts)
    for name in scripts:
        assert os.access(ROOT / "script" / name, os.X_OK), name
    presets = (ROOT / "CMakePresets.json").read_text()
    for name in re.findall(r"--preset (\w+)", WORKFLOW):
        assert f'"name": "{name}"' in presets
    firmware = (ROOT / "firmware" / "CMakeLists.txt").read_text()
    for name in ("firmware", "firmware_hil"):
        assert f"ninespring_add_firmware({name}" in firmware


def locked(name: str) -> dict[str, list[str]]:
    """The versions of each package in requirements/NAME.txt; fails where one has no hash."""
    versions: dict[str, list[str]] = {}
    for entry in re.split(r"\n(?=\S)", (ROOT / "requirements" / f"{name}.txt").read_text()):
        if not entry.startswith("#"):
            assert "--hash=sha256:" in entry, entry
            package, version = re.match(r"([\w.-]+)==(\S+)", entry).groups()
            versions.setdefault(package, []).append(version)
    return versions


def test_what_the_package_asks_for_is_locked_with_hashes() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    wanted = {"run": project["project"]["dependencies"] + project["build-system"]["requires"]}
    wanted["test"] = wanted["run"] + [
        line for extra in project["project"]["optional-dependencies"].values() for line in extra
    ]
    for name, requirements in wanted.items():
        versions = locked(name)
        for requirement in map(Requirement, requirements):
            found = versions.get(canonicalize_name(requirement.name), [])
            assert found, f"{requirement} is not in requirements/{name}.txt: script/lock"
            assert all(requirement.specifier.contains(version) for version in found), f"{requirement}: script/lock"
    tested = locked("test")
    assert {name: versions for name, versions in locked("run").items() if tested.get(name) != versions} == {}


@pytest.mark.parametrize("name", ["run", "test"])
def test_the_lock_names_no_index(name: str) -> None:
    lines = (ROOT / "requirements" / f"{name}.txt").read_text().splitlines()
    assert [line for line in lines if "://" in line or line.startswith("-")] == []


@pytest.mark.parametrize(
    ("kind", "whole", "parts"),
    [
        ("firmware", "MIT", {"avr-libc", "libgcc"}),
        ("simulator", "GPL-3.0-or-later", {"avr-libc", "libgcc", "simavr", "libelf", "numpy"}),
        ("package", "MIT", {"numpy", "scipy", "starlette"}),
    ],
)
def test_a_release_says_what_it_is_made_of(kind: str, whole: str, parts: set[str]) -> None:
    run = subprocess.run([sys.executable, ROOT / "script" / "sbom", kind], capture_output=True, text=True, check=True)
    document = json.loads(run.stdout)
    product = document["metadata"]["component"]
    assert product["licenses"] == [{"expression": whole}]
    assert product["version"] == release_version().stdout.strip().removeprefix("version=")
    found = {part["name"]: part for part in document["components"]}
    assert parts <= set(found)
    for name in parts & set(locked("run")):
        assert found[name]["version"] in locked("run")[name]
    assert all("version" in part or part["name"] in run.stderr for part in found.values())


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
