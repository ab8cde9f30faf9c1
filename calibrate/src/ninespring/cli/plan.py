"""`ninespring plan`."""

from __future__ import annotations

import json
from pathlib import Path

import click

from ..errors import InputError
from ..find.plan import FIRST_S, THROUGH_S, make_plan, plan_experiment, plan_through
from ..io import ranges, results
from ..io.logs import read_bytes
from ..model.models import Array
from .console import ARRAY, FILE, beside, command, model_and_array, number, output, write


@command("""\b
Examples:
  ninespring plan -o steps.txt
  ninespring plan --array array.toml --supply 10 --duration 1200 -o steps.txt
  ninespring record --port /dev/ttyACM0 --run steps.txt --duration 900 -o board1.csv
  ninespring plan --no-thermometer -o steps.txt
  ninespring plan --through 5 --model diagnosis/model.toml -o steps.txt
  ninespring plan --for diagnosis/diagnosis.json -o steps.txt
""")
@ARRAY
@click.option("--for", "diagnosis", type=FILE, help="diagnosis.json: the experiment that it asks for first")
@click.option(
    "--no-thermometer",
    "board_alone",
    is_flag=True,
    help="for the board's own v and i alone: every turn crosses the transformation, and a little current always flows",
)
@number("--through", ranges.SPRING, "drive this spring alone through its transformation; needs --model")
@click.option("--model", "model_path", type=FILE, help="with --through: model.toml that says where that ends")
@number("--duration", ranges.PLAN_S, "s  [default: 900; without a thermometer 1800]")
@number(
    "--current",
    ranges.PLAN_CURRENT_A,
    "A, one spring at full level  [default: 2.0; without a thermometer 2.6, to transform in the fan's air too]",
)
@number("--supply", ranges.PLAN_SUPPLY_A, "A, all springs together", 14.0)
@number("--hottest", ranges.PLAN_HOTTEST_C, "degC, of any spring, as declared", 105.0)
@number("--seed", ranges.SEED, "another one: another plan", 1)
@output("steps.txt to write; - prints it")
def plan(
    array_path: Path | None,
    diagnosis: Path | None,
    board_alone: bool,
    through: int | None,
    model_path: Path | None,
    duration: float | None,
    current: float | None,
    supply: float,
    hottest: float,
    seed: int,
    output: Path,
) -> None:
    """Write the steps of a recording that identifies an array, within what its supply and its springs stand.

    The springs' temperatures are those of the declared array; the board's own limits hold all the same.
    """
    if (through is None) != (model_path is None):
        raise InputError("--through and --model go together")
    if through and (diagnosis or array_path or board_alone or duration or current):
        raise InputError("--through takes the array, the current and the time from the model: no other of these")
    model, given = model_and_array(model_path, array_path)
    array = given or Array()
    array.one_layer("a plan is for")
    array.one_board("a plan is for")
    head = []
    duration = duration or (1800.0 if board_alone else 900.0)
    current = current or (2.6 if board_alone else 2.0)
    if model and through:
        head = [f"# spring {through} through its transformation, as {model_path.name if model_path else ''} has it"]
        duration = 2.0 * THROUGH_S
        made = plan_through(model, through, supply, hottest)
    elif diagnosis:
        said, asked = asked_for(diagnosis)
        head = [f"# {said}"]
        duration = asked.duration_s + 2.0 * FIRST_S
        made = plan_experiment(array, asked, supply, hottest, current)
    else:
        made = make_plan(array, duration, current, supply, hottest, seed, board_alone)
    thermometers = "" if board_alone else " --thermometers PORT"
    head += [
        f"# {array.rows} x {array.cols} springs, {duration:g} s; at most {made.most_a:.2f} A of {supply:g}, "
        f"{made.hottest_c:.0f} degC of {hottest:g} if the array is as declared",
        f"# ninespring record --run {output.name} --duration {duration:g} --port PORT{thermometers} -o run1.csv",
    ]
    write({output: "\n".join([*head, *made.steps]) + "\n"})
    beside(output).print(
        f"{len(made.steps)} steps -> {output}: at most {made.most_a:.2f} A, {made.hottest_c:.0f} degC; each spring is on "
        f"for {100 * made.share_on.min():.0f} to {100 * made.share_on.max():.0f} % of the time",
        soft_wrap=True,
    )


def asked_for(path: Path) -> tuple[str, results.Experiment]:
    """Return the first experiment that a diagnosis.json asks for, and that in words."""
    try:
        rivals = json.loads(read_bytes(path))["rivals"]
        found = next((one for one in rivals if one.get("experiment", {}).get("steps")), None)
        if found:
            return str(found["separating_experiment"]), results.read(results.Experiment, found["experiment"])
    except (ValueError, KeyError, TypeError, AttributeError):
        raise InputError("no diagnosis.json that `ninespring diagnose` wrote", path) from None
    raise InputError("asks for no experiment: these logs tell all effects apart", path)
