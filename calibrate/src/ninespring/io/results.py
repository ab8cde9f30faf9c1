"""What commands find, as --json and diagnosis.json have it: fields, units, ranges.

A result is built of these, and what is written is held to them. `ninespring schema` prints the JSON Schemas that are made of them.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, Literal

import msgspec
import numpy as np
from msgspec import UNSET, Meta, UnsetType

from .. import __version__

if TYPE_CHECKING:
    Absent = Any  # who reads it knows that it is there
else:
    Absent = UnsetType

TOOL = f"ninespring {__version__}"

Size = Annotated[float, Meta(ge=0.0)]
Count = Annotated[int, Meta(ge=0)]
Spring = Annotated[int, Meta(ge=1)]
Share = Annotated[float, Meta(ge=0.0, le=1.0)]
Correlated = Annotated[float, Meta(ge=-1.000001, le=1.000001)]
Sha256 = Annotated[str, Meta(pattern="^[0-9a-f]{64}$")]
Reason = Annotated[str, Meta(min_length=1)]
Name = Annotated[
    str,
    Meta(
        pattern="^[a-z][a-z_]*$", description="a name of lib/parameters/effects.def; of a rival also one of runs_differ"
    ),
]
Certainty = Literal["certain", "probable"]
OwnOfRuns = Literal["run_drive_gain", "run_ambient_offset", "run_sensor_offset"]
Unknown = Literal["heat", "common", "sensor"]
Elements = Literal["coarse", "normal", "fine"]
Measure = Literal["held", "heating_s", "hottest_c", "undriven"]


class Part(msgspec.Struct, forbid_unknown_fields=True):
    """Part of a result: what is UNSET is not written."""


class Number(Part):
    """A fitted number."""

    value: float
    stderr: Size | None
    unit: str
    note: str | Absent = UNSET
    interval_95: Annotated[tuple[float, float], Meta(description="where it lies in 95 of 100 cases")] | Absent = UNSET


Parameters = dict[str, Number]


class Source(Part):
    """A file that a result is from."""

    file: str
    sha256: Sha256


class Read(Source):
    """A log that was diagnosed."""

    rows: Annotated[int, Meta(ge=1)]


class Log(Read):
    """A log, and what was mended of it or is doubted."""

    notes: list[str]


class Correlation(Part):
    """Two numbers whose errors go together."""

    a: str
    b: str
    correlation: Correlated


# ---- a diagnosis


class Witness(Part):
    """What speaks for an effect in a fit."""

    nats: float
    share: float
    """Of what the fit without it leaves beyond the noise, the part that it explains, 0..1."""
    in_time: float
    """How its size scatters from stretch to stretch, relative to its size (0: the same always)."""
    in_place: float
    """The same from spring to spring."""
    left: float
    """What the whole model leaves beyond the noise, relative to the noise."""
    flexible: bool
    """It follows anything slow: as likely a stand-in as a cause, where what it says changed was logged."""


class Named(Part):
    """An effect, which may be one of several kinds: both have a `name` and a `variant`."""

    @property
    def called(self: Any) -> str:
        """Its name, and which of its kinds it is."""
        return f"{self.name} ({self.variant})" if self.variant else self.name


class Effect(Named):
    """An effect that the declared model lacks."""

    name: Name
    rmse_c: Size | None
    holdout_rmse_c: Size | None
    evidence: float
    parameters: Parameters
    on_chip: bool
    in_words: str
    probability: Share | Absent = UNSET
    certainty: Certainty | Absent = UNSET
    witness: Witness | Absent = UNSET
    text: str | Absent = UNSET
    variant: str | Absent = UNSET
    why_not_on_chip: Reason | Absent = UNSET
    seen_by: Literal["v / i"] | Absent = UNSET


class Step(Part):
    """What an experiment sets: at a time, per cent of the current of each spring, per cent of the fan."""

    at_s: float
    percent: list[int]
    fan: int


class Experiment(Part):
    """An experiment that would tell two models apart."""

    name: str
    inputs: str
    spring: Spring
    difference_c: float
    at_s: float
    duration_s: float
    current_a: float | None
    steps: list[Step]


class Rival(Named):
    """What these data cannot tell from an effect that was named."""

    instead_of: Name
    name: Name
    rmse_c: Size
    evidence: Annotated[float, Meta(description="by which the named one leads, nats")]
    parameters: Parameters
    separating_experiment: Reason
    variant: str | Absent = UNSET
    holdout_rmse_c: Size | Absent = UNSET
    predictions_differ_c: float | Absent = UNSET
    experiment: Experiment | Absent = UNSET
    against: str | Absent = UNSET


class Spread(Part):
    """How far runs lie apart: rms of each one's distance from the array's own number; of a gain as its logarithm."""

    value: Size
    unit: Literal["1", "K"]


class RunsDiffer(Part):
    """What is a run's own, not the array's: random effects with the spread of the runs."""

    name: OwnOfRuns
    evidence: float
    probability: Share
    certainty: Certainty
    witness: Witness
    spread: Spread
    parameters: Parameters
    text: str


class Unnamed(Part):
    """A cause that has no name in the library."""

    kind: str
    size: float
    stderr: Size
    unit: str
    text: str


class Unseen(Part):
    """A run that the fit never saw, predicted by what was found, by the declared model and by that with a lag."""

    what: Literal["last part", "each run left out in turn"]
    rmse_c: Size
    declared_rmse_c: Size
    with_lag_rmse_c: Size
    text: str


class Event(Part):
    """Heat of unknown origin, or a thermometer that jumped."""

    run: Spring
    kind: Unknown
    spring: Spring | None
    from_s: float
    to_s: float
    size: float
    stderr: Size
    unit: Literal["W", "K"]
    share: float | None
    evidence: float
    text: str


class UnknownHeat(Part):
    """Heat that the best model still lacks: events, watts of each spring in each run, watts that it is usually given."""

    events: list[Event]
    mean_w: list[list[float]]
    usual_w: list[float | None]


class Resistance(Part):
    """v / i: its error before and after, ohm."""

    rows: Count
    noise_ohm: Size
    before_ohm: Size
    after_ohm: Size
    parameters: Parameters


class Residual(Part):
    """What is left."""

    autocorrelation_lag1: Annotated[float, Meta(ge=-1.0, le=1.0)]
    depends_on: list[str]
    note: str
    structure_c: Size | Absent = UNSET
    rmse_per_spring_c: list[float | None] | Absent = UNSET
    noise_per_spring_c: list[float | None] | Absent = UNSET


class Identifiability(Part):
    """What the data do not fix."""

    not_identifiable: list[str]
    at_bounds: list[str]
    correlated: list[Correlation]


class Baseline(Part):
    """The declared model's errors; of v / i where no temperature was logged."""

    rmse_c: Size | None
    holdout_rmse_c: Size | None
    noise_c: Size | None
    parameters: Parameters | Absent = UNSET
    effects: list[Name] | Absent = UNSET
    rmse_v: Size | Absent = UNSET
    noise_v: Size | Absent = UNSET


