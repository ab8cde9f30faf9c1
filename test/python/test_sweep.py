"""Sweeps: every point once and always the same, whatever is killed; what cannot be run is refused whole."""

from __future__ import annotations

import itertools
import json
import os
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command import alone, ended
from ninespring.errors import InputError
from ninespring.explore import point, sweep
from ninespring.explore.results import Results
from ninespring.explore.spec import METRICS, Spec, read_spec
from ninespring.model import native
from ninespring.model.models import Array
from ninespring.model.simulate import board_settings

distributed = pytest.importorskip("distributed", reason="SKIPPED: dask is missing: pip install 'ninespring[explore]'")
pytest.importorskip("pyarrow", reason="SKIPPED: pyarrow is missing: pip install 'ninespring[explore]'")
pytest.importorskip("SALib", reason="SKIPPED: SALib is missing: pip install 'ninespring[explore]'")


SHORT = "duration_s = 60\non_s = 40\n"


def spec_of(folder: Path, text: str) -> Spec:
    (folder / "spec.toml").write_text(text)
    return read_spec(folder / "spec.toml")


@pytest.fixture(scope="module")
def client() -> Iterator[Any]:
    with sweep.local_cluster(2) as cluster, distributed.Client(cluster) as one:
        yield one


def swept(client: Any, spec: Spec, folder: Path) -> Any:
    results = Results(folder, spec)
    sweep.sweep(client, spec, results, results.open(), lambda _: None)
    return results.read()


GRID = f"[sweep]\n{SHORT}[fixed]\ntolerance = 0.1\n[vary]\npitch_mm = {{from = 4.5, to = 7, steps = 3}}\nfan = [0, 1]\n"


def test_a_grid_is_every_combination_and_each_point_is_always_the_same(tmp_path: Path, client: Any) -> None:
    spec = spec_of(tmp_path, GRID)
    assert [(p["pitch_mm"], p["fan"]) for p in spec.all_points()] == list(itertools.product((4.5, 5.75, 7.0), (0, 1)))
    table = swept(client, spec, tmp_path / "out")
    assert table["point"].tolist() == list(range(6)) and (table["error"] == "").all()
    for index, one in enumerate(spec.all_points()):
        alone = point.run_point(spec, index, one)
        for metric in METRICS:
            np.testing.assert_equal(table[metric][index], alone[metric])
    # what the fan and the pitch do
    at = table.set_index(["pitch_mm", "fan"])
    assert at.hottest_c[4.5, 1] < at.hottest_c[4.5, 0]
    assert at.undriven_c[7.0, 0] < at.undriven_c[4.5, 0]
    # the tolerance is drawn for each point by its own seed
    assert table["seed"].nunique() == 6


def test_each_file_says_what_it_is_of(tmp_path: Path, client: Any) -> None:
    import pyarrow.parquet as parquet

    spec = spec_of(tmp_path, GRID)
    swept(client, spec, tmp_path / "out")
    for part in (tmp_path / "out" / "points").glob("*.parquet"):
        meta = json.loads(parquet.read_schema(part).metadata[b"ninespring"])
        assert meta["spec"] == GRID and meta["sha256"] == spec.sha256 and meta["seed"] == 1 and meta["version"]


def test_what_is_there_is_not_done_again(tmp_path: Path, client: Any) -> None:
    spec = spec_of(tmp_path, GRID)
    whole = swept(client, spec, tmp_path / "out")
    parts = sorted((tmp_path / "out" / "points").glob("*.parquet"))
    kept = {part: part.stat().st_mtime_ns for part in parts[1:]}
    parts[0].unlink()
    (tmp_path / "out" / "points" / "00000000-00000000.part").write_text("half a file")
    assert swept(client, spec, tmp_path / "out").equals(whole)
    assert all(part.stat().st_mtime_ns == at for part, at in kept.items())
    held = Results(tmp_path / "out", spec)
    assert held.open().all()
    with pytest.raises(InputError, match="another sweep is writing"):
        Results(tmp_path / "out", spec).open()
    held.lock.close()
    with pytest.raises(InputError, match="another spec"):
        Results(tmp_path / "out", spec_of(tmp_path, GRID.replace("0.1", "0.2"))).open()


