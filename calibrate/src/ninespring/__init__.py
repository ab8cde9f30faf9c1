"""Calibrate the thermal model of an array of NiTi springs, and say what the model lacks.

>>> import ninespring as ns
>>> run = ns.read_log("run1.csv")
>>> found = ns.diagnose(run)
>>> ns.plot(run, found.model).savefig("run1.png")
"""

from importlib.metadata import version

__version__ = version("ninespring")

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
from .errors import InputError, WorkError
from .io.board import Board, Reading, to_pandas
from .io.logs import Run, read_log
from .model.models import Array, Model, read_array, read_model

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
