"""The thermometers, or one of them, read in a wrong proportion or with an offset."""

from collections.abc import Iterator

from .effect import Candidate, Effect, Numbers, Scene, Steady, linear, percent, sized


def _candidates(scene: Scene) -> Iterator[Candidate]:
    gain, offset = "sensor_gain", "sensor_offset_k"
    yield Candidate(
        "all sensors",
        (linear(gain, 0.7, 1.4, 1.02, 0.05), linear(offset, -20.0, 20.0, 0.5, 1.0)),
        ({gain: 1.05, offset: 0.0}, {gain: 1.0, offset: 1.0}),
        signed=True,
        most=8.0,
    )
    for k in range(1, scene.springs + 1) if scene.springs > 1 else ():
        own, its = f"{gain}[{k}]", f"{offset}[{k}]"
        yield Candidate(
            f"sensor {k}",
            (linear(own, 0.5, 2.0, 1.0, 0.05), linear(its, -20.0, 20.0, 0.0, 1.0)),
            ({own: 1.05, its: 0.0}, {own: 1.0, its: 1.0}),
            fixed=((gain, 1.0), (offset, 0.0)),
            signed=True,
            most=8.0,
        )


def _says(numbers: Numbers, variant: str) -> str:
    which = (
        "All thermometers read" if variant == "all sensors" else f"Thermometer {variant.removeprefix('sensor ')} reads"
    )
    gain = next(value for name, value in numbers.items() if name.startswith("sensor_gain"))
    offset = next(value for name, value in numbers.items() if name.startswith("sensor_offset_k"))
    return f"{which} {percent(*gain)} of the rise, off by {sized(*offset, 'K')}."


EFFECT = Effect(
    "sensor_gain",
    _candidates,
    Steady(
        "sensor_gain",
        0.5,
        2.5,
        {"sensor_offset_k": 0.0},
        against="the same gain would apply to the hot springs: they would have shown far above the 99 they did",
    ),
    says=_says,
)