def test_a_damaged_folder_is_named(tmp_path: Path) -> None:
    spec = spec_of(tmp_path, GRID)
    (tmp_path / "out" / "points").mkdir(parents=True)
    kept, part = tmp_path / "out" / "spec.json", tmp_path / "out" / "points" / "00000000-00000001.parquet"
    kept.write_text("half a fi")
    with pytest.raises(InputError, match=r"spec\.json.*no sweep wrote this"):
        Results(tmp_path / "out", spec).open()
    kept.unlink()
    Results(tmp_path / "out", spec).open()
    part.write_text("junk")
    with pytest.raises(InputError, match=r"00000001\.parquet.*is damaged"):
        Results(tmp_path / "out", spec).open()


def test_numbers_are_of_one_kind_in_every_file(tmp_path: Path) -> None:
    spec = spec_of(tmp_path, f"[sweep]\n{SHORT}[vary]\npitch_mm = [5, 6.5]\nsize = [1, 2]\n")
    results = Results(tmp_path / "out", spec)
    results.open()
    for index, one in enumerate(spec.all_points()):
        results.add([point.run_point(spec, index, one)])
    assert results.read()["pitch_mm"].tolist() == [5.0, 5.0, 6.5, 6.5]


def test_lost_workers_lose_nothing(tmp_path: Path, client: Any) -> None:
    text = GRID.replace(SHORT, "duration_s = 240\non_s = 160\n").replace("steps = 3", "steps = 12")
    spec = spec_of(tmp_path, text)
    calm = swept(client, spec, tmp_path / "calm")
    results = Results(tmp_path / "out", spec)
    done, kills = results.open(), []

    def kill(count: int) -> None:
        if len(kills) < 2 and count > 4 * len(kills):
            pid = next(iter(client.run(os.getpid).values()))
            kills.append(pid)
            os.kill(pid, signal.SIGKILL)

    sweep.sweep(client, spec, results, done, kill)
    table = results.read()
    assert kills and len(table) == 24 == table["point"].nunique()
    assert table.equals(calm)


@pytest.mark.parametrize(("method", "count"), [("latin", 8), ("sobol", 8), ("saltelli", 4 * 8)])
def test_samples_fill_their_ranges_and_are_the_same_again(tmp_path: Path, method: str, count: int) -> None:
    vary = "[vary]\npitch_mm = {from = 5, to = 8}\nfan = {from = 0, to = 1}\n"
    head = f'[sweep]\nmethod = "{method}"\npoints = 8\n{SHORT}'
    spec = spec_of(tmp_path, head + vary)
    points = list(spec.all_points())
    assert spec.points == len(points) == count
    assert points == list(spec_of(tmp_path, head + vary).all_points())
    assert points != list(spec_of(tmp_path, head + "seed = 2\n" + vary).all_points())
    pitch = np.array([p["pitch_mm"] for p in points])
    assert ((pitch >= 5) & (pitch <= 8)).all() and np.ptp(pitch) > 2


def test_indices_say_what_matters(tmp_path: Path) -> None:
    import pandas as pd

    spec = spec_of(
        tmp_path,
        '[sweep]\nmethod = "saltelli"\npoints = 256\n[vary]\npitch_mm = {from = 5, to = 8}\nfan = {from = 0, to = 1}\n',
    )
    points = list(spec.all_points())
    made = {name: [np.nan] * len(points) for name in METRICS} | {
        "hottest_c": [3 * p["fan"] + p["pitch_mm"] / 3 for p in points]
    }
    found = sweep.indices_of(spec, pd.DataFrame(made))
    assert list(found) == ["hottest_c"]
    # variances 9/12 and 1/12
    assert found["hottest_c"]["fan"]["ST"] == pytest.approx(0.9, abs=0.05)
    assert found["hottest_c"]["pitch_mm"]["S1"] == pytest.approx(0.1, abs=0.05)


