"""A first power-up on the simulated board: from nothing to nine springs, and each mistake of wiring found and named."""

from __future__ import annotations

import json
import re
import subprocess
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import pytest
from made import ELF, SIM, needs_board
from ninespring.errors import InputError
from ninespring.io import bringup
from ninespring.io.board import PATIENCE, Board
from ninespring.io.bringup import Hands, converse, do_step

pytestmark = needs_board


class Bench:
    """A simulated board, and the hands at it: what is wired stands in a file that the board looks at."""

    def __init__(self, file: Path, wiring: Sequence[str], *more: str) -> None:
        self.file = file
        self.wire(*wiring)
        words = [str(SIM), "board", "--speed", "max", "--elf", str(ELF), "--wiring", f"@{file}", *more]
        self.process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        self.board = Board(self.process.stdout.readline().strip())
        self.board.patience = PATIENCE

    def wire(self, *words: str) -> None:
        self.file.write_text("\n".join(words))

    def finds(self, step: str, hands: Hands | None = None) -> list[str]:
        """Return what a step finds wrong."""
        return do_step(self.board, step, hands).found


Make = Callable[..., Bench]


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Make]:
    made: list[Bench] = []

    def make(*wiring: str, more: Sequence[str] = ()) -> Bench:
        made.append(Bench(tmp_path / "bench.txt", wiring or ["resistor=all"], *more))
        return made[-1]

    yield make
    for one in made:
        one.board.close()
        one.process.terminate()
        one.process.wait()


WRONG = [
    ("no-pull-up", "sensors", "SDA (D20) or SCL (D21) has no pull-up"),
    ("absent=4", "sensors", "sensor 4 does not answer at 0x43 (A1 to GND, A0 to SCL)"),
    ("r050=2", "channels", "2 times 0.22: its shunt says R050"),
    ("reversed=5", "channels", "sensor 5 is reversed"),
    ("gate=6", "channels", "no current in channel 6 (0.000 V though it is driven): the gate's wire (D8)"),
    ("no-enable", "channels", "no channel has current"),
]


@pytest.mark.parametrize(("mistake", "step", "named"), WRONG)
def test_a_mistake_of_wiring_is_found_and_named(bench: Make, mistake: str, step: str, named: str) -> None:
    (found,) = bench("resistor=all", mistake).finds(step)
    assert named in found


@pytest.mark.parametrize(
    ("mistake", "named"),
    [
        ("addresses=3,4", "the addresses of sensors 3 and 4 are swapped"),
        ("gates=8,9", "the gates' wires of channels 8 and 9 are swapped"),
    ],
)
def test_swapped_channels_are_told_from_swapped_addresses_by_a_resistor_that_is_taken_out(
    bench: Make, mistake: str, named: str
) -> None:
    made = bench("resistor=all", mistake)
    asked: list[str] = []

    def hands(question: str) -> bool:
        asked.append(question)
        made.wire("resistor=all", mistake, *([f"open={mistake[-3]}"] if "out" in question else []))
        return True

    (found,) = made.finds("channels", hands)
    assert found.startswith(named), found
    assert len(asked) == 2 and "Take resistor" in asked[0] and "back" in asked[1]
    # where nobody can take one out, both are named
    (found,) = made.finds("channels")
    assert "Either their sensors' addresses or their gates' wires" in found


def test_what_was_found_twice_is_right_once_it_is_mended(bench: Make) -> None:
    """The board keeps the fault of a spring that was cleared of one before until that has rested."""
    made = bench("resistor=all", "welded=7")
    for _ in range(2):
        (found,) = made.finds("channels")
        assert "current flows in channel 7 with everything off" in found
    made.wire("resistor=all")
    assert made.finds("channels") == []


def test_a_spring_that_was_open_is_driven_by_itself_once_it_is_soldered(bench: Make) -> None:
    """What it showed while it was open is nothing that its circuit showed before."""
    made = bench("resistor=all", "open=3")
    made.board.ask("policy open")
    bringup.rows(made.board, 2.0, "on 3")
    (fault,) = made.board.ask("faults")[:1]
    assert fault.startswith("spring 3: fault 2 open_spring"), fault
    made.wire("resistor=all")
    made.board.ask("clear")
    bringup.rows(made.board, 5.0, "on 3")
    assert not [one for one in made.board.ask("faults") if "fault" in one]


def test_a_diode_that_drops_more_than_declared_is_told_from_a_low_supply(bench: Make) -> None:
    made = bench(more=["--set", "plant.freewheel_drop_v=0.39"])
    (found,) = made.finds("channels")
    assert found.startswith(("the diodes drop 0.3", "the diodes drop 0.4")), found
    made.board.ask("$freewheel_v=0.39")
    made.board.ask("$supply_v=6")
    (found,) = made.finds("channels")
    assert found.startswith(("the stages have 5.0", "the stages have 4.9")), found
    made.board.ask("$supply_v=5")
    assert made.finds("channels") == []


def test_a_stage_that_may_give_less_is_tested_with_that(bench: Make) -> None:
    made = bench()
    made.board.ask("$maximum_current_a=1.1")
    assert [found for step in ("channels", "spring", "springs") for found in made.finds(step)] == []