class After(Part):
    """The errors of the model that is given, and its declared numbers."""

    rmse_c: Size | None
    holdout_rmse_c: Size | None
    parameters: Parameters | Absent = UNSET
    rmse_v: Size | Absent = UNSET


class Candidate(Part):
    """A model that the search fitted."""

    effects: list[str]
    rmse_c: Size
    evidence_over_baseline: float
    adopted: bool


class SteadyCandidate(Part):
    """An effect tried on a steady table, with its one number."""

    name: Name
    rmse_c: Size
    holdout_rmse_c: Size
    note: str
    parameter: str | None = None
    value: float | None = None
    stderr: Size | None = None
    unit: str | None = None
    evidence: float | None = None
    at_bound: bool | None = None


class Case(Part):
    """A row of a steady table."""

    case: str
    measured_c: float
    before_c: float
    after_c: float | Absent = UNSET


class Told(Part, kw_only=True, tag_field="schema", tag="ninespring.diagnosis/1"):
    """What every diagnosis says."""

    tool: str = TOOL
    logs: list[Read]
    baseline: Baseline
    effects: list[Effect]
    rivals: list[Rival]
    after: After
    unexplained: bool
    residual: Residual
    identifiability: Identifiability
    warnings: list[str]


class Diagnosis(Told, tag="ninespring.diagnosis/1"):
    """Of logs with temperatures."""

    unknown_heat: UnknownHeat
    runs_differ: list[RunsDiffer]
    unnamed: list[Unnamed]
    candidates: list[Candidate]
    doubts: Annotated[list[str], Meta(description="those of the warnings for which export refuses the model")]
    seconds: Size
    simulations: Count
    unseen: Unseen | Absent = UNSET
    resistance: Resistance | Absent = UNSET