def test_the_optimiser_finds_the_best_and_carries_on(tmp_path: Path, client: Any) -> None:
    pytest.importorskip("optuna", reason="SKIPPED: optuna is missing: pip install 'ninespring[explore]'")
    text = (
        f'[sweep]\nmethod = "optimise"\npoints = 24\n{SHORT}[vary]\npitch_mm = {{from = 4.5, to = 9}}\n'
        '[optimise]\nmetric = "undriven_c"\n'
    )
    spec = spec_of(tmp_path, text)
    table = swept(client, spec, tmp_path / "out")
    best = sweep.best_of(spec, table)
    assert best is not None and best["pitch_mm"] > 8.0
    for part in sorted((tmp_path / "out" / "points").glob("*.parquet"))[-3:]:
        part.unlink()
    assert swept(client, spec, tmp_path / "out").equals(table)
    none = spec_of(tmp_path, text + "undriven_c = {most = 0}\n")
    assert sweep.best_of(none, table) is None


def test_a_point_that_the_chip_refuses_is_kept_with_its_reason(tmp_path: Path) -> None:
    heavy = "latent_heat_j_per_kg = 100000\ndensity_kg_per_m3 = 20000\n"
    spec = spec_of(tmp_path, f"[sweep]\n{SHORT}[fixed]\n{heavy}[vary]\nfan = [0, 1]\n")
    row = point.run_point(spec, 0, next(spec.all_points()))
    assert "latent_heat_j" in row["error"] and np.isnan(row["hottest_c"])


def test_geometry_goes_into_the_points(tmp_path: Path) -> None:
    pytest.importorskip(
        "gmsh", reason="SKIPPED: gmsh is missing: pip install 'ninespring[explore]'", exc_type=Exception
    )
    text = (
        f'[sweep]\ncouplings = "field"\n{SHORT}[fixed]\nrows = 1\ncols = 2\npattern = "middle"\nfan_m_per_s = 0\n'
        'plate = "none"\n[vary]\npitch_mm = [5, 7]\n'
    )
    spec = spec_of(tmp_path, text)
    near, far = (point.plant_of_point(spec, one) for one in spec.all_points())
    assert near.get("orthogonal_w_per_k") > 1.5 * far.get("orthogonal_w_per_k")


def test_another_spring_is_no_fault(tmp_path: Path) -> None:
    """A thin wire has a resistance that the paper's spring has only with a bad contact: the board is told."""
    thin = "[sweep]\nduration_s = 60\non_s = 40\ncouplings = 'field'\n[fixed]\nrows = 1\ncols = 2\npattern = 'middle'\n"
    thin += "fan_m_per_s = 0\nplate = 'none'\n[vary]\nwire_diameter_mm = [0.5, 0.8]\n"
    spec = spec_of(tmp_path, thin)
    for index, one in enumerate(spec.all_points()):
        row = point.run_point(spec, index, one)
        assert (row["error"], row["faults"], row["started"]) == ("", 0, 1.0), one
    board = board_settings(Array(1, 2, spring={"wire_diameter_mm": 0.5}))
    assert board["resistance_maximum_ohm"] == pytest.approx(0.5 * 0.56 / 0.219, rel=0.01)
    assert board_settings(Array(1, 2)) == {}


HEAD = "[sweep]\n"
OPTIMISE = HEAD + "method = 'optimise'\npoints = 3\n"
GOAL = "[optimise]\nmetric = 'undriven_c'\n"
OVERLAP = "point 1 (pitch_mm 4) cannot exist: coils overlap"


def test_boards_of_a_large_array_do_as_one_board_does() -> None:
    """They know nothing of each other: what each spring needs it sees in the spring."""
    spec = Spec(duration_s=240, on_s=160)
    array = {"size": 6, "fan": 1.0, "pitch_mm": 5.0, "pattern": "checkerboard", "supply_limit_a": 60.0}
    one = point.metrics_of(spec, array | {"board_rows": 6, "board_cols": 6}, 1)
    many = point.metrics_of(spec, array | {"board_rows": 3, "board_cols": 2}, 1)
    assert one["started"] == many["started"] == 1.0
    assert abs(one["undriven_c"] - many["undriven_c"]) < 3.0
    assert many["hottest_c"] < 115.0
    # where couplings are strong (what geometry says of 4.3 mm), a board that took its neighbours to be cold would run away
    strong = point.plant_of_point(spec, array)
    strong.set("orthogonal_w_per_k", 1.8e-3)
    strong.set("loss_w_per_k", 2.2e-3)
    parts = native.boards_of(6, 6, 2, 2)
    lines = [native.chip_export(strong, part)[0] + point.settings_of(array) for part in parts]
    hot, *_ = native.chip_run(strong, (2, 2), lines, [True] * 36, 0.0, 1, 200, 200)
    assert hot.max() < 115.0
    spec.boards = {1: {"supply_limit_a": 1.0}}  # the first six springs of all: 3 x 2
    first = point.metrics_of(spec, array | {"board_rows": 3, "board_cols": 2}, 1)
    assert 0.8 <= first["started"] < 1.0
    spec.boards = {}
    little = point.metrics_of(spec, array | {"board_rows": 3, "board_cols": 2, "supply_limit_a": 1.0}, 1)
    assert little["started"] < 1.0 and little["supply_a"] <= 6 * 1.05


