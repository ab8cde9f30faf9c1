"""One spring differs from the others in loss and in heat capacity."""

from collections.abc import Iterator

from .effect import Candidate, Effect, Numbers, Scene, Steady, linear, percent


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
    k = variant.removeprefix("spring ")
    loss, mass = numbers[f"loss_scale[{k}]"], numbers[f"heat_capacity_scale[{k}]"]
    said = f"Spring {k} loses {percent(*loss)}"
    if abs(mass[0] - 1.0) > 2.0 * (mass[1] or 0.0):
        said += f", and holds {percent(*mass)} heat"
    return said + "."


EFFECT = Effect(
    "spring_mismatch",
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
