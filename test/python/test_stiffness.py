"""The stiffness layer from array.toml to a picture: the joint's closed form, the field, patterns, boards, logs of both layers."""

from __future__ import annotations

import math
import subprocess
from pathlib import Path

import numpy as np
import pytest
from command import ended
from made import SIM, needs_simulator
from ninespring.errors import InputError
from ninespring.explore.point import run_point
from ninespring.explore.spec import read_spec
from ninespring.infer.predict import plant_of
from ninespring.io.logs import read_log
from ninespring.model import native, stiffness
from ninespring.model.models import Array, Model, model_of_layer, model_text, pattern_of, read_array, read_model
from ninespring.model.simulate import array_parameters
from ninespring.say import plotting

HEAD = "[array]\nrows = 3\ncols = 3\npitch_mm = 5\n"


def array_of(folder: Path, text: str) -> Array:
    (folder / "array.toml").write_text(text)
    return read_array(folder / "array.toml")


@pytest.mark.parametrize("joint", [math.inf, 1e-2, 3e-4])
def test_the_joints_closed_form_is_what_two_fins_do(joint: float) -> None:
    loss, along, cells = 6e-3, 8e-5, 2000
    # finite volumes of both springs and the joint: nothing of the formula
    n = 2 * cells
    link = np.full(n - 1, along * cells)
    link[cells - 1] = 1.0 / (1.0 / (along * cells) + (0.0 if math.isinf(joint) else 1.0 / joint))
    matrix = np.diag(np.full(n, loss / cells))
    for k in range(n - 1):
        matrix[k : k + 2, k : k + 2] += link[k] * np.array([[1, -1], [-1, 1]])
    heated = np.repeat([1.0, 0.0], cells) / cells
    above, below = np.linalg.solve(matrix, heated).reshape(2, cells).mean(axis=1)
    assert above + below == pytest.approx(1.0 / loss)
    network = (1.0 / (above - below) - loss) / 2.0
    assert stiffness.series_w_per_k(loss, along, joint) == pytest.approx(network, rel=2e-3)


def test_what_the_plant_has_by_default_is_the_papers_spring_by_that_form() -> None:
    from ninespring.explore.geometry import spring_of
    from ninespring.model.cooling import Cooling

    pytest.importorskip("skfem")
    spring = spring_of(Array(), Cooling())
    along = spring.along_w_per_mk * math.pi * spring.radius_mm**2 / spring.length_mm * 1e-3
    table = native.parameter_table()
    for name in ("series_w_per_k", "series_fan_w_per_k"):
        loss = table[name.replace("series", "loss")].default
        closed = stiffness.series_w_per_k(loss, along, stiffness.joint_w_per_k({}))
        assert table[name].default == pytest.approx(closed, rel=0.01)


def test_an_array_without_the_table_is_as_it_was(tmp_path: Path) -> None:
    array = array_of(tmp_path, HEAD)
    assert (array.layers, array.springs, array.parts) == (1, 9, [(0, 0, 3, 3)])
    assert array_parameters(array) == {}
    assert "stiffness" not in model_text(Model(array)) and "board" not in model_text(Model(array))


def test_a_stiffness_layer_has_its_own_springs_and_boards(tmp_path: Path) -> None:
    text = HEAD + "[stiffness]\nwire_diameter_mm = 0.4\ntransformation_shift_k = -12\n[board.2]\nsupply_limit_a = 6\n"
    array = array_of(tmp_path, text)
    assert (array.layers, array.springs) == (2, 18)
    assert array.parts == [(0, 0, 3, 3), (3, 0, 3, 3)]
    values = array_parameters(array)
    assert "heat_capacity_j_per_k" not in values  # the springs above are the plant's own
    assert values["heat_capacity_j_per_k[10]"] == pytest.approx(0.3 / 4, rel=0.01)
    assert values["resistance_austenite_ohm[18]"] == pytest.approx(0.219 * 4, rel=0.01)
    assert values["transformation_shift_k[18]"] == -12 and "transformation_shift_k[9]" not in values
    (tmp_path / "model.toml").write_text(model_text(Model(array, [], {"loss_w_per_k[18]": 0.004})))
    again = read_model(tmp_path / "model.toml")
    assert again.array == array and again.parameters == {"loss_w_per_k[18]": 0.004}


