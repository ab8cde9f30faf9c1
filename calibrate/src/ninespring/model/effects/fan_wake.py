"""The fan's air carries heat from one spring to the next."""

from collections.abc import Iterator

from .effect import Candidate, Effect, Scene, Steady, linear, one_number, says

NAME = "wake_w_per_k"


def _candidates(scene: Scene) -> Iterator[Candidate]:
    if not scene.fan_seen:
        return
    for direction, (towards, count) in enumerate(
        (("east", scene.cols), ("south", scene.rows), ("west", scene.cols), ("north", scene.rows))
    ):
        if count > 1:
            fixed = (("wake_direction", float(direction)),)
            yield one_number(linear(NAME, 0.0, 0.05, 1e-3, 1e-3), 1e-3, towards, fixed=fixed, most=5.0)


EFFECT = Effect(
    "fan_wake",
    _candidates,
    Steady(NAME, 0.0, 0.0113, {"wake_direction": 0.0}, against="it needs the fan, yet the error is there without it"),
    says=says("The fan's air carries {} from spring to spring, to the {variant}.", NAME, "mW/K", 1e3),
)