def test_every_pattern_is_a_point_of_its_own(tmp_path: Path) -> None:
    path = tmp_path / "s.toml"
    path.write_text(HEAD + "[fixed]\nsize = 2\n[vary]\npattern = 'every'\n")
    spec = read_spec(path)
    given = [one["pattern"] for one in spec.all_points()]
    assert len(set(given)) == 16 and given[6] == "0110"
    assert point.pattern_of({"pattern": "0110"}, Array(2, 2), np.random.default_rng(1)).tolist() == [0, 1, 1, 0]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (HEAD + "[vary]\npich_mm = [5]\n", "did you mean pitch_mm?"),
        (HEAD + "[vary]\npitch_mm = {from = 6, to = 5, steps = 3}\n", "from 6 to 5: the wrong way round"),
        (HEAD + "[vary]\npitch_mm = {from = 4, to = 5, steps = 2}\n", OVERLAP),
        (HEAD + "[vary]\nfan = [0, 1]\nsize = [3, 33]\n", "size is 33"),
        (HEAD + "[vary]\nrows = [64]\ncols = [17]\n", "64 x 17 are more than 1024 springs"),
        (HEAD + "[fixed]\nboard_rows = 9\n[vary]\nsize = [16]\n", "9 x 8 are more than 64 springs on a board"),
        (HEAD + "[vary]\nfan = [0, 2]\n", "it must be 0 to 1"),
        (HEAD + "[vary]\nfan = [0, 1]\n[board.2]\nsupply_limit_a = 5\n", "[board.2], but the array has 1 boards"),
        (HEAD + "[vary]\nfan = [0, 1]\n[board.1]\nsuply_limit_a = 5\n", "did you mean supply_limit_a?"),
        (HEAD + "[vary]\nfan = [0, 1]\n[board.first]\nsupply_limit_a = 5\n", "must be [board.1]"),
        (HEAD + "[vary]\npattern = ['0101']\n", "pattern has 4 digits for 9 springs"),
        (HEAD + "[fixed]\nsize = 4\n[vary]\npattern = 'every'\n", "16 springs have too many patterns"),
        (HEAD + "[vary]\nsize = [2, 3]\npattern = 'every'\n", "an array of one size"),
        (HEAD + "[vary]\npitch_mm = 5\n", "belongs into [fixed]"),
        (HEAD + "[vary]\npitch_mm = {from = 5, to = 6}\n", "a grid needs steps"),
        (HEAD + "[vary]\npitch_mm = [5, 5]\n", "a value twice"),
        (HEAD + "[vary]\nwire_diameter_mm = [0.7, 0.8]\n", 'couplings = "field"'),
        (HEAD + "[fixed]\nfan = 1\n[vary]\nfan = [0, 1]\n", "fixed and varied"),
        (HEAD + "[vary]\n", "nothing is varied"),
        (HEAD + "methd = 'grid'\n[vary]\nfan = [0, 1]\n", "did you mean method?"),
        (HEAD + "method = 'latine'\npoints = 3\n[vary]\nfan = [0, 1]\n", "did you mean latin?"),
        (HEAD + "method = 'latin'\n[vary]\nfan = [0, 1]\n", "points is 0"),
        (HEAD + "method = 'saltelli'\npoints = 9\n[vary]\nfan = {from = 0, to = 1}\n", "a power of two"),
        (HEAD + "on_s = 400\n[vary]\nfan = [0, 1]\n", "on_s is 400"),
        (HEAD + "method = 'optimise'\npoints = 3\n[vary]\nfan = [0, 1]\n", "go together"),
        (OPTIMISE + "[vary]\npitch_mm = {from = 4, to = 8}\n" + GOAL, OVERLAP),
        (OPTIMISE + "[vary]\nfan = [0, 1]\n" + GOAL + "hottest_c = {most = 'a'}\n", "hottest_c must be a number"),
        (OPTIMISE + "[vary]\nfan = [0, 1]\n" + GOAL + "hottest_c = {most = nan}\n", "hottest_c is nan"),
        (OPTIMISE + "[vary]\nfan = [0, 1]\n" + GOAL + "hottest_c = {least = 2, most = 1}\n", "the wrong way round"),
        (HEAD + "method = 'sobol'\npoints = 9\n[vary]\nfan = {from = 0, to = 1}\n", "a power of two"),
        (HEAD + "[vary]\npitch_mm = [nan]\n", "pitch_mm is nan"),
        (HEAD + "[vary]\npitch_mm = []\n", "no values"),
        (HEAD + "[vary]\npitch_mm = ['5']\n", "must be a number"),
        (HEAD + "[fixed]\nsize = 0\n[vary]\nfan = [0, 1]\n", "size is 0"),
        (
            HEAD + "[vary]\npitch_mm = {from = 5, to = 6, steps = 9999}\nfan = {from = 0, to = 1, steps = 9999}\n",
            "99980001 points are more than",
        ),
        (HEAD + "[vary]\npolicy = ['opne']\n", "did you mean open?"),
        (HEAD + "[vary]\nmartensite_start_c = [60.0, 78.0]\n", "point 1 (martensite_start_c 60) cannot exist"),
    ],
)
def test_a_bad_spec_is_refused_whole(tmp_path: Path, text: str, says: str) -> None:
    (tmp_path / "spec.toml").write_text(text)
    code, said = ended("sweep", tmp_path / "spec.toml", "-o", tmp_path / "out")
    assert code == 2 and says in said and str(tmp_path / "spec.toml") in said
    assert not (tmp_path / "out").exists()


