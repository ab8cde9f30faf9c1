"""A board's console to be typed at: history, completion of words and settings, help beside it; lines from a pipe as well."""

from __future__ import annotations

import re
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass

import click
from prompt_toolkit import PromptSession
from prompt_toolkit.completion import CompleteEvent, Completer, Completion
from prompt_toolkit.document import Document
from prompt_toolkit.history import FileHistory, History, InMemoryHistory
from prompt_toolkit.key_binding import KeyBindings, KeyPressEvent
from prompt_toolkit.patch_stdout import patch_stdout

from ..errors import InputError, RefusedError, WorkError
from ..io.board import SIMULATED, Board
from ..io.history import home
from ..model import tables
from .console import command, out

LONGEST_S = 12.0
"""An answer's next line is awaited so long: `$save` reads back for 2 s, `selftest` takes 0.6 s a spring."""
LISTEN_S = 0.1
ENDS = frozenset({"exit", "quit"})
DEEDS = ("$$", "$save", "$defaults")
HELP_LINE = re.compile(r"([a-z]+)((?: [^ ]+)*)(?:  (.*))?")


@dataclass(frozen=True)
class Word:
    """A word of the console, as the board's own `help` has it."""

    name: str
    arguments: tuple[str, ...]
    sentence: str

    @property
    def usage(self) -> str:
        """The word with its arguments."""
        return " ".join([self.name, *self.arguments])

    def choices(self, at: int, springs: int) -> list[str]:
        """Return what may stand for an argument (from 0)."""
        if at >= len(self.arguments):
            return []
        options = self.arguments[at].strip("[]").split("|")
        out = [one for one in options if re.fullmatch("[a-z]+", one)]
        return out + ([str(k + 1) for k in range(springs)] if "K" in options else [])


def words_of(lines: Iterable[str]) -> dict[str, Word]:
    """Return the words by name; lines that are of no word (`$$`, `!`, `?`) are left out."""
    out = {}
    for line in lines:
        if match := HELP_LINE.fullmatch(line):
            out[match[1]] = Word(match[1], tuple(match[2].split()), match[3] or "")
    return out


class Known(Completer):
    """What a board can be told: its words, and its settings with unit, range and sense."""

    def __init__(self, words: dict[str, Word], settings: dict[str, str]) -> None:
        self.words = words
        self.settings = settings
        self.springs = round(float(settings.get("rows", "0")) * float(settings.get("columns", "0")))

    def about(self, name: str) -> str:
        """Return what a setting is, in a line."""
        if not (row := tables.setting(name)):
            return ""
        number = f"{{:.{row.decimals}f}}"
        span = f"{number.format(row.minimum)} .. {number.format(row.maximum)} {row.unit}".rstrip()
        return f"{span}, built in {number.format(row.default)}: {row.sentence}"

    def get_completions(self, document: Document, complete_event: CompleteEvent) -> Iterator[Completion]:
        """Yield what the line may become."""
        text = document.text_before_cursor.lstrip()
        if text.startswith("$"):
            if "=" not in text:
                for one in DEEDS:
                    if one.startswith(text) and one != text:
                        yield Completion(one, -len(text))
                for name, value in self.settings.items():
                    if text[1:] in name:
                        yield Completion(f"${name}", -len(text), f"${name}={value}", self.about(name))
            return
        before, _, last = text.rpartition(" ")
        if not before:
            for word in self.words.values():
                if word.name.startswith(last):
                    yield Completion(word.name, -len(last), word.usage, word.sentence)
        elif word := self.words.get(before.split()[0]):
            for choice in word.choices(len(before.split()) - 1, self.springs):
                if choice.startswith(last):
                    yield Completion(choice, -len(last))

    def beside(self, text: str) -> str:
        """Return the help that stands below what is typed."""
        name = text.strip().partition(" ")[0]
        if name.startswith("$"):
            setting = name[1:].partition("=")[0]
            if setting in self.settings:
                return f"${setting}={self.settings[setting]}  {self.about(setting)}"
            return "$$ all settings   $NAME one   $NAME=VALUE sets it   $save keeps them   $defaults"
        if word := self.words.get(name):
            return f"{word.usage}  {word.sentence}"
        return "Tab completes   ! everything off, at once   ? status   Ctrl-D ends"


