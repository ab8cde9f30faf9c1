"""Outer springs lose more heat: per free side, or all of them alike."""

from collections.abc import Iterator

from ..spec import Free
from .effect import Candidate, Effect, Numbers, Scene, Steady, linear, percent


def _candidates(scene: Scene) -> Iterator[Candidate]:
    if scene.springs < 5 or not scene.plane:
        return
    name = "edge_loss_fraction"
    yield Candidate("per free side", (linear(name, -0.2, 1.5, 0.1, 0.1),), ({name: 0.1},), signed=True, most=5.0)
    cols = scene.cols
    outer = [k for k in range(scene.springs) if k // cols in (0, scene.rows - 1) or k % cols in (0, cols - 1)]
    if len(outer) < scene.springs:
        key = "outer_loss_scale"
        names = tuple(f"loss_scale[{k + 1}]" for k in outer)
        yield Candidate(
            "outer springs alike",
            (Free(key, 1.2, 0.3, 4.0, "1", names, False, scale=0.2),),
            ({key: 1.2},),
            fixed=((name, 0.0),),
            signed=True,
            most=5.0,
            neutral=1.0,
            also_on=("spring_mismatch",),
        )


def _says(numbers: Numbers, variant: str) -> str:
    if "edge_loss_fraction" in numbers:
        value, error = numbers["edge_loss_fraction"]
        return f"Outer springs lose {percent(1.0 + value, error)} for each free side."
    return f"Outer springs lose {percent(*numbers['outer_loss_scale'])}."


EFFECT = Effect("edge_loss", _candidates, Steady("edge_loss_fraction", -0.2, 2.0), says=_says)
