"""The alloy as it is: where it transforms and how wide its hysteresis is, beside what was declared."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from ..spec import Free
from .effect import Scene

VARIANT = "alloy as found"
SHIFT, HYSTERESIS = "alloy_shift_k", "hysteresis_change_k"
HEATING, COOLING = "heating_width_change_k", "cooling_width_change_k"
STILL = {HYSTERESIS: 0.0, HEATING: 0.0, COOLING: 0.0}
"""All but where it transforms, as declared."""
FARTHEST_K = 45.0
WIDTHS = 5.0
"""Spread of the bands, and of what lies between their starts, one sigma in the inner coordinate: 10 K (87 samples of NiTi: quartiles
14 to 27, 16 to 31 and 6 to 21 K)."""
LEAST_GAP_K = -30.0
"""From M_s to A_s: bands overlap in 7 % of the samples. A loop must be closed: the plant refuses one that is not."""
USUAL_K = 20.0
"""Width of a band, by those samples."""
CLOSED_K = 4.0
"""Between the middles of the bands of a narrow loop: an R-phase's, or of a wire that is loaded and trained."""
OPEN_K = 1e-3
"""By how much a loop is open at least: less does not survive the seven digits of model.toml, and the plant refuses one that is not."""
STEP_K = 5.0
"""Places of the transformation that are tried: half its usual width apart."""


def numbers(scene: Scene) -> tuple[Free, ...]:
    """Return the alloy's numbers, all 0 where it is as declared."""
    get = scene.declared
    gap = get("austenite_start_c") - get("martensite_start_c")
    heating = get("austenite_finish_c") - get("austenite_start_c")
    cooling = get("martensite_start_c") - get("martensite_finish_c")
    start, finish = ("austenite_start_c", "martensite_start_c"), ("austenite_finish_c", "martensite_finish_c")
    everything = tuple((name, 1.0) for name in (*start, *finish))
    opened = tuple((name, 0.5 if name.startswith("austenite") else -0.5) for name in (*start, *finish))
    # what is believed before: batches and loads shift a declared alloy by some 15 K
    ends = ("austenite_finish_c", 1.0), ("martensite_finish_c", -1.0)
    return (
        _change(SHIFT, -FARTHEST_K, FARTHEST_K, everything, 5.0, 3.0),
        _change(HYSTERESIS, LEAST_GAP_K - gap, 40.0, opened, WIDTHS),
        _change(HEATING, 0.5 - heating, 40.0, ends[:1], WIDTHS),
        _change(COOLING, 0.5 - cooling, 40.0, ends[1:], WIDTHS),
    )


def _change(
    key: str, low: float, high: float, shifts: tuple[tuple[str, float], ...], prior: float, scale: float = 2.0
) -> Free:
    return Free(key, 0.0, low, high, "K", scale=scale, shifts=shifts, prior=prior)


def places(scene: Scene) -> list[dict[str, float]]:
    """Return the alloys worth trying: as declared, and with bands as they mostly are about the same middles, wherever the hottest
    spring would transform."""
    get, most = scene.declared, int(FARTHEST_K / STEP_K)
    wider = {
        HEATING: max(0.0, USUAL_K - get("austenite_finish_c") + get("austenite_start_c")),
        COOLING: max(0.0, USUAL_K - get("martensite_start_c") + get("martensite_finish_c")),
    }
    bands = [STILL, wider | {HYSTERESIS: -0.5 * sum(wider.values())}] if any(wider.values()) else [STILL]
    shifts = [STEP_K * k for k in range(-most + 1, most)]
    return [{SHIFT: s} | one for one in bands for s in shifts if get("austenite_start_c") + s < scene.hottest_c]


def shut(numbers: Mapping[str, float]) -> bool:
    """Return whether these parameters of the plant, where they are an alloy's that is fitted, make a loop that is hardly open."""
    pairs = ("martensite_start_c", "austenite_finish_c"), ("martensite_finish_c", "austenite_start_c")
    return any(low in numbers and high in numbers and numbers[high] - numbers[low] < OPEN_K for low, high in pairs)


def closed(place: Mapping[str, float], get: Callable[[str], float]) -> dict[str, float]:
    """Return a place with its bands as wide as they mostly are, about nearly the same middle: a narrow loop."""
    heating = get("austenite_finish_c") - get("austenite_start_c")
    cooling = get("martensite_start_c") - get("martensite_finish_c")
    apart = get("austenite_start_c") - get("martensite_start_c") + 0.5 * (heating + cooling)
    wider = {HEATING: USUAL_K - heating, COOLING: USUAL_K - cooling}
    return dict(place) | wider | {HYSTERESIS: CLOSED_K - apart - 0.5 * sum(wider.values())}
