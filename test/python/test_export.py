"""What reaches the chip: only what the logs determined, and nothing that drives worse than what the chip has."""

from __future__ import annotations

import json
import os
from pathlib import Path

import ninespring as ns
import numpy as np
import pytest
from command import ended
from made import an_effect
from ninespring.export import drive
from ninespring.export.settings import judged, left_out, settings_of, together
from ninespring.find import diagnosis
from ninespring.infer.predict import predict_by_chip
from ninespring.io.logs import read_log, write_atomically
from ninespring.model import native
from ninespring.model.models import Array, Model, model_text, read_model
from plants import a_plant, columns_of


def lukewarm(columns: dict[str, np.ndarray]) -> None:
    """Leave a log as it would be with a quarter of the heat."""
    for k in range(1, 10):
        columns[f"i{k}_a"] = 0.5 * columns[f"i{k}_a"]
        columns[f"v{k}_v"] = 0.5 * columns[f"v{k}_v"]
        columns[f"t{k}_c"] = 20.0 + 0.25 * (columns[f"t{k}_c"] - 20.0)


@pytest.fixture(scope="module")
def cold(make_shared_log) -> Path:
    """Return a model of a log that never comes near the transformation."""
    log = make_shared_log("cold.csv", change=lukewarm)
    found = diagnosis.diagnose(Array(), [read_log(log)])
    path = log.with_suffix(".toml")
    path.write_text(model_text(found.model))
    return path


def test_what_the_log_never_reached_is_not_written_and_the_file_says_so(cold: Path, tmp_path: Path) -> None:
    ended("export", "--model", cold, "-o", tmp_path / "s.txt")
    lines = (tmp_path / "s.txt").read_text().splitlines()
    names = {line[1:].split("=")[0] for line in lines if line.startswith("$")}
    assert {"heat_capacity_j_per_k", "loss_w_per_k", "orthogonal_w_per_k"} <= names
    assert not {n for n in names if "latent" in n or n.endswith(("start_c", "finish_c")) or n.startswith("resistance")}
    hottest = read_model(cold).provenance["hottest_c"]
    said = next(line for line in lines if "transformation kept as it is" in line)
    assert f"reached {hottest:.1f} degC" in said and "latent_heat_j" in said and "austenite_start_c" in said


def test_a_latent_heat_that_the_data_speak_against_is_written_as_what_it_is(make_log) -> None:
    found = diagnosis.diagnose(Array(), [read_log(make_log(seconds=900))])  # through the transformation, without any
    assert found.model.effects == []
    made = settings_of(found.model)
    assert abs(float(made.written["latent_heat_j"])) < 0.6


def test_bands_that_overlap_reach_the_chip_narrower_about_their_middles_and_it_is_said() -> None:
    broad = {"austenite_start_c": 40.0, "austenite_finish_c": 60.0}
    broad |= {"martensite_start_c": 46.0, "martensite_finish_c": 28.0}
    found = Model(Array(1, 1), ["latent_heat"])
    found.parameters, found.stderr = {"latent_heat_j": 5.0} | broad, dict.fromkeys(broad, 1.0)
    made = settings_of(found)
    assert made.written["austenite_start_c"] == made.written["martensite_start_c"]
    assert "overlap by 6.0 K" in made.remarks
    for start, finish in (("austenite_start_c", "austenite_finish_c"), ("martensite_start_c", "martensite_finish_c")):
        middle = 0.5 * (float(made.written[start]) + float(made.written[finish]))
        assert middle == pytest.approx(0.5 * (broad[start] + broad[finish]), abs=0.02)


def test_a_fan_curve_is_written_where_it_was_found_and_stays_as_it_is_elsewhere() -> None:
    found = Model(Array(), ["fan_curve"])
    found.parameters, found.stderr = {"fan_half_share": 0.42}, {"fan_half_share": 0.01}
    assert settings_of(found).written["fan_half_share"] == "0.420"
    assert settings_of(Model(Array())).kept["fan_half_share"] == "the diagnosis named no fan_curve"


