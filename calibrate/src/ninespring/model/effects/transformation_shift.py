"""A spring transforms elsewhere: by the load that was logged, or always, as one of another batch of wire does."""

from collections.abc import Iterator

from ..simulate import SHIFT_PER_N
from .effect import Candidate, Effect, Numbers, Scene, linear, one_number, sized

LOADED = "by the logged load"


def _candidates(scene: Scene) -> Iterator[Candidate]:
    # it shows by what goes with a transformation: beside latent heat, or the resistance of the phases
    if scene.hottest_c < scene.declared("austenite_start_c") - 45.0:
        return
    if scene.load_moves:
        starts = {SHIFT_PER_N: 6.0}, {SHIFT_PER_N: -6.0}
        number = linear(SHIFT_PER_N, -20.0, 20.0, 0.0, 1.0)
        yield one_number(number, 2.0, LOADED, signed=True, most=8.0, more_starts=starts)
    if scene.springs < 2:
        return
    for k in range(1, scene.springs + 1):
        name = f"transformation_shift_k[{k}]"
        number, starts = linear(name, -40.0, 40.0, 0.0, 3.0), ({name: 10.0}, {name: -10.0})
        yield one_number(number, 3.0, f"spring {k}", signed=True, most=5.0, more_starts=starts)


def _says(numbers: Numbers, variant: str) -> str:
    (value, error), *_ = numbers.values()
    if variant == LOADED:
        return f"Each newton of load moves the transformation by {sized(value, error, 'K')}."
    word = "higher" if value > 0 else "lower"
    return f"{variant.capitalize()} transforms {sized(abs(value), error, 'K')} {word} than the others."


EFFECT = Effect("transformation_shift", _candidates, says=_says)
