"""predict, export and import never write over what they read, follow a link instead of replacing it, and take - and devices
(record: test_recording.py)."""

from __future__ import annotations

import stat
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from ninespring.cli.main import cli
from ninespring.errors import InputError
from ninespring.model.models import Array, Model, model_text


@pytest.fixture
def commands(make_log, tmp_path: Path) -> dict[str, tuple[list[str], list[Path], str]]:
    """Return, per command, its words without the output, what it reads, and how its result begins."""
    log, model, table, regions = (
        make_log("run.csv", seconds=120),
        *(tmp_path / n for n in ("m.toml", "table.txt", "map.toml")),
    )
    made = Model(Array())
    made.parameters, made.stderr = {"loss_w_per_k": 0.0058}, {"loss_w_per_k": 1e-4}
    model.write_text(model_text(made))
    rows = np.column_stack([np.arange(60.0), *(np.full(60, v) for v in (50.0, 0.0, 21.0, 21.0))])
    np.savetxt(
        table, rows, delimiter=",", header="Time (sec),Heater 1,Heater 2,Temperature 1,Temperature 2", comments=""
    )
    regions.write_text(
        '[columns]\ntime_s = "Time (sec)"\nu1 = { column = "Heater 1", scale = 0.01 }\nu2 = { column = "Heater 2", scale = 0.01 }\n'
        't1_c = "Temperature 1"\nt2_c = "Temperature 2"\n'
    )
    return {
        "predict": (["predict", str(log), "--model", str(model)], [log, model], "# tool: ninespring "),
        "export": (["export", "--model", str(model)], [model], "# from m.toml"),
        "import": (["import", str(table), "--map", str(regions)], [table, regions], "# "),
    }


def run(words: list[str], output: Path | str) -> str:
    done = CliRunner().invoke(cli, [*words, "-o", str(output)])
    if done.exception and not isinstance(done.exception, SystemExit):
        raise done.exception
    assert done.exit_code == 0, done.output
    return done.stdout


@pytest.mark.parametrize("name", ["predict", "export", "import"])
def test_an_input_is_never_written_over_by_name_link_or_second_name(commands, tmp_path: Path, name: str) -> None:
    words, read, _ = commands[name]
    for number, one in enumerate(read):
        before = one.read_bytes()
        link, second = tmp_path / f"link{number}", tmp_path / f"second{number}"
        link.symlink_to(one)
        second.hardlink_to(one)
        for output in (one, link, second, tmp_path / "." / one.name):
            with pytest.raises(InputError, match="it is read"):
                run(words, output)
        assert one.read_bytes() == before and link.is_symlink()


@pytest.mark.parametrize("name", ["predict", "export", "import"])
def test_a_link_is_followed_a_device_stays_one_and_a_dash_prints(commands, tmp_path: Path, name: str) -> None:
    words, _, begins = commands[name]
    target, link = tmp_path / "target", tmp_path / "link"
    target.touch()
    link.symlink_to(target)
    run(words, link)
    assert link.is_symlink() and target.read_text().startswith(begins)
    assert run(words, "-") == target.read_text(), "nothing else on standard output, and no file of that name"
    assert not Path("-").exists()
    run(words, "/dev/null")
    assert stat.S_ISCHR(Path("/dev/null").stat().st_mode)
