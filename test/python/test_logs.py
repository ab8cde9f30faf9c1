"""Logs: what is handled and said, what is refused with file, line and column."""

from __future__ import annotations

import os
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from made import keep_rows
from ninespring.errors import InputError
from ninespring.find.steady import is_steady
from ninespring.io.logs import condense, log_text, read_log, read_table
from ninespring.io.logs.run import Run
from ninespring.model.simulate import simulate_run
from plants import a_plant

HEADER = "time_s,i1_a,t1_c\n"
SWAP = (("i", "a", "v", "v"), ("v", "v", "i", "a"))


def refused(tmp_path: Path, text: str) -> InputError:
    path = tmp_path / "bad.csv"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(InputError) as caught:
        read_log(path)
    assert str(caught.value).startswith(str(path))
    return caught.value


def read(folder: Path, text: str) -> Run:
    (folder / "log.csv").write_text(text)
    return read_log(folder / "log.csv")


SLOW = "".join(f"{500 * n},{n // 100 % 2},{20.0 + 0.1 * (n % 7):g}\n" for n in range(1800))
"""Days of rows that show no warming."""


@pytest.mark.parametrize(
    ("text", "line", "word"),
    [
        ("", None, "empty"),
        (HEADER, 1, "no row"),
        ("0,1,20\n1,1,20\n2,1,20\n", 1, "column names"),
        (HEADER + "0,1,20\n1,1,20\n" + HEADER + "0,1,20\n", 4, "two logs"),
        ("\ufeff".encode("utf-16-le").decode("latin-1") + "t\0i\0", 1, "UTF-16"),
        ("PK\x03\x04\x14\0", None, "unpack it"),
        ("\x1f\x8b\x08\0", None, "unpack it"),
        (HEADER + "0,1,20\n1,1,-127\n2,1,20\n", 3, "leave the cell empty"),
        (HEADER + "0,1,20\n1,1,20\n1,1,21\n2,1,20\n", 4, "rise"),
        (HEADER + "0,1,20\n1,1,20\n0.5,1,21\n", 4, "rise"),
        (HEADER + "0,1,20\n1,x,20\n2,1,20\n", 3, "not a number: give the number"),
        (HEADER + "0,1,20\n1,nan,20\n2,1,20\n", 3, "i1_a is empty"),
        (HEADER + "0,1,20\n1,1,n/a\n2,1,20\n", 3, "not a number: leave the cell empty"),
        (HEADER + "0,1,20\nnan,1,20\n2,1,20\n", 3, "time_s"),
        (HEADER + "0,1,20\n1,,20\n2,1,20\n", 3, "empty"),
        (HEADER + "0,1,20\n1,1\n", 3, "cut off"),
        (HEADER + "0,1,20\n1,1,20,5\n2,1,20\n", 3, "a decimal comma? write 20.5, not 20,5"),
        (HEADER + "0,1,20,\n1,1,20,\n2,1,20,\n", 2, "a comma too many at its end"),
        (HEADER + "s,A,degC\n0,1,20\n1,1,20\n2,1,20\n", (2, 1), "a line of words under the names: delete it"),
        ("time_s;i1_a;t1_c\n0;1,5;20,1\n", 1, "semicolons"),
        ("time_s i1_a t1_c\n0 1.5 20.1\n", (1, 7), "separated by spaces"),
        ("time_s,i1_ma,t1_c\n0,1,20\n", 1, "unknown column"),
        ("time_s,i1_a,t1_f\n0,1,68\n", 1, "unknown column"),
        ("time_s,i1_a,i1_a,t1_c\n0,1,1,20\n", 1, "twice"),
        ("time_s,t1_c\n0,20\n1,20\n2,20\n", 1, "neither currents"),
        ("i1_a,t1_c\n1,20\n", 1, "time_s"),
        ("time_s,u1,t1_c\n0,1,20\n1,-18.5,20\n2,1,20\n", (3, 3), "what a controller asks beyond that is cut off"),
        (HEADER + "0,1500,20\n1,1500,20\n2,1500,20\n", 2, "milliamperes"),
        (HEADER + "0,0,68\n1,0,68.1\n2,1,68.2\n3,1,69\n4,1,70\n", 2, "Fahrenheit"),
        (HEADER + "0,0,293\n1,0,293\n2,1,294\n3,1,295\n4,1,296\n", 2, "kelvin"),
        (HEADER + "0," + "1" * 200000 + ",20\n", 2, "characters"),
        (HEADER + "0,1,20\n1,1,20.5\n6000000,1,21\n", (4, 1), "if its time is in ms"),
        (HEADER + SLOW, (1801, 1), "10.4 days, its rows 500 s apart: if its time is in ms, divide by 1000"),
        (HEADER + "0,0,20\n1e308,0,20\n2,0,20\n3,0,20\n", (3, 1), "time_s = 1e+308 s"),
        (HEADER + "0,1,20\n1,1.25,9999\n2,1,20\n", (3, 8), "leave the cell empty"),
        ("time_s,i1_a,i3_a,t1_c,t2_c,t3_c\n0,1,1,20,20,20\n", (1, 1), "spring 2"),
    ],
)
def test_bad_logs_are_refused_where_they_are_bad(
    tmp_path: Path, text: str, line: int | tuple[int, int] | None, word: str
) -> None:
    error = refused(tmp_path, text)
    assert line in (error.line, (error.line, error.column))
    assert word in error.message