@pytest.mark.parametrize(
    ("text", "where", "says"),
    [
        ("[stiffness]\ngap = 2\n", ":6:1:", "did you mean gap_mm?"),
        ("[stiffness]\ngap_mm = 0\n", ":6:10:", "it must be 0.1 to 50"),
        ("[stiffness]\njoint = 'steal'\n", ":6:9:", "did you mean steel?"),
        ("[[board]]\nsupply_limit_a = 5\n", "", "[board] must be a table"),
        ("[board.2]\nsupply_limit_a = 5\n", ":5:1:", "the array has board 1 to 1"),
        ("[stiffness]\n[board.3]\nsupply_limit_a = 5\n", ":6:1:", "the array has board 1 to 2"),
        ("[board.1]\nsupply = 5\n", ":6:1:", "did you mean supply_limit_a?"),
        ("[board.1]\nsupply_limit_a = 90\n", ":6:18:", "it must be 0.1 to 60"),
        ("board_rows = 2\n", ":5:14:", "go together"),
        ("board_rows = 0\nboard_cols = 3\n", ":5:14:", "must be a whole number"),
    ],
)
def test_what_cannot_be_is_refused_at_its_place(tmp_path: Path, text: str, where: str, says: str) -> None:
    with pytest.raises(InputError) as error:
        array_of(tmp_path, HEAD + text)
    assert says in str(error.value) and f"array.toml{where}" in str(error.value)