def test_from_nothing_to_nine_springs(bench: Make, tmp_path: Path) -> None:
    """As docs/building.md walks: what hands do between the steps is done when it is asked for."""
    made, page = bench(), tmp_path / "bringup.html"
    made.board.ask("$open_current_a=1.2")
    heard: list[str] = []
    left = [
        ("The Mega alone", ["absent=all", "open=all"]),
        ("Sensors on the bus", ["open=all", "addresses=3,4"]),
        ("The cut-off", ["open=all", "addresses=3,4"]),
        ("Resistors", ["resistor=all", "addresses=3,4"]),
    ]

    def hands(question: str) -> bool:
        if question == "Ready":
            title, words = left.pop(0)
            assert heard[-1].startswith(f"\n{title}"), (heard, title)
            made.wire(*words)
        elif question.startswith("Channels 3 and 4 are swapped"):
            made.wire("resistor=all", "addresses=3,4", "open=3")
        return True

    done = converse(made.board, page, hands, heard.append)
    assert list(done) == ["board", "sensors", "supply", "channels"]
    assert done["channels"].found[0].startswith("the addresses of sensors 3 and 4 are swapped"), done["channels"].found
    assert "are swapped" in page.read_text() and "3 of 7 steps are right" in page.read_text()
    # mended: it goes on where something was wrong
    heard.clear()
    left = [
        ("Resistors", ["resistor=all", "thermistor"]),
        ("Fan", ["resistor=all", "thermistor"]),
        ("One spring", ["resistor=2,3,4,5,6,7,8,9", "thermistor"]),
        ("All springs", ["thermistor"]),
    ]
    done = converse(made.board, page, hands, heard.append)
    assert left == [] and all(one.passed for one in done.values()), [
        (n, one.passed, one.found) for n, one in done.items() if not one.passed
    ]
    assert list(done) == list(bringup.STEPS)
    kept = json.loads(page.with_suffix(".json").read_text())
    assert kept["schema"] == "ninespring.bringup/1" and len(kept["steps"]) == 7
    numbers = {row[0]: row[1] for one in kept["steps"] for row in one["numbers"]}
    assert numbers["spring 1 cold"].startswith("0.17") and numbers["thermistor"].startswith("25.")
    assert numbers["the fan blows"] == numbers["spring 1 is warm"] == "yes"
    assert numbers["supply, by duty and current"].startswith(("5.0", "4.9"))
    # a spring with a bad crimp is found when the last step is repeated, and what was right is not asked again
    made.wire("open=9")
    done = converse(made.board, page, None, heard.append, again="springs")
    assert done["springs"].found == ["no current in spring 9: it, a crimp or a lead is open"]
    assert "6 of 7 steps are right" in page.read_text()
    settings = made.board.settings()
    assert settings["open_current_a"] == "1.200" and settings["policy"] == "1"  # given back


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--wiring", "loose=3"], "--wiring 'loose=3': one of resistor=K"),
        (["--wiring", "gate=10"], "--wiring 'gate=10': springs are 1 to 9, or all"),
        (["--wiring", "gates=3"], "--wiring 'gates=3': two springs, as in 3,4"),
        (["--wiring", "@nowhere.txt"], "nowhere.txt: cannot be read"),
    ],
)
def test_a_word_that_is_no_wiring_is_refused(words: list[str], said: str) -> None:
    done = subprocess.run([str(SIM), "board", "--elf", str(ELF), *words], capture_output=True, text=True, check=False)
    assert done.returncode == 2 and said in done.stderr, done


@pytest.mark.parametrize(
    ("world", "step", "named"),
    [
        ("noise.current_a=0.1", "sensors", "noise is"),
        ("plant.resistance_martensite_ohm[7]=0.21", "springs", "spring 7 has 0.2"),
        ("plant.resistance_martensite_ohm[1]=0.35", "spring", "spring 1 has 0.3"),
    ],
)
def test_what_lies_apart_is_named(bench: Make, world: str, step: str, named: str) -> None:
    (found,) = bench("", more=["--set", world]).finds(step)
    assert named in found


def test_springs_where_resistors_belong_are_told_once(bench: Make) -> None:
    made = bench("")
    (found,) = made.finds("channels")
    assert re.match(
        r"all channels read 0\.17\d ohm, not 0\.22 within 15 %: leads, crimps or another resistor", found
    ), found
    made.wire("resistor=all", "r050=all")
    (found,) = made.finds("channels")
    read = re.match(r"all channels read (0\.\d+) ohm, 2 times 0\.22: its shunt says R050", found)
    assert read and float(read[1]) == pytest.approx(0.44, abs=0.002), found  # half of a voltage's step


def test_what_no_sensor_tells_is_asked(bench: Make) -> None:
    made = bench()
    for step, found in (("supply", "the relay does not follow"), ("air", "the fan does not follow D11")):
        assert made.finds(step, lambda question: False)[0].startswith(found)
        assert made.finds(step) == []
    made.board.ask("ambient 50")  # as warm as a room may be: it is told a kelvin otherwise, and within the limits
    assert made.finds("air") == []


def test_a_page_that_is_not_its_own_is_refused(bench: Make, tmp_path: Path) -> None:
    made = bench()
    (tmp_path / "thesis.html").write_text("mine")
    with pytest.raises(InputError, match="not a page that bringup has begun"):
        converse(made.board, tmp_path / "thesis.html", None)
    (tmp_path / "other.json").write_text("{}")
    with pytest.raises(InputError, match="no conversation that bringup has begun"):
        converse(made.board, tmp_path / "other.html", None)
    with pytest.raises(InputError, match="there is no step 'wires': board, sensors"):
        converse(made.board, tmp_path / "new.html", None, again="wires")
    assert (tmp_path / "thesis.html").read_text() == "mine"