def test_a_run_that_begins_warm_in_degc_is_no_fahrenheit(tmp_path: Path) -> None:
    """Two springs from an earlier run, above 45 degC to the end: they fall below where they began, which a room does not."""
    rows = [f"{t},{float(t >= 30)},{69.6 - 0.3 * min(t, 30):.1f}\n" for t in range(60)]
    assert read(tmp_path, HEADER + "".join(rows)).temperature_c[0, 0] == pytest.approx(69.6)


@pytest.mark.parametrize(
    ("header", "column", "advice"),
    [
        ("time_s,i1_a,t1_f", 13, "convert with (F - 32) / 1.8, and name it t1_c"),
        ("time_s,i12_ma,t1_c", 8, "divide by 1000, and name it i12_a"),
        ("time_s,i1_a,v1_mV", 13, "divide by 1000, and name it v1_v"),
        ("time_ms,i1_a", 1, "divide by 1000, and name it time_s"),
        ("Time,i1_a", 1, "if it is in seconds, name it time_s"),
        ("time_s,Q1_pct", 8, "divide by 100, and name it u1"),
        ("time_s,i1_a,t1", 13, "if it is in degC, name it t1_c"),
        ("time_s,i1_a,ambient_f", 13, "(F - 32) / 1.8, and name it ambient_c"),
        ("time_s,i1_a,weather", 13, "note_"),
        ("time_s,i65_a,t1_c", 8, "64 springs"),
        ("time_s,i1_a,,t1_c", 13, "no name"),
        ("time_s,i1_a,t1_c,", 18, "a comma too many at the end of the line?"),
        ("TIME_S,i1_a,t1_c", 1, "name it time_s"),
        ("Time (s),i1_a,t1_c", 1, "name it time_s"),
        ("time_s,i1_a,T1 [degC]", 13, "name it t1_c"),
        ("time_s,i1_a,T1 [F]", 13, "convert with (F - 32) / 1.8, and name it t1_c"),
    ],
)
def test_a_column_with_another_s_name_is_refused_with_what_to_do(
    tmp_path: Path, header: str, column: int, advice: str
) -> None:
    error = refused(tmp_path, header + "\n0,0,0,0\n")
    assert (error.line, error.column) == (1, column)
    assert advice in error.message


def test_what_a_thermometer_says_of_a_failed_reading_is_no_temperature(tmp_path: Path) -> None:
    """-127 of a chip that did not answer, 1372 of an open thermocouple: one cell in a hundred has no other unit."""
    rows = [f"{t},{t % 60 // 30},{20 + t % 60 / 10 if t not in (50, 150) else -127}\n" for t in range(300)]
    run = read(tmp_path, HEADER + "".join(rows))
    assert np.flatnonzero(np.isnan(run.temperature_c[:, 0])).tolist() == [50, 150]
    assert "t1_c: 2 cells that no spring can have left out, the first -127 degC in line 52" in run.notes
    error = refused(tmp_path, HEADER + "".join(row.replace("22.0", "-127") for row in rows))
    assert "not a spring's temperature" in error.message


