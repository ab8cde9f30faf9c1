"""Which of the chip's settings a model determines, and which stay as the chip has them, and why.

Nothing lists which setting follows from which number: each determined number is moved, and the settings that move with
it are the ones it determines.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..io import results
from ..io.board import as_lines
from ..model import effects, native
from ..model.models import Model
from ..model.simulate import array_parameters, board_settings

TEMPERATURES = ("martensite_finish_c", "martensite_start_c", "austenite_start_c", "austenite_finish_c")
FIRMWARE_EFFECTS = ("latent_heat", "resistance_phase")
"""What the firmware's defaults carry: what no log determines keeps these."""
KNOWN = 0.5
"""A number is known, or known not to be there, where what it may be off by is less than this part of it."""
CROSSED = 3.0
"""Standard errors of where a transformation ends, by which a spring must have been beyond it: a fit takes for its end what
was reached."""


@dataclass
class Settings:
    """Console lines of a model, and what was left to the chip."""

    written: dict[str, str]
    """Setting, value as text."""
    kept: dict[str, str]
    """Setting that is not written, and why."""
    remarks: str
    """What the chip takes otherwise than the model has it, in words."""

    @property
    def lines(self) -> str:
        """Console lines, one a setting."""
        return as_lines(self.written)


def best_plant(model: Model, numbers: dict[str, float] | None = None) -> native.Plant:
    """Return the plant as it is best known: the firmware's declared spring with all that the model says over it."""
    plant = native.Plant(model.array.rows, model.array.cols)
    table = native.parameter_table()
    values = array_parameters(model.array) | model.parameters | (numbers or {})
    said = {table[name.partition("[")[0]].effect for name in values} & set(FIRMWARE_EFFECTS)
    plant.set_effects({*model.effects, *FIRMWARE_EFFECTS, *said} - effects.MEASUREMENT)
    plant.set_all({name: value for name, value in values.items() if name != "resistance_ohm"})
    return plant


def determined(model: Model) -> dict[str, str]:
    """Return the model's numbers that may be written, and why each of the others may not ('' where it may).

    Numbers that are known in combination only are written together: one without the other would be wrong.
    """
    table = native.parameter_table()
    out: dict[str, str] = dict.fromkeys(array_parameters(model.array), "")
    uncrossed = not_crossed(model)
    for name, value in model.parameters.items():
        known, error = table[name.partition("[")[0]], model.stderr.get(name)
        of_phases = known.effect in FIRMWARE_EFFECTS
        if name in model.kept:
            out[name] = model.kept[name]
        elif error is None and known.effect not in model.effects:
            continue
        elif uncrossed and (known.name in TEMPERATURES or (of_phases and known.effect in model.effects)):
            out[name] = uncrossed
        elif known.effect is None or (known.effect in model.effects and not of_phases):
            out[name] = ""
        elif error is not None:
            size = max(abs(known.default), abs(value) if known.effect in model.effects else 0.0)
            out[name] = "" if error < KNOWN * size else "the log says too little of it"
        else:
            out[name] = ""
    return out


def not_crossed(model: Model) -> str:
    """Return why a model's transformation stays as the chip has it, '' where a spring was seen to go through all of it."""
    hottest = model.provenance.get("hottest_c")
    finish, error = best_plant(model).get("austenite_finish_c"), model.stderr.get("austenite_finish_c", 0.0)
    if hottest is None or hottest >= finish + CROSSED * error:
        return ""
    end = f"{finish:.1f} +- {error:.1f} degC" if error else f"{finish:.1f} degC"
    return (
        f"the log's hottest spring reached {hottest:.1f} degC, which is not clearly beyond the end of the transformation "
        f"({end}): transformation kept as it is. Drive one spring through it: "
        f"ninespring plan --through {(model.array.springs + 1) // 2} --model {model.name or 'model.toml'} -o steps.txt"
    )


def left_out(model: Model) -> dict[str, str]:
    """Return the effects of a model of which nothing goes into the chip, and why: what report, diagnosis.json and export tell.

    An effect of the thermometers or of that day never does; any other does with the numbers of it that may be written.
    """
    why = determined(model)
    table = native.parameter_table()
    out = {}
    for effect in model.effects:
        # what array.toml declares of it is no part of what was found
        of_it = [
            why[name] for name in model.parameters if name in why and table[name.partition("[")[0]].effect == effect
        ]
        if effect in effects.WHY_NOT_ON_CHIP:
            out[effect] = effects.WHY_NOT_ON_CHIP[effect]
        elif of_it and all(of_it):
            out[effect] = of_it[0]
    return out


