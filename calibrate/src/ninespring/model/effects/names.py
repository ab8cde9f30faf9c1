"""What the table of effects (lib/parameters/effects.def) says of each: its sentence, where it acts, why not on the chip."""

from __future__ import annotations

from .. import tables

IN_WORDS = {name: row.sentence for name, row in tables.effects().items()}
MEASUREMENT = frozenset(name for name, row in tables.effects().items() if row.acts == "measurement")
WHY_NOT_ON_CHIP = {name: row.not_on_chip for name, row in tables.effects().items() if row.not_on_chip}
ON_CHIP = frozenset(tables.effects()) - set(WHY_NOT_ON_CHIP)
