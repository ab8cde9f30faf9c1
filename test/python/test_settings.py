"""A board's settings: kept before an upload, taken back, as a file that diffs."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import ninespring as ns
import pytest
from command import ended as ninespring
from fake_board import FakeBoard, row
from ninespring.io import history

HAD = {"rows": "3", "loss_w_per_k": "0.005800", "loss_scale_1": "1.000", "ambient_c": "21.00"}


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Keep what is kept in a folder of the test's own."""
    monkeypatch.setenv(history.HOME, str(tmp_path / "home"))
    return tmp_path / "home"


@pytest.fixture
def fake() -> FakeBoard:
    board = FakeBoard()
    board.settings = dict(HAD)
    return board


def upload(fake: FakeBoard, tmp_path: Path, *lines: str) -> None:
    (tmp_path / "s.txt").write_text("".join(f"{line}\n" for line in lines))
    assert ninespring("upload", "--port", fake.port, tmp_path / "s.txt")[0] == 0


def test_an_upload_is_taken_back_and_the_one_before_it_next(fake: FakeBoard, tmp_path: Path) -> None:
    upload(fake, tmp_path, "$loss_w_per_k=0.006000", "$loss_scale_1=1.100")
    upload(fake, tmp_path, "$loss_w_per_k=0.007000")
    fake.settings["ambient_c"] = "25.00"  # set by hand since: none of the upload's
    said = ninespring("settings", "history", "--port", fake.port)[1]
    assert "upload s.txt: 2 sent, 2 changed" in said
    assert "$loss_w_per_k: 0.006000 -> 0.007000" in said
    code, said = ninespring("upload", "--port", fake.port, "--undo")
    assert (code, "$loss_w_per_k: 0.007000 -> 0.006000" in said) == (0, True)
    assert fake.settings == HAD | {"loss_w_per_k": "0.006000", "loss_scale_1": "1.100", "ambient_c": "25.00"}
    assert fake.sent().count("$save") == 3
    assert ns.undo_upload(fake.port) == ["$loss_w_per_k: 0.005800 -> 0.006000", "$loss_scale_1: 1.000 -> 1.100"]
    assert fake.settings == HAD | {"ambient_c": "25.00"}
    code, said = ninespring("upload", "--port", fake.port, "--undo")
    assert (code, "no upload to this board is kept" in said) == (1, True)


def believed(*warm_c: float) -> list[str]:
    """A board's answer to `model`: springs 1 ... as warm as that, and one of which nothing is known yet."""
    each = [*map(str, warm_c), "68.6"]
    told = [
        f"spring {k}: {t} degC, 7.0 to 117.3, 9.4 K below martensite start (+-9.1), austenite 0.0 %, 0.0 to 7.8"
        for k, t in enumerate(each, 1)
    ]
    return [*told, "  not known for 81 s: it may still be hot from before power-on", "ambient: 20.00 degC", "ok"]


def test_an_upload_says_which_springs_are_warm_or_waits_until_none_is(fake: FakeBoard, tmp_path: Path) -> None:
    (tmp_path / "s.txt").write_text("$loss_w_per_k=0.006000\n")
    fake.answers["model"] = believed(87.4, 24.9, 25.4)
    code, said = ninespring("upload", "--port", fake.port, tmp_path / "s.txt")
    assert (code, "spring 1 (87 degC), spring 3 (25 degC): a drive may end in fault 9" in said) == (0, True), said

    def cools() -> Iterator[str]:
        for k in range(20):
            if k == 3:
                fake.answers["model"] = believed(24.0, 24.0, 24.0)
            yield row(k)

    fake.stream, fake.every_s = cools(), 0.05
    code, said = ninespring("upload", "--wait", "--port", fake.port, tmp_path / "s.txt")
    assert (code, "fault 9" in said) == (0, False), said
    assert fake.sent()[-4:] == ["learnt clear", "$loss_w_per_k=0.006000", "$$", "$save"]


@pytest.mark.parametrize(
    ("answers", "said"),
    [
        ({"learnt clear": ["error:12 a spring is on"]}, "a spring is on"),
        ({"$loss_w_per_k=9": ["error:4 out of range"]}, "s.txt:3:3: '$loss_w_per_k=9' refused: error 4 out of range"),
        ({"$loss_w_per_k=9": ["[not active yet: x]", "ok"]}, "x]: nothing is saved, the board has what it had"),
        ({"$$": ["$loss_w_per_k=0.005800", "ok"]}, "loss_w_per_k is 0.005800, not 9"),
        ({"$$": ["ok"]}, "loss_w_per_k is missing"),
    ],
)
def test_what_the_board_does_not_take_is_said_and_nothing_saved(
    tmp_path: Path, answers: dict[str, list[str]], said: str
) -> None:
    board = FakeBoard(answers)
    (tmp_path / "s.txt").write_text("# one\n\n  $loss_w_per_k=9\n")
    code, told = ninespring("upload", "--port", board.port, tmp_path / "s.txt")
    assert (code, said in told) == (1, True), told
    assert "$save" not in board.seen