def test_numbers_that_are_known_in_combination_only_are_written_together(make_log) -> None:
    """One run of all springs alike: losses and couplings cannot be told, and what is written must still be right."""

    def together(columns: dict[str, np.ndarray]) -> None:
        drive = np.repeat(np.where(np.arange(600) % 300 < 200, 0.3, 0.0)[:, None], 9, axis=1)
        plant = a_plant((3, 3), numbers={"loss_w_per_k": 0.007})
        shown = plant.simulate(np.arange(600.0), native.POWER, drive)
        shown += np.column_stack([np.random.default_rng(k).normal(0, 0.3, 600) for k in range(1, 10)])
        columns |= columns_of(i=drive, v=np.ones_like(drive), t=shown) | {"fan": np.zeros(600)}

    run_ = read_log(make_log(change=together))
    found = diagnosis.diagnose(Array(), [run_])
    made = settings_of(found.model)
    assert "loss_fan_w_per_k" not in made.written
    shown = predict_by_chip(found.model, made.lines, run_)
    assert np.sqrt(np.nanmean((run_.temperature_c - shown) ** 2)) < 0.5
    couplings = [float(made.written[n]) for n in ("orthogonal_w_per_k", "diagonal_w_per_k") if n in made.written]
    assert all(0.2e-3 < one < 1.2e-3 for one in couplings), "near what was declared: the data do not speak"


def test_the_settings_of_an_effect_are_found_without_a_list() -> None:
    model = Model(Array(), ["fan_wake", "radiation"])
    model.parameters = {"wake_w_per_k": 0.001, "wake_direction": 2.0, "emissivity": 0.6}
    model.stderr = {"wake_w_per_k": 0.0001, "emissivity": 0.05}
    made = settings_of(model)
    assert set(made.written) == {"rows", "columns", "wake_w_per_k", "wake_direction", "radiating_area_mm2"}
    assert made.written["wake_direction"] == "2"


def test_a_board_is_told_what_resistance_another_wire_has(cold: Path) -> None:
    model = read_model(cold)
    assert not [name for name in settings_of(model).written if name.endswith("imum_ohm")]
    for wire_mm in (0.4, 1.2):
        model.array.spring = {"wire_diameter_mm": wire_mm}
        written = settings_of(model).written
        assert float(written["resistance_minimum_ohm"]) == pytest.approx(0.08 * (0.8 / wire_mm) ** 2, rel=0.05)
        assert float(written["resistance_maximum_ohm"]) == pytest.approx(0.5 * (0.8 / wire_mm) ** 2, rel=0.05)
        # told in this order, the lower never meets the upper
        limits = [name for name in written if name.endswith("imum_ohm")]
        assert limits[0] == ("resistance_maximum_ohm" if wire_mm < 0.8 else "resistance_minimum_ohm")