def test_the_command_runs_and_says_where_the_dashboard_is(tmp_path: Path) -> None:
    (tmp_path / "spec.toml").write_text(GRID)
    looked = alone("sweep", "spec.toml", "-o", "out", "--check", cwd=tmp_path)
    assert "6 points, pitch_mm, fan" in looked.stdout and not (tmp_path / "out").exists()
    done = alone("sweep", "spec.toml", "-o", "out", "--workers", 1, "--json", "r.json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "Dask's dashboard: http://127.0.0.1:" in done.stdout and "6 points in out/points" in done.stdout
    assert json.loads((tmp_path / "r.json").read_text())["points"] == 6
    nowhere = alone("sweep", "spec.toml", "-o", "other", "--scheduler", "tcp://127.0.0.1:9", cwd=tmp_path)
    assert nowhere.returncode == 1 and "no Dask scheduler" in nowhere.stderr


def test_a_cluster_as_it_stands_is_used(tmp_path: Path, client: Any) -> None:
    spec = spec_of(tmp_path, GRID)
    code, said = ended("sweep", tmp_path / "spec.toml", "-o", tmp_path / "out", "--scheduler", client.scheduler.address)
    assert code == 0 and client.dashboard_link in said and len(Results(tmp_path / "out", spec).read()) == 6


def test_one_point_is_what_the_controller_does(tmp_path: Path) -> None:
    spec = spec_of(tmp_path, "[sweep]\n[vary]\nfan = [0, 1]\n")
    plant = point.plant_of_point(spec, next(spec.all_points()))
    plant.reset()
    lines = native.chip_export(plant)[0] + "$policy=1\n"
    t, x, power, current, faults = native.chip_run(plant, (3, 3), [lines], [True] * 8 + [False], 0.0, 5, 120, 90)
    assert t.shape == x.shape == (120, 9) and (x[89, :8] > 0.95).all() and x[89, 8] == 0.0
    # what goes in is stored, or lost: from cold, nothing is hotter than its energy
    assert power[:90].sum() > 0 and power[91:].max() == 0.0 and current.max() <= 15.0
    *again, _ = native.chip_run(plant, (3, 3), [lines], [True] * 8 + [False], 0.0, 5, 120, 90)
    assert faults == 0 and all(np.array_equal(a, b) for a, b in zip((t, x, power, current), again, strict=True))
