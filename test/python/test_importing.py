"""Other people's files: units and separators by a mapping, camera frames by a region a spring."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from ninespring.errors import InputError
from ninespring.io import importing
from ninespring.io.logs import log_text, read_log, read_table

fuzzed = settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])

GRID = ("rows", "cols", "left", "top", "step_x", "step_y", "width", "height")
MAP = """[file]
separator = ";"
decimal = ","
[columns]
time_s = {column = "t/min", unit = "min"}
i1_a = {column = "heat", unit = "mA"}
t1_c = {column = "temp", unit = "degF"}
[constants]
ambient_c = 21.5
"""
OF_FIVE = "0,50,0,20.5,21\n1,50,0,20.5,21\n"
NAMED = '[columns]\ntime_s = "Time"\ni1_a = "I"\nt1_c = "T"\n'
CLOCK = '[columns]\ntime_s = {column = "Time", unit = "%s"}\nt1_c = "T"\n'


def imported(folder: Path, logger: str | bytes, mapping: str) -> str:
    """Return the log of another logger's table, by a mapping file's text or one that is built in."""
    (folder / "logger.csv").write_bytes(logger.encode() if isinstance(logger, str) else logger)
    (folder / "map.toml").write_text(mapping, encoding="utf-8")
    return importing.import_table(folder / "logger.csv", folder / "map.toml" if "\n" in mapping else mapping)


def test_a_pixel_that_is_none_is_refused_where_it_stands(tmp_path: Path) -> None:
    (tmp_path / "frame.csv").write_text("20.0,21.5\n20.0,warm\n")
    with pytest.raises(InputError, match=r"frame.csv:2:6: a pixel is 'warm', not a number"):
        importing.frames_of(tmp_path / "frame.csv")


def test_frames_of_any_size_become_a_temperature_a_spring(tmp_path: Path) -> None:
    frames = np.full((5, 24, 32), 20.0)
    for k in range(9):
        frames[:, 2 + 7 * (k // 3) : 6 + 7 * (k // 3), 3 + 9 * (k % 3) : 8 + 9 * (k % 3)] = 30.0 + k
    np.save(tmp_path / "frames.npy", frames)
    regions = tmp_path / "regions.toml"
    regions.write_text("[grid]\nrows = 3\ncols = 3\nleft = 5\ntop = 4\nstep_x = 9\nstep_y = 7\nwidth = 2\nheight = 2\n")

    def spring_temperatures() -> dict[str, np.ndarray]:
        source = tmp_path / "frames.npy"
        count, read = importing.frames_of(source)
        return importing.reduce_frames(source, count, read, importing.read_regions(regions))

    columns = spring_temperatures()
    assert [float(columns[f"t{k + 1}_c"][0]) for k in range(9)] == [30.0 + k for k in range(9)]
    regions.write_text("[[region]]\nspring = 1\nleft = 30\ntop = 0\nwidth = 5\nheight = 2\n")
    with pytest.raises(InputError, match="leaves frame 1"):
        spring_temperatures()


def test_frames_of_a_folder_come_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    for k in range(12):
        (tmp_path / f"Rec-1_{k}.csv").write_text(f"{k}\n")
    assert [float(frame[0, 0]) for frame in importing.frames_of(tmp_path)[1]] == list(range(12))


@fuzzed
@given(
    st.lists(st.tuples(st.floats(0.0, 3.0), st.floats(-10.0, 150.0)), min_size=4, max_size=12),
    st.floats(0.5, 60.0).map(lambda s: round(s, 2)),
)
def test_a_logger_in_other_units_is_read_back_in_the_logs(
    tmp_path: Path, rows: list[tuple[float, float]], step: float
) -> None:
    lines = [
        f"{k * step / 60:.8f};{current * 1000:.5f};{celsius * 1.8 + 32:.6f}".replace(".", ",")
        for k, (current, celsius) in enumerate(rows)
    ]
    (tmp_path / "log.csv").write_text(imported(tmp_path, "\n".join(["t/min;heat;temp", *lines]) + "\n", MAP))
    frame = read_table(tmp_path / "log.csv").frame
    assert frame["time_s"].to_numpy() == pytest.approx(np.arange(len(rows)) * step, abs=1e-4)
    assert frame["i1_a"].to_numpy() == pytest.approx([r[0] for r in rows], abs=1e-4)
    assert frame["t1_c"].to_numpy() == pytest.approx([r[1] for r in rows], abs=1e-4)
    assert (frame["ambient_c"] == 21.5).all()


@pytest.mark.parametrize(
    ("mapping", "logger", "place", "word"),
    [
        ('[columns]\ntime = "t"\n', "t\n1\n", "map.toml:2", "'time' is not a log's column"),
        ('[columns]\ntime_s = "t"\n[more]\n', "t\n1\n", "map.toml:3", "no key 'more'"),
        ('[columns]\ntime_s = {column = "t", unit = "furlong"}\n', "t\n1\n", "map.toml:2", "unknown unit"),
        ('[columns]\ntime_s = {unit = "s"}\n', "t\n1\n", "map.toml:2", "column"),
        ('[columns]\ntime_s = {column = "t", scale = "big"}\n', "t\n1\n", "map.toml:2", "scale"),
        ('[columns]\ntime_s = {column = "t", units = "s"}\n', "t\n1\n", "map.toml:2", "units"),
        ("[columns]\ntime_s = 7\n", "t\n1\n", "map.toml:2", "column"),
        ('[columns]\ni1_a = "t"\n', "t\n1\n", "map.toml:1", "no time_s"),
        ('[columns]\ntime_s = "t"\n[constants]\nwind = 1\n', "t\n1\n", "map.toml:4", "'wind' is not a log's column"),
        ('[columns]\ntime_s = "t"\n[constants]\nfan = "on"\n', "t\n1\n", "map.toml:4", "number"),
        ('[file]\nseparator = 5\n[columns]\ntime_s = "t"\n', "t\n1\n", "map.toml:2", "separator"),
        ('[file]\nskip_lines = "2"\n[columns]\ntime_s = "t"\n', "t\n1\n", "map.toml:2", "skip_lines"),
        ('[file]\nskip = 2\n[columns]\ntime_s = "t"\n', "t\n1\n", "map.toml:2", "skip"),
        ("[columns\n", "t\n1\n", "map.toml:1", "TOML"),
        ('[columns]\ntime_s = "t"\n', "", "logger.csv", "empty"),
        ('[columns]\ntime_s = "t"\n', "u\n1\n", "logger.csv:1", "no column 't'"),
        ('[columns]\ntime_s = "t"\n', "# by me\nt\n1\n\n2\nx\n", "logger.csv:6", "'x' in column 't' is not a number"),
        ('[columns]\ntime_s = "t"\n', "t,u\n1,2\n2,3,4\n", "logger.csv:3", "cells"),
        ('[columns]\ntime_s = "t"\n', "t,t\n1,2\n", "logger.csv:1", "twice"),
        ('[columns]\ntime_s = "t"\n', "t\n", "logger.csv:1", "no row"),
        (
            '[columns]\ntime_s = "t"\n',
            OF_FIVE,
            "logger.csv:1",
            '; without a line of names: [file] names = ["time", ...]',
        ),
        (
            '[columns]\ntime_s = "t"\n',
            f"# 3 May, by me, at home, 20 W, the lid closed\n{OF_FIVE}",
            "logger.csv:1",
            "the file has '3 May', 'by me', 'at home', '20 W', 'the lid closed'; without a line of names: [file] names",
        ),
        ('[file]\nnames = ["t"]\n[columns]\ntime_s = "t"\n', OF_FIVE, "logger.csv:1", "5 cells where the header has 1"),
        ("[file]\nperiod_s = 2.5\n" + NAMED, "Time,I,T\n1,1,20\n", "map.toml:3", "time_s and a period_s: give one"),
        (NAMED, "Time,I,T\n0,1,710\n1,1,711\n", "logger.csv", "no room in degC, degF or K: raw counts, millivolts?"),
        (NAMED, "Time,I,T\n0,1,294\n1,1,295\n", "logger.csv", 'looks like kelvin, unit = "K" for t1_c'),
        (
            CLOCK % "%H",
            "Time,T\n12 o'clock,20\n",
            "logger.csv:2",
            "'12 o'clock' in column 'Time' is not a time as '%H'",
        ),
        (
            CLOCK % "iso",
            "Time,T\n2026-10-25 02:59:59,20\n2026-10-25 02:00:01,20\n",
            "logger.csv:3",
            "the time falls by 3598 s",
        ),
    ],
)
def test_wrong_mappings_and_loggers_are_refused_where_they_are_wrong(
    tmp_path: Path, mapping: str, logger: str, place: str, word: str
) -> None:
    with pytest.raises(InputError) as caught:
        imported(tmp_path, logger, mapping)
    assert re.match(rf"{re.escape(str(tmp_path / place))}(:\d+)?: ", str(caught.value)), str(caught.value)
    assert word in caught.value.message


@fuzzed
@given(st.text(alphabet='t/min;heatp,0123456789.-\n#[]="{}', max_size=200), st.booleans())
@example('"0\n0"', False)
def test_any_text_is_imported_or_refused_with_one_line(tmp_path: Path, text: str, as_mapping: bool) -> None:
    logger = "t/min;heat;temp\n" + ("0;1;68\n" if as_mapping else text)
    try:
        imported(tmp_path, logger, "[columns]\n" + text if as_mapping else MAP)
    except InputError as error:
        assert "\n" not in str(error)


@fuzzed
@given(st.dictionaries(st.sampled_from(GRID), st.one_of(st.integers(-9, 90), st.floats(), st.just("x")), max_size=8))
def test_any_grid_is_read_or_refused_with_one_line(tmp_path: Path, grid: dict[str, object]) -> None:
    path = tmp_path / "regions.toml"
    path.write_text("[grid]\n" + "".join(f"{k} = {v!r}\n".replace("'", '"') for k, v in grid.items()))
    try:
        regions = importing.read_regions(path)
    except InputError as error:
        assert "\n" not in str(error) and str(error).startswith(str(path))
    else:
        assert all(one.right > one.left and one.bottom > one.top for one in regions)


@pytest.mark.parametrize("encoding", ["cp1252", "utf-8-sig", "utf-16"])
def test_a_logger_with_dates_quotes_and_an_old_character_set_is_read(tmp_path: Path, encoding: str) -> None:
    mapping = '[file]\nskip_lines = 1\n[columns]\ntime_s = {column = "Zeit", unit = "iso"}\nt1_c = "Temp (°C)"\n'
    logger = (
        'Logger 7\n"Zeit","Temp (°C)","Duty"\n"2026-01-31 23:59:59.5","20.5","50"\n\n"2026-02-01 00:00:01.0","21","0"\n'
    )
    text = imported(tmp_path, logger.encode(encoding), mapping + 'u1 = {column = "Duty", unit = "%"}\n')
    rows = [line.split(",") for line in text.splitlines() if line[0] not in "#t"]
    assert [[float(cell) for cell in row] for row in rows] == [[0, 20.5, 0.5], [1.5, 21, 0]]


@pytest.mark.parametrize(
    ("unit", "stamps"),
    [
        ("%H:%M:%S", ("23:10:09", "23:10:10")),
        ("%M:%S.%f", ("00:09.50", "00:10.50")),
        ("%m/%d/%Y %I:%M:%S %p", ("03/05/2024 02:00:59 PM", "03/05/2024 02:01:00 PM")),
        ("%d.%m.%Y %H:%M:%S", ("31.12.2024 23:59:59", "01.01.2025 00:00:00")),
    ],
)
def test_a_clock_is_read_as_the_mapping_says_that_it_is_written(
    tmp_path: Path, unit: str, stamps: tuple[str, str]
) -> None:
    text = imported(tmp_path, "Time,T\n" + "".join(f"{one},20\n" for one in stamps), CLOCK % unit)
    assert text.endswith("\n0.00000,20.00000\n1.00000,20.00000\n")


def test_a_clock_that_was_set_back_says_its_zone(tmp_path: Path) -> None:
    logger = "Time,T\n2026-10-25 02:59:59+02:00,20\n2026-10-25 02:00:01+01:00,20\n"
    assert imported(tmp_path, logger, CLOCK % "iso").endswith("\n2.00000,20.00000\n")


@pytest.mark.parametrize(
    "form",
    [
        "Time,Q1,Q2,T1,T2\n0,50,0,20.5,21\n",
        "Time;Q1;Q2;T1;T2\n0;50;0;20,5;21\n",
        "t_s\tH1\tH2\tT1\tT2\n0\t50\t0\t20.5\t21\n",
        "Time,Q1,Q2,TC1,TC2\n0,50,0,20.5,21\n",
        " Time   Q1  Q2    T1  T2 \n    0   50   0  20.5  21 \n",
        "Time,T1,T2,Q1\n0,20.5,21,50\n",  # the second heater was never driven
    ],
)
def test_a_heater_boards_table_is_read_as_its_programs_write_it(tmp_path: Path, form: str) -> None:
    *keys, header, row = imported(tmp_path, form, "tclab").splitlines()
    assert keys[-1] == "# sensor: semiconductor"
    wanted = {"time_s": 0.0, "u1": 0.5, "u2": 0.0, "t1_c": 20.5, "t2_c": 21.0}
    assert dict(zip(header.split(","), map(float, row.split(",")), strict=True)) == wanted


@pytest.mark.parametrize(
    ("named", "rows"),
    [
        ("", "# by me\n# Time,Q1,Q2,T1,T2\n0,50,0,20.5,21\n1,50,0,20.5,21\n"),  # as NumPy writes it
        ("", "#Time;Q1;Q2;T1;T2;spare\n0;50;0;20,5;21\n1;50;0;20,5;21\n"),
        ('names = ["Time", "Q1", "Q2", "T1", "T2"]', OF_FIVE),
        ('names = ["Time", "Q1", "Q2", "T1", "T2"]', "0\t50\t0\t20.5\t21\n1\t50\t0\t20.5\t21\n"),
    ],
)
def test_columns_whose_names_are_a_comment_or_nowhere_are_read(tmp_path: Path, named: str, rows: str) -> None:
    built_in = importing.BUILT_IN["tclab"].read_text()
    decimal = 'decimal = ","\n' if ";" in rows else 'decimal = "."\n'
    text = imported(tmp_path, rows, f"[file]\n{decimal}{named}\n{built_in}").splitlines()
    assert text[-2:] == [f"{k}.00000,0.50000,0.00000,20.50000,21.00000" for k in (0, 1)]


def test_a_file_without_times_has_a_period(tmp_path: Path) -> None:
    mapping = '[file]\nperiod_s = 2.5\n[columns]\ni1_a = "I"\nt1_c = "T"\n'
    rows = imported(tmp_path, "I,T\n1,20\n1,20.5\n1,21\n", mapping).splitlines()[-3:]
    assert [float(row.split(",")[0]) for row in rows] == [0.0, 2.5, 5.0]


def test_switches_in_words_and_nanoseconds_are_read(tmp_path: Path) -> None:
    mapping = '[columns]\ntime_s = { column = "t", unit = "ns" }\nu1 = "heater"\nfan = "fan"\nt1_c = "T"\n'
    rows = "1600000000000000000,False,ON,20\n1600000003000000000,True,off,20.5\n"
    text = imported(tmp_path, "t,heater,fan,T\n" + rows, mapping).splitlines()
    assert [row.split(",", 1)[1] for row in text[-2:]] == ["0.00000,1.00000,20.00000", "1.00000,0.00000,20.50000"]


def test_scale_comes_before_the_unit_and_offset_after(tmp_path: Path) -> None:
    mapping = '[columns]\ntime_s = "t"\nt1_c = { column = "T", unit = "degF", scale = 0.1, offset = -0.5 }\n'
    assert imported(tmp_path, "t,T\n0,680\n", mapping).splitlines()[-1] == "0.00000,19.50000"


def test_frames_are_put_into_a_log_on_its_clock(tmp_path: Path) -> None:
    log = tmp_path / "board.csv"
    time_s = 30.0 + np.arange(10.0)
    text = log_text(time_s, {"i1_a": np.ones(10)}, {"board": "7"})
    log.write_text(re.sub(r"(?m)^(\d.*)$", r"\1,ok", text).replace("i1_a\n", "i1_a,state\n"))
    rising = {"t1_c": 20.0 + 0.5 * np.arange(6.0)}
    for times, offset, first in ((None, 0.0, 30), (None, 2.0, 32), (30.0 + 2 * np.arange(6.0), 0.0, 30)):
        merged = tmp_path / "run.csv"
        merged.write_text(importing.merge_into_log(log, times, 2.0, offset, rising))
        run = read_log(merged)
        assert np.flatnonzero(np.isfinite(run.temperature_c[:, 0]))[0] + 30 == first
        assert run.temperature_c[-1, 0] == pytest.approx(20.0 + 0.25 * (39 - first))
        assert "# board: 7" in merged.read_text()
    broken = {"t1_c": np.array([20.0, 21.0, 22.0, 50.0])}  # the camera stood still from 2 s to 30 s
    long = tmp_path / "long.csv"
    long.write_text(log_text(np.arange(32.0), {"i1_a": np.ones(32)}))
    between = importing.merge_into_log(long, np.array([0.0, 1.0, 2.0, 30.0]), 1.0, 0.0, broken).splitlines()[3:]
    assert [k for k, row in enumerate(between) if not row.endswith(",")] == [0, 1, 2, 30]
    with pytest.raises(InputError, match="never meet"):
        importing.merge_into_log(log, None, 2.0, 900.0, rising)
    with pytest.raises(InputError, match="only one of them is within"):
        importing.merge_into_log(log, None, 20.0, 0.0, rising)


def test_frames_that_are_not_in_degrees_are_refused(tmp_path: Path) -> None:
    regions = [importing.Region(3, 0, 0, 2, 2)]
    raw = np.full((4, 4, 4), 20.0)
    raw[2] = 29315.0
    with pytest.raises(InputError, match=r"spring 3 shows 29315 in frame 3: that is no temperature in degC"):
        importing.reduce_frames("f.npy", 4, iter(raw), regions)
    dead = raw[:2].copy()
    dead[0, 0, 0] = np.nan
    dead[1, :2, :2] = np.nan
    assert importing.reduce_frames("f.npy", 2, iter(dead), regions)["t3_c"] == pytest.approx(
        [20.0, np.nan], nan_ok=True
    )


@pytest.mark.parametrize(("text", "line"), [("0\n1\nx\n", 3), ("0\n0\n", 2), ("0\nnan\n", 2)])
def test_wrong_times_of_frames_are_refused_with_their_line(tmp_path: Path, text: str, line: int) -> None:
    path = tmp_path / "times.txt"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        importing.read_times(path)
    assert caught.value.line == line
    path.write_text("# s\n0\n0.5  # late\n\n2\n")
    assert importing.read_times(path).tolist() == [0, 0.5, 2]


def test_kelvin_is_recognised_in_frames_and_converted_when_told() -> None:
    frames = np.full((5, 4, 4), 294.0) + np.arange(5.0)[:, None, None]
    one = [importing.Region(1, 0, 0, 4, 4)]
    with pytest.raises(InputError, match=r"looks like kelvin, `--unit K` converts"):
        importing.reduce_frames("f.npy", 5, iter(frames), one)
    got = importing.reduce_frames("f.npy", 5, iter(frames), one, unit="K")["t1_c"]
    assert got == pytest.approx(20.85 + np.arange(5.0))
