"""`import ninespring as ns`: the page docs/python.md does what it says."""

from __future__ import annotations

import re
from pathlib import Path

import ninespring as ns
import numpy as np
import pytest
from fake_board import FakeBoard, row
from made import ROOT, SIM
from ninespring.cli.main import COMMANDS

LATENT = {"latent_heat": {"latent_heat_j": 8.0}}


def test_the_page_about_python_runs(make_log, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    make_log("run1.csv", effects=LATENT)
    blocks = re.findall(r"^```python\n(.*?)^```", (ROOT / "docs" / "python.md").read_text(), re.MULTILINE | re.DOTALL)
    assert len(blocks) == 3
    if not SIM.exists():
        blocks = [one for one in blocks if "simulated" not in one]
    monkeypatch.chdir(tmp_path)
    space: dict[str, object] = {}
    for block in blocks:
        exec(block, space)
    assert space["found"].effects == ["latent_heat"]
    assert repr(space["found"]).startswith("<diagnosis: latent_heat; ")
    predicted, run = space["predicted"], space["run"]
    assert predicted.shape == space["on_chip"].shape == run.temperature_c.shape
    assert np.sqrt(np.nanmean((predicted - run.temperature_c) ** 2)) < 0.35
    assert (tmp_path / "run1.png").stat().st_size > 20_000
    assert ns.read_model("model.toml").effects == ["latent_heat"]
    assert len(repr(run)) < 100 and len(repr(space["found"].model)) < 100
    if SIM.exists():
        now = space["now"]
        assert now.current_a[4] > 0.8 and now.current_a[[0, 8]].tolist() == [0.0, 0.0]
        assert now.fan == 0.5 and len(repr(now)) < 100
        table = space["table"]
        assert table["time_s"].is_monotonic_increasing
        assert 2.5 < table["time_s"].iloc[-1] - table["time_s"].iloc[0] <= 3.0
        assert (table["low1_c"] <= table["m1_c"]).all() and (table["m1_c"] <= table["high1_c"]).all()
        assert table["x1"].between(0.0, 1.0).all() and set(table["state"]) == {"ok"}


def test_fit_takes_what_read_log_gave_or_a_path(make_log) -> None:
    log = make_log(effects=LATENT, seconds=300)
    by_path, by_run = ns.fit(log, effects=["latent_heat"]), ns.fit(ns.read_log(log), effects=["latent_heat"])
    assert by_path.parameters == by_run.parameters
    with pytest.raises(ns.InputError, match="there is no effect 'ghosts'"):
        ns.fit(log, effects=["ghosts"])
    with pytest.raises(ns.InputError, match="no log"):
        ns.diagnose()


def test_a_board_is_off_after_its_block_also_after_an_error() -> None:
    fake = FakeBoard({"on 9 100": ["error:10 locked after a reset; type unlock"]}, stream=[row(1.0, 0.5)] * 3)
    with pytest.raises(ns.WorkError, match="locked after a reset"), ns.Board(fake.port) as board:
        board.on(1, 50)
        assert board.read().current_a.tolist() == [0.5]
        with pytest.raises(ns.InputError, match="one line"):
            board.ask("on 1\non 2")
        board.on(9)
    sent = fake.sent()
    assert sent.index("on 1 50") < sent.index("on 9 100") < sent.index("off all")


BELIEVED = [
    "spring 1: 40.5 degC, 38.0 to 43.0, 37.5 K below martensite start (+-2.1), austenite 12.5 %, 0.0 to 20.0, hold",
    "  0.500 A, 0.200 V, 0.100000 W, target 0.500 A",
    "ok",
]


def test_a_stream_has_bounds_and_phase_once_a_second_and_ends_telemetry_with_the_loop() -> None:
    fake = FakeBoard({"model": BELIEVED}, stream=[row(1.0 + 0.2 * k) for k in range(60)])
    with ns.Board(fake.port) as board:
        seen = list(board.stream(hz=5, seconds=3.0))
        assert [one.time_s for one in seen] == pytest.approx([1.0 + 0.2 * k for k in range(16)])
        assert {(one.low_c[0], one.high_c[0], one.austenite[0]) for one in seen} == {(38.0, 43.0, 0.125)}
        assert fake.sent().count("model") in (3, 4)
        assert fake.sent()[-1] == "telemetry off"
        for now in board.stream():
            assert now.current_a.tolist() == [1.0]
            break
        assert fake.sent()[-1] == "telemetry off"
        with pytest.raises(ns.InputError, match="hz"):
            next(board.stream(hz=0))
    table = ns.to_pandas(seen)
    columns = "time_s i1_a v1_v m1_c low1_c high1_c x1 d1 fan ambient_c state"
    assert list(table.columns) == columns.split()
    assert len(table) == 16
    assert table["x1"].iloc[-1] == 0.125


def test_a_board_that_tells_nothing_of_its_springs_still_streams() -> None:
    fake = FakeBoard({"model": ["error:1 no such word"]}, stream=[row(1.0)] * 3)
    with ns.Board(fake.port) as board:
        now = next(board.stream())
        assert np.isnan(now.low_c).all() and now.current_a.tolist() == [1.0]


def test_a_log_where_a_model_belongs_is_said(make_log) -> None:
    run = ns.read_log(make_log(seconds=60))
    with pytest.raises(ns.InputError, match="a model is wanted"):
        ns.predict(run, run)
    with pytest.raises(ns.InputError, match="a log is wanted"):
        ns.fit(ns.Model(ns.Array()))
    with pytest.raises(ns.InputError, match="duration_s = nan"):
        ns.make_plan(duration_s=float("nan"))


def test_what_the_commands_do_can_be_called(make_log, tmp_path: Path) -> None:
    run, model = ns.read_log(make_log(seconds=60)), ns.Model(ns.Array())
    model.parameters, model.stderr = {"loss_w_per_k": 0.0058}, {"loss_w_per_k": 1e-4}
    temperature, austenite = ns.replay(model, run)
    assert temperature.shape == austenite.shape == run.temperature_c.shape
    before, after = ns.verify(model, run)
    assert 0.0 < after < 10.0 and before > 0.0
    assert "on 5 100" in " ".join(ns.plan_through(model, 5).steps)
    table = tmp_path / "table.csv"
    table.write_text(
        "Time (sec),Heater 1,Heater 2,Temperature 1,Temperature 2\n0,0,0,21,21\n1,50,0,21,21\n2,50,0,22,21\n"
    )
    assert ns.import_log(table, "tclab", tmp_path / "tclab.csv").springs == 2
    fake = FakeBoard({}, stream=[row(float(k), 0.5) for k in range(1, 8)])
    got = ns.record(fake.port, tmp_path / "board.csv", duration_s=3.0)
    assert not got.ended and (tmp_path / "board.csv").exists()
    with pytest.raises(ns.InputError, match="never written over"):
        ns.record(fake.port, tmp_path / "board.csv", duration_s=3.0)
    settings = ns.chip_settings(model, force=True)
    assert "$loss_w_per_k=0.005800" in settings.lines
    assert (
        ns.upload(fake.port, settings.lines) == settings.lines.count("$") == len(fake.settings) and "$save" in fake.seen
    )
    assert ns.make_plan(duration_s=300).steps


def test_a_sweep_can_be_called(tmp_path: Path) -> None:
    pytest.importorskip("distributed", reason="SKIPPED: dask is missing: pip install 'ninespring[explore]'")
    pytest.importorskip("pyarrow", reason="SKIPPED: pyarrow is missing: pip install 'ninespring[explore]'")
    (tmp_path / "fan.toml").write_text("[sweep]\nduration_s = 60\non_s = 40\n[vary]\nfan = [0, 1]\n")
    for _ in range(2):  # the second finds them
        assert ns.sweep(tmp_path / "fan.toml", tmp_path / "fan", workers=1)["fan"].tolist() == [0, 1]


def test_every_command_stands_on_the_page_about_python() -> None:
    page = (ROOT / "docs" / "python.md").read_text()
    table = re.findall(r"^\| (`.*`) \| (.*) \|$", page, re.MULTILINE)
    called = set(re.findall(r"ns\.([a-z]\w*)\(?", page))
    readers = {"read_array", "read_model"}
    assert called <= set(ns.__all__) and {name for name in ns.__all__ if name.islower()} <= called | readers
    told = {word for left, _ in table for word in re.findall(r"`(\w+)", left)}
    only = set(
        re.findall(r"`?(\w+)", page[page.index("\n| command") :].partition("\n\n")[2].partition("commands only")[0])
    )
    for name in COMMANDS:
        assert name in told | only | called, f"docs/python.md does not say how `{name}` is called"
