"""Arguments: every number of every command has a range, and nothing that was measured is written over."""

from __future__ import annotations

from pathlib import Path

import click
import ninespring as ns
import numpy as np
import pytest
from command import ended, ninespring
from ninespring.cli.console import Command, Real, Whole
from ninespring.cli.main import COMMANDS, cli
from ninespring.io import ranges
from ninespring.io.logs import kind_of, write_atomically
from ninespring.io.recording import LogFile
from ninespring.model.models import Array, Model, model_text

NUMBERS = [
    (name, one)
    for name in COMMANDS
    for one in cli.get_command(click.Context(cli), name).params
    if isinstance(one, click.Option) and isinstance(one.type, click.types.IntParamType | click.types.FloatParamType)
]


def test_every_number_of_every_command_is_refused_beyond_its_range() -> None:
    assert len(NUMBERS) >= 15
    for name, option in NUMBERS:
        assert isinstance(option.type, Real | Whole), f"{name} {option.opts[0]}: give it a range"
        low, high = option.type.min, option.type.max
        for value in ("nan", "inf", "-inf", "-1", "1e308", "x", ""):
            if value == "-1" and low <= -1:
                continue
            code, said = ended(name, option.opts[0], value)
            assert code == 2 and option.opts[0] in said and "\n" not in said, (name, option.opts, value, said)
        assert np.isfinite([low, high]).all()


