"""Heat radiates away with the fourth power of temperature."""

from collections.abc import Iterator

from .effect import Candidate, Effect, Numbers, Scene, Steady, linear, one_number, sized

LARGEST = 30.0
"""Times the declared surface that what radiates is believed to be at most, where it is known in proportion only."""


def _candidates(scene: Scene) -> Iterator[Candidate]:
    if scene.modes == {"command"}:
        # watts are known in proportion to the declared heat capacity only, and so is the surface: none is as black as black of it
        declared = scene.declared("surface_mm2")
        number = linear("surface_mm2", 1.0, min(1e5, LARGEST * declared), 0.4 * declared, 0.3 * declared)
        yield one_number(number, 0.6 * declared, fixed=(("emissivity", 1.0),), most=LARGEST, neutral=1.0)
    else:
        yield one_number(linear("emissivity", 0.0, 1.0, 0.4, 0.3), 0.6, most=1.7)


def _says(numbers: Numbers, variant: str) -> str:
    if "emissivity" in numbers:
        return f"Heat radiates away: emissivity {sized(*numbers['emissivity'])}."
    return f"Heat radiates away as from {sized(*numbers['surface_mm2'], 'mm2')} of a black surface."


EFFECT = Effect(
    "radiation",
    _candidates,
    Steady("emissivity", 0.0, 1.0, against="it only adds loss: the undriven spring would be colder, not warmer"),
    says=_says,
)
