"""pyserial as a real client of `ninespring-sim board`: usage board_pty.py NINESPRING_SIM AVR_DIR."""

from __future__ import annotations

import itertools
import signal
import statistics
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Self

SKIPPED = 77

try:
    import serial
except ImportError:
    print("SKIPPED: this python has no pyserial; script/setup makes one that has (.venv)")
    sys.exit(SKIPPED)


class Board:
    """A simulated board in its own process; `with` ends it as Ctrl-C would."""

    def __init__(self, program: str, elf: Path, *more: str) -> None:
        self.process = subprocess.Popen([program, "board", "--elf", str(elf), *more], stdout=subprocess.PIPE, text=True)
        assert self.process.stdout is not None
        self.port = self.process.stdout.readline().strip()
        assert self.port.startswith("/dev/"), f"no pty: {self.port!r}"

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        assert self.process.wait(timeout=20) == 0

    def open(self) -> serial.Serial:
        return serial.Serial(self.port, 115200, timeout=20)


def ask(port: serial.Serial, line: str) -> list[str]:
    """The answer's lines; the last one is `ok` or `error:N text`."""
    port.write(line.encode() + b"\n")
    lines: list[str] = []
    while not lines or not (lines[-1] == "ok" or lines[-1].startswith("error:")):
        raw = port.readline()
        assert raw.endswith(b"\n"), f"{line}: no answer after {lines}"
        lines.append(raw.decode("ascii").rstrip("\r\n"))
    return lines


def first_contact(board: Board) -> serial.Serial:
    """Opens the port and waits until the board has started."""
    port = board.open()
    for _ in range(50):
        port.timeout = 1
        port.write(b"\n")
        port.write(b"version\n")
        text = port.read_until(b"ok\r\n")
        if text.endswith(b"ok\r\n"):
            port.timeout = 20
            port.read(port.in_waiting)
            return port
    raise AssertionError("the board does not answer")


def uptime_s(port: serial.Serial) -> float:
    port.write(b"?")
    return float(port.readline().decode("ascii").split("|t:")[1].split("|")[0])


def talks_like_a_board_at_its_own_pace(program: str, elf: Path) -> None:
    """No `--speed`: no faster than a real one, whose clock it keeps."""
    with Board(program, elf) as board, first_contact(board) as port:
        begun_s, first_s = time.monotonic(), uptime_s(port)
        assert ask(port, "frobnicate")[-1].startswith("error:1 ")
        assert len([line for line in ask(port, "$$") if line.startswith("$")]) > 20
        time.sleep(0.5)
        assert 0 < uptime_s(port) - first_s < time.monotonic() - begun_s + 0.2


def survives_clients_that_leave(program: str, elf: Path) -> None:
    with Board(program, elf, "--speed", "max") as board:
        first_contact(board).close()
        for _ in range(3):
            with board.open() as port:
                port.write(b"telemetry csv 50\n")  # and goes without reading
        with board.open() as port:
            port.timeout = 1
            port.write(b"telemetry off\n")
            port.read_until(b"ok\r\n")
            port.timeout = 20
            port.write(b"version\n")
            assert b"ok\r\n" in port.read_until(b"ok\r\n")
        assert board.process.poll() is None


def waits_for_a_slow_reader(program: str, elf: Path) -> None:
    """As fast as it goes is faster than anybody reads: nothing of it may be lost."""
    with Board(program, elf, "--speed", "max") as board, first_contact(board) as port:
        ask(port, "telemetry csv 20")
        times: list[float] = []
        while len(times) < 300:
            if len(times) % 50 == 49:
                time.sleep(0.5)  # 10 s of the board's time, and more than the terminal keeps
            cells = port.readline().split(b",")
            if len(cells) > 30:
                times.append(float(cells[0]))
                port.write(b"\n" * (len(times) % 20 == 0))  # it is still there
        steps = [later - earlier for earlier, later in itertools.pairwise(times)]
        assert max(steps) < 0.09, max(steps)  # a lost row would make it 0.1


def a_host_alive_by_the_wall_clock_is_not_silent(program: str, elf: Path) -> None:
    """As fast as it goes, seconds of the board pass in an instant of the host: its timeout is then by the wall clock."""
    with Board(program, elf, "--speed", "max") as board, first_contact(board) as port:
        for line in ("model cold", "$host_timeout_s=5", "telemetry csv 20", "on 1"):
            assert ask(port, line)[-1] == "ok", line
        begun = time.monotonic()
        while b"fault_16" not in port.readline():
            assert time.monotonic() < begun + 30.0
        assert time.monotonic() - begun > 4.5, time.monotonic() - begun


