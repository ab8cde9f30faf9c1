"""One spring differs from the others in loss and in heat capacity, or each does."""

from collections.abc import Iterator, Mapping

from ..spec import Free
from .effect import Candidate, Effect, Numbers, Scene, Steady, linear, percent

NAME = "spring_mismatch"
EACH = "each its own"
EACH_IN_WORDS = "each spring differs from the others"
APART = 0.1
"""What is believed before of how far springs that are made alike lie apart, as a part."""


def each_its_own(scene: Scene, apart: Mapping[str, float] | None = None) -> Candidate | None:
    """Return how all springs may differ, none where there is one: random effects about what the array's numbers say, as far apart as
    is known of losses and heat capacities."""
    if scene.springs < 2:
        return None
    known = {"loss_scale": APART, "heat_capacity_scale": APART} | dict(apart or {})
    keys = [f"{name}[{k}]" for name in known for k in range(1, scene.springs + 1)]
    free = tuple(
        Free(key, 1.0, 0.2, 5.0, "1", (key,), True, effect=NAME, prior=known[key.partition("[")[0]]) for key in keys
    )
    return Candidate(EACH, free, (dict.fromkeys(keys, 1.0),), NAME, signed=True, most=5.0, neutral=1.0)


def _candidates(scene: Scene) -> Iterator[Candidate]:
    if scene.springs < 2:
        return
    for k in range(1, scene.springs + 1):
        loss, mass = f"loss_scale[{k}]", f"heat_capacity_scale[{k}]"
        yield Candidate(
            f"spring {k}",
            (linear(loss, 0.2, 5.0, 1.0, 0.15), linear(mass, 0.2, 5.0, 1.0, 0.15)),
            ({loss: 1.15, mass: 1.0}, {loss: 1.0, mass: 1.15}),
            signed=True,
            most=5.0,
        )


def _says(numbers: Numbers, variant: str) -> str:
    if variant == EACH:
        losses = [
            f"{percent(*one)} ({name.partition('[')[2][:-1]})"
            for name, one in numbers.items()
            if name.startswith("loss_scale")
        ]
        return f"Each spring loses its own: {', '.join(losses)}."
    k = variant.removeprefix("spring ")
    loss, mass = numbers[f"loss_scale[{k}]"], numbers[f"heat_capacity_scale[{k}]"]
    said = f"Spring {k} loses {percent(*loss)}"
    if abs(mass[0] - 1.0) > 2.0 * (mass[1] or 0.0):
        said += f", and holds {percent(*mass)} heat"
    return said + "."


EFFECT = Effect(
    NAME,
    _candidates,
    Steady(
        "loss_scale",
        0.05,
        5.0,
        of_one_spring=True,
        against="one spring of nine made alike would have to lose that much less than its neighbours, at every pitch, "
        "after each rebuild",
    ),
    says=_says,
)
