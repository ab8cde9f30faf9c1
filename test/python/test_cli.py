"""The commands: what they write, how they end."""

from __future__ import annotations

import json
import os
import pty
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from ninespring import importing
from ninespring.errors import InputError


def ninespring(*arguments: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "ninespring", *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


def test_diagnose_predict_and_export_in_a_row(make_log, tmp_path: Path) -> None:
    log = make_log(effects={"latent_heat": {"latent_heat_j": 8.0}})
    done = ninespring("diagnose", log, "-o", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert "latent_heat" in done.stdout
    result = json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    assert [e["name"] for e in result["effects"]] == ["latent_heat"]
    page = (tmp_path / "out" / "report.html").read_text()
    assert "<svg" in page and "http-equiv" not in page and 'src="' not in page
    model = tmp_path / "out" / "model.toml"
    assert ninespring("predict", "--model", model, log, "-o", tmp_path / "p.csv").returncode == 0
    assert (tmp_path / "p.csv").read_text().startswith("time_s,t1_c,")
    assert ninespring("export", "--model", model, "-o", tmp_path / "s.txt").returncode == 0
    assert "$latent_heat_j=" in (tmp_path / "s.txt").read_text()


def test_fit_with_an_effect_writes_a_model(make_log, tmp_path: Path) -> None:
    log = make_log(effects={"sensor_lag": {"sensor_lag_s": 6.0}})
    done = ninespring(
        "fit",
        "--effects",
        "sensor_lag",
        log,
        "-o",
        tmp_path / "m.toml",
        "--json",
        tmp_path / "f.json",
    )
    assert done.returncode == 0, done.stderr
    value = json.loads((tmp_path / "f.json").read_text())["parameters"]["sensor_lag_s"]["value"]
    assert value == pytest.approx(6.0, rel=0.1)


@pytest.mark.parametrize(
    "arguments",
    [
        ("fit", "no-such.csv", "-o", "m.toml"),
        ("fit",),
        ("diagnose", "no-such.csv", "-o", "out", "--frozen"),
        ("export", "--model", "no-such.toml", "-o", "s.txt"),
        ("nonsense",),
    ],
)
def test_wrong_input_ends_with_two_and_one_line(arguments: tuple[str, ...], tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "ninespring", *arguments],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        timeout=60,
        check=False,
    )
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_a_bad_log_leaves_nothing_half_written(make_log, tmp_path: Path) -> None:
    log = make_log()
    log.write_text(log.read_text()[:5000].rsplit(",", 3)[0])
    before = set(tmp_path.iterdir())
    done = ninespring("diagnose", log, "-o", tmp_path / "out")
    assert done.returncode == 2
    assert set(tmp_path.iterdir()) == before


def test_percent_fahrenheit_and_decimal_commas_are_imported(tmp_path: Path) -> None:
    source = tmp_path / "logger.csv"
    source.write_text("t/min;heat;temp\n0;50;68,0\n0,5;50;69,8\n1;0;71,6\n")
    mapping = tmp_path / "map.toml"
    mapping.write_text(
        '[file]\nseparator = ";"\ndecimal = ","\n[columns]\ntime_s = {column = "t/min", unit = "min"}\n'
        'u1 = {column = "heat", unit = "%"}\nt1_c = {column = "temp", unit = "degF"}\n'
    )
    rows = [line.split(",") for line in importing.import_table(source, mapping).splitlines()[-3:]]
    assert [float(r[0]) for r in rows] == [0, 30, 60]
    assert [float(r[1]) for r in rows] == [0.5, 0.5, 0.0]
    assert [float(r[2]) for r in rows] == pytest.approx([20.0, 21.0, 22.0])


def test_frames_of_any_size_become_a_temperature_a_spring(tmp_path: Path) -> None:
    frames = np.full((5, 24, 32), 20.0)
    for k in range(9):
        frames[:, 2 + 7 * (k // 3) : 6 + 7 * (k // 3), 3 + 9 * (k % 3) : 8 + 9 * (k % 3)] = 30.0 + k
    np.save(tmp_path / "frames.npy", frames)
    regions = tmp_path / "regions.toml"
    regions.write_text("[grid]\nrows = 3\ncols = 3\nleft = 5\ntop = 4\nstep_x = 9\nstep_y = 7\nwidth = 2\nheight = 2\n")
    _, columns = importing.import_frames(tmp_path / "frames.npy", importing.read_regions(regions), None, 1.0)
    assert [float(columns[f"t{k + 1}_c"][0]) for k in range(9)] == [30.0 + k for k in range(9)]
    regions.write_text("[[region]]\nspring = 1\nleft = 30\ntop = 0\nwidth = 5\nheight = 2\n")
    with pytest.raises(InputError, match="leaves frame 1"):
        importing.import_frames(tmp_path / "frames.npy", importing.read_regions(regions), None, 1.0)


def fake_board(answers: dict[str, list[str]], seen: list[str]) -> str:
    """A board on a pty: answers lines, then `ok`, or what it is told."""
    master, slave = pty.openpty()
    import tty

    tty.setraw(slave)

    def serve() -> None:
        buffer = b""
        while True:
            try:
                buffer += os.read(master, 256)
            except OSError:
                return
            while b"\n" in buffer:
                line, buffer = buffer.split(b"\n", 1)
                text = line.decode().strip()
                seen.append(text)
                for answer in answers.get(text, ["ok"]):
                    os.write(master, answer.encode() + b"\r\n")

    threading.Thread(target=serve, daemon=True).start()
    return os.ttyname(slave)


def test_upload_sends_settings_and_saves(tmp_path: Path) -> None:
    seen: list[str] = []
    port = fake_board({}, seen)
    (tmp_path / "s.txt").write_text("# from model.toml\n$latent_heat_j=8.000\n$loss_w_per_k=0.005800\n")
    done = ninespring("upload", "--port", port, tmp_path / "s.txt")
    assert done.returncode == 0, done.stderr
    assert seen[-3:] == ["$latent_heat_j=8.000", "$loss_w_per_k=0.005800", "$save"]


def test_a_refused_setting_is_said_and_nothing_saved(tmp_path: Path) -> None:
    seen: list[str] = []
    port = fake_board({"$loss_w_per_k=9": ["error:4 out of range"]}, seen)
    (tmp_path / "s.txt").write_text("$loss_w_per_k=9\n")
    done = ninespring("upload", "--port", port, tmp_path / "s.txt")
    assert done.returncode == 1
    assert "error 4 out of range" in done.stderr
    assert "$save" not in seen


def test_record_keeps_whole_rows_that_rise(tmp_path: Path) -> None:
    rows = ["time_s,i1_a,v1_v,m1_c,fan,ambient_c,state", "ok"]
    rows += [
        "0.0,1,0.2,20,0,20,ok",
        "0.5,1,0.2,20,0,20,ok",
        "0.5,1,0.2,20,0,20,ok",
        "1.0,1,0.",
        "[remark]",
        "1.5,1,0.2,21,0,20,ok",
    ]
    port = fake_board({"telemetry csv 2": rows}, [])
    done = ninespring(
        "record",
        "--port",
        port,
        "--hz",
        2,
        "--duration",
        1.5,
        "-o",
        tmp_path / "log.csv",
    )
    assert done.returncode == 0, done.stderr
    lines = (tmp_path / "log.csv").read_text().splitlines()
    assert lines[0] == "# dropped_lines: 2"
    assert [line.split(",")[0] for line in lines[2:]] == ["0.0", "0.5", "1.5"]


def test_a_port_that_is_not_there_ends_with_one() -> None:
    done = ninespring("record", "--port", "/dev/no-such-port", "-o", "x.csv")
    assert done.returncode == 1
    assert "cannot be opened" in done.stderr