class BoardDiagnosis(Told, tag="ninespring.diagnosis/1"):
    """Of logs without any temperature, by v / i."""

    seconds: Size
    simulations: Count


class SteadyDiagnosis(Told, tag="ninespring.diagnosis/1"):
    """Of a steady table."""

    candidates: list[SteadyCandidate]
    cases: list[Case]


FILES = ("diagnosis.json", "report.html", "model.toml")
"""What a diagnosis writes into its folder."""


# ---- what --json writes


class Result(Part, kw_only=True, tag_field="schema", tag="ninespring"):
    """What a command found, and what wrote it."""

    tool: str = TOOL


class Fit(Result, tag="ninespring.fit/1"):
    """`ninespring fit`; errors are of the voltages at the measured currents, V, where no temperature was logged."""

    logs: Annotated[list[Log], Meta(min_length=1)]
    rmse_before_c: Size | None
    rmse_c: Size | None
    holdout_rmse_c: Size | None
    noise_c: Size | None
    effects: list[Name]
    parameters: Parameters
    correlations: Annotated[
        list[Correlation], Meta(description="pairs of numbers whose errors go together, strongest first")
    ]
    not_identifiable: list[str]
    at_bounds: list[str]
    warnings: list[str]
    rmse_before_v: Size | Absent = UNSET
    rmse_v: Size | Absent = UNSET
    noise_v: Size | Absent = UNSET


class Predict(Result, tag="ninespring.predict/1"):
    """`ninespring predict`."""

    logs: Annotated[list[Log], Meta(min_length=1)]
    model: Source
    by: Literal["plant", "chip"]
    rows: Count
    rmse_c: Size | None
    rmse_per_spring_c: list[Size | None]
    note: str | Absent = UNSET


class Replayed(Part):
    """A spring's errors in a replay."""

    spring: Spring
    samples: Count
    rmse_c: Size | None
    mean_error_c: float | None
    largest_error_c: Size | None
    shown_rmse_c: Size | None


class Replay(Result, tag="ninespring.replay/1"):
    """`ninespring replay`."""

    logs: Annotated[list[Log], Meta(min_length=1)]
    model: Source
    rows: Count
    duration_s: Size
    rmse_c: Size | None
    shown_rmse_c: Size | None
    left_out: str
    springs: list[Replayed]


class Drive(Part):
    """A measure of a drive with the old and the new settings, on one of the arrays that were tried."""

    array: Spring
    measure: Measure
    old: float
    new: float


class Export(Result, tag="ninespring.export/1"):
    """`ninespring export`."""

    model: Source
    settings: dict[str, float]
    left_out: dict[Name, Reason]
    kept: Annotated[dict[str, Reason], Meta(description="settings that are not written, and why")]
    worse: list[str]
    drives: list[Drive]


class ChipError(Part):
    """The error of the chip's model on a log, K rms."""

    rmse_c: Size
    rmse_per_spring_c: list[Size | None]


class Verify(Result, tag="ninespring.verify/1"):
    """`ninespring verify`."""

    logs: Annotated[list[Log], Meta(min_length=1)]
    model: Source
    before: ChipError
    after: ChipError


