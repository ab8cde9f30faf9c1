"""What a sweep leaves: a folder of Parquet files, one for each lot of points, written whole or not at all.

`points/from-to.parquet` hold the rows; each carries the spec's text, its SHA-256 and this version in its metadata, each row
its point's number and seed. A point that is in a file is done: that is all that a resumed sweep needs to know.
"""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .. import __version__
from ..errors import InputError
from .spec import Spec

try:
    import fcntl
except ImportError:  # Windows: two sweeps into one folder are not told apart there
    fcntl = None

META = b"ninespring"


class Results:
    """A sweep's folder."""

    def __init__(self, folder: Path, spec: Spec) -> None:
        self.folder, self.spec = folder, spec
        self.points = folder / "points"
        self.meta = json.dumps({"version": __version__, "sha256": spec.sha256, "seed": spec.seed, "spec": spec.text})

    def open(self) -> np.ndarray:
        """Make or take up the folder; return which points are done, (points,) bool. Another spec's folder is refused."""
        import pyarrow.parquet as parquet

        if self.folder.exists() and not self.folder.is_dir():
            raise InputError("is a file; give a folder", self.folder)
        begun = (self.folder / "spec.json").exists() or not self.folder.exists()
        if not begun and (
            {one.name for one in self.folder.iterdir()} - {"lock", "points"} or any(self.points.glob("*"))
        ):
            raise InputError("holds files, and no sweep's: give another folder", self.folder)
        self.points.mkdir(parents=True, exist_ok=True)
        self.lock = (self.folder / "lock").open("a")
        try:
            if fcntl:
                fcntl.flock(self.lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise InputError("another sweep is writing into this folder", self.folder) from None
        kept = self.folder / "spec.json"
        if kept.exists():
            try:
                before = json.loads(kept.read_text())
                its = before["sha256"], before["version"]
            except (ValueError, KeyError, TypeError) as error:
                raise InputError(f"no sweep wrote this ({error}): give another folder", kept) from None
            if its != (self.spec.sha256, __version__):
                raise InputError(
                    "holds the results of another spec, or of another version: give another folder", self.folder
                )
        done = np.zeros(self.spec.points, dtype=bool)
        for part in self.points.glob("*.parquet"):
            try:
                done[parquet.read_table(part, columns=["point"])["point"].to_numpy()] = True
            except (OSError, ValueError, KeyError) as error:
                raise InputError(f"is damaged ({error}): remove it, its points are then run again", part) from None
        for left in self.points.glob("*.part"):
            left.unlink()  # of a sweep that was killed while it wrote
        _whole(kept, self.meta.encode())
        return done

    def add(self, rows: Sequence[dict[str, Any]]) -> None:
        """Keep a lot of points."""
        import pyarrow as pa
        import pyarrow.parquet as parquet

        table = pa.Table.from_pylist(list(rows)).replace_schema_metadata({META: self.meta.encode()})
        name = f"{rows[0]['point']:08d}-{rows[-1]['point']:08d}"
        made = self.points / f"{name}.part"
        parquet.write_table(table, made)
        os.replace(made, self.points / f"{name}.parquet")

    def count(self) -> tuple[int, int]:
        """Return how many points there are, and how many of them could not be run; nothing is read whole."""
        import pyarrow.dataset as dataset

        rows = dataset.dataset(self.points, format="parquet")
        return rows.count_rows(), rows.count_rows(filter=dataset.field("error") != "")

    def read(self) -> Any:
        """Return all rows as a table (pandas), by point."""
        import pyarrow.dataset as dataset

        return (
            dataset.dataset(self.points, format="parquet")
            .to_table()
            .to_pandas()
            .sort_values("point", ignore_index=True)
        )


def _whole(path: Path, data: bytes) -> None:
    made = path.with_suffix(".part")
    made.write_bytes(data)
    os.replace(made, path)
