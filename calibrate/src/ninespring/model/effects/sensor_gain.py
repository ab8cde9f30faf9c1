"""The thermometers, or one of them, read in a wrong proportion or with an offset."""

from collections.abc import Iterable, Iterator

from ..spec import Free
from .effect import Candidate, Effect, Numbers, Scene, Steady, linear, percent, sized

GAIN, OFFSET = "sensor_gain", "sensor_offset_k"
BEHIND = "holder_mass", "plate_conduction"
"""What keeps heat behind springs, behind all of them alike."""
OR_ITS_SPRING = (
    "Or: its spring is unlike the others in what it is mounted on, in its drive, or in what neighbours give it. These readings do not "
    "tell which. "
    "Exchange two thermometers and record again: what goes along is the thermometer's."
)


def or_its_spring(variant: str, effects: Iterable[str], modes: Iterable[str]) -> bool:
    """Return whether the gain of one thermometer, in a model with these effects, may be its spring's.

    Of commands each drive's strength is fitted and takes up a gain but for what neighbours are given, and heat behind springs that are
    mounted unlike is in no model: a gain is where either goes.
    """
    return variant.startswith("sensor ") and (set(modes) == {"command"} or not set(BEHIND).isdisjoint(effects))


def _candidates(scene: Scene) -> Iterator[Candidate]:
    # of commands a gain of all is their power, and an offset the room's, where that was logged
    if scene.modes != {"command"} or not scene.ambient_logged:
        yield _off("all sensors", linear(GAIN, 0.7, 1.4, 1.02, 0.05), linear(OFFSET, -20.0, 20.0, 0.5, 1.0))
    for k in range(1, scene.springs + 1) if scene.springs > 1 else ():
        gain, offset = linear(f"{GAIN}[{k}]", 0.5, 2.0, 1.0, 0.05), linear(f"{OFFSET}[{k}]", -20.0, 20.0, 0.0, 1.0)
        yield _off(f"sensor {k}", gain, offset, ((GAIN, 1.0), (OFFSET, 0.0)))


def _off(variant: str, gain: Free, offset: Free, fixed: tuple[tuple[str, float], ...] = ()) -> Candidate:
    probes = {gain.key: 1.05, offset.key: 0.0}, {gain.key: 1.0, offset.key: 1.0}
    return Candidate(variant, (gain, offset), probes, fixed=fixed, signed=True, most=8.0)


def _says(numbers: Numbers, variant: str) -> str:
    one = f"Thermometer {variant.removeprefix('sensor ')} reads"
    gain, offset = (next(size for name, size in numbers.items() if name.startswith(of)) for of in (GAIN, OFFSET))
    which = "All thermometers read" if variant == "all sensors" else one
    return f"{which} {percent(*gain)} of the rise, off by {sized(*offset, 'K')}."


EFFECT = Effect(
    GAIN,
    _candidates,
    Steady(
        GAIN,
        0.5,
        2.5,
        {OFFSET: 0.0},
        against="the same gain would apply to the hot springs: they would have shown far above the 99 they did",
    ),
    says=_says,
)