def test_repeated_rows_are_dropped_and_said(tmp_path: Path) -> None:
    run = read(tmp_path, HEADER + "0,1,20\n1,1,20.5\n1,1,20.5\n2,1,21\n3,1,21.5\n")
    assert len(run.time_s) == 4
    assert any("1 repeated" in note for note in run.notes)
    # a logger that sends a block again
    again = read(tmp_path, HEADER + "0,1,20\n1,1,20.5\n2,1,21\n1,1,20.5\n2,1,21\n3,1,21.5\n")
    assert again.time_s.tolist() == [0, 1, 2, 3]


def test_of_a_time_that_is_there_twice_the_later_row_counts(tmp_path: Path) -> None:
    """As programs write that simulate by steps: what is switched has the row before and the row after it at one time."""
    rows = [f"{k},0.5,{20 + k / 10}" for k in range(200)]
    run = read(tmp_path, "\n".join(["time_s,u1,t1_c", *rows[:100], "100,0,30.1", *rows[100:]]) + "\n")
    assert (len(run.time_s), run.drive[100, 0]) == (200, 0.5)
    assert "1 row at the next one's time dropped: a later row counts" in run.notes
    with pytest.raises(InputError, match="repeats 1 with other values"):
        read(tmp_path, "time_s,u1,t1_c\n0,0,20\n1,0,20\n1,1,20\n2,1,20\n")
    with pytest.raises(InputError, match="two runs in one file"):
        read(tmp_path, "time_s,u1,t1_c\n0,0,20\n1,0,20\n0,1,20\n1,1,20\n")


def test_a_gap_starts_the_simulation_again(make_log) -> None:
    run = read_log(make_log(change=lambda columns: keep_rows(columns, np.r_[0:200, 320:600])))
    assert run.starts == [0, 200]
    assert any("gap" in note for note in run.notes)
    # the reading at the start is kept, the two minutes after it do not count
    assert np.isfinite(run.temperature_c[200]).all()
    assert np.isnan(run.temperature_c[201:320]).all()
    assert np.isfinite(run.temperature_c[320:]).all()


