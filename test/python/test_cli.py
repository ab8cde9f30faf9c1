"""The commands: what they write, how they end."""

from __future__ import annotations

import io
import json
import re
import signal
import subprocess
import sys
from pathlib import Path

import jsonschema
import ninespring as ns
import numpy as np
import pytest
from click.testing import CliRunner
from command import ninespring
from made import keep_rows
from ninespring.cli import main as cli
from ninespring.errors import WorkError
from ninespring.find import doubt
from ninespring.infer.predict import predict
from ninespring.io import results
from ninespring.io.logs import log_text, read_log, read_table, write_atomically
from ninespring.model import native
from ninespring.model.models import Array, Model, model_text, read_model
from plants import a_plant
from rich.console import Console


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
    typed = f"ninespring plan --through 5 --model {model} -o steps.txt"
    assert typed in " ".join(done.stdout.split()) and typed in page
    assert ninespring("predict", "--model", model, log, "-o", tmp_path / "p.csv").returncode == 0
    assert "\ntime_s,t1_c," in (tmp_path / "p.csv").read_text()
    assert ninespring("export", "--model", model, "-o", tmp_path / "s.txt").returncode == 0
    text = (tmp_path / "s.txt").read_text()
    assert "$loss_w_per_k=" in text
    assert "reached 95.5 degC, which is not clearly beyond the end of the transformation (98.0 degC)" in text
    assert typed in text


def test_a_picture_of_a_time_that_the_log_does_not_have_is_refused(make_log, tmp_path: Path) -> None:
    """A board's log begins at its clock's time, not at 0."""
    log = make_log(seconds=100, change=lambda c: c.update(time_s=np.arange(100) + 540.5))
    for at, code in ((539, 2), (600, 0), (640, 2)):
        done = ninespring("plot", log, "--at", at, "-o", tmp_path / f"{at}.png")
        assert done.returncode == code
        assert (tmp_path / f"{at}.png").exists() == (code == 0)
    assert done.stderr.endswith("run.csv: --at 640: its time_s runs from 540.5 to 639.5 s\n")


STEADY = """case,pitch_mm,fan,ambient_c,hold1_c,hold2_c,hold3_c,hold4_c,hold6_c,hold7_c,hold8_c,hold9_c,t5_c
a,4,0,20,99,99,99,99,99,99,99,99,63
b,5,0,20,99,99,99,99,99,99,99,99,57
c,6,1,20,99,99,99,99,99,99,99,99,49
"""


def test_a_steady_table_is_diagnosed_with_a_report_and_a_model(tmp_path: Path) -> None:
    (tmp_path / "steady.csv").write_text(STEADY)
    done = ninespring("diagnose", tmp_path / "steady.csv", "-o", tmp_path / "out", "--json", tmp_path / "d.json")
    assert done.returncode == 0, done.stderr
    result = json.loads((tmp_path / "d.json").read_text())
    assert result == json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    assert [c["measured_c"] for c in result["cases"]] == [63, 57, 49]
    page = (tmp_path / "out" / "report.html").read_text()
    cases = page.partition("<h2>Cases</h2>")[2].partition("<h2>")[0]
    shown = [f"{one[when]:.1f}" for one in result["cases"] for when in ("measured_c", "before_c", "after_c")]
    assert re.findall(r'class="n">([\d.]+)<', cases) == shown
    assert result["rivals"][0]["separating_experiment"] in page
    assert read_model(tmp_path / "out" / "model.toml").effects == [result["effects"][0]["name"]]
    assert result["warnings"][0] in done.stdout.replace("\n", " ")
    refused = ninespring("fit", tmp_path / "steady.csv", "-o", tmp_path / "m.toml")
    assert refused.returncode == 2 and "ninespring diagnose" in refused.stderr


