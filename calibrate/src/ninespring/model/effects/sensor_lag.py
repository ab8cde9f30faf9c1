"""The thermometers follow late."""

from collections.abc import Callable, Iterator, Mapping

from .effect import Candidate, Effect, Scene, one_number, positive, says

LAG, HEAT, LOSS = "sensor_lag_s", "heat_capacity_j_per_k", "loss_w_per_k"
POWERS = (LOSS, "loss_fan_w_per_k", "orthogonal_", "diagonal_", "command_power_w")
"""What is known in proportion to the heat capacity alone where only commands were logged."""


def _mirror(values: Mapping[str, float], get: Callable[[str], float]) -> Mapping[str, float]:
    """Return numbers with which springs are as quick as their thermometers were, and those as slow as the springs: of a spring alone they
    show the same, and only what its neighbours show tells which it is."""
    lag, heat, loss = (values.get(name, get(name)) for name in (LAG, HEAT, LOSS))
    slow = {LAG: heat / loss}
    if HEAT in values:
        return slow | {HEAT: loss * lag}
    return slow | {key: heat / (loss * lag) * value for key, value in values.items() if key.startswith(POWERS)}


def _candidates(scene: Scene) -> Iterator[Candidate]:
    step = scene.step_s
    number = positive(LAG, 0.02 * step, 600.0, 4.0 * step)
    # of a spring alone nothing tells, and what touches it is the quicker one
    mirror = _mirror if scene.springs > 1 else None
    yield one_number(number, 3.0 * step, most=8.0, more_starts=({LAG: 15.0 * step},), mirror=mirror)


EFFECT = Effect("sensor_lag", _candidates, says=says("The thermometers lag {}.", LAG, "s"))
