"""What `verify` measured, as a section of a report that is there already."""

from __future__ import annotations

import re

from ..io import results
from .page import cut_short, render

BEGIN, END = "<!-- verified -->", "<!-- /verified -->"


def error_rows(before: results.ChipError, after: results.ChipError) -> list[tuple[str, str, str]]:
    """Return the chip's error before and after, of all springs and of each, as rows of text."""
    pairs = zip(before.rmse_per_spring_c, after.rmse_per_spring_c, strict=True)
    rows = [("all springs", before.rmse_c, after.rmse_c), *((f"spring {k}", *one) for k, one in enumerate(pairs, 1))]
    cell = lambda value: "–" if value is None else f"{value:.2f}"  # noqa: E731
    return [(name, cell(a), cell(b)) for name, a, b in rows]


def with_verification(page: str, verified: results.Verify) -> str:
    """Return a report with the chip's error before and after in it; what an earlier verification said is replaced."""
    log = verified.logs[0]
    bad = [f"{log.file}: {note}" for note in cut_short(log.notes)]
    rows = error_rows(verified.before, verified.after)
    section = BEGIN + render("verified.html", log=log, cut_short=bad, rows=rows) + END
    bare = re.sub(f"{BEGIN}.*?{END}", "", page, flags=re.S)
    at = bare.find("<h2")
    at = at if at >= 0 else bare.find("</main>")
    return bare[:at] + section + bare[at:]
