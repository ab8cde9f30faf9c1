"""The effects that a diagnosis knows, one file each: numbers, bounds, variants, sizes to try.

A file of this folder with an `EFFECT` is in the library; nothing else lists them. Order, sentences and where an effect
acts are the table's (`native.effects`).
"""

from __future__ import annotations

import functools
import importlib
import pkgutil

from ...io.results import Parameters
from .. import native, tables
from . import plate_conduction, runs_differ, spring_mismatch
from .effect import Candidate as Candidate
from .effect import Effect as Effect
from .effect import Scene as Scene
from .effect import Steady as Steady

IN_WORDS = {name: row.sentence for name, row in tables.effects().items()}
MEASUREMENT = frozenset(name for name, row in tables.effects().items() if row.acts == "measurement")
WHY_NOT_ON_CHIP = {name: row.not_on_chip for name, row in tables.effects().items() if row.not_on_chip}
ON_CHIP = frozenset(tables.effects()) - set(WHY_NOT_ON_CHIP)
"""What the table of effects (lib/parameters/effects.def) says of each: its sentence, where it acts, why not on the chip."""
VARIANT_IN_WORDS = {
    (spring_mismatch.NAME, spring_mismatch.EACH): spring_mismatch.EACH_IN_WORDS,
    ("plate_conduction", plate_conduction.ALONE): plate_conduction.ALONE_IN_WORDS,
}
"""What that table has no sentence for."""


def in_words(name: str, variant: str = "") -> str:
    """Return what an effect is, in words."""
    return VARIANT_IN_WORDS.get((name, variant), IN_WORDS[name])


@functools.cache
def library() -> tuple[Effect, ...]:
    """Return every effect of this folder, in the table's order."""
    modules = (importlib.import_module(f"{__name__}.{one.name}") for one in pkgutil.iter_modules(__path__))
    known = [module.EFFECT for module in modules if hasattr(module, "EFFECT")]
    return tuple(sorted(known, key=lambda one: native.effect_names().index(one.name)))


def sentence(name: str, parameters: Parameters, variant: str = "") -> str:
    """Return what was found of an effect, in words and sizes."""
    return next(one for one in (*library(), *runs_differ.EFFECTS) if one.name == name).sentence(parameters, variant)


def candidates(scene: Scene) -> list[Candidate]:
    """Return every effect, in every variant, that logs could show."""
    return [candidate for effect in library() for candidate in effect.candidates_for(scene)]


of_runs = runs_differ.candidates
of_springs = spring_mismatch.each_its_own