def test_every_spring_is_on_one_board(tmp_path: Path) -> None:
    array = array_of(
        tmp_path,
        "[array]\nrows = 5\ncols = 4\nboard_rows = 3\nboard_cols = 3\n[stiffness]\n[board.8]\nsupply_limit_a = 5\n",
    )
    seen = np.zeros((10, 4), dtype=int)
    for row, col, rows, cols in array.parts:
        assert row // 5 == (row + rows - 1) // 5  # of one layer
        seen[row : row + rows, col : col + cols] += 1
    assert len(array.parts) == 8 and (seen == 1).all()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("111101111", "of 1 layer, the array has two; write elongation/stiffness"),
        ("111101111/000010000/1", "of 3 layers, the array has two"),
        ("11110111/000010000", "elongation pattern has 8 digits for 9"),
        ("111101111/0000100000", "stiffness pattern has 10 digits for 9"),
        ("111101111/00001000x", "stiffness pattern '00001000x' holds something else"),
    ],
)
def test_a_bad_pattern_is_refused(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        pattern_of(text, Array(stiffness={}))
    (tmp_path / "model.toml").write_text(model_text(Model(Array(stiffness={}))))
    assert ended("scenario", "--model", tmp_path / "model.toml", "--pattern", text, "-o", tmp_path / "run.ini")[0] == 2
    assert not (tmp_path / "run.ini").exists()


def test_patterns_of_both_layers() -> None:
    assert pattern_of("10/01", Array(1, 2, stiffness={})) == [True, False, False, True]
    assert pattern_of("10", Array(1, 2)) == [True, False]
    with pytest.raises(InputError, match="of 2 layers, the array has one"):
        pattern_of("10/01", Array(1, 2))


def test_a_layers_model_is_what_its_board_exports() -> None:
    array = Array(2, 2, 5.0, stiffness={"wire_diameter_mm": 0.7})
    values = {
        "loss_w_per_k": 0.004,
        "orthogonal_w_per_k": 4e-4,
        "stiffness_coupling_scale": 0.5,
        "series_w_per_k": 3e-4,
    }
    values |= {f"loss_w_per_k[{k}]": 0.003 for k in range(5, 9)} | {"loss_w_per_k[2]": 0.005}
    both = Model(array, [], values, {"loss_w_per_k": 1e-5, "orthogonal_w_per_k": 1e-5})
    above, below = (model_of_layer(both, layer) for layer in stiffness.LAYERS)
    assert above.array == Array(2, 2, 5.0) and above.parameters == {
        "loss_w_per_k": 0.004,
        "orthogonal_w_per_k": 4e-4,
        "loss_w_per_k[2]": 0.005,
    }
    assert below.parameters["loss_w_per_k"] == 0.003 and below.parameters["orthogonal_w_per_k"] == 2e-4
    assert not any("[" in name or name.startswith(("series", "stiffness")) for name in below.parameters)
    assert below.stderr["orthogonal_w_per_k"] == 5e-6
    # by the other way: the part of the two-layer plant that is this board's
    for which, one in enumerate((above, below)):
        lines, said = native.chip_export(plant_of(both), array.parts[which])
        assert "series_w_per_k is not on the chip" in said
        assert lines == native.chip_export(plant_of(one))[0]


def test_what_knows_one_layer_refuses_two(tmp_path: Path) -> None:
    (tmp_path / "model.toml").write_text(model_text(Model(Array(stiffness={}))))
    code, said = ended("export", "--model", tmp_path / "model.toml", "-o", tmp_path / "s.txt")
    assert code == 2 and "--layer elongation or --layer stiffness" in said
    columns = [f"i{k}_a" for k in range(1, 19)] + [f"t{k}_c" for k in range(1, 19)]
    rows = [",".join([str(second)] + ["1"] * 18 + [f"{20 + second / 10:.2f}"] * 18) for second in range(60)]
    log = tmp_path / "log.csv"
    log.write_text("# layers: 2\n" + ",".join(["time_s", *columns]) + "\n" + "\n".join(rows) + "\n")
    assert read_log(log).layers == 2
    code, said = ended("diagnose", log, "-o", tmp_path / "d")
    assert code == 2 and "fit and diagnose know one layer" in said
    log.write_text(log.read_text().replace("layers: 2", "layers: 3"))
    with pytest.raises(InputError, match="there are 1 or 2"):
        read_log(log)


@pytest.mark.parametrize(
    "words", [["plan", "--array"], ["calibrate", "--simulate", "--yes", "--array"], ["export", "--model"]]
)
def test_what_knows_one_board_refuses_an_array_on_several(tmp_path: Path, words: list[str]) -> None:
    model = Model(Array(4, 4, board=(2, 2)))
    path = tmp_path / "array.toml"
    path.write_text(
        model_text(model) if "--model" in words else "[array]\nrows=4\ncols=4\nboard_rows=2\nboard_cols=2\n"
    )
    code, said = ended(*words, path, "-o", tmp_path / "out")
    assert code == 2 and "an array on 4 boards" in said and "(rows = 2, cols = 2)" in said
    assert not (tmp_path / "out").exists()


@needs_simulator
def test_a_picture_has_both_layers_side_by_side(tmp_path: Path) -> None:
    ini = tmp_path / "two.ini"
    ini.write_text(
        "[scenario]\nduration_s = 30\npolicy = open\n[array]\nrows = 1\ncols = 2\nlayers = 2\n"
        "[plant]\neffects = latent_heat, resistance_phase\n[events]\nat 1 = pattern 10/01\n"
    )
    subprocess.run([SIM, "run", str(ini), "-o", str(tmp_path / "two.csv")], check=True, capture_output=True)
    log = read_log(tmp_path / "two.csv")
    assert (log.layers, log.springs) == (2, 4)
    assert (log.temperature_c[-1, [0, 3]] > 40).all() and (log.temperature_c[-1, [1, 2]] < 40).all()
    titles = [one.get_title() for one in plotting.figure(log).axes]
    assert titles[:2] == list(stiffness.LAYERS)
    shown = plotting.map_at(log, 1, 2, 29.0)
    assert shown.axes[0].get_title(loc="left") == "29 s (bold: driven)"
    assert [one.get_xlabel() for one in shown.axes[:2]] == list(stiffness.LAYERS)
    words = [one.get_text() for at in shown.axes[:2] for one in at.texts]
    assert [one.partition(":")[0] for one in words] == ["1", "2", "3", "4"]


@needs_simulator
@pytest.mark.nightly
def test_from_geometry_to_a_picture(tmp_path: Path) -> None:
    """The journey of docs/exploring.md, in small."""
    pytest.importorskip("skfem", reason="SKIPPED: scikit-fem is missing: pip install 'ninespring[explore]'")
    pytest.importorskip("gmsh", reason="SKIPPED: gmsh is missing", exc_type=Exception)
    at = {name: tmp_path / name for name in ("array.toml", "model.toml", "run.ini", "run.csv", "run.png", "map.png")}
    at["array.toml"].write_text(
        '[array]\nrows = 1\ncols = 2\npitch_mm = 6\n[cooling]\nplate = "none"\n'
        "[stiffness]\ncoil_diameter_mm = 2.8\n[board.2]\nsupply_limit_a = 2\n"
    )
    assert ended("couplings", at["array.toml"], "--mesh", "coarse", "-o", at["model.toml"])[0] == 0
    values = read_model(at["model.toml"]).parameters
    # a thinner coil of as many turns: less wire, less to the air, less from one to the other
    assert values["loss_w_per_k[3]"] < 0.95 * values["loss_w_per_k"]
    assert values["heat_capacity_j_per_k[4]"] == pytest.approx(0.82 * values["heat_capacity_j_per_k"], rel=0.03)
    assert values["stiffness_coupling_scale"] < 0.9
    assert 2e-4 < values["series_w_per_k"] < 5e-4 < values["loss_w_per_k[3]"]
    words = ("--model", at["model.toml"], "--pattern", "11/01", "--duration", 120)
    assert ended("scenario", *words, "-o", at["run.ini"])[0] == 0
    subprocess.run([SIM, "run", str(at["run.ini"]), "-o", str(at["run.csv"])], check=True, capture_output=True)
    log = read_log(at["run.csv"])
    assert log.springs == 4
    assert log.current_a is not None and log.current_a[:, 3].max() < 2.1  # its board's own limit
    assert log.current_a[:, :2].max() > 2.5
    # driven above only, the stiffness spring is warmed and does not move
    assert 22 < log.temperature_c[:, 2].max() < 60
    for output, more in ((at["run.png"], ()), (at["map.png"], ("--at", 100))):
        assert ended("plot", at["run.csv"], "--model", at["model.toml"], *more, "-o", output)[0] == 0
        assert output.read_bytes()[:4] == b"\x89PNG"


def test_a_sweep_has_layers(tmp_path: Path) -> None:
    path = tmp_path / "s.toml"
    path.write_text(
        "[sweep]\nduration_s = 120\non_s = 100\n[fixed]\nlayers = 2\nrows = 1\ncols = 2\n"
        '[board.2]\nsupply_limit_a = 1\n[vary]\npattern = ["all/none", "all/01", "10/middle"]\n'
    )
    spec = read_spec(path)
    rows = [run_point(spec, k, point) for k, point in enumerate(spec.all_points())]
    assert [one["error"] for one in rows] == ["", "", ""]
    assert rows[0]["started"] == 1.0 and 22 < rows[0]["undriven_c"] < 60
    assert rows[1]["supply_a"] > rows[0]["supply_a"] + 0.3
    every = path.read_text().replace('pattern = ["all/none", "all/01", "10/middle"]', 'pattern = "every"')
    path.write_text(every)
    assert [one["pattern"] for one in read_spec(path).all_points()][:3] == ["00/00", "00/01", "00/10"]
    for wrong, says in (
        ('pattern = ["all"]', "of 1 layer, the array has two"),
        ('pattern = ["all/0"]', "stiffness pattern has 1 digits for 2"),
        ('pattern = ["all/nonne"]', "did you mean none?"),
        ('pattern = ["all/none"]\nstiffness_gap_mm = [1, 2]', 'couplings = "field"'),
    ):
        path.write_text(every.replace('pattern = "every"', wrong))
        with pytest.raises(InputError, match=says):
            read_spec(path)