def judged(listed: Sequence[results.Effect], model: Model) -> None:
    """Say of effects as diagnosis.json lists them whether they go into the chip, and why not."""
    left = left_out(model)
    for one in listed:
        # not in the model (v / i alone names it, a run's own): never exported
        why = left.get(one.name, "" if one.name in model.effects else "it is not in model.toml")
        why = effects.WHY_NOT_ON_CHIP.get(one.name, why)
        one.on_chip, one.why_not_on_chip = not why, why or results.UNSET


def together(kept: Mapping[str, str], written: Mapping[str, str]) -> dict[str, list[str]]:
    """Return what is not written, by reason: settings of all springs as one name, of some of them by their numbers."""
    base = lambda name: re.sub(r"_\d+$", "", name)  # noqa: E731
    mixed = {base(name) for name in written}
    out: dict[str, list[str]] = {}
    for name, why in kept.items():
        said = base(name)
        others = {reason for other, reason in kept.items() if base(other) == said}
        out.setdefault(why, []).append(name if said in mixed or len(others) > 1 else said)
    return {why: list(dict.fromkeys(names)) for why, names in out.items()}


def _lines(plant: native.Plant) -> tuple[dict[str, str], str]:
    text, remarks = native.chip_export(plant)
    return dict(line[1:].split("=", 1) for line in text.splitlines()), remarks


def _moved(plant: native.Plant, name: str) -> native.Plant:
    """Return a copy of a plant in which one number is clearly another."""
    known = native.parameter_table()[name.partition("[")[0]]
    twin = plant.copy()
    value = twin.get(name)
    span = known.maximum - known.minimum
    # clearly more than the last digit that the chip holds of it
    step = max(0.1 * abs(value), 0.05 * abs(known.default)) or min(0.05 * span, 1.0)
    if float(value).is_integer() and span <= 8:
        step = 1.0
    for other in (value + step, value - step, value + 0.1 * step, value - 0.1 * step):  # a narrow transformation: less
        if known.minimum <= other <= known.maximum:
            try:
                twin.set(name, other)
                native.chip_export(twin)
            except Exception:
                twin.set(name, value)
                continue
            return twin
    return twin


def settings_of(model: Model) -> Settings:
    """Return the settings that a model determines; refused (WorkError) where one does not fit the chip, InputError where it has several."""
    model.array.one_board("settings are of")
    why = determined(model)
    declared = array_parameters(model.array)
    told = {name: value for name, value in model.parameters.items() if not why.get(name)}
    plant = best_plant(replace(model, parameters=told))
    full, remarks = _lines(plant)
    wanted = {"rows", "columns"} & set(full)

    def moves(name: str) -> set[str]:
        moved, _ = _lines(_moved(plant, name))
        return {key for key in full if moved.get(key) != full[key]}

    weak: dict[str, str] = {}
    for name, reason in why.items():
        if reason and name not in declared:
            weak |= dict.fromkeys(moves(name), reason)
        else:
            wanted |= moves(name)
    for name, known in native.parameter_table().items():
        # what also follows from a number of the firmware's that no log determined stays the firmware's
        if known.effect in FIRMWARE_EFFECTS and name not in why:
            wanted -= moves(name)
    written = {name: value for name, value in full.items() if name in wanted}
    kept = {name: weak.get(name) or _reason(model, name) for name in full if name not in wanted}
    written |= {name: f"{value:.3f}" for name, value in board_settings(model.array).items()}
    return Settings(written, kept, remarks)


def _reason(model: Model, setting: str) -> str:
    table = native.parameter_table()
    known = table.get(setting.rstrip("0123456789").rstrip("_")) or table.get(setting)
    if (setting == "latent_heat_j" or setting in TEMPERATURES) and (why := not_crossed(model)):
        return why
    if known is not None and known.effect and known.effect not in model.effects:
        return f"the diagnosis named no {known.effect}"
    return "these logs do not determine it"


def draw(model: Model, rng: np.random.Generator) -> dict[str, float]:
    """Return the model's numbers once more, each moved by its standard error's chance."""
    table = native.parameter_table()
    out = {}
    for name, error in model.stderr.items():
        known, value = table[name.partition("[")[0]], model.parameters[name]
        if error > 0.2 * abs(value):  # known in combination only: moved alone it would be no array that fits the logs
            continue
        moved = value + error * rng.standard_normal()
        out[name] = min(known.maximum, max(known.minimum, moved))
    return out