@pytest.mark.parametrize("step_c", [0.0, 0.5])
def test_a_sensor_that_freezes_half_way_is_left_out_from_there(tmp_path: Path, step_c: float) -> None:
    rng = np.random.default_rng(3)
    time_s = np.arange(400.0)
    current = np.where((time_s // 50) % 2 == 0, 0.0, 1.4)
    true = np.empty(400)
    now = 20.0
    for row in range(400):
        true[row] = now
        now += (0.2 * current[row] ** 2 - 5.8e-3 * (now - 20.0)) / 0.3
    shown = true + rng.normal(0.0, 0.1, 400)
    if step_c:
        shown = step_c * np.round(shown / step_c)
    whole = read(tmp_path, log_text(time_s, {"i1_a": current, "t1_c": shown}))
    assert np.isfinite(whole.temperature_c).all(), "steps of a thermometer are not frozen"
    shown[230:] = shown[230]
    run = read(tmp_path, log_text(time_s, {"i1_a": current, "t1_c": shown}))
    assert np.isfinite(run.temperature_c[:231]).all()
    assert np.isnan(run.temperature_c[233:]).all()
    assert any("frozen" in note and "t1_c" in note for note in run.notes)


def test_a_saturated_sensor_a_dead_one_and_a_glitch_are_left_out_and_said(make_log) -> None:
    def broken(columns: dict[str, np.ndarray]) -> None:
        columns["t3_c"] = np.minimum(columns["t3_c"], 45.0)
        columns["t7_c"][:] = 21.0
        columns["t1_c"][250] += 40.0

    clean, run = read_log(make_log("clean.csv")), read_log(make_log(change=broken))
    assert not np.isnan(clean.temperature_c).any()
    assert any("t3_c" in note and "saturated" in note for note in run.notes)
    assert np.nanmax(run.temperature_c[:, 2]) < 45.0 - 3 * 0.3
    assert np.isnan(run.temperature_c[:, 6]).all() and any("dead" in note for note in run.notes)
    assert np.flatnonzero(np.isnan(run.temperature_c[:, 0])).tolist() == [250]
    assert np.array_equal(np.delete(run.temperature_c, [0, 2, 6], 1), np.delete(clean.temperature_c, [0, 2, 6], 1))


def test_thermometers_that_change_places_for_a_while_are_put_back_and_said(make_log) -> None:
    def mixed_up(columns: dict[str, np.ndarray]) -> None:
        for rows in (slice(300, 350), slice(540, 542)):
            columns["t1_c"][rows], columns["t2_c"][rows] = columns["t2_c"][rows].copy(), columns["t1_c"][rows].copy()
        columns["t4_c"][300:350] += 20.0  # one that jumps by itself

    clean, run = read_log(make_log("clean.csv")), read_log(make_log(change=mixed_up))
    assert np.array_equal(run.temperature_c[:, :3], clean.temperature_c[:, :3])
    assert run.temperature_c[300:350, 3] == pytest.approx(clean.temperature_c[300:350, 3] + 20.0)
    said = [note for note in run.notes if "places" in note]
    assert len(said) == 1 and said[0].startswith("t1_c and t2_c change places 2 times, the first at 300 s: put back")


def test_thermometers_that_change_places_for_good_are_left(make_log) -> None:
    """Nobody knows which of both times they were right."""

    def mixed_up(columns: dict[str, np.ndarray]) -> None:
        columns["t1_c"][300:], columns["t2_c"][300:] = columns["t2_c"][300:].copy(), columns["t1_c"][300:].copy()

    clean, run = read_log(make_log("clean.csv")), read_log(make_log(change=mixed_up))
    assert np.array_equal(run.temperature_c[300:, :2], clean.temperature_c[300:, 1::-1])
    assert not any("places" in note for note in run.notes)


def test_spikes_are_left_out_however_many_and_up_to_four_rows_long(make_log) -> None:
    def loose(columns: dict[str, np.ndarray]) -> None:
        columns["t1_c"][20::45] += 60.0
        columns["t2_c"][np.add.outer(np.arange(20, 590, 45), [0, 1]).ravel()] -= 40.0
        columns["t3_c"][np.add.outer(np.arange(20, 590, 90), range(4)).ravel()] += 30.0
        columns["t4_c"][200:400] += np.random.default_rng(1).normal(0.0, 3.0, 200)
        columns["t5_c"] = np.floor(np.arange(600.0) / 60.0) + (np.arange(600) % 25 == 0)  # steps, and flickers

    clean, run = read_log(make_log("clean.csv")), read_log(make_log(change=loose))
    away = np.abs(run.temperature_c[:, :3] - clean.temperature_c[:, :3])
    assert np.nanmax(away) < 3.0 and np.isnan(away).sum(axis=0).tolist() == [13, 26, 28]
    assert np.isnan(run.temperature_c[:, 3:5]).sum() <= 2, "what is restless, or steps, is no row of spikes"


def test_a_peak_between_rows_far_apart_is_no_spike(tmp_path: Path) -> None:
    rows = "".join(f"{60 * k},{k % 80 == 4:d},{20 + 0.1 * (k % 3) + 40 * (k % 80 == 5):.1f}\n" for k in range(200))
    assert np.isfinite(read(tmp_path, HEADER + rows).temperature_c).all()


@pytest.mark.parametrize("off_k", [16.0, -52.0])
def test_a_first_reading_that_is_a_spike_is_where_no_simulation_starts(make_log, off_k: float) -> None:
    def spike(columns: dict[str, np.ndarray]) -> None:
        columns["t2_c"][0] += off_k

    clean, run = read_log(make_log("clean.csv")), read_log(make_log(change=spike))
    assert run.temperature_c[0, 1] == clean.temperature_c[1, 1]
    assert np.array_equal(np.delete(run.temperature_c, 1, axis=1), np.delete(clean.temperature_c, 1, axis=1))
    (said,) = (re.search(r"t2_c: the first reading, (\S+) degC", note) for note in run.notes if "first reading" in note)
    assert said and float(said[1]) == pytest.approx(clean.temperature_c[0, 1] + off_k, abs=0.01)


@pytest.mark.parametrize("cell", ["", "nan", "NaN", " nan"])
def test_what_was_not_measured_is_empty_or_nan(tmp_path: Path, cell: str) -> None:
    rows = "".join(f"{k},1,{cell if k == 7 else 20 + k % 3}\n" for k in range(40))
    run = read(tmp_path, HEADER + rows)
    assert np.flatnonzero(np.isnan(run.temperature_c[:, 0])).tolist() == [7]


def test_a_spring_that_was_not_switched_on_yet_is_not_saturated(tmp_path: Path) -> None:
    """Of a simulation, without noise: in the row in which it is switched on a spring is as warm as before."""
    since = np.arange(400) - 40
    shown = 20.5 + 30.0 * (1.0 - np.exp(-np.clip(since, 0, None) / 50.0))
    rows = "".join(f"{k},{s >= 0:d},{t:.6f}\n" for k, (s, t) in enumerate(zip(since, shown, strict=True)))
    run = read(tmp_path, HEADER + rows)
    assert np.isfinite(run.temperature_c).all(), run.notes


@pytest.mark.parametrize("hotter", [False, True])
def test_a_spring_that_has_settled_is_neither_frozen_nor_saturated(tmp_path: Path, hotter: bool) -> None:
    """Its thermometer steps by half a kelvin, and what measures its current is noisy."""
    rng, since = np.random.default_rng(3), np.arange(2600)
    amps = np.where(since < 1500, 0.3, 0.5 if hotter else 0.1) + rng.normal(0.0, 1e-3, 2600)
    shown = 36.6 + (12.0 if hotter else -8.0) * (1.0 - np.exp(-np.clip(since - 1500, 0, None) / 300.0))
    shown -= 12.0 * np.exp(-since / 90.0)
    rows = "".join(f"{k},{a:.4f},{t:.1f}\n" for k, a, t in zip(since, amps, np.round(2.0 * shown) / 2.0, strict=True))
    run = read(tmp_path, HEADER + rows)
    assert not any("frozen" in note or "saturated" in note for note in run.notes), run.notes
    assert np.isfinite(run.temperature_c).all()


def test_a_first_reading_a_step_beside_the_next_is_no_spike(tmp_path: Path) -> None:
    shown = np.round(2.0 * (21.0 + 6.0 * np.clip(np.arange(300) - 100, 0, 100) / 100.0)) / 2.0
    shown[0] = 20.5
    run = read(tmp_path, HEADER + "".join(f"{k},{100 <= k < 200:d},{one:.1f}\n" for k, one in enumerate(shown)))
    assert run.temperature_c[0, 0] == 20.5 and not any("first reading" in note for note in run.notes)


def test_a_spring_that_is_heated_or_cools_from_the_first_row_on_begins_where_it_is_read(make_log) -> None:
    def quick(columns: dict[str, np.ndarray]) -> None:
        since = np.arange(len(columns["t1_c"]))
        columns["t1_c"] = 60.0 - 35.0 * np.exp(-since / 3.0)
        columns["t2_c"] = 25.0 + 60.0 * np.exp(-since / 3.0)
        columns["i1_a"][:] = 1.0

    run = read_log(make_log(change=quick))
    assert run.temperature_c[0, :2] == pytest.approx([25.0, 85.0])


@pytest.mark.parametrize("shows", [0.0, 85.0])
def test_rows_before_the_first_reading_are_no_readings(make_log, shows: float) -> None:
    def nothing_yet(columns: dict[str, np.ndarray]) -> None:
        for k in range(1, 10):
            columns[f"t{k}_c"][:4] = shows

    clean, run = read_log(make_log("clean.csv")), read_log(make_log(change=nothing_yet))
    assert np.array_equal(run.temperature_c[0], clean.temperature_c[4])
    assert np.isnan(run.temperature_c[1:4]).all()
    assert np.array_equal(run.temperature_c[4:], clean.temperature_c[4:])
    assert any("first 4 row(s)" in note for note in run.notes)


def test_a_log_that_begins_at_rest_and_is_then_driven_has_no_rows_before_its_first_reading(make_log) -> None:
    def coarse(columns: dict[str, np.ndarray]) -> None:
        for k in range(1, 10):
            columns[f"t{k}_c"] = np.round(columns[f"t{k}_c"] * 2.0) / 2.0

    for change in (None, coarse):
        run = read_log(make_log(noise=0.0, change=change))
        assert np.isfinite(run.temperature_c).all() and not any("first" in note for note in run.notes)


def test_offsets_of_the_sensors_about_zero_heat_nothing(tmp_path: Path) -> None:
    both = read(tmp_path, "time_s,i1_a,v1_v,t1_c\n0,-0.005,0.004,20\n1,1,0.2,20\n2,0.005,-0.004,20\n")
    assert both.drive[:, 0].tolist() == [0.0, 0.2, 0.0]
    assert read(tmp_path, HEADER + "0,-0.005,20\n1,1,20\n2,0,20\n").drive[:, 0].tolist() == [0.0, 1.0, 0.0]


def test_a_peak_without_noise_is_no_glitch(make_log) -> None:
    def peak(columns: dict[str, np.ndarray]) -> None:  # heated fast and switched off, again and again
        row = np.arange(600.0) % 150.0
        columns["t1_c"] = np.where(row < 10.0, 40.0 + 5.0 * row, 40.0 + 50.0 * np.exp((10.0 - row) / 12.0))

    run = read_log(make_log(change=peak))
    assert not np.isnan(run.temperature_c[:, 0]).any(), run.notes


def test_columns_of_the_simulator_are_skipped(tmp_path: Path) -> None:
    rows = "0,1,20,0.5,4,1,20,ok,1\n1,1,20,0.5,0,0,20,ok,1\n2,1,20,0.5,0,0,20,locked,1\n"
    assert read(tmp_path, "time_s,i1_a,m1_c,d1,limits1,cut1_a,t1_c,state,note_x\n" + rows).springs == 1


def test_status_between_the_rows_is_no_key_of_the_log(tmp_path: Path) -> None:
    text = "# board: 7\n" + HEADER + "0,1,20\n# <limits|spring:1|t:0.900|supply|cut_a:2.610>\n1,1,20\n2,1,x\n"
    assert refused(tmp_path, text).line == 6
    assert read(tmp_path, text.replace("x", "21")).temperature_c[:, 0].tolist() == [20, 20, 21]
    assert read_table(tmp_path / "log.csv").keys == {"board": "7"}


def test_fast_logs_are_averaged_without_a_shift_and_with_white_noise(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    time_s = np.arange(60000) * 0.05
    curve = 60.0 + 30.0 * np.sin(time_s / 40.0)
    columns = {"i1_a": np.where(np.sin(time_s / 40.0 + 0.1) > 0, 1.5, 0.0), "t1_c": curve + rng.normal(0, 0.3, 60000)}
    run = read(tmp_path, log_text(time_s, columns))
    short = condense(run, 8000)
    assert len(short.time_s) == 7500
    left = short.temperature_c[:, 0] - (60.0 + 30.0 * np.sin(short.time_s / 40.0))
    slope = np.cos(short.time_s / 40.0)
    # 0.05 s of shift would move the regression on the slope of 0.75 degC/s by 0.04
    assert abs(np.polyfit(slope, left, 1)[0]) < 0.01
    assert np.std(left) == pytest.approx(0.3 / np.sqrt(7), rel=0.05)
    assert abs(np.corrcoef(left[1:], left[:-1])[0, 1]) < 0.05
    # what was given is the same in sum, row by row of the first
    given = np.add.reduceat(run.drive[:, 0], np.arange(0, 60000, 8)) / 8
    assert short.drive[:, 0] == pytest.approx(given)
    assert any("averaged 8 by 8" in note for note in short.notes)


def test_endless_logs_are_averaged_where_nothing_happens_and_simulated_as_well_as_the_whole(make_log) -> None:
    true = {"plate_conduction": {"plate_coupling_w_per_k": 0.002}, "latent_heat": {"latent_heat_j": 8.0}}
    run = read_log(make_log(effects=true, seconds=20000, noise=0.05))
    short = condense(run, 4000)
    assert 2000 < len(short.time_s) <= 4000
    assert short.time_s[0] == run.time_s[0] and short.starts == [0]
    # what was given is the same in sum, and what was switched is switched at that very time
    span = np.diff(short.time_s, append=run.time_s[-1] + 1.0)
    assert span @ short.drive == pytest.approx(run.drive.sum(axis=0))
    switched = run.time_s[1:][(np.abs(np.diff(run.drive, axis=0)) > 0.05 * run.drive.max(axis=0)).any(axis=1)]
    assert np.isin(switched, short.time_s).all()
    left = short.temperature_c - simulate_run(a_plant((3, 3), true), short, short.ambient_c)
    assert np.isfinite(left).mean() > 0.99
    assert np.sqrt(np.nanmean(left**2)) < 0.06
    assert any("20000 rows averaged" in note for note in short.notes)


def test_no_row_of_a_log_that_is_switched_all_the_time_is_left_out(make_log) -> None:
    def restless(columns: dict[str, np.ndarray]) -> None:
        rng = np.random.default_rng(2)
        for k in range(9):
            columns[f"i{k + 1}_a"] = rng.choice([0.0, 1.5], 9000)

    run = read_log(make_log(seconds=9000, change=restless))
    short = condense(run, 3000)
    assert len(short.time_s) == 3000 and short.starts == [0]
    assert short.drive.sum(axis=0) * 3.0 == pytest.approx(run.drive.sum(axis=0), rel=1e-3)


def test_rows_here_and_there_that_are_missing_are_said(make_log) -> None:
    here = np.random.default_rng(0).random(600) > 0.1
    run = read_log(make_log(change=lambda columns: keep_rows(columns, here)))
    assert run.starts == [0]
    assert any("steps from row to row are longer than usual" in note for note in run.notes)


def test_one_column_in_fahrenheit_is_refused_by_its_name_and_a_hot_start_is_not(make_log) -> None:
    path = make_log(change=lambda c: c.update(t3_c=c["t3_c"] * 1.8 + 32))
    with pytest.raises(InputError, match=r"spring 3 .* Fahrenheit") as caught:
        read_log(path)
    assert (caught.value.line, caught.value.column) == (2, path.read_text().splitlines()[1].index(",68.") + 2)

    def hot(columns: dict[str, np.ndarray]) -> None:
        columns["t3_c"] = 20.0 + 48.0 * np.exp(-np.arange(600.0) / 60) + columns["t3_c"] * 1e-3

    assert read_log(make_log(change=hot)).springs == 9


def in_fahrenheit(columns: dict[str, np.ndarray]) -> None:
    columns.update({f"t{k}_c": columns[f"t{k}_c"] * 1.8 + 32 for k in range(1, 10)})
    columns.update(i1_a=np.maximum(columns["i1_a"], 0.5), v1_v=np.maximum(columns["v1_v"], 0.1))


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (lambda c: c.update(time_s=np.arange(600.0) * 120), "milliseconds"),
        (lambda c: c.update(time_s=np.arange(600.0) / 60), "minutes"),
        (lambda c: c["ambient_c"].__setitem__(slice(300, None), 30.0), "jumps from 20 to 30"),
        (lambda c: in_fahrenheit(c) or c["ambient_c"].fill(np.nan), "in Fahrenheit would be a room"),
        (
            lambda c: c.update({f"{a}{k}_{b}": c[f"{x}{k}_{y}"].copy() for k in range(1, 10) for a, b, x, y in SWAP}),
            "currents and voltages are swapped",
        ),
        (in_fahrenheit, "Fahrenheit"),
    ],
)
def test_what_is_possible_but_unlikely_is_said(make_log, change, word: str) -> None:
    assert any(word in note for note in read_log(make_log(change=change)).notes)
    assert not any(word in note for note in read_log(make_log("good.csv")).notes)


def test_spikes_of_an_ambient_are_left_out_and_said(make_log) -> None:
    def spiky(columns: dict[str, np.ndarray]) -> None:
        columns["ambient_c"][[0, 100, 101, 350]] = -18.0, 40.0, 41.0, 0.0

    run = read_log(make_log(change=spiky))
    assert run.ambient_c is not None and np.ptp(run.ambient_c) == 0.0
    assert "ambient_c: 4 isolated spike(s) left out, the first, -18 degC, at 0 s" in run.notes


def test_quotes_a_byte_order_mark_and_other_line_ends_change_nothing(make_log) -> None:
    path = make_log()
    plain = read_log(path)
    text = path.read_text()
    quoted = "\n".join(",".join(f'"{cell}"' for cell in line.split(",")) for line in text.splitlines()) + "\n"
    for other in (b"\xef\xbb\xbf" + text.encode(), text.replace("\n", "\r\n").encode(), quoted.encode()):
        path.write_bytes(other)
        assert np.array_equal(read_log(path).temperature_c, plain.temperature_c)


def test_a_line_that_was_cut_off_is_left_out_and_said(make_log) -> None:
    path = make_log()
    whole = path.read_text()
    for cut in (whole[:-1], whole[:-40], whole[: whole.rindex("\n", 0, -1) + 4]):
        path.write_text(cut)
        run = read_log(path)
        assert len(run.time_s) == 599
        assert any("cut off" in note for note in run.notes)


ROWS = 12
GOOD = "# board: 7\n" + log_text(
    np.arange(float(ROWS)),
    {"i1_a": np.linspace(0, 2, ROWS), "i2_a": np.zeros(ROWS), "t1_c": np.linspace(20, 40, ROWS), "fan": np.zeros(ROWS)},
)
fuzzed = settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@fuzzed
@given(st.integers(0, ROWS - 1), st.integers(0, 4), st.sampled_from(["x", "inf", "1_0", "--1", "1e999", "0x10", "é"]))
def test_a_bad_cell_anywhere_is_refused_at_its_line_and_column(tmp_path: Path, row: int, cell: int, junk: str) -> None:
    lines = GOOD.splitlines()
    cells = lines[2 + row].split(",")
    column = 1 + sum(len(one) + 1 for one in cells[:cell])
    cells[cell] = junk
    lines[2 + row] = ",".join(cells)
    with pytest.raises(InputError, match="not a number") as caught:
        read(tmp_path, "\n".join(lines) + "\n")
    assert (caught.value.line, caught.value.column) == (3 + row, column)


@fuzzed
@given(
    st.lists(st.tuples(st.integers(0, len(GOOD)), st.integers(0, 40), st.binary(max_size=12)), min_size=1, max_size=4)
)
def test_a_damaged_log_is_read_or_refused_with_one_line(tmp_path: Path, wounds: list[tuple[int, int, bytes]]) -> None:
    data = GOOD.encode()
    for at, cut, put in wounds:
        data = data[:at] + put + data[at + cut :]
    path = tmp_path / "fuzz.csv"
    path.write_bytes(data)
    try:
        run = read_log(path)
    except InputError as error:
        assert "\n" not in str(error)
        assert str(error).startswith(str(path))
    else:
        assert (np.diff(run.time_s) > 0).all()
        assert np.isfinite(run.drive).all() and np.isfinite(run.fan).all()


@fuzzed
@given(st.lists(st.tuples(st.floats(0, 3), st.floats(-10, 150)), min_size=4, max_size=20), st.floats(0.01, 5.0))
@example([(0.0, 7.0), *[(0.0, 0.0)] * 5, (0.0, 1.0)], 1.0)
def test_what_is_written_is_read_back(tmp_path: Path, rows: list[tuple[float, float]], step: float) -> None:
    current, temperature = np.array(rows).T
    try:
        run = read(tmp_path, log_text(np.arange(len(rows)) * round(step, 3), {"i1_a": current, "t1_c": temperature}))
    except InputError as error:
        assert "Fahrenheit" in str(error)
        return
    assert np.allclose(run.drive[:, 0], current, atol=1e-4)
    seen = np.isfinite(run.temperature_c[:, 0])
    if any("left out" in note for note in run.notes):
        seen[0] = False  # a run begins somewhere: what was no reading there begins as the next one
    assert np.allclose(run.temperature_c[seen, 0], temperature[seen], atol=1e-4)


@pytest.mark.parametrize(("value", "said"), [(-1.5, "leads of that sensor are swapped"), (1500, "milliamperes")])
def test_a_negative_current_is_not_taken_for_milliamperes(make_log, value: float, said: str) -> None:
    log = make_log(change=lambda c: c["i3_a"].__setitem__(slice(50, 60), value))
    with pytest.raises(InputError, match=said):
        read_log(log)


def test_a_log_that_comes_through_a_pipe_is_the_log(tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    log.write_text("time_s,i1_a,t1_c\n" + "".join(f"{k},1,2{k}\n" for k in range(5)))
    out_of, into = os.pipe()
    os.write(into, log.read_bytes())
    os.close(into)
    piped = f"/dev/fd/{out_of}"
    assert not is_steady(piped)  # looks at it first
    assert read_log(piped).sha256 == read_log(log).sha256
    os.close(out_of)