@pytest.mark.parametrize(
    ("takes_back", "said"), [(True, "the board has what it had"), (False, "a reset of the board gives back")]
)
def test_a_refused_upload_gives_back_what_it_sent_before(
    fake: FakeBoard, tmp_path: Path, takes_back: bool, said: str
) -> None:
    fake.answers["$hold_margin_k=300"] = ["error:4 out of range"]
    if not takes_back:
        fake.answers[f"$loss_w_per_k={HAD['loss_w_per_k']}"] = ["error:12 a spring is on"]
    (tmp_path / "s.txt").write_text("$loss_w_per_k=0.009100\n$hold_margin_k=300\n")
    code, told = ninespring("upload", "--port", fake.port, tmp_path / "s.txt")
    assert (code, f"error 4 out of range: nothing is saved, {said}" in told) == (1, True), told
    assert (fake.settings == HAD) is takes_back and "$save" not in fake.sent()


def test_what_the_board_has_otherwise_than_sent_is_not_taken_back(fake: FakeBoard, tmp_path: Path) -> None:
    upload(fake, tmp_path, "$loss_w_per_k=0.006000")
    fake.settings["loss_w_per_k"] = "0.009000"
    code, said = ninespring("upload", "--port", fake.port, "--undo")
    assert code == 1
    assert "loss_w_per_k is 0.009000, not 0.006000" in said
    assert fake.settings["loss_w_per_k"] == "0.009000"


@pytest.mark.parametrize(
    ("content", "code", "says"),
    [
        (b"\xef\xbb\xbf$rows=3\r\n$loss_w_per_k=0.006 W/K\r\n$loss_rise_per_k=0 1/K\r\n", 0, "3 settings sent"),
        ("\ufeff$rows=3\n".encode("utf-16-le"), 2, "s.txt:1: UTF-16 text: save it as UTF-8"),
        (b"$rows=3\n# 20 \xb0C\n", 2, "s.txt:2:6: not UTF-8 text"),
        (b"$rows=3\n  $loss_w_per_k=0,006\n", 2, "s.txt:2:3: '$loss_w_per_k=0,006' is not a setting"),
        (b"$rows=3\n$loss_w_per_k=0,006\n", 2, "a decimal comma?"),
        (b"$loss_w_per_k=0.006 0.007\n", 2, "s.txt:1:1: '$loss_w_per_k=0.006 0.007' is not a setting"),
        (b"$rows=3\n$rows=3\n", 0, "1 settings sent"),
        (b"$rows=3\n$rows=2\n", 2, "s.txt:2:1: rows is 2 here and 3 before: leave one of them"),
        (b"# nothing\n", 2, "s.txt: no setting in it"),
        (b"loss_w_per_k=1\n", 2, "s.txt:1:1: 'loss_w_per_k=1' is not a setting"),
        (b"$loss=1;$save\n", 2, "is not a setting"),
        (b"$x=nan\n", 2, "is not a setting"),
        ("$ä=1\n".encode(), 2, "is not a setting"),
    ],
)
def test_settings_are_a_text_file_as_any_other(
    content: bytes, code: int, says: str, fake: FakeBoard, tmp_path: Path
) -> None:
    (tmp_path / "s.txt").write_bytes(content)
    got, said = ninespring("upload", "--port", fake.port, tmp_path / "s.txt")
    assert (got, says in said) == (code, True), said
    assert code == 0 or not fake.sent()


def test_what_a_board_had_is_a_file_that_upload_takes(fake: FakeBoard, tmp_path: Path, home: Path) -> None:
    upload(fake, tmp_path, "$loss_w_per_k=0.006000")
    (kept,) = home.rglob("*.txt")
    assert ninespring("upload", "--port", fake.port, kept)[0] == 0
    assert fake.settings == HAD


def test_settings_as_a_file_that_diffs(fake: FakeBoard, tmp_path: Path) -> None:
    assert ninespring("settings", "read", "--port", fake.port, "-o", tmp_path / "a.txt")[0] == 0
    head, *lines = (tmp_path / "a.txt").read_text().splitlines()
    assert head.startswith("# from /dev/")
    assert lines == ["$rows=3", "$loss_w_per_k=0.005800", "$loss_scale_1=1.000", "$ambient_c=21.00  # built in: 20.00"]
    assert ninespring("settings", "diff", tmp_path / "a.txt", "--port", fake.port)[0] == 0
    fake.settings |= {"loss_w_per_k": "0.0070", "cut_off": "1"}
    code, said = ninespring("settings", "diff", tmp_path / "a.txt", "--port", fake.port)
    assert code == 1
    assert said.splitlines() == ["$loss_w_per_k: 0.005800 -> 0.0070", f"1 only in {fake.port}", "1 of 4 differ"]
    # what was read goes back onto a board, comments and all
    upload(fake, tmp_path, *lines)
    assert fake.settings["loss_w_per_k"] == "0.005800"


def test_a_diff_is_of_settings(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("$rows=3\n")
    (tmp_path / "b.txt").write_text("rows 3\n")
    code, said = ninespring("settings", "diff", tmp_path / "a.txt", tmp_path / "b.txt")
    assert code == 2
    assert "b.txt:1:1: 'rows 3' is not a setting" in said
