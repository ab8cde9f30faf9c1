"""The tables that Python reads are those that the firmware and the plant were compiled from."""

from ninespring.model import native, tables


def test_a_row_arrives_with_its_numbers_in_the_unit() -> None:
    row = tables.settings()["resistance_martensite_rise_per_k"]
    assert (row.unit, row.part, row.effect, row.per_spring) == ("1/K", "model", "resistance_temperature", False)
    assert (row.minimum, row.maximum, row.default, row.resolution) == (-0.003, 0.005, 0.0, 1e-6)
    assert tables.settings()["loss_scale"].per_spring


def test_effects_are_the_plants_in_its_order() -> None:
    assert tuple(tables.effects()) == native.effect_names()
    assert tables.effects()["sensor_lag"].acts == "measurement"
    assert tables.effects()["latent_heat"].not_on_chip is None
    assert {row.effect for row in tables.settings().values()} - {None} <= set(tables.effects())


def test_the_plant_takes_what_it_shares_with_the_chip_from_the_same_rows() -> None:
    shared = {name: row for name, row in tables.settings().items() if row.part == "model"}
    plant = native.parameter_table()
    assert len(shared.keys() & plant.keys()) > 20
    for name in shared.keys() & plant.keys():
        assert plant[name].unit == (shared[name].unit or "1")
        assert plant[name].effect == shared[name].effect
        assert plant[name].description == shared[name].sentence
        off = 0.5 if name == "fan_half_share" else 0.0  # in proportion: no curve
        switched_off = shared[name].default == off and shared[name].effect is not None
        assert plant[name].default == shared[name].default or switched_off, name