def test_every_result_is_held_to_its_schema(make_log, tmp_path: Path) -> None:
    log = make_log(seconds=200)
    (tmp_path / "map.toml").write_text(
        '[columns]\ntime_s = "time_s"\n' + "".join(f'i{k}_a = "i{k}_a"\nt{k}_c = "t{k}_c"\n' for k in range(1, 10))
    )
    model = tmp_path / "m.toml"
    published = jsonschema.Draft202012Validator(json.loads(results.schema("results")))
    commands = {
        "fit": (log, "-o", model),
        "predict": ("--model", model, log, "-o", tmp_path / "p.csv"),
        "export": ("--model", model, "-o", tmp_path / "s.txt"),
        "import": (log, "--map", tmp_path / "map.toml", "-o", tmp_path / "i.csv"),
    }
    for name, words in commands.items():
        done = ninespring(name, *words, "--json", tmp_path / f"{name}.json")  # one result never takes another's place
        assert done.returncode == 0, done.stderr
        result = json.loads((tmp_path / f"{name}.json").read_text())
        assert result["schema"] == f"ninespring.{name}/1"
        published.validate(result)
        for key in set(result) - {"tool"}:
            broken = {other: value for other, value in result.items() if other != key}
            with pytest.raises(jsonschema.ValidationError):
                published.validate(broken)
        with pytest.raises(jsonschema.ValidationError):
            published.validate(result | {"surplus": 1})


def test_fit_takes_the_effects_that_a_diagnosis_named_by_v_over_i(make_log, tmp_path: Path) -> None:
    """No temperature depends on them where both v and i were logged: the line `effects` of a diagnosis's model was refused."""

    def steps(columns: dict[str, np.ndarray]) -> None:
        """Heat the springs through, each with two resistances, by how much of it has transformed."""
        rng = np.random.default_rng(8)
        plant = a_plant((3, 3), ["latent_heat"])
        power = 1.4 * np.column_stack([columns[f"i{k}_a"] * columns[f"v{k}_v"] for k in range(1, 10)])
        seconds = len(power)
        traced = plant.trace(np.arange(float(seconds)), native.POWER, power, columns["fan"], np.full(seconds, 20.0))
        for k in range(9):
            current = np.sqrt(power[:, k] / (0.18 + 0.035 * traced[:, k, 1]))
            columns[f"t{k + 1}_c"] = traced[:, k, 0] + rng.normal(0.0, 0.3, seconds)
            columns[f"i{k + 1}_a"] = current
            columns[f"v{k + 1}_v"] = power[:, k] / np.maximum(current, 1e-9) + rng.normal(0.0, 1e-3, seconds)

    log, model = make_log(effects={"latent_heat": {}}, change=steps), tmp_path / "m.toml"
    words = ("fit", "--effects", "latent_heat,resistance_phase", log, "-o", model, "--json", tmp_path / "m.json")
    done = ninespring(*words)
    assert done.returncode == 0, done.stderr
    made, told = read_model(model), json.loads((tmp_path / "m.json").read_text())
    assert made.effects == told["effects"] == ["latent_heat", "resistance_phase"]
    for name, ohm in (("resistance_martensite_ohm", 0.18), ("resistance_austenite_ohm", 0.215)):
        assert made.parameters[name] == pytest.approx(ohm, rel=0.03)
        assert made.parameters[name] == pytest.approx(told["parameters"][name]["value"], rel=1e-6)
        assert 0.0 < made.stderr[name] < 0.01
    assert ns.fit(log, effects=["latent_heat", "resistance_phase"]).parameters == pytest.approx(
        made.parameters, rel=1e-5
    )
    # what neither shows is still refused, at its log
    steady = make_log("steady.csv", effects={"latent_heat": {}})
    done = ninespring("fit", "--effects", "latent_heat,resistance_phase", steady, "-o", model)
    assert done.returncode == 2
    assert f"{steady}: resistance_phase cannot show here: no temperature depends on it, and v / i" in done.stderr


def test_the_chip_starts_again_after_gaps_and_is_seen_by_the_same_sensors(make_log) -> None:
    true = {"sensor_lag": {"sensor_lag_s": 8.0}, "edge_loss": {"edge_loss_fraction": 0.2}}
    run = read_log(make_log(effects=true, change=lambda columns: keep_rows(columns, np.r_[0:250, 400:600])))
    model = Model(Array(), list(true), {k: v for one in true.values() for k, v in one.items()})
    plant, chip = predict(model, run), predict(model, run, chip=True)
    assert np.abs(plant - chip).max() < 0.1
    left = run.temperature_c - chip
    assert np.sqrt(np.nanmean(left**2)) < 0.35


