"""The thermometers follow late."""

from collections.abc import Iterator

from .effect import Candidate, Effect, Scene, one_number, positive, says


def _candidates(scene: Scene) -> Iterator[Candidate]:
    name, step = "sensor_lag_s", scene.step_s
    number = positive(name, 0.02 * step, 600.0, 4.0 * step)
    yield one_number(number, 3.0 * step, most=8.0, more_starts=({name: 15.0 * step},))


EFFECT = Effect("sensor_lag", _candidates, says=says("The thermometers lag {}.", "sensor_lag_s", "s"))
