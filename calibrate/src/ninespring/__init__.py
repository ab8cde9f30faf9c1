"""Calibrate the thermal model of an array of NiTi springs, and say what the model lacks.

>>> import ninespring as ns
>>> run = ns.read_log("run1.csv")
>>> found = ns.diagnose(run)
>>> ns.plot(run, found.model).savefig("run1.png")
"""

from importlib.metadata import version
from typing import TYPE_CHECKING, Any

__version__ = version("ninespring")

from .errors import InputError, WorkError
from .io.board import Board, Reading, to_pandas
from .io.logs import Run, read_log
from .model.models import Array, Model, read_array, read_model

if TYPE_CHECKING:
    from .api import (
        chip_settings,
        diagnose,
        fit,
        import_log,
        make_plan,
        plan_through,
        plot,
        predict,
        record,
        replay,
        save,
        sweep,
        undo_upload,
        upload,
        verify,
    )

__all__ = [
    "Array",
    "Board",
    "InputError",
    "Model",
    "Reading",
    "Run",
    "WorkError",
    "chip_settings",
    "diagnose",
    "fit",
    "import_log",
    "make_plan",
    "plan_through",
    "plot",
    "predict",
    "read_array",
    "read_log",
    "read_model",
    "record",
    "replay",
    "save",
    "sweep",
    "to_pandas",
    "undo_upload",
    "upload",
    "verify",
]


def __dir__() -> list[str]:
    return __all__


def __getattr__(name: str) -> Any:
    """Load what fits, searches and draws (`api`) when one of it is asked for: whoever only talks to a board waits for no SciPy."""
    if name not in __all__:
        raise AttributeError(f"module 'ninespring' has no attribute '{name}'")
    from . import api

    return getattr(api, name)
