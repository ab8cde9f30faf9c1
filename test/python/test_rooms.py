"""The package's rooms: each imports only from those below it, at the top of its files."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import ninespring

HOME = Path(ninespring.__file__).parent
ROOT = Path(__file__).parents[2]
OVERVIEW = ROOT / "docs" / "overview.md"
ROOMS = ("errors", "io", "model", "export", "infer", "find", "say", "explore", "dashboard", "api", "cli")
"""From below: what each is for stands in CONTRIBUTING.md. `explore` and `dashboard` are apart: neither knows the other."""
INSIDE = {
    # what a user may not have: `pip install ninespring[explore]`, or a Windows that has no such thing
    *("SALib", "dask", "distributed", "gmsh", "optuna", "pyarrow", "skfem", "fcntl", "termios"),
    # of doors: whoever only talks to a board waits for no SciPy
    "ninespring.api",
    "ninespring.dashboard.replay_source.ReplaySource",
    # of logs: whoever only talks to a board waits for it neither
    "pandas",
    # half a second that only a sweep that draws its points has to wait for
    "scipy.stats.qmc",
}
"""What may be imported inside a function; the other lazy door, the table of commands, is in cli/main.py."""


def imports(path: Path) -> Iterator[tuple[str, bool]]:
    """Yield what a file imports, `ninespring.io.board.Board`, and whether inside a function."""
    tree = ast.parse(path.read_text("utf-8"))
    inside = {
        id(one)
        for function in ast.walk(tree)
        if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef)
        for one in ast.walk(function)
    }
    package = ("ninespring", *path.relative_to(HOME).parent.parts)
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((name.name, id(node) in inside) for name in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) - node.level + 1] if node.level else ()
            base = ".".join((*above, *([node.module] if node.module else [])))
            yield from ((f"{base}.{name.name}", id(node) in inside) for name in node.names)


def room_of(module: str) -> str:
    """Return the room of `ninespring.io.board.Board`; empty for the package itself and for what is not of it."""
    parts = module.split(".")
    return parts[1] if parts[0] == "ninespring" and len(parts) > 1 and parts[1] in ROOMS else ""


FILES = [path for path in HOME.rglob("*.py") if path.parent != HOME or path.stem in ROOMS]


def test_every_folder_is_a_room() -> None:
    folders = {path.name for path in HOME.iterdir() if any(path.glob("*.py"))}
    assert folders < set(ROOMS)


def test_rooms_import_only_downwards() -> None:
    upwards = [
        f"{path.relative_to(HOME)} imports {module}"
        for path in FILES
        for module, _ in imports(path)
        if (room := room_of(module))
        and ROOMS.index(room) > ROOMS.index(path.relative_to(HOME).parts[0].removesuffix(".py"))
    ]
    apart = [
        f"{path.relative_to(HOME)} imports {module}"
        for path in (HOME / "dashboard").rglob("*.py")
        for module, _ in imports(path)
        if room_of(module) == "explore"
    ]
    assert not upwards + apart


def test_imports_are_at_the_top() -> None:
    hidden = [
        f"{path.relative_to(HOME)} imports {module}"
        for path in HOME.rglob("*.py")
        for module, inside in imports(path)
        if inside and not {module, module.partition(".")[0]} & INSIDE
    ]
    assert not hidden


def test_what_only_talks_to_a_board_waits_for_no_scipy_and_no_pandas() -> None:
    commands = ("console", "record", "upload", "monitor", "settings", "bringup", "dashboard")
    asks = f"""import sys
from ninespring.cli.main import cli
for name in {commands}:
    cli.get_command(None, name)
print(*sorted({{"scipy", "matplotlib", "pandas"}} & set(sys.modules)))"""
    done = subprocess.run([sys.executable, "-c", asks], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_the_overview_names_files_that_there_are() -> None:
    """Where a file lives is a newcomer's first question: docs/overview.md answers it by name."""
    names = re.findall(r"`((?:[a-z_]+/)*[a-z_]+\.(?:py|c|cpp|def|ini|toml))`", OVERVIEW.read_text("utf-8"))
    known = [str(path) for top in (HOME, ROOT / "lib", ROOT / "firmware") for path in top.rglob("*.*")]
    known += [str(path) for path in (ROOT / "sim_host").rglob("*.*")] + [str(ROOT / "test/python/test_rooms.py")]
    written = {"array.toml", "model.toml"}  # by the user and by the tool
    assert len(names) > 40
    assert not [name for name in names if name not in written and not any(path.endswith(f"/{name}") for path in known)]
