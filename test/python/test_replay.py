"""`ninespring replay`: the on-chip model along a measured log, row by row."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from click.testing import CliRunner
from ninespring.cli.main import cli
from ninespring.errors import InputError

MODEL = """schema = "ninespring.model/1"
effects = []
[array]
rows = 1
cols = 2
[[parameter]]
name = "heat_capacity_j_per_k"
value = 2.0
unit = "J/K"
[[parameter]]
name = "command_power_w"
value = 1.0
unit = "W"
"""
LOG = "time_s,u1,u2,t1_c,t2_c\n0,0,0,20,20\n1,1,0,20,20\n2,1,0,20.4,20\n10,0,0.5,24,20.1\n11.25,0,0.5,,20.3\n"


def replay(tmp_path: Path, log: str = LOG, model: str = MODEL) -> tuple[str, pd.DataFrame, dict[str, Any]]:
    """Return what is printed, the rows that are written, the result for programs."""
    for name, text in (("log.csv", log), ("m.toml", model)):
        (tmp_path / name).write_text(text)
    words = ["replay", str(tmp_path / "log.csv"), "--model", str(tmp_path / "m.toml")]
    words += ["-o", str(tmp_path / "r.csv"), "--json", str(tmp_path / "r.json")]
    done = CliRunner().invoke(cli, words)
    if done.exception:
        raise done.exception
    return done.output, pd.read_csv(tmp_path / "r.csv", comment="#"), json.loads((tmp_path / "r.json").read_text())


def test_the_model_follows_the_command(tmp_path: Path) -> None:
    table, rows, result = replay(tmp_path, "\ufeff" + LOG.replace("\n", "\r\n"))
    assert "K rms" in table
    assert rows["time_s"].tolist() == [0, 1, 2, 10, 11.25]
    # 1 W into 2 J/K from 1 s to 10 s, little lost: half a kelvin a second
    assert rows["m1_c"][2] == pytest.approx(20.5, abs=0.02)
    assert rows["m1_c"][3] == pytest.approx(24.45, abs=0.15)
    assert rows["m2_c"][4] == pytest.approx(rows["m2_c"][3] + 0.3125, abs=0.03)
    assert [one["samples"] for one in result["springs"]] == [4, 5]


def test_rows_between_two_steps_of_the_chip(tmp_path: Path) -> None:
    model = MODEL.replace("2.0", "0.2")  # 5 K/s at 1 W: half a step of the chip is 0.25 K
    _, rows, _ = replay(tmp_path, "time_s,u1,u2,t1_c\n0,1,0.5,20\n1.05,1,0,\n1.1,0,0,\n", model)
    rise = [(1 - math.exp(-seconds * 0.0058 / 0.2)) / 0.0058 for seconds in (0, 1.05, 1.1)]
    assert rows["m1_c"].tolist() == pytest.approx([20 + one for one in rise], abs=0.03)
    assert rows["m2_c"][2] == pytest.approx(20 + 0.5 * rise[1], abs=0.03)  # off in the middle of the step


def test_the_log_s_fan_and_air_count(tmp_path: Path) -> None:
    uncoupled = "".join(
        f'[[parameter]]\nname = "{name}"\nvalue = 0\nunit = "W/K"\n'
        for name in ("orthogonal_w_per_k", "orthogonal_fan_w_per_k")
    )
    log = "time_s,u1,u2,t1_c,fan,ambient_c\n0,0,0,60,0,40\n9,0,0,,0,40\n18,0,0,,1,40\n27,0,0,,1,20\n36,0,0,,1,20\n"
    _, rows, _ = replay(tmp_path, log, MODEL + uncoupled)
    natural, fanned = math.exp(-9 * 0.0058 / 2), math.exp(-9 * 0.0113 / 2)
    first = [60, 40 + 20 * natural, 40 + 20 * natural**2, 40 + 20 * natural**2 * fanned]
    first.append(20 + (first[-1] - 20) * fanned)
    assert rows["m1_c"].tolist() == pytest.approx(first, abs=0.05)
    # never measured: starts at the log's ambient
    assert rows["m2_c"].tolist() == pytest.approx([40, 40, 40, 40, 20 + 20 * fanned], abs=0.05)


def test_the_errors_are_those_of_the_file(tmp_path: Path) -> None:
    _, rows, result = replay(tmp_path, model=MODEL.replace("effects = []", 'effects = ["sensor_gain"]'))
    everything = []
    for k, spring in enumerate(result["springs"], 1):
        left = rows[f"m{k}_c"] - rows[f"t{k}_c"]
        assert spring["rmse_c"] == pytest.approx((left**2).mean() ** 0.5, abs=0.001)
        assert spring["mean_error_c"] == pytest.approx(left.mean(), abs=0.001)
        assert spring["largest_error_c"] == pytest.approx(left.abs().max(), abs=0.001)
        seen = rows[f"y{k}_c"] - rows[f"t{k}_c"]
        assert spring["shown_rmse_c"] == pytest.approx((seen**2).mean() ** 0.5, abs=0.001)
        everything += left.dropna().tolist()
    assert result["rmse_c"] == pytest.approx((pd.Series(everything) ** 2).mean() ** 0.5, abs=0.001)
    assert result["springs"][0]["shown_rmse_c"] != pytest.approx(result["springs"][0]["rmse_c"], abs=0.01)


def test_measurement_effects_stay_off_the_chip(tmp_path: Path) -> None:
    # its room logged: told by a first minute it would be seen by that sensor, too
    warm = "".join(f"{line},{'ambient_c' if line[0] == 't' else 20}\n" for line in LOG.split("\n") if line)
    warm = warm.replace("0,0,0,20,20", "0,0,0,30,20")
    plain = replay(tmp_path, warm)[1]
    table, rows, _ = replay(tmp_path, warm, MODEL.replace("effects = []", 'effects = ["sensor_lag"]'))
    assert rows["m1_c"].tolist() == plain["m1_c"].tolist()
    assert rows["y1_c"][0] == plain["m1_c"][0]  # the sensor starts where the spring does
    assert rows["y1_c"][3] < plain["m1_c"][3] - 1
    assert "sensor_lag is not on the chip" in table


def test_current_and_voltage_are_power_and_a_current_alone_heats_by_the_model_s_resistance(tmp_path: Path) -> None:
    model = MODEL.replace("cols = 2", "cols = 1")
    _, rows, _ = replay(tmp_path, "time_s,i1_a,v1_v,t1_c\n0,2,0.5,20\n4,0,0,22\n5,0,0,22\n", model)
    assert rows["m1_c"][1] == pytest.approx(21.98, abs=0.03)
    _, rows, _ = replay(tmp_path, "time_s,i1_a,t1_c\n0,2,20\n4,0,22\n5,0,22\n", model)
    assert rows["m1_c"][1] == pytest.approx(20 + 4 * 0.219 * 4 / 2, abs=0.05)


def test_a_log_without_temperatures_is_simulated(tmp_path: Path) -> None:
    table, rows, result = replay(tmp_path, "time_s,u1,u2\n0,1,0\n5,1,0\n10,0,0\n")
    assert "no temperature to compare with" in table
    assert rows["m1_c"][2] == pytest.approx(25, abs=0.2)
    assert (result["rmse_c"], result["springs"][0]["largest_error_c"]) == (None, None)


@pytest.mark.parametrize(
    ("old", "new", "place", "words"),
    [
        ("2.0", "200.0", ":8:9:", "the chip holds"),
        ("value = 1.0", "value = 0.0", ":", "no command_power_w of spring 1"),
        ("2.0\n", '2.0\nspring = 1\neffect = "radiation"\n', ":10:10:", "belongs to no effect"),
    ],
)
def test_a_model_that_cannot_be_replayed_is_refused_where_it_says_so(
    tmp_path: Path, old: str, new: str, place: str, words: str
) -> None:
    with pytest.raises(InputError) as refused:
        replay(tmp_path, model=MODEL.replace(old, new))
    assert str(refused.value).startswith(f"{tmp_path / 'm.toml'}{place}") and words in str(refused.value)
    assert not (tmp_path / "r.csv").exists()