def keeps_its_eeprom(program: str, elf: Path, folder: Path) -> None:
    image = folder / "eeprom.bin"
    image.unlink(missing_ok=True)
    with Board(program, elf, "--speed", "max", "--eeprom", str(image)) as board, first_contact(board) as port:
        assert ask(port, "$loss_w_per_k=0.006543") == ["ok"]
        assert ask(port, "$save")[-1] == "ok"
    assert image.stat().st_size == 4096
    with Board(program, elf, "--speed", "max", "--eeprom", str(image)) as board, first_contact(board) as port:
        assert "$loss_w_per_k=0.006543" in ask(port, "$loss_w_per_k")
    image.unlink()


def thermometers_beside_the_board(program: str, elf: Path, folder: Path) -> None:
    log = folder / "thermometers.csv"
    rates = ("--thermometer-rate", "5", "--thermometer-noise", "0.5", "--thermometer-springs", "2,9")
    with Board(program, elf, "--speed", "max", "--duration", "40", "--thermometers", str(log), *rates) as board:
        assert board.process.wait(timeout=100) == 0
    tool, header, *lines = log.read_text().splitlines()
    assert tool.startswith("# tool: ninespring-sim "), tool  # so that another run may replace it
    assert header == "time_s,t2_c,t9_c", header
    rows = [[float(cell) for cell in line.split(",")] for line in lines]
    assert len(rows) == 201, len(rows)  # 0 to 40 s
    assert all(abs(row[0] - 0.2 * k) < 0.0015 for k, row in enumerate(rows))
    for column in (1, 2):
        values = [row[column] for row in rows]
        assert abs(statistics.mean(values) - 20.0) < 0.15  # 0.5 / sqrt(200) is 0.035
        assert 0.4 < statistics.stdev(values) < 0.6
    log.unlink()
    with Board(program, elf, "--speed", "max", "--thermometers", "pty", "--thermometer-noise", "0") as board:
        assert board.process.stdout is not None
        name = board.process.stdout.readline().strip()
        with serial.Serial(name, 115200, timeout=20) as logger, first_contact(board) as port:
            assert ask(port, "on 1") == ["ok"]
            seen: dict[bytes, float] = {}
            while seen.get(b"t1_c", 0.0) < 25.0:
                line = logger.readline()
                assert line.endswith(b"\r\n"), line
                cells = line.strip().split(b",")
                if cells[0] == b"time_s":
                    header = cells
                elif isinstance(header, list) and len(cells) == len(header):
                    seen = dict(zip(header, map(float, cells), strict=True))
            assert seen[b"t1_c"] > seen[b"t9_c"] + 2.0, seen


def refuses_what_is_wrong(program: str, elf: Path) -> None:
    for arguments in (
        ["--elf", "/no/such.elf"],
        ["--elf", str(elf), "--speed", "fast"],
        ["--elf", __file__],
        ["--elf", sys.executable],  # of another processor
        ["--elf", str(elf), "--thermometers", "pty", "--thermometer-springs", "3,1"],
        ["--elf", str(elf), "--thermometers", "pty", "--thermometer-springs", "10"],
        ["--elf", str(elf), "--thermometer-rate", "2"],
        ["--elf", str(elf), "--thermometers", "pty", "--thermometer-rate", "0"],
    ):
        result = subprocess.run([program, "board", *arguments], check=False, capture_output=True, text=True, timeout=60)
        assert result.returncode == 2, result
        assert result.stderr.count("\n") == 1, result.stderr


def main() -> int:
    program, avr = sys.argv[1], Path(sys.argv[2])
    elf = avr / "firmware.elf"
    if not elf.exists():
        print(f"SKIPPED: {elf} is not there: build the avr target first")
        return SKIPPED
    here = Path.cwd()
    tests = (
        (thermometers_beside_the_board, here),
        (a_host_alive_by_the_wall_clock_is_not_silent,),
        (waits_for_a_slow_reader,),
        (keeps_its_eeprom, here),
        (survives_clients_that_leave,),
        (talks_like_a_board_at_its_own_pace,),
        (refuses_what_is_wrong,),
    )
    with ThreadPoolExecutor(len(tests)) as pool:  # each has boards of its own, and waits for most of its time
        for done in [pool.submit(test, program, elf, *more) for test, *more in tests]:
            done.result()
    print("PASS")
    return 0


if __name__ == "__main__":
    sys.exit(main())
