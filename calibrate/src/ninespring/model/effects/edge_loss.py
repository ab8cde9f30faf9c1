"""Outer springs lose more heat: per free side, or all of them alike."""

from collections.abc import Iterator

from ..spec import Free
from .effect import Candidate, Effect, Numbers, Scene, Steady, linear, one_number, percent


def _candidates(scene: Scene) -> Iterator[Candidate]:
    if scene.springs < 5 or not scene.plane:
        return
    name = "edge_loss_fraction"
    yield one_number(linear(name, -0.2, 1.5, 0.1, 0.1), 0.1, "per free side", signed=True, most=5.0)
    cols = scene.cols
    outer = [k for k in range(scene.springs) if k // cols in (0, scene.rows - 1) or k % cols in (0, cols - 1)]
    if len(outer) < scene.springs:
        names = tuple(f"loss_scale[{k + 1}]" for k in outer)
        number = Free("outer_loss_scale", 1.2, 0.3, 4.0, "1", names, False, scale=0.2)
        more = {"signed": True, "most": 5.0, "neutral": 1.0, "also_on": ("spring_mismatch",)}
        yield one_number(number, 1.2, "outer springs alike", fixed=((name, 0.0),), **more)


def _says(numbers: Numbers, variant: str) -> str:
    if "edge_loss_fraction" in numbers:
        value, error = numbers["edge_loss_fraction"]
        return f"Outer springs lose {percent(1.0 + value, error)} for each free side."
    return f"Outer springs lose {percent(*numbers['outer_loss_scale'])}."


EFFECT = Effect("edge_loss", _candidates, Steady("edge_loss_fraction", -0.2, 2.0), says=_says)