class Talk:
    """One board; a thread prints what it says unasked."""

    def __init__(self, board: Board, show: Callable[[str], None]) -> None:
        self._board, self._show = board, show
        self._lock = threading.Lock()
        self.ends = threading.Event()
        self.trouble = ""
        self.refused = 0

    def listen(self) -> None:
        """Print telemetry and status lines as they come, until `ends`."""
        while not self.ends.is_set():
            try:
                with self._lock:
                    line = self._board.next_line(time.monotonic() + LISTEN_S)
            except WorkError as error:
                self.trouble = str(error)
                self._show(self.trouble)
                return
            if line:
                self._show(line)
            time.sleep(0.0 if line else 0.01)  # whoever waits to ask comes first

    def stop(self) -> None:
        """Everything off, at once, whatever is under way."""
        self._board.stop_now()
        self._show("! everything off; `clear` goes on")

    def settings(self) -> dict[str, str]:
        """Return the board's settings."""
        with self._lock:
            return self._board.settings()

    def say(self, line: str) -> bool:
        """Send a line and print its answer as the board gave it; what is refused is counted. True where the board took it."""
        if "!" in line:
            self.stop()
            return False
        try:
            with self._lock:
                asked = line.strip() == "?"
                answer = [self._board.status()] if asked else [*self._board.ask(line, LONGEST_S), "ok"]
            took = True
        except KeyboardInterrupt:
            self.stop()
            return False
        except RefusedError as error:
            took, answer = False, [*error.said, error.refusal]
        except (WorkError, InputError) as error:
            took, answer = False, [str(error)]
        self.refused += not took
        for one in answer:
            self._show(one)
        return took


def talk_at_a_terminal(board: Board) -> None:
    """Let a user type until Ctrl-D, with history, completion and help."""
    known = Known(words_of(board.ask("help", LONGEST_S)), board.settings())
    talk = Talk(board, print)
    keys = KeyBindings()
    history: History = InMemoryHistory()
    with suppress(OSError):
        home().mkdir(parents=True, exist_ok=True)
        history = FileHistory(str(home() / "console-history"))

    @keys.add("!")
    def _(event: KeyPressEvent) -> None:
        talk.stop()

    prompt: PromptSession[str] = PromptSession(
        history=history,
        completer=known,
        complete_while_typing=True,
        key_bindings=keys,
        bottom_toolbar=lambda: known.beside(prompt.default_buffer.text),
    )
    listener = threading.Thread(target=talk.listen, name="board", daemon=True)
    with patch_stdout():
        listener.start()
        while not talk.trouble:
            try:
                line = prompt.prompt("> ").strip()
            except KeyboardInterrupt:  # the line is dropped, as in a shell
                continue
            except EOFError:
                break
            if line in ENDS:
                break
            if not line or not talk.say(line):
                continue
            name, equals, value = line[1:].lower().partition("=")
            if line.startswith("$") and (equals or name == "defaults"):
                known.settings |= {name: value} if equals else talk.settings()
        talk.ends.set()
        listener.join(2)
    if talk.trouble:
        raise WorkError(talk.trouble)


def talk_from_a_pipe(board: Board, lines: Iterable[str]) -> None:
    """Send lines one after the other and print the answers; WorkError where the board refused some."""
    talk = Talk(board, lambda line: out.print(line, soft_wrap=True))
    for line in lines:
        if line.strip():
            talk.say(line.strip())
    if talk.refused:
        raise WorkError(f"{talk.refused} of these lines {'was' if talk.refused == 1 else 'were'} refused")


@command("""\b
Examples:
  ninespring console --port /dev/ttyACM0
  ninespring console --simulate
  echo faults | ninespring console --port /dev/ttyACM0
""")
@click.option("--port", help="serial port, e.g. /dev/ttyACM0; 115200 baud")
@click.option("--simulate", is_flag=True, help="start a simulated board and talk to that")
def console(port: str | None, simulate: bool) -> None:
    """Type at a board: words and settings are completed, help stands below, what was typed before comes back by arrow keys.

    `!` acts as it is pressed: everything off. Leaving (Ctrl-D) switches nothing off. Lines that come from a pipe are sent
    one after the other; exit code 1 where the board refused one.
    """
    if (port is not None) == simulate:
        raise InputError("give --port, or --simulate where there is no board")
    with Board(port or SIMULATED, off_at_end=False) as board:
        board.guard({})  # who types looks: nothing goes off because a minute was thought
        try:
            if sys.stdin.isatty():
                out.print(board.version[0])
                talk_at_a_terminal(board)
            else:
                talk_from_a_pipe(board, sys.stdin)
        finally:
            board.ask("telemetry off")
            if board.status().startswith("<on"):
                out.print("springs are on, and stay on")
