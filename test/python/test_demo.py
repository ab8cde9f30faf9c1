"""script/demo: its own functions, with shorter drives and a log of the plant in place of its ten minutes of recording."""

from __future__ import annotations

import importlib.util
import re
import shutil
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def demo(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    spec = importlib.util.spec_from_file_location("demo", ROOT / "script" / "demo.py")
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    if not (module.SIM.exists() and module.FIRMWARE.exists()):
        pytest.skip("SKIPPED: the simulated Mega is not built: run script/build")
    monkeypatch.setattr(module, "OUT", tmp_path)
    return module


@pytest.mark.nightly
def test_the_demo_finds_what_nobody_declared_and_drives_better_right_after_its_upload(
    demo: ModuleType, make_log, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    effects = {"latent_heat": {}, "resistance_phase": {}, demo.EFFECT: {f"{demo.EFFECT}_fraction": demo.EDGE_LOSS}}
    log, record = make_log("plant.csv", effects=effects, noise=0.1), demo.record

    def quick(ports: tuple[str, str], name: str, steps: Path, duration_s: int) -> Path:
        if name != "measured":
            return record(ports, name, steps, duration_s)
        return Path(shutil.copy(log, tmp_path / "measured.csv"))

    monkeypatch.setattr(demo, "record", quick)
    monkeypatch.setattr(demo, "DRIVE_S", 85)
    monkeypatch.setattr(demo, "HELD_S", 10)
    # a new board would wait for what may be hot from before power-on
    monkeypatch.setattr(demo, "DRIVE_STEPS", demo.DRIVE_STEPS.replace("fan 0\n", "fan 0\nmodel cold\n"))
    text = re.sub(r"<[^>]*>", "", demo.undeclared())
    assert re.search(rf"names\s+{demo.EFFECT}", text), text
    before, after = (float(re.search(rf"([\d.]+) K\s+{word}", text)[1]) for word in ("wrong after", "wrong\\."))
    assert before > 2.0 and after < 0.75 * before
    assert ("before" in text and "What is left" in text) or "No spring loses its phase" in text


def test_the_demos_paper_is_the_papers(demo: ModuleType) -> None:
    text = re.sub(r"<[^>]*>", "", demo.paper())
    assert re.search(r"met to\s+0\.\d\d K rms", text) and "missed" in text


def test_a_spring_that_is_heated_again_counts_though_it_takes_up_little(demo: ModuleType) -> None:
    held_c = [20.0, 95.0, 102.0, 90.0, 85.0, 78.0, 84.0, 88.3, 82.0, 80.5, 80.0]
    trace = {"time_s": [float(time_s) for time_s in range(len(held_c))], "t1_c": held_c}
    assert demo.heated_at(trace, 1) == [1.0, 7.0]
