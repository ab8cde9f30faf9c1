"""The surroundings change during the run: steadily, or bent between knots of each run's own."""

from collections.abc import Iterator

from ..spec import Free
from .effect import Candidate, Effect, Numbers, Scene, linear, one_number, sized

KINDS = (("free", "ambient_drift_k", 500.0), ("slow", "ambient_slow_drift_k", 1800.0))
"""Variants with knots: name, key of their numbers, the shortest run (s) that could show one."""

MOST_K_PER_H = 20.0
"""No room goes on faster: what does so in a run of minutes is heat nearer to the springs, and goes on in no longer one."""


def _candidates(scene: Scene) -> Iterator[Candidate]:
    ramp = "ambient_ramp_k_per_h"
    number, probe = linear(ramp, -MOST_K_PER_H, MOST_K_PER_H, 2.0, 4.0), min(20.0, 3600.0 / max(60.0, scene.duration_s))
    yield one_number(number, probe, "ramp", fixed=(("ambient_amplitude_k", 0.0),), signed=True, most=20.0)
    for variant, key, shortest_s in KINDS:
        if scene.duration_s < shortest_s:
            continue
        free = tuple(
            Free(f"{key}@{r + 1}.{k}", 0.0, -6.0, 6.0, "K", (), False, run=r, knot=k, scale=1.0)
            for r, count in enumerate(scene.knots[key])
            for k in range(1, count + 1)
        )
        yield Candidate(
            variant,
            free,
            tuple({f.key: float(f is one) for f in free} for one in free),
            fixed=(("ambient_amplitude_k", 0.0), (ramp, 0.0)),
            signed=True,
            most=10.0,
            flexible=True,
        )


def _says(numbers: Numbers, variant: str) -> str:
    if "ambient_ramp_k_per_h" in numbers:
        return f"The surroundings drift by {sized(*numbers['ambient_ramp_k_per_h'], 'K/h')}."
    values = [value for value, _ in numbers.values()]
    return f"The surroundings drift during the runs, by {max(values) - min(values):.1f} K."


EFFECT = Effect("ambient_drift", _candidates, says=_says)
