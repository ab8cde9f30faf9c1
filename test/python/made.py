"""Results as a diagnosis would say them, for the tests of what is made of them."""

from __future__ import annotations

from typing import Any

from ninespring.io import results


def an_effect(name: str, **fields: Any) -> results.Effect:
    """Return an effect with these fields; what is not given is of no interest."""
    plain: dict[str, Any] = {
        "rmse_c": 0.3,
        "holdout_rmse_c": 0.3,
        "evidence": 100.0,
        "parameters": {},
        "on_chip": True,
        "in_words": "",
    }
    return results.Effect(name=name, **(plain | fields))
