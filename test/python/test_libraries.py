"""Each library that others take stands alone: it and what it names as its dependencies compile for the Mega elsewhere."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
CORE = Path("/usr/share/arduino/hardware/arduino/avr")
LIBRARIES = {json.loads(one.read_text())["name"]: one.parent for one in sorted(ROOT.glob("lib/*/library.json"))}
WARNINGS = ("-Wall", "-Wextra", "-Werror")
MEGA = ("-mmcu=atmega2560", "-DF_CPU=16000000L", "-DARDUINO=10819", "-DARDUINO_ARCH_AVR", "-Os", *WARNINGS)


def described(name: str) -> dict[str, object]:
    return json.loads((LIBRARIES[name] / "library.json").read_text())


def needed(name: str) -> list[str]:
    """Return a library with all that it depends on, by its own word."""
    out = [name]
    for one in out:
        out += [d["name"] for d in described(one).get("dependencies", []) if d["name"] not in out]
    return out


@pytest.mark.parametrize("name", LIBRARIES)
def test_its_descriptions_say_the_same_as_its_build(name: str) -> None:
    folder = LIBRARIES[name]
    properties = dict(line.split("=", 1) for line in (folder / "library.properties").read_text().splitlines())
    data = described(name)
    assert properties["name"] == name and properties["version"] == data["version"]
    said = [one["name"] for one in data.get("dependencies", [])]
    assert properties.get("depends", "").split(",") == (said or [""])
    names = {path.name: other for other, path in LIBRARIES.items()}
    depends = re.search(r"\bDEPENDS\s+([^)]*)\)", (folder / "CMakeLists.txt").read_text())
    assert sorted(said) == sorted(names[one] for one in (depends[1].split() if depends else []))
    assert (folder / data["headers"]).exists()


@pytest.fixture(scope="module")
def elsewhere(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a copy of each library, where each was compiled once, with nothing but what it names."""
    folder = tmp_path_factory.mktemp("libraries")
    for name, home in LIBRARIES.items():
        shutil.copytree(home, folder / name, ignore=shutil.ignore_patterns("CMakeLists.txt"))
    return folder


def build(*words: object) -> None:
    done = subprocess.run(list(map(str, words)), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def compiled(folder: Path, name: str) -> list[Path]:
    """Return a library's objects."""
    objects = []
    for source in (folder / name).glob("*.c"):
        objects.append(source.with_suffix(".o"))
        if not objects[-1].exists():
            include = [f"-I{folder / one}" for one in needed(name)]
            build("avr-gcc", *MEGA, "-std=c99", *include, "-c", source, "-o", objects[-1])
    return objects


@pytest.mark.skipif(shutil.which("avr-gcc") is None, reason="SKIPPED: no avr-gcc: script/setup installs it")
@pytest.mark.parametrize("name", LIBRARIES)
def test_it_and_its_examples_compile_for_the_mega_outside_of_the_tree(name: str, elsewhere: Path) -> None:
    include = [f"-I{elsewhere / one}" for one in needed(name)]
    objects = [made for one in needed(name) for made in compiled(elsewhere, one)]
    examples = list((elsewhere / name / "examples").glob("*/*.ino"))
    assert len(examples) == len(described(name).get("examples", []))
    if examples and not CORE.is_dir():
        pytest.skip(f"SKIPPED: no Arduino core at {CORE}: script/setup installs it")
    core = [f"-I{CORE / 'cores/arduino'}", f"-I{CORE / 'variants/mega'}"]
    for example in examples:
        made = example.with_suffix(".o")
        cpp = ("-std=gnu++11", "-x", "c++", "-include", "Arduino.h", *core)
        build("avr-g++", *MEGA, *cpp, *include, "-c", example, "-o", made)
        # whatever it calls is in the libraries that it names, in the core, or in the compiler's own
        undefined = subprocess.run(["avr-nm", "-u", made, *objects], capture_output=True, text=True, check=True).stdout
        defined = subprocess.run(
            ["avr-nm", "--defined-only", *objects], capture_output=True, text=True, check=True
        ).stdout
        own = {path.name for path in LIBRARIES.values()}
        missing = set(re.findall(r" U (\w+)", undefined)) - set(re.findall(r" [TtDdBbRrVvWw] (\w+)", defined))
        assert not [one for one in missing if any(one.startswith(f"{prefix}_") for prefix in own)]
