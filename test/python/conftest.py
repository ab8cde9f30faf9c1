"""What the tests share: logs made with the product's plant, small and quick."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from ninespring.infer import budget
from ninespring.io.logs import log_text
from ninespring.model import native
from plants import a_plant, columns_of, switched

Make = Callable[..., Path]


def pytest_configure(config: pytest.Config) -> None:
    """Name the mark of what takes minutes: a test of its own to ctest, of the label nightly."""
    config.addinivalue_line("markers", "nightly: a whole journey, of minutes")


@pytest.fixture(scope="session", autouse=True)
def kept_elsewhere(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Have what ninespring keeps on a computer (settings that boards had, console history) kept in a folder of the tests' own."""
    os.environ["NINESPRING_HOME"] = str(tmp_path_factory.mktemp("kept"))


def _maker(folder: Path) -> Make:
    """Return a maker of 3 x 3 logs: effects and numbers of the plant, noise, seed, seconds, what is logged, the fan at half."""

    def make(
        name: str = "run.csv",
        effects: dict[str, dict[str, float]] | None = None,
        seed: int = 0,
        seconds: int = 600,
        noise: float = 0.3,
        columns: str = "iv",
        change: Callable[[dict[str, np.ndarray]], None] | None = None,
        half: bool = False,
    ) -> Path:
        rng = np.random.default_rng(seed)
        time_s = np.arange(float(seconds))
        current = switched(rng, seconds, 0.0, 1.0, 1.8)
        fan = ((time_s // 200) % 2 == 1).astype(float)
        if half:  # of its command, after the first time
            fan[400:] *= 0.5
        mode = native.POWER if columns == "iv" else native.CURRENT
        drive = current**2 * 0.2 if columns == "iv" else current
        shown = a_plant((3, 3), effects or {}).simulate(time_s, mode, drive, fan, np.full(seconds, 20.0))
        shown = shown + rng.normal(0.0, noise, shown.shape)
        volts = {"v": current * 0.2} if columns == "iv" else {}
        out = columns_of(i=current, **volts, t=shown) | {"fan": fan, "ambient_c": np.full(seconds, 20.0)}
        if change:
            change(out)
        stamps = out.pop("time_s", time_s)
        path = folder / name
        path.write_text(log_text(stamps, out))
        return path

    return make


@pytest.fixture
def make_log(tmp_path: Path) -> Make:
    """Return a maker of logs of one test."""
    return _maker(tmp_path)


@pytest.fixture(scope="module")
def make_shared_log(tmp_path_factory: pytest.TempPathFactory) -> Make:
    """Return a maker of logs from which something is made once for all tests of a file."""
    return _maker(tmp_path_factory.mktemp("shared"))


@pytest.fixture
def briefly(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have searches end early: of a log of which something must be said, whatever else may be found in it after all."""
    monkeypatch.setattr(budget, "ENOUGH", 1500)


@pytest.fixture
def measured() -> Path:
    """Return the folder of measured data."""
    return Path(os.environ.get("NINESPRING_DATA", Path(__file__).resolve().parents[2] / "data"))


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """Return a folder on a disk of its own with room for 16 kB."""
    folder = tmp_path / "disk"
    folder.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=16k", "none", folder], capture_output=True).returncode:
        pytest.skip("SKIPPED: this user cannot mount a small disk")
    yield folder
    subprocess.run(["umount", folder], check=True)
