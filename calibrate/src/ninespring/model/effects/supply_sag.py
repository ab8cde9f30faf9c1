"""The supply gives less while other springs draw: visible where only the command is logged."""

from collections.abc import Iterator

from .effect import Candidate, Effect, Scene, linear, one_number, says


def _candidates(scene: Scene) -> Iterator[Candidate]:
    if "command" not in scene.modes or scene.springs < 2:
        return
    name = "supply_resistance_ohm"
    total = max(1e-3, scene.declared("command_power_w")) * scene.springs
    size = 0.1 * scene.declared("supply_v") ** 2 / total
    for chopped, variant in enumerate(("loads that draw their mean", "chopped loads")):
        number, fixed = linear(name, 0.0, 100.0, size, size), (("supply_chopped", float(chopped)),)
        yield one_number(number, size, variant, fixed=fixed, most=6.0, law=True, more_starts=({name: 0.3 * size},))


EFFECT = Effect(
    "supply_sag",
    _candidates,
    says=says("The supply sags under load: {} in front of {variant}.", "supply_resistance_ohm", "ohm"),
)
