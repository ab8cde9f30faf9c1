"""The repository as others meet it: one version, a site without broken links, a package that installs anywhere."""

from __future__ import annotations

import json
import os
import re
import site
import subprocess
import sys
import venv
from pathlib import Path

import nbformat
import ninespring
import pytest
from jupyter_client import AsyncKernelManager
from made import ROOT, SIM, needs_simulator
from nbclient import NotebookClient

VERSION = re.search(r"project\(ninespring VERSION ([0-9.]+)", (ROOT / "CMakeLists.txt").read_text())[1]


def run(*words: object, **more: object) -> subprocess.CompletedProcess[str]:
    done = subprocess.run(list(map(str, words)), capture_output=True, text=True, timeout=280, check=False, **more)
    assert done.returncode == 0, done.stdout + done.stderr
    return done


def test_the_version_stands_in_one_place() -> None:
    assert ninespring.__version__ == VERSION
    assert f"\nversion: {VERSION}\n" in (ROOT / "CITATION.cff").read_text()
    assert f"## {VERSION}\n" in (ROOT / "CHANGELOG.md").read_text()
    for library in ROOT.glob("lib/*/library.json"):
        assert json.loads(library.read_text())["version"] == VERSION, library


def test_the_site_builds_without_a_warning(tmp_path: Path) -> None:
    run(sys.executable, "-m", "mkdocs", "build", "--strict", "-f", ROOT / "mkdocs.yml", "-d", tmp_path / "site")
    index = (tmp_path / "site" / "index.html").read_text()
    # nothing is loaded from elsewhere
    assert not re.findall(r'<(?:script|link)[^>]+(?:src|href)="https?://(?!127)[^"]+\.(?:js|css)', index)


def test_each_test_that_the_page_of_failures_names_is_run() -> None:
    named = 0
    for line in (ROOT / "docs" / "safety.md").read_text().splitlines():
        cell = line.rsplit("|", 2)[-2] if line.startswith("| ") else ""
        words = re.findall(r"`(\w+)`", cell)
        programs = [word for word in words if (ROOT / "test" / word).is_dir()]
        text = "".join(path.read_text() for program in programs for path in (ROOT / "test" / program).glob("*.c*"))
        for word in words:
            assert word in programs or f"TEST({word})" in text, f"docs/safety.md: {line}"
        named += bool(words)
    assert named > 30


INSIDE = (
    "lib/spring_estimator/",
    "test/fakes/belief_inside.h",
    *(f"test/test_spring_estimator/{name}.c" for name in ("law", "rules", "seals", "watch")),
)
BELIEF = r"\bspring_(?:belief|estimator)_t"
TOLD = {"spring_estimator_" + what for what in ("begin_heating", "begin_hold", "leave", "disturb")}


def looks_inside(text: str, members: set[str]) -> set[str]:
    """Return the places of a C source that read or write a field of a belief."""
    own = set(re.findall(BELIEF + r"\s*(?:\*\s*)?(?:const\s+)?(\w+)", text)) | members
    by_the_way_in = set(re.findall(r"(\w+) = belief_inside\(", text))
    names = "|".join(sorted(own - by_the_way_in)) or "-"
    of = r"(?:spring_estimator_of\([^(){};]*\)|\b(?:" + names + r")(?:\[[^]]*\])?)\s*(?:->|\.)\s*\w+"
    return {found[0] for found in re.finditer(of, text)}