def test_settings_that_drive_worse_are_refused_and_written_only_by_force(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    model, path, out = Model(Array(), ["latent_heat", "resistance_phase"]), tmp_path / "m.toml", tmp_path / "s.txt"
    path.write_text(model_text(model))
    made = settings_of(model)
    made.written |= {"loss_w_per_k": "0.002000"}  # too little power to hold anything
    monkeypatch.setattr("ninespring.export.drive.settings_of", lambda model: made)
    code, said = ended("export", "--model", path, "-o", out)
    assert code == 1 and "would drive worse" in said and not out.exists()
    ended("export", "--model", path, "-o", out, "--force")
    assert "$loss_w_per_k=0.002000" in out.read_text() and "# worse, written by --force" in out.read_text()


def test_a_drive_is_measured_as_it_was() -> None:
    plant = a_plant((3, 3), ["latent_heat", "resistance_phase"])
    alone = np.arange(9) == 4
    good = drive.drive(plant, "", alone)
    assert good.held > 0.9 and good.heating_s < 60 and good.hottest_c < 130 and good.undriven < 0.1
    weak = drive.drive(plant, "$boost_current_a=0.500\n$maximum_current_a=0.600", alone)
    assert weak.held < 0.1 and weak.heating_s > 150


def transforming(hottest_c: float, error_k: float = 0.3) -> Model:
    """Return a model with a transformation that was found lower and narrower than declared, seen up to some degC."""
    found = {"latent_heat_j": 6.0, "austenite_start_c": 87.0, "austenite_finish_c": 91.0, "martensite_start_c": 79.0}
    model = Model(Array(), ["latent_heat"])
    model.parameters = {"loss_w_per_k": 0.006} | found
    model.stderr = {"loss_w_per_k": 1e-5} | dict.fromkeys(found, error_k)
    model.provenance["hottest_c"] = hottest_c
    return model


def test_a_transformation_that_no_spring_clearly_passed_stays_as_the_chip_has_it() -> None:
    """A fit takes for its end what was reached: heat and end of half a transformation look like those of a whole one."""
    crossed = settings_of(transforming(95.0)).written
    assert float(crossed["latent_heat_j"]) == 6.0 and float(crossed["austenite_finish_c"]) == 91.0
    assert float(crossed["austenite_start_c"]) == 87.0
    made = settings_of(transforming(91.5))
    assert set(made.written) == {"rows", "columns", "loss_w_per_k"}
    assert (
        "91.5 degC, which is not clearly beyond the end of the transformation (91.0 +- 0.3"
        in made.kept["latent_heat_j"]
    )
    assert made.kept["austenite_start_c"] == made.kept["latent_heat_j"]


def test_a_latent_heat_as_uncertain_as_large_is_not_written() -> None:
    model = transforming(110.0)
    model.stderr["latent_heat_j"] = 5.0
    made = settings_of(model)
    assert made.kept["latent_heat_j"] == "the log says too little of it" and "austenite_finish_c" in made.written


def test_a_spring_whose_thermometer_is_late_is_not_taken_for_one_of_twice_the_mass(make_log, briefly: None) -> None:
    def late(columns: dict[str, np.ndarray]) -> None:
        time_s = np.arange(300.0)
        columns["t4_c"] = np.interp(time_s - 15.0, time_s, columns["t4_c"])

    log = make_log(effects={"latent_heat": {"latent_heat_j": 8.0}}, change=late, seconds=300)
    model = ns.fit(log, effects=["latent_heat", "spring_mismatch"])
    assert model.parameters["heat_capacity_scale[4]"] > 1.5
    made = settings_of(model)
    assert not [name for name in made.written if "scale" in name]
    assert "of spring 4 are unexplained" in made.kept["heat_capacity_scale_4"]
    # and what the chip has of the others is that of a spring like them, not of the mean with it
    assert float(made.written["heat_capacity_j_per_k"]) == pytest.approx(0.3, rel=0.05)
    # who did not ask for it is told where something is left, and by no name
    found = diagnosis.diagnose(Array(), [read_log(log)])
    assert found.model.effects == ["latent_heat"]
    assert any("rms of what spring 4 showed is explained by nothing" in warning for warning in found.result["warnings"])


def test_what_rests_on_a_declared_resistance_is_said_and_not_written(make_log, tmp_path: Path) -> None:
    log = make_log(columns="i", effects={"latent_heat": {"latent_heat_j": 8.0}})
    assert "in proportion to the declared 0.175 ohm only" in ended("diagnose", log, "-o", tmp_path / "d")[1]
    ended("export", "--model", tmp_path / "d" / "model.toml", "-o", tmp_path / "s.txt")
    lines = (tmp_path / "s.txt").read_text().splitlines()
    assert {line.split("=")[0] for line in lines if line.startswith("$")} == {"$rows", "$columns"}
    assert any("no voltages were logged" in line for line in lines)
    said = " ".join(line for line in lines if line.startswith("#"))
    assert all(
        name in said for name in ("heat_capacity_j_per_k", "loss_w_per_k", "orthogonal_w_per_k", "latent_heat_j")
    )


def test_a_model_of_a_doubted_log_is_refused_and_written_only_by_force(make_log, briefly: None, tmp_path: Path) -> None:
    def swap(columns: dict[str, np.ndarray]) -> None:
        columns["t1_c"], columns["t2_c"] = columns["t2_c"], columns["t1_c"]

    log, out = make_log(change=swap, seconds=300), tmp_path / "s.txt"
    for made in (["diagnose", log, "-o", tmp_path / "d"], ["fit", log, "-o", tmp_path / "d" / "model.toml"]):
        ended(*made)
        code, said = ended("export", "--model", tmp_path / "d" / "model.toml", "-o", out)
        assert code == 1 and "the log of this model is doubted" in said and "columns swapped?" in said
        assert not out.exists()
    page = (tmp_path / "d" / "report.html").read_text()
    assert "ninespring export" not in page and "# t1_c follows the drive of spring 2" in page
    ended("export", "--model", tmp_path / "d" / "model.toml", "-o", out, "--force")
    assert "# doubted, written by --force: t2_c follows the drive of spring 1" in out.read_text()


def test_a_log_that_the_model_misses_by_more_than_a_boards_margin_is_doubted(make_log, briefly: None) -> None:
    def sways(columns: dict[str, np.ndarray]) -> None:
        columns["t4_c"] = columns["t4_c"] + 9.0 * np.sin(np.arange(300.0) / 12.0)

    result = diagnosis.diagnose(Array(), [read_log(make_log(change=sways, seconds=300))]).result
    (said,) = result["doubts"]
    assert "K rms of what spring 4 showed is explained by nothing" in said and said in result["warnings"]


@pytest.mark.parametrize(
    ("later_s", "more", "refused"),
    [
        ([9, 8, 9, 8, 9], 0.0, True),  # each time
        ([9, 3, 9, 8, 9], 0.0, False),  # which spring is heated first is chance
        ([9, 8, 9, 8, 9], 0.027, False),  # what comes later does more afterwards
        ([60, 60, 60, 60, 60], 0.027, True),  # not enough of it
    ],
)
def test_heating_takes_longer_where_it_does_each_time_and_nothing_makes_up_for_it(
    cold: Path, monkeypatch: pytest.MonkeyPatch, later_s: list[int], more: float, refused: bool
) -> None:
    on_s, later = 250.0, iter(2 * later_s)

    def drive_(plant: native.Plant, lines: str, pattern: np.ndarray) -> drive.Drive:
        heating_s = 70.0 + (next(later) if lines else 0)
        held = 0.97 + (more if lines else 0.0)
        return drive.Drive(held, heating_s, 103.0, 110.0, 0.0, held * (1.0 - 0.5 * heating_s / on_s))

    monkeypatch.setattr(drive, "drive", drive_)
    worse, rows = drive.compare(read_model(cold), "", "$loss_w_per_k=0.006")
    assert [one.split()[0] for one in worse] == ["heating"] * refused
    assert len(rows) == 2 * 5 * len(drive.WORSE)


def test_a_spring_that_differs_is_written_and_the_chips_error_is_told_on_a_log_that_was_not_fitted(
    make_log, tmp_path: Path
) -> None:
    other = {"spring_mismatch": {"loss_scale[5]": 1.3}, "latent_heat": {"latent_heat_j": 8.0}}
    fitted, fresh = make_log("fitted.csv", effects=other, seed=1), make_log("fresh.csv", effects=other, seed=2)
    ended("diagnose", fitted, "-o", tmp_path / "d")
    written = settings_of(read_model(tmp_path / "d" / "model.toml")).written
    assert float(written["loss_scale_5"]) / float(written["loss_scale_1"]) == pytest.approx(1.3, abs=0.05)
    said = ended("verify", "--model", tmp_path / "d" / "model.toml", fresh, "--json", tmp_path / "v.json")[1]
    assert "as it is" in said
    result = json.loads((tmp_path / "v.json").read_text())
    assert result["after"]["rmse_c"] < 0.5 < result["before"]["rmse_c"]
    report = tmp_path / "d" / "report.html"
    for _ in range(2):
        ended("verify", "--model", tmp_path / "d" / "model.toml", fresh, "--report", report)
    page = report.read_text()
    assert page.count("The chip on fresh.csv, which the fit never saw") == 1, "what was said before is replaced"
    assert f"{result['after']['rmse_c']:.2f}" in page and page.rstrip().endswith("</html>")
    for more, why in (((fresh, "--report", fresh), "is there already"), ((fitted,), "never saw")):
        code, told = ended("verify", "--model", tmp_path / "d" / "model.toml", *more)
        assert code == 2 and why in told


def test_a_link_stays_a_link_a_device_a_device_and_a_dash_is_standard_output(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    target, link = tmp_path / "target.txt", tmp_path / "link.txt"
    target.write_text("old")
    link.symlink_to(target)
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    write_atomically({link: "new\n", pipe: "piped\n", Path("-"): "shown\n", Path("/dev/null"): "gone"}, force=True)
    assert link.is_symlink() and target.read_text() == "new\n"
    assert os.read(reader, 100) == b"piped\n" and pipe.is_fifo()
    os.close(reader)
    assert capsys.readouterr().out == "shown\n"


def test_one_judgement_says_what_goes_into_the_chip_and_how_to_have_it_go(tmp_path: Path) -> None:
    for hottest_c, goes in ((95.0, True), (91.5, False)):
        model = transforming(hottest_c)
        one = an_effect("latent_heat", on_chip=not goes)
        judged([one], model)
        assert one.on_chip == goes == ("latent_heat" not in left_out(model))
        assert goes == ("latent_heat_j" in settings_of(model).written)
    said = one.why_not_on_chip
    words = said[said.index("ninespring plan") :].split()[1:]
    (tmp_path / "model.toml").write_text(model_text(model))
    words = [str(tmp_path / one) if "." in one else one for one in words]
    assert ended(*words)[0] == 0
    assert "on 5 100" in (tmp_path / "steps.txt").read_text()


def test_a_declared_number_of_an_effect_is_none_that_was_found(tmp_path: Path) -> None:
    """Martensite's resistance is array.toml's; austenite's was found by no voltages: the effect does not go into the chip."""
    model = Model(Array(1, 1, material={"austenite_finish_c": 94.0}))
    model.effects = ["resistance_phase"]
    model.parameters, model.stderr = {"resistance_austenite_ohm": 0.159}, {"resistance_austenite_ohm": 0.002}
    model.kept = {"resistance_austenite_ohm": "no voltages were logged"}
    one = an_effect("resistance_phase", on_chip=True)
    judged([one], model)
    assert not one.on_chip and one.why_not_on_chip == "no voltages were logged"


def test_what_is_not_written_never_names_a_spring_that_is() -> None:
    kept = dict.fromkeys(("wire_1", "wire_3", "loss_1", "loss_2", "area_mm2"), "unknown")
    assert together(kept, {"wire_2": "1"}) == {"unknown": ["wire_1", "wire_3", "loss", "area_mm2"]}


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("$nonsense=1", "now.txt:2:1: the chip has no setting 'nonsense'"),
        ("$loss_w_per_k=99", "now.txt:2:1: loss_w_per_k is 99; it must be 1e-06 to 0.065535 W/K"),
        ("$loss_scale_3=9", "now.txt:2:1: loss_scale_3 is 9; it must be 0.001 to 8"),
    ],
)
def test_what_no_board_can_have_is_refused_where_it_stands(tmp_path: Path, line: str, said: str) -> None:
    (tmp_path / "model.toml").write_text(model_text(Model(Array())))
    (tmp_path / "now.txt").write_text(f"$rows=3\n{line}\n")
    words = ("--model", tmp_path / "model.toml", "--chip", tmp_path / "now.txt", "-o", tmp_path / "s.txt")
    code, why = ended("export", *words)
    assert code == 2 and said in why and not (tmp_path / "s.txt").exists()
