"""report.html: everything that was found, in one file that needs nothing else."""

from __future__ import annotations

import copy
import dataclasses
import re
from html.parser import HTMLParser
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest
from made import an_effect, keep_rows
from ninespring.cli import diagnose as command
from ninespring.find import diagnosis
from ninespring.io import results
from ninespring.io.logs import read_log
from ninespring.model.models import Array
from ninespring.say import page as report


class Page(HTMLParser):
    """Headings, tables as rows of cells, figures, and whatever would be fetched."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.headings: list[str] = []
        self.rows: list[list[str]] = []
        self.figures = 0
        self.fetched: list[str] = []
        self.open: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        self.open.append(tag)
        if tag == "tr":
            self.rows.append([])
        elif tag in ("td", "th"):
            self.rows[-1].append("")
        elif tag in ("h1", "h2"):
            self.headings.append("")
        elif tag == "figure":
            self.figures += 1
        elif tag in ("script", "link", "iframe"):
            self.fetched.append(tag)
        self.fetched += [
            v
            for k, v in values.items()
            if k in ("src", "href", "xlink:href") and v and not v.startswith(("#", "data:"))
        ]

    def handle_endtag(self, tag: str) -> None:
        while self.open and self.open.pop() != tag:
            pass

    def handle_data(self, data: str) -> None:
        if not self.open:
            return
        if self.open[-1] in ("td", "th"):
            self.rows[-1][-1] += data
        elif self.open[-1] in ("h1", "h2"):
            self.headings[-1] += data

    def row(self, first: str) -> list[str]:
        return next(row for row in self.rows if row and row[0] == first)


@pytest.fixture(scope="module")
def found(make_shared_log) -> diagnosis.Diagnosis:
    """Return a diagnosis of two runs: phase change, a slow sensor, a spring that is not measured, a gap."""
    effects = {"latent_heat": {"latent_heat_j": 8.0}, "sensor_lag": {"sensor_lag_s": 5.0}}

    logs = [
        make_shared_log("a<b.csv", effects, seed=1, change=lambda c: c.pop("t5_c")),
        make_shared_log(
            "gap.csv", effects, seed=2, change=lambda c: (keep_rows(c, np.r_[0:250, 320:600]), c.pop("t5_c"))
        ),
    ]
    return diagnosis.diagnose(Array(), [read_log(log) for log in logs])


def test_the_report_shows_what_was_found_and_needs_nothing_else(found: diagnosis.Diagnosis) -> None:
    result = found.result
    assert {e["name"] for e in result["effects"]} == {"latent_heat", "sensor_lag"}
    text = report.html_report(found)
    page = Page(text)
    assert not page.fetched
    assert not re.search(r"url\((?!#)", text)
    assert page.headings == [
        "What the array does that the model did not",
        "What to do next",
        "Errors before and after",
        "About the data",
        "Effects adopted",
        "Their numbers",
        "Measured against model",
        "Where the error sits",
        "What is left",
        "What was tried",
        "The declared model's numbers",
    ]
    # the map of the first screen; two runs, temperatures and residuals; maps; autocorrelation
    assert page.figures == 7
    assert ["latent_heat + sensor_lag", "adopted"] in [[row[0], row[-1]] for row in page.rows]
    before, after = result["baseline"], result["after"]
    for row, one in (("before: the declared model", before), ("after: the model that is given", after)):
        assert page.row(row)[1:] == [f"{one['rmse_c']:.3f}", f"{one['holdout_rmse_c']:.3f}"]
    assert page.row("noise of the sensors")[1] == f"{before['noise_c']:.3f}"
    assert "The thermometers lag 5." in text and "The transformation takes up" in text and "certain, " in text
    for effect in result["effects"]:
        row = page.row(effect["name"])
        assert row[2:5] == [f"{effect['rmse_c']:.3f}", f"{effect['holdout_rmse_c']:.3f}", f"{effect['evidence']:.0f}"]
        # this log's springs never ended their transformation: export leaves it out, and so says the report
        assert row[5].startswith("no: the log's hottest" if effect["name"] == "latent_heat" else "no: ")
    for name, one in (result["effects"][0]["parameters"] | after["parameters"]).items():
        assert page.row(name)[1:4] == [f"{one['value']:.5g}", f"{one['stderr']:.2g}", one["unit"]]
        assert page.row(name)[4]
    # the spring without a thermometer is said to be, nowhere is a NaN shown
    assert (text.count(">not measured<"), len(re.findall(r">\s*not\s*<", text))) == (4, 5)
    assert not re.search(r">[+-]?nan", text)
    # what was mended is told; names of files cannot break the page
    assert "gap.csv: 1 gap(s) in time" in text
    assert "a&lt;b.csv" in text and "a<b" not in text


def test_the_report_shows_rivals_what_is_unexplained_and_what_is_not_determined(found: diagnosis.Diagnosis) -> None:
    changed = copy.copy(found)
    told = changed.told = copy.deepcopy(found.told)
    rival = results.Rival(
        instead_of="latent_heat",
        name="shared_air",
        rmse_c=0.4,
        evidence=3.0,
        parameters={},
        separating_experiment="all springs on for 60 min; watch spring 1",
    )
    told.rivals = [rival]
    told.unexplained = True
    told.residual.note = "It depends on the moon."
    told.identifiability = results.Identifiability(
        not_identifiable=["latent_heat_j"],
        at_bounds=["sensor_lag_s"],
        correlated=[results.Correlation(a="loss_w_per_k", b="sensor_lag_s", correlation=0.99)],
    )
    assert "Heat of unknown origin" not in Page(report.html_report(changed)).headings, "there is none"
    watts = [np.zeros_like(run.temperature_c) for run in found.problem.runs]
    watts[1][100:200, 3] = -0.2
    changed.heat = dataclasses.replace(found.heat, watts=watts)
    text = report.html_report(changed)
    page = Page(text)
    assert {"Heat of unknown origin", "Unexplained"} <= set(page.headings)
    assert {"What these data cannot tell apart", "Not determined by these data"} <= set(page.headings)
    wanted = ["latent_heat", "shared_air", "0.400", "3.0", "all springs on for 60 min; watch spring 1"]
    assert wanted in page.rows
    for words in ("depends on the moon", "latent_heat_j: the data cannot", "sensor_lag_s: at its"):
        assert words in text
    assert "determined in combination only: loss_w_per_k, sensor_lag_s" in text


def told(**more: object) -> results.Diagnosis:
    """Return a diagnosis that found nothing, but for `more`."""
    usual = results.Diagnosis(
        logs=[],
        baseline=results.Baseline(rmse_c=2.0, holdout_rmse_c=2.0, noise_c=0.3),
        effects=[],
        rivals=[],
        after=results.After(rmse_c=0.3, holdout_rmse_c=0.31),
        unexplained=False,
        residual=results.Residual(autocorrelation_lag1=0.0, depends_on=[], note="", structure_c=0.0),
        identifiability=results.Identifiability(not_identifiable=[], at_bounds=[], correlated=[]),
        warnings=[],
        unknown_heat=results.UnknownHeat(events=[], mean_w=[], usual_w=[]),
        runs_differ=[],
        unnamed=[],
        candidates=[],
        doubts=[],
        seconds=1.0,
        simulations=1,
    )
    return msgspec.structs.replace(usual, **more)


def effect(name: str, variant: str = "") -> results.Effect:
    return an_effect(
        name, variant=variant or results.UNSET, holdout_rmse_c=0.31, probability=0.99, certainty="certain", text=""
    )


def test_the_verdict_says_the_outcome() -> None:
    assert report.verdict(told()).startswith("Nothing is missing")
    assert report.verdict(told(unexplained=True)).startswith("Something is missing that no effect")
    both = [effect("spring_mismatch", "spring 3"), effect("sensor_lag")]
    named = report.verdict(told(effects=both))
    assert named.startswith("Missing: spring_mismatch (spring 3) and sensor_lag; held-out error 2.00 →")
    assert "and something that no effect" in report.verdict(told(effects=both, unexplained=True))


def test_the_terminal_tells_what_acts_without_a_name(capsys: pytest.CaptureFixture[str]) -> None:
    said = "spring 8 is given heat, 300 to 600 s of run 1: 0.1003 W (+-0.0002)"
    cause = results.Unnamed(kind="heat", size=0.1003, stderr=0.0002, unit="W", text=said)
    command._print_diagnosis(told(unnamed=[cause]), "Missing: nothing.")
    assert "a cause without a name: Spring 8 is given heat" in capsys.readouterr().out


def test_the_next_commands_say_what_was_typed() -> None:
    told = SimpleNamespace(logs=[SimpleNamespace(file="a.csv")], doubts=["columns 1 and 2 are swapped"], rivals=[])
    assert report.next_steps(told, "out")[-1].startswith("ninespring diagnose a.csv -o out ")
    typed = report.next_steps(told, "out", "--model m.toml logs/a.csv")
    assert typed[-1].startswith("ninespring diagnose --model m.toml logs/a.csv -o out ")
