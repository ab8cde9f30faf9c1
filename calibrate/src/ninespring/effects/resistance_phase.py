"""Resistance, and with it the heat of a given current, depends on the phase."""

from collections.abc import Iterator

from .effect import Candidate, Effect, Scene, Steady, linear


def _candidates(scene: Scene) -> Iterator[Candidate]:
    if "current" in scene.modes and scene.transforms:
        name, martensite = "resistance_austenite_ohm", scene.declared("resistance_martensite_ohm")
        yield Candidate(
            "",
            (linear(name, 0.5 * martensite, 2.0 * martensite, 1.2 * martensite, 0.2 * martensite),),
            ({name: 1.15 * martensite},),
            signed=True,
            neutral=martensite,
            more_starts=({name: 0.85 * martensite}, {name: 1.25 * martensite}),
        )


EFFECT = Effect("resistance_phase", _candidates, Steady("resistance_austenite_ohm", 0.1, 0.4))