def test_nobody_looks_into_what_is_believed_but_the_estimator() -> None:
    sources = [*ROOT.glob("lib/*/*.[ch]"), *ROOT.glob("lib/*/examples/*/*.ino")]
    for folder in ("firmware", "sim_host", "calibrate/src/native", "bench", "test"):
        sources += [path for path in (ROOT / folder).rglob("*.*") if path.suffix in {".c", ".h", ".cpp", ".hpp"}]
    texts = {
        str(path.relative_to(ROOT)): re.sub(r"/\*.*?\*/|//[^\n]*", "", path.read_text(), flags=re.S) for path in sources
    }
    members = {name for name in texts if name.startswith("lib/")}
    members = {field for name in members for field in re.findall(BELIEF + r"\s*\*?\s*(\w+);", texts[name])}
    assert {"belief", "estimator"} <= members
    for name, text in texts.items():
        if not name.startswith(INSIDE):
            assert not looks_inside(text, members), f"{name} looks into what is believed"
        assert "belief_inside.h" not in text or name.startswith("test/"), name
    # the policy tells it what it does, and nothing else
    surface = texts["lib/spring_estimator/spring_estimator.h"]
    changing = set(re.findall(r"\bvoid (spring_estimator_\w+)\(spring_estimator_t \*", surface))
    policy = set(re.findall(r"spring_estimator_\w+", texts["lib/drive_policy/drive_policy.c"]))
    assert policy & changing == TOLD


def test_the_results_first_page_has_a_figure_for_each_of_its_lines() -> None:
    sys.path.insert(0, str(ROOT / "bench"))
    import results

    assert "not measured" not in results.first_page()
    page = (ROOT / "docs" / "results.md").read_text()
    assert page.split("Page written")[0] == results.first_page().split("Page written")[0]  # by nobody's hand


@needs_simulator
@pytest.mark.nightly
def test_the_notebook_runs_from_its_first_cell_to_its_last(tmp_path: Path) -> None:
    book = nbformat.read(ROOT / "docs" / "first-hour.ipynb", 4)
    for cell in book.cells:
        assert (
            cell.cell_type != "code" or "import ninespring" in cell.source or cell.outputs
        )  # shown as it was executed
        cell.outputs = []
    (tmp_path / "docs").mkdir()
    (tmp_path / "data").symlink_to(ROOT / "data")
    ways = os.pathsep.join((str(Path(sys.executable).parent), os.environ["PATH"]))
    kernel = AsyncKernelManager(kernel_name="python3")
    client = NotebookClient(book, km=kernel, timeout=300, resources={"metadata": {"path": str(tmp_path / "docs")}})
    client.execute(env=os.environ | {"PATH": ways, "NINESPRING_SIM": str(SIM)})  # an error in a cell is raised here
    said = "".join(str(output) for cell in book.cells for output in cell.get("outputs", []))
    assert "<diagnosis: " in said and "image/png" in said and "hottest spring 5" in said


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the wheel that is built from the source distribution alone, where no other source is."""
    folder = tmp_path_factory.mktemp("dist")
    run(sys.executable, "-m", "build", "--sdist", "--no-isolation", "-o", folder, ROOT)
    (sdist,) = folder.glob("*.tar.gz")
    assert sdist.stat().st_size < 2e6
    run(
        sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation", "-w", folder, sdist, cwd=folder
    )
    (made,) = folder.glob("*.whl")
    return made


def test_the_wheel_works_without_the_tree_beside_it(wheel: Path, tmp_path: Path) -> None:
    assert wheel.name.startswith(f"ninespring-{VERSION}-py3-none-")
    venv.create(tmp_path / "venv", with_pip=False)
    python = tmp_path / "venv" / "bin" / "python"
    home = next((tmp_path / "venv" / "lib").glob("python*")) / "site-packages"
    run(sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--target", home, wheel)
    # what it depends on, from here; not what is installed here in editable form
    (home / "dependencies.pth").write_text("\n".join(site.getsitepackages()) + "\n")
    code = "import ninespring, ninespring.model.native as n; n.library(); print(ninespring.__file__, ninespring.__version__)"
    clean = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "NINESPRING"))}
    said = run(python, "-c", code, cwd=tmp_path, env=clean).stdout.split()
    assert said == [str(home / "ninespring" / "__init__.py"), VERSION]
    assert (home / "ninespring" / "py.typed").exists()
    assert "dashboard" in run(python, "-m", "ninespring", "--help", cwd=tmp_path, env=clean).stdout