@pytest.mark.parametrize(("rows", "cols"), [(1, 2), (1, 7)])
def test_predict_takes_the_array_from_the_model(tmp_path: Path, rows: int, cols: int) -> None:
    springs, seconds = rows * cols, 60
    model = Model(Array(rows, cols))
    model.parameters = {"loss_w_per_k": 0.006}
    (tmp_path / "m.toml").write_text(model_text(model))
    columns = {f"i{k}_a": np.full(seconds, 1.0 + 0.05 * k) for k in range(1, springs + 1)}
    (tmp_path / "log.csv").write_text(log_text(np.arange(float(seconds)), columns))
    for chip in ((), ("--chip",)):
        words = ("--model", tmp_path / "m.toml", tmp_path / "log.csv", "-o", tmp_path / "p.csv")
        done = ninespring("predict", *chip, *words)
        assert done.returncode == 0, done.stderr
        table = read_table(tmp_path / "p.csv").frame
        assert list(table) == ["time_s", *(f"t{k}_c" for k in range(1, springs + 1))]
        assert table.iloc[0, 1:].tolist() == pytest.approx([20.0] * springs, abs=0.01)
        assert (table.iloc[-1, 1:] > 30).all()
    refused = ninespring("predict", "--model", tmp_path / "m.toml", tmp_path / "p.csv", "-o", tmp_path / "q.csv")
    assert refused.returncode == 2
    model.array = Array(3, 3)
    (tmp_path / "nine.toml").write_text(model_text(model))
    refused = ninespring("predict", "--model", tmp_path / "nine.toml", tmp_path / "log.csv", "-o", tmp_path / "q.csv")
    assert refused.returncode == 2
    assert "nine.toml is of 3 x 3" in refused.stderr
    assert not (tmp_path / "q.csv").exists()


def test_what_cannot_be_fitted_is_refused_before_any_work(make_log, tmp_path: Path) -> None:
    log, short = make_log(), make_log("short.csv", seconds=20)
    idle = make_log("idle.csv", change=lambda c: c.update({n: c[n] * 0 for n in c if n[0] in "iv"}))
    eight = make_log("eight.csv", change=lambda c: [c.pop(n) for n in ("i9_a", "v9_v", "t9_c")])
    (tmp_path / "copy.csv").write_bytes(log.read_bytes())
    for words, said in (
        ((log, tmp_path / "copy.csv"), "it would count twice"),
        ((short,), "20 rows are too few"),
        ((idle,), "no spring is ever driven"),
        ((eight,), "8 springs: say how they are arranged"),
        ((log, eight), f"{eight}: has 8 springs, {log} has 9: give logs of one array"),
        ((log, "--effects", "ghosts"), "there is no effect 'ghosts': "),
        ((log, "--effects", "latnt_heat"), "there is no effect 'latnt_heat' (did you mean latent_heat?)"),
    ):
        done = ninespring("fit", *words, "-o", tmp_path / "m.toml")
        assert done.returncode == 2
        assert said in done.stderr
        assert len(done.stderr.strip().splitlines()) == 1
    nowhere = tmp_path / "nowhere" / "m.toml"
    for words in (("fit", log, "-o", nowhere), ("fit", log, "-o", tmp_path / "m.toml", "--json", nowhere)):
        done = ninespring(*words)
        assert done.returncode == 2
        assert "create it first" in done.stderr
    assert not (tmp_path / "m.toml").exists()


