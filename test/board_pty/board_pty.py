"""pyserial as a real client of `ninespring-sim board`: usage board_pty.py NINESPRING_SIM AVR_DIR."""

from __future__ import annotations

import signal
import subprocess
import sys
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
        self.process = subprocess.Popen(
            [program, "board", "--elf", str(elf), *more],
            stdout=subprocess.PIPE,
            text=True,
        )
        assert self.process.stdout is not None
        self.port = self.process.stdout.readline().strip()
        assert self.port.startswith("/dev/"), f"no pty: {self.port!r}"

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        self.process.wait(timeout=20)

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


def talks_like_a_board(program: str, elf: Path) -> None:
    with Board(program, elf) as board, first_contact(board) as port:
        assert any("ninespring" in line for line in ask(port, "version"))
        assert ask(port, "on 1") == ["ok"]
        assert ask(port, "frobnicate")[-1].startswith("error:1 ")
        assert len([line for line in ask(port, "$$") if line.startswith("$")]) > 20


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


def keeps_its_eeprom(program: str, elf: Path, folder: Path) -> None:
    image = folder / "eeprom.bin"
    image.unlink(missing_ok=True)
    with (
        Board(program, elf, "--speed", "max", "--eeprom", str(image)) as board,
        first_contact(board) as port,
    ):
        assert ask(port, "$loss_w_per_k=0.006543") == ["ok"]
        assert ask(port, "$save")[-1] == "ok"
    assert image.stat().st_size == 4096
    with (
        Board(program, elf, "--speed", "max", "--eeprom", str(image)) as board,
        first_contact(board) as port,
    ):
        assert "$loss_w_per_k=0.006543" in ask(port, "$loss_w_per_k")
    image.unlink()


def ends_cleanly(program: str, elf: Path) -> None:
    with Board(program, elf) as board:
        first_contact(board).close()
        board.process.send_signal(signal.SIGINT)
        assert board.process.wait(timeout=20) == 0


def refuses_what_is_wrong(program: str, elf: Path) -> None:
    for arguments in (
        ["--elf", "/no/such.elf"],
        ["--elf", str(elf), "--speed", "fast"],
        ["--elf", __file__],
    ):
        result = subprocess.run(
            [program, "board", *arguments],
            check=False,
            capture_output=True,
            text=True,
            timeout=60,
        )
        assert result.returncode == 2, result
        assert result.stderr.count("\n") == 1, result.stderr


def main() -> int:
    program, avr = sys.argv[1], Path(sys.argv[2])
    elf = avr / "firmware.elf"
    if not elf.exists():
        print(f"SKIPPED: {elf} is not there: build the avr target first")
        return SKIPPED
    talks_like_a_board(program, elf)
    survives_clients_that_leave(program, elf)
    keeps_its_eeprom(program, elf, Path.cwd())
    ends_cleanly(program, elf)
    refuses_what_is_wrong(program, elf)
    print("PASS")
    return 0


if __name__ == "__main__":
    sys.exit(main())
