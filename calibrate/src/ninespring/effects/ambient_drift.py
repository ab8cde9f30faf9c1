"""The surroundings change during the run: steadily, or bent between knots of each run's own."""

from collections.abc import Iterator

from ..fit.spec import Free
from .effect import Candidate, Effect, Numbers, Scene, linear, sized

KINDS = (("free", "ambient_drift_k", 500.0), ("slow", "ambient_slow_drift_k", 1800.0))
"""Variants with knots: name, key of their numbers, the shortest run (s) that could show one."""


OFFSET_K = 3.0
"""What a logged ambient is believed to be off by where the springs are, standard deviation: each run's own."""


def _offsets(scene: Scene) -> tuple[Free, ...]:
    """Return how far each run's surroundings are from what was logged; where nothing was, they are fitted anyway."""
    return tuple(
        Free(f"ambient_offset_k@{r + 1}", 0.0, -10.0, 10.0, "K", (), False, run=r, scale=1.0, prior=OFFSET_K)
        for r, logged in enumerate(scene.ambient_logged)
        if logged
    )


def _candidates(scene: Scene) -> Iterator[Candidate]:
    ramp = "ambient_ramp_k_per_h"
    if offsets := _offsets(scene):
        still = (("ambient_amplitude_k", 0.0), (ramp, 0.0))
        probes = tuple({free.key: float(free is one) for free in offsets} for one in offsets)
        yield Candidate("offset", offsets, probes, fixed=still, signed=True, most=10.0)
        size = min(20.0, 3600.0 / max(60.0, scene.duration_s))
        bent = tuple(one | {ramp: 0.0} for one in probes)
        yield Candidate(
            "offset and ramp",
            (*offsets, linear(ramp, -100.0, 100.0, 2.0, 4.0)),
            (*bent, {free.key: 0.0 for free in offsets} | {ramp: size}),
            fixed=(("ambient_amplitude_k", 0.0),),
            signed=True,
            most=20.0,
        )
    yield Candidate(
        "ramp",
        (linear(ramp, -60.0, 60.0, 2.0, 4.0),),
        ({ramp: min(20.0, 3600.0 / max(60.0, scene.duration_s))},),
        fixed=(("ambient_amplitude_k", 0.0),),
        signed=True,
        most=20.0,
    )
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
    ramp = "ambient_ramp_k_per_h"
    values = [value for name, (value, _) in numbers.items() if name != ramp]
    said = f"are {', '.join(f'{value:+.1f}' for value in values)} K off what is logged, run by run" if values else ""
    if ramp in numbers:
        drift = f"drift by {sized(*numbers[ramp], 'K/h')}"
        return f"The surroundings {f'{said}, and ' if said else ''}{drift}."
    if variant == "offset":
        return f"The surroundings {said}."
    return f"The surroundings drift during the runs, by {max(values) - min(values):.1f} K."


EFFECT = Effect("ambient_drift", _candidates, says=_says)
