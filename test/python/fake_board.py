"""A board on a pseudo-terminal: answers lines with `ok` or what it is told, keeps settings, and can be pulled."""

from __future__ import annotations

import os
import pty
import threading
import time
import tty
from collections.abc import Iterable

VERSION = ["ninespring 9.9.9 mega2560, sensors fake", "reset power-on; settings loaded", "ok"]
TELEMETRY = "time_s,i1_a,v1_v,m1_c,fan,ambient_c,state"


def row(time_s: float, current_a: float = 1.0) -> str:
    return f"{time_s:.1f},{current_a:.3f},0.200,20.00,0.00,20.00,ok"


class FakeBoard:
    def __init__(
        self, answers: dict[str, list[str]] | None = None, stream: Iterable[str] = (), every_s: float = 0.0
    ) -> None:
        self.master, self.slave = pty.openpty()
        tty.setraw(self.slave)
        self.port = os.ttyname(self.slave)
        self.answers = {"version": VERSION, "faults": ["ok"]} | (answers or {})
        self.seen: list[str] = []
        self.settings: dict[str, str] = {}
        self.saved: dict[str, str] = {}
        """As they were at `$save`."""
        self.stream = stream
        """Lines that follow the answer to `telemetry csv`, until `telemetry off` or a pull; `FAULT ...`: latched from then on."""
        self.every_s = every_s
        self._streaming = 0
        """Which stream runs; 0 none."""
        self.gone = False
        self.slow_s = 0.0
        """So long every line takes."""
        self._busy = False
        """With a line whose answer is [] here: it has none until a stop."""
        threading.Thread(target=self._serve, daemon=True).start()

    def say(self, *lines: str) -> None:
        if not self.gone:
            os.write(self.master, "".join(line + "\r\n" for line in lines).encode("latin-1"))

    def pull(self) -> None:
        """The cable is pulled: from now on every access fails."""
        self.gone = True
        os.close(self.master)
        os.close(self.slave)

    def sent(self) -> list[str]:
        """What came, without the empty lines that only show that someone is there."""
        return [line for line in self.seen if line]

    def _stream(self, number: int) -> None:
        last = ""
        for line in self.stream:
            if self._streaming != number or self.gone:
                return
            if line.startswith("FAULT "):
                self.answers["faults"] = [line[6:], "ok"]
                continue
            if line == "PULL":
                self._wait_for_life(number, last)
                self.pull()
                return
            self.say(line)
            last = line
            time.sleep(self.every_s)

    def _wait_for_life(self, number: int, last: str) -> None:
        """Wait until the other end has read that row: what is on its way goes with the cable.

        It sends an empty line with the first row, and with each that is a second of the board's after the last such one.
        """
        while self.seen[number:].count("") < int(float(last.split(",")[0])):
            time.sleep(0.01)

    def _serve(self) -> None:
        buffer = b""
        while not self.gone:
            try:
                buffer += os.read(self.master, 256)
            except OSError:
                return
            if b"!" in buffer:
                self.seen.append("!!" if b"!!" in buffer else "!")
                buffer = buffer.replace(b"!", b"")
                if self._busy:
                    self._busy = False
                    self.say("error:12 dropped by the stop")
            if b"?" in buffer:
                self.seen.append("?")
                buffer = buffer.replace(b"?", b"")
                self.say("<off|t:12.340|sum_a:0.000|hottest_c:21.30@5|fan:0|fault:0|late:0|load:26|supply:on>")
            while b"\n" in buffer and not self._busy:
                line, buffer = buffer.split(b"\n", 1)
                self._obey(line.decode().strip())

    def _obey(self, text: str) -> None:
        self.seen.append(text)
        time.sleep(self.slow_s)
        self._busy = self.answers.get(text) == []
        if text.startswith("telemetry csv") and text not in self.answers:
            self.say(TELEMETRY, "ok")
            now = {"telemetry_hz": text.split()[2], "telemetry_format": "1"}
            self.settings |= {name: value for name, value in now.items() if name in self.settings}
            self._streaming = len(self.seen)
            threading.Thread(target=self._stream, args=(self._streaming,), daemon=True).start()
        elif text in self.answers:
            self.say(*self.answers[text])
        elif text == "$$":
            self.say(*(f"${name}={value}" for name, value in self.settings.items()), "ok")
        elif text[1:] in self.settings:
            self.say(f"{text}={self.settings[text[1:]]}", "ok")
        elif text:
            if text == "telemetry off":
                self._streaming = 0
            if text.lower() == "$save":
                self.saved = dict(self.settings)
            if text.startswith("$") and "=" in text:
                self.settings.__setitem__(*text[1:].split("=", 1))
            self.say("ok")