def test_an_option_that_is_required_is_asked_for() -> None:
    asked = 0
    for name in COMMANDS:
        command = cli.get_command(click.Context(cli), name)
        for option in (one for one in command.params if one.required):
            asked += 1
            with pytest.raises(click.MissingParameter):
                option.handle_parse_result(click.Context(command, info_name=name), {}, [])
    assert asked >= 20


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), -1.0, 1e308, "900", None, True])
def test_a_function_refuses_what_its_option_refuses(bad: object) -> None:
    with pytest.raises(ns.InputError, match="duration_s = "):
        ranges.PLAN_S.check("duration_s", bad)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("nonsense", "No such command"),
        ("fit", "Missing argument"),
        ("fit no-such.csv -o m.toml", "no-such.csv: cannot be read"),
        ("diagnose no-such.csv -o out --frozen", "--frozen needs --model"),
        ("export --model no-such.toml -o s.txt", "no-such.toml: cannot be read"),
        ("plot run.csv --at x -o p.png", "'x' is not a valid number"),
        ("plot run.csv -o p.bmp", "a picture's name ends in one of .png, .svg, .pdf, .gif"),
        ("record --port /dev/x --thermometers /dev/../dev/x -o x.csv", "that is the board's port"),
        ("record --port x --tape --hz 5 -o day.tape", "leave out --hz"),
        ("upload --port x", "either a file of settings or --undo"),
        ("upload --port x --undo s.txt", "either a file of settings or --undo"),
        ("settings diff a.txt", "give two files"),
        ("bringup --port /dev/null -o b.html", "give --yes"),
        ("console", "give --port, or --simulate"),
        ("dashboard", "give one of --port, --simulate, --replay"),
        ("dashboard --simulate --port x", "give one of --port, --simulate, --replay"),
        ("dashboard --simulate --listen here", "not HOST:PORT"),
        ("dashboard --simulate --speed 3", "--speed goes with --replay"),
        ("dashboard --replay no-such.csv", "no-such.csv: cannot be read"),
        ("calibrate", "give --port, or --simulate"),
        ("calibrate --port /dev/x --simulate", "give --port, or --simulate"),
        ("calibrate --port /dev/x", "--thermometers is missing"),
        ("calibrate --port /dev/x --thermometers /dev/x", "a logger has its own"),
        ("calibrate --simulate --thermometers /dev/x", "goes with --port"),
        ("calibrate --simulate", "give --yes"),
        ("calibrate --simulate --yes --duration 10", "300<=x"),
        ("calibrate --simulate --yes --pattern 111", "pattern has 3 digits for 9 springs"),
    ],
)
def test_arguments_that_do_not_go_together_are_refused_in_one_line_before_any_work(
    words: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    done = ninespring(*words.split())
    assert done.returncode == 2 and said in done.stderr, done
    assert len(done.stderr.strip().splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def derived(make_log, tmp_path: Path) -> dict[str, list[str]]:
    """Return, per command that derives a file, its words without the output."""
    log, model = make_log("run.csv", seconds=12), tmp_path / "m.toml"  # a frame a second
    made = Model(Array())
    made.parameters, made.stderr = {"loss_w_per_k": 0.0058}, {"loss_w_per_k": 1e-4}
    model.write_text(model_text(made))
    given = ["--model", str(model)]
    return {
        "p.csv": ["predict", str(log), *given],
        "steps.txt": ["plan", "--duration", "300"],
        "run.ini": ["scenario", *given],
        "s.txt": ["export", *given],
        "p.png": ["plot", str(log)],
        "p.gif": ["plot", str(log)],
    }


def test_what_is_derived_replaces_its_like_and_nothing_else(derived, tmp_path: Path) -> None:
    kinds = []
    for name, words in derived.items():
        output = tmp_path / name
        for _ in range(2):
            assert ended(*words, "-o", output)[0] == 0
        kinds.append(kind_of(output.read_bytes()))
    pictures = ["a picture of a log"] * 2
    assert kinds == ["what predict wrote", "a plan", "a scenario", "settings", *pictures]
    before = (tmp_path / "steps.txt").read_bytes()
    code, said = ended(*derived["run.ini"], "-o", tmp_path / "steps.txt")
    assert code == 2 and "is a plan, and a scenario would take its place" in said
    assert (tmp_path / "steps.txt").read_bytes() == before
    assert not [one for one in tmp_path.iterdir() if one.name.startswith(".")]


def test_an_input_is_never_written_over_by_name_link_or_second_name(derived, tmp_path: Path) -> None:
    for name in set(COMMANDS) - {"settings"}:
        assert isinstance(cli.get_command(click.Context(cli), name), Command)
    for number, one in enumerate((tmp_path / "run.csv", tmp_path / "m.toml")):
        before = one.read_bytes()
        link, second = tmp_path / f"link{number}", tmp_path / f"second{number}"
        link.symlink_to(one)
        second.hardlink_to(one)
        for output in (one, link, second, tmp_path / "." / one.name):
            code, said = ended(*derived["p.csv"], "-o", output)
            assert code == 2 and "it is read" in said
        assert one.read_bytes() == before and link.is_symlink()
    code, said = ended(*derived["p.csv"], "-o", tmp_path / "p.csv", "--json", tmp_path / "p.csv")
    assert code == 2 and "cannot be written into one file" in said


def test_a_dash_prints_the_result_and_nothing_else(derived, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("p.csv", "steps.txt", "run.ini", "s.txt"):
        printed = ninespring(*derived[name], "-o", "-").stdout
        assert ended(*derived[name], "-o", name)[0] == 0
        assert printed.replace("record --run -", f"record --run {name}") == Path(name).read_text()
    assert not Path("-").exists()


def test_a_log_or_somebodys_own_file_is_never_replaced(derived, tmp_path: Path) -> None:
    for name, words in derived.items():
        for content in ("time_s,i1_a,t1_c\n0,1,20\n", "my notes\n", '{"a": 1}', "[array]\nrows = 3\n"):
            target = tmp_path / f"own{Path(name).suffix}"
            target.write_text(content)
            code, said = ended(*words, "-o", target)
            assert code == 2 and said.startswith(f"{target}: is there already") and target.read_text() == content


def test_diagnose_refuses_a_folder_whose_files_are_not_its_own_before_it_works(make_log, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / "model.toml").write_text("[array]\nrows = 3\ncols = 3\n")
    code, said = ended("diagnose", make_log(seconds=60), "-o", folder)
    assert code == 2 and "model.toml: is there already" in said
    assert [one.name for one in folder.iterdir()] == ["model.toml"]


def test_a_recording_and_an_import_keep_the_log_that_is_there(tmp_path: Path) -> None:
    table, output = tmp_path / "table.txt", tmp_path / "run1.csv"
    rows = np.column_stack([np.arange(60.0), *(np.full(60, v) for v in (50.0, 0.0, 21.0, 21.0))])
    head = "Time (sec),Heater 1,Heater 2,Temperature 1,Temperature 2"
    np.savetxt(table, rows, delimiter=",", header=head, comments="")
    words = ["import", table, "--map", "tclab", "-o", output]
    assert ended(*words)[0] == 0
    before = output.read_bytes()
    for again in (words, ["record", "--port", "/dev/null", "-o", output]):
        code, said = ended(*again)
        assert code == 2 and "never written over" in said and "--force" in said
    with pytest.raises(ns.InputError, match="never written over"):
        LogFile(output)
    assert output.read_bytes() == before and ended(*words, "--force")[0] == 0


@pytest.mark.parametrize(("force", "kept"), [(False, "first\n"), (True, "second\n")])
def test_a_log_that_came_while_another_grew_is_kept_too(tmp_path: Path, force: bool, kept: str) -> None:
    log = LogFile(tmp_path / "run.csv", force)
    log.write_row("second")
    (tmp_path / "run.csv").write_text("first\n")
    log.close()
    assert (tmp_path / "run.csv").read_text() == kept and log.path.read_text() == "second\n"


def test_a_full_disk_names_the_file_and_leaves_what_was_there(small_disk: Path) -> None:
    path = small_disk / "model.toml"
    path.write_text('schema = "ninespring.model/1"\n')
    with pytest.raises(ns.WorkError, match=f"{path}: cannot be written: No space left"):
        write_atomically({path: 'schema = "ninespring.model/1"\n' + "#" * 100_000})
    assert path.read_text() == 'schema = "ninespring.model/1"\n' and [one.name for one in small_disk.iterdir()] == [
        "model.toml"
    ]
