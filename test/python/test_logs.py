"""Logs: what is handled and said, what is refused with file, line and column."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from ninespring.errors import InputError
from ninespring.logs import condense, log_text, read_log

HEADER = "time_s,i1_a,t1_c\n"


def refused(tmp_path: Path, text: str, springs: int | None = None) -> InputError:
    path = tmp_path / "bad.csv"
    path.write_bytes(text.encode())
    with pytest.raises(InputError) as caught:
        read_log(path, springs)
    assert str(caught.value).startswith(str(path))
    return caught.value


@pytest.mark.parametrize(
    ("text", "line", "word"),
    [
        ("", None, "empty"),
        (HEADER, 1, "no row"),
        (HEADER + "0,1,20\n1,1,20\n1,1,21\n2,1,20\n", 4, "rise"),
        (HEADER + "0,1,20\n1,1,20\n0.5,1,21\n", 4, "rise"),
        (HEADER + "0,1,20\n1,x,20\n2,1,20\n", 3, "not a number"),
        (HEADER + "0,1,20\n1,nan,20\n2,1,20\n", 3, "not a number"),
        (HEADER + "0,1,20\n1,,20\n2,1,20\n", 3, "empty"),
        (HEADER + "0,1,20\n1,1\n", 3, "cut off"),
        (HEADER + "0,1,20\n1,1,20,5\n2,1,20\n", 3, "decimal commas"),
        ("time_s;i1_a;t1_c\n0;1,5;20,1\n", 1, "semicolons"),
        ("time_s,i1_ma,t1_c\n0,1,20\n", 1, "unknown column"),
        ("time_s,i1_a,t1_f\n0,1,68\n", 1, "unknown column"),
        ("time_s,i1_a,i1_a,t1_c\n0,1,1,20\n", 1, "twice"),
        ("time_s,t1_c\n0,20\n1,20\n2,20\n", 1, "neither currents"),
        ("i1_a,t1_c\n1,20\n", 1, "time_s"),
        (HEADER + "0,1500,20\n1,1500,20\n2,1500,20\n", 2, "milliamperes"),
        (HEADER + "0,0,68\n1,0,68.1\n2,1,68.2\n3,1,69\n4,1,70\n", 2, "Fahrenheit"),
        (HEADER + "0,0,293\n1,0,293\n2,1,294\n3,1,295\n4,1,296\n", 2, "kelvin"),
        (HEADER + "0," + "1" * 200000 + ",20\n", 2, "characters"),
    ],
)
def test_bad_logs_are_refused_where_they_are_bad(tmp_path: Path, text: str, line: int | None, word: str) -> None:
    error = refused(tmp_path, text)
    assert error.line == line
    assert word in error.message


def test_a_missing_spring_is_refused_by_its_number(tmp_path: Path) -> None:
    error = refused(tmp_path, "time_s,i1_a,i3_a,t1_c,t2_c,t3_c\n0,1,1,20,20,20\n")
    assert "spring 2" in error.message


def test_a_cell_is_found_by_its_column(tmp_path: Path) -> None:
    error = refused(tmp_path, HEADER + "0,1,20\n1,1.25,9999\n2,1,20\n")
    assert (error.line, error.column) == (3, 8)


def test_repeated_rows_are_dropped_and_said(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(HEADER + "0,1,20\n1,1,20.5\n1,1,20.5\n2,1,21\n3,1,21.5\n")
    run = read_log(path)
    assert len(run.time_s) == 4
    assert any("repeated" in note for note in run.notes)


def test_a_gap_starts_the_simulation_again(make_log) -> None:
    def cut(columns: dict[str, np.ndarray]) -> None:
        keep = np.r_[0:200, 320:600]
        for name in list(columns):
            columns[name] = columns[name][keep]
        columns["time_s"] = np.arange(600.0)[keep]

    run = read_log(make_log(change=cut))
    assert run.starts == [0, 200]
    assert any("gap" in note for note in run.notes)


def test_a_saturated_sensor_is_left_out_and_said(make_log) -> None:
    def clip(columns: dict[str, np.ndarray]) -> None:
        columns["t3_c"] = np.minimum(columns["t3_c"], 45.0)

    run = read_log(make_log(change=clip))
    assert any("t3_c" in note and "saturated" in note for note in run.notes)
    assert not np.any(run.temperature_c[:, 2] == 45.0)


def test_a_dead_sensor_is_left_out_and_said(make_log) -> None:
    run = read_log(make_log(change=lambda c: c.update(t7_c=np.full(600, 21.0))))
    assert np.isnan(run.temperature_c[:, 6]).all()
    assert any("dead" in note for note in run.notes)


def test_a_glitch_is_left_out_and_nothing_else(make_log) -> None:
    def spike(columns: dict[str, np.ndarray]) -> None:
        columns["t1_c"][250] += 40.0

    clean = read_log(make_log("clean.csv"))
    run = read_log(make_log(change=spike))
    assert not np.isnan(clean.temperature_c).any()
    assert np.flatnonzero(np.isnan(run.temperature_c[:, 0])).tolist() == [250]


def test_columns_of_the_simulator_are_skipped(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(
        "time_s,i1_a,m1_c,d1,t1_c,state,note_x\n0,1,20,0.5,20,ok,1\n1,1,20,0.5,20,ok,1\n2,1,20,0.5,20,locked,1\n"
    )
    assert read_log(path).springs == 1


def test_long_logs_are_averaged_without_a_shift(make_log) -> None:
    run = read_log(make_log(seconds=600, noise=0.0))
    short = condense(run, 200)
    assert len(short.time_s) == 200
    middle = np.interp(short.time_s, run.time_s, run.temperature_c[:, 4])
    # kinks are rounded by the averaging; a shift by one second would show as a bias on every slope
    rising = np.gradient(middle) > 0.3
    assert rising.any()
    assert abs(np.mean((short.temperature_c[:, 4] - middle)[rising])) < 0.25


@settings(
    max_examples=150,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(st.text(alphabet='time_s,i1_at0123456789.-+e\n#: nax;\t\r"', max_size=300))
def test_any_text_is_read_or_refused_with_one_line(tmp_path: Path, text: str) -> None:
    path = tmp_path / "fuzz.csv"
    path.write_bytes(text.encode())
    try:
        read_log(path)
    except InputError as error:
        assert "\n" not in str(error)


@settings(
    max_examples=50,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(
    st.lists(st.tuples(st.floats(0, 3), st.floats(-10, 150)), min_size=4, max_size=20),
    st.floats(0.01, 5.0),
)
def test_what_is_written_is_read_back(tmp_path: Path, rows: list[tuple[float, float]], step: float) -> None:
    path = tmp_path / "round.csv"
    time_s = np.arange(len(rows)) * round(step, 3)
    current = np.array([r[0] for r in rows])
    temperature = np.array([r[1] for r in rows])
    path.write_text(log_text(time_s, {"i1_a": current, "t1_c": temperature}))
    try:
        run = read_log(path)
    except InputError as error:
        assert "Fahrenheit" in str(error)
        return
    assert np.allclose(run.drive[:, 0], current, atol=1e-4)
    seen = np.isfinite(run.temperature_c[:, 0])
    assert np.allclose(run.temperature_c[seen, 0], temperature[seen], atol=1e-4)