class Import(Result, tag="ninespring.import/1"):
    """`ninespring import`."""

    source: str
    columns: Annotated[list[str], Meta(min_length=2)]
    rows: Count


class Fault(Part):
    """A fault that the board told of."""

    time_s: float | None
    """By the board's clock, as in the log; None: after its last row."""
    spring: int | None
    """None: of the board, and all springs are off."""
    number: int
    name: str


class Record(Result, tag="ninespring.record/1"):
    """`ninespring record`."""

    rows: Count
    dropped_lines: Count
    ended: str
    faults: list[Fault]


class Upload(Result, tag="ninespring.upload/1"):
    """`ninespring upload`; `undone` is the upload that was taken back."""

    settings: Annotated[int, Meta(ge=1)]
    saved: bool
    undone: str | Absent = UNSET


class Coupling(Part):
    """A number of the network that stands for the field."""

    value: float
    unit: str
    reduction_error: float | None
    mesh_error: float | None


class Couplings(Result, tag="ninespring.couplings/1"):
    """`ninespring couplings`."""

    mesh: Elements
    unknowns: Annotated[int, Meta(ge=1)]
    cylinder_diameter_mm: float
    drive_error: float
    balance_error: float
    second_w_per_k: float
    second_fan_w_per_k: float | None
    parameters: dict[str, Coupling]


class Sweep(Result, tag="ninespring.sweep/1"):
    """`ninespring sweep`."""

    spec: str
    sha256: str
    points: Count
    done_before: Count
    failed: Count
    best: dict[str, Any] | Absent = UNSET
    indices: dict[str, Any] | Absent = UNSET


class Done(msgspec.Struct):
    """What a step of a calibration found, and the files that belong to it, with their SHA-256."""

    files: dict[str, str]


class Calibrate(Result, tag="ninespring.calibrate/1"):
    """`ninespring calibrate`, begun with `options` on a `board` that was as said; `refused` says why nothing was written to it."""

    options: dict[str, Any]
    board: dict[str, Any]
    done: dict[Literal["plan", "run1", "diagnose", "run2", "verify", "export", "before", "after"], Done]
    refused: str


COMMANDS = (Fit, Predict, Replay, Export, Import, Record, Upload, Verify, Couplings, Sweep, Calibrate)
DIAGNOSES = (Diagnosis, BoardDiagnosis, SteadyDiagnosis)


def _plain(one: Any) -> Any:
    if isinstance(one, np.generic):
        return one.item()
    raise NotImplementedError(type(one).__name__)


def plain(result: msgspec.Struct) -> dict[str, Any]:
    """Return a result as JSON has it."""
    return msgspec.to_builtins(result, enc_hook=_plain)


def checked(result: msgspec.Struct) -> str:
    """Return a result as JSON text; refused (msgspec.ValidationError) where it is not what its class says."""
    text = msgspec.json.encode(result, enc_hook=_plain)
    msgspec.json.decode(text, type=type(result))
    return msgspec.json.format(text, indent=1).decode() + "\n"


def read(kind: type[msgspec.Struct], data: bytes | Mapping[str, Any]) -> Any:
    """Return a result that was written as one; msgspec.ValidationError or DecodeError where it is none."""
    return msgspec.json.decode(data, type=kind) if isinstance(data, bytes) else msgspec.convert(data, kind)


SCHEMAS: dict[str, tuple[str, tuple[type, ...]]] = {
    "results": ("What --json writes (diagnose: the schema `diagnosis`)", COMMANDS),
    "diagnosis": ("diagnosis.json", DIAGNOSES),
}
"""What there is a JSON Schema of: its title, and what it may be."""


def schema(of: str) -> str:
    """Return one of SCHEMAS as JSON text."""
    title, kinds = SCHEMAS[of]
    parts, named = msgspec.json.schema_components(kinds, ref_template="#/$defs/{name}")
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": title}
    return json.dumps(head | {"anyOf": list(parts), "$defs": named}, indent=1) + "\n"