@pytest.mark.parametrize(
    ("raised", "said"),
    [
        (KeyboardInterrupt(), "ninespring: stopped"),
        (KeyError("x\ny"), "a defect of the tool: KeyError"),
        (WorkError("the port is gone"), "ninespring: the port is gone"),
    ],
)
def test_work_that_ends_early_leaves_nothing_and_says_one_line(
    make_log, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, raised: BaseException, said: str
) -> None:
    log = make_log(seconds=100)

    def ends(*_: object) -> None:
        raise raised

    stream = io.StringIO()
    monkeypatch.setattr(doubt, "model_of_fit", ends)
    monkeypatch.setattr(cli, "err", Console(file=stream, width=200))
    monkeypatch.setattr(sys, "argv", ["ninespring", "fit", str(log), "-o", str(tmp_path / "m.toml")])
    before = signal.getsignal(signal.SIGTERM)
    with pytest.raises(SystemExit) as ended:
        cli.main()
    signal.signal(signal.SIGTERM, before)
    assert ended.value.code == 1
    assert stream.getvalue().count("\n") == 1 and said in stream.getvalue()
    assert list(tmp_path.iterdir()) == [log]


def test_ctrl_c_while_the_package_is_loaded_is_one_line() -> None:
    slow = "import builtins, os, signal\nload = builtins.__import__\n"
    slow += "def late(name, *more):\n    if name == 'numpy': os.kill(os.getpid(), signal.SIGINT)\n    return load(name, *more)\n"
    slow += "builtins.__import__ = late\nfrom ninespring_start import main; main()"
    done = subprocess.run([sys.executable, "-c", slow], capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (1, "", "ninespring: stopped\n")


def test_fit_and_predict_say_what_is_wrong_with_a_log_too(make_log, tmp_path: Path) -> None:
    def swap(columns: dict[str, np.ndarray]) -> None:
        columns["t2_c"], columns["t8_c"] = columns["t8_c"], columns["t2_c"]

    def early(columns: dict[str, np.ndarray]) -> None:
        for k in range(1, 10):
            columns[f"t{k}_c"] = np.append(columns[f"t{k}_c"][8:], np.full(8, np.nan))
        del columns["t5_c"]

    model, said = tmp_path / "m.toml", {}
    for name, change in (("swap", swap), ("early", early)):
        log = make_log(f"{name}.csv", change=change)
        said[name] = ninespring("fit", log, "-o", model, "--json", tmp_path / "f.json").stderr
        assert json.loads((tmp_path / "f.json").read_text())["warnings"]
    assert "t2_c follows the drive of spring 8" in said["swap"]
    assert re.search(r"come about [789] s before the inputs", said["early"])
    assert "early.csv: no temperature of spring 5" in said["early"]
    done = ninespring("predict", "--model", model, tmp_path / "swap.csv", "-o", tmp_path / "p.csv")
    assert "t2_c follows the drive of spring 8" in done.stderr


def test_files_are_written_together_or_not_at_all(tmp_path: Path) -> None:
    write_atomically({tmp_path / "a": "1\n", tmp_path / "b": "2\n"})
    assert [(tmp_path / name).read_text() for name in "ab"] == ["1\n", "2\n"]
    with pytest.raises(UnicodeEncodeError):
        write_atomically({tmp_path / "a": "3\n", tmp_path / "b": "\ud800"}, force=True)
    assert (tmp_path / "a").read_text() == "1\n"
    assert sorted(one.name for one in tmp_path.iterdir()) == ["a", "b"]


@pytest.mark.parametrize("command", sorted(set(cli.COMMANDS) - {"settings"}))
def test_help_says_what_it_does_with_an_example(command: str) -> None:
    text = CliRunner().invoke(cli.cli, [command, "--help"]).output
    assert f"ninespring {command} " in text.partition("Example")[2]
    assert "  -o, --output" in text or command in ("upload", "monitor", "dashboard", "console", "verify", "schema")
    for line in re.findall(r"^  (?:-\w, )?--.*(?:\n {10,}.*)*", text, re.MULTILINE):
        assert re.search(r"  +\S.*\w", line.lstrip().partition("  ")[1] + line.lstrip().partition("  ")[2]), line


def test_a_bad_log_leaves_nothing_half_written(make_log, tmp_path: Path) -> None:
    log = make_log()
    log.write_text(log.read_text()[:5000].rsplit(",", 3)[0] + "\n")
    before = set(tmp_path.iterdir())
    done = ninespring("diagnose", log, "-o", tmp_path / "out")
    assert done.returncode == 2
    assert set(tmp_path.iterdir()) == before
