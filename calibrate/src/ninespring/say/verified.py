"""What `verify` measured, as a section of a report that is there already."""

from __future__ import annotations

import html
import re
from typing import Any

from ..io.logs import CUT_SHORT

BEGIN, END = "<!-- verified -->", "<!-- /verified -->"


def with_verification(page: str, result: dict[str, Any]) -> str:
    """Return a report with the chip's error before and after in it; what an earlier verification said is replaced."""
    before, after = result["before"], result["after"]

    def cell(value: float | None) -> str:
        return "–" if value is None else f"{value:.2f}"

    springs = zip(before["rmse_per_spring_c"], after["rmse_per_spring_c"], strict=True)
    rows = [("all springs", before["rmse_c"], after["rmse_c"])]
    rows += [(f"spring {k + 1}", a, b) for k, (a, b) in enumerate(springs)]
    body = "".join(
        f'<tr><td>{name}</td><td class="n">{cell(a)}</td><td class="n">{cell(b)}</td></tr>' for name, a, b in rows
    )
    log = html.escape(result["logs"][0]["file"])
    bad = "<br>".join(html.escape(note) for note in result["logs"][0]["notes"] if CUT_SHORT in note)
    first = f'<div class="warn bad">{log}: {bad}</div>' if bad else ""
    section = (
        f"{BEGIN}<h2>The chip on {log}, which the fit never saw</h2>{first}"
        '<div class="table"><table><tr><th></th><th class="n">error as it was, K rms</th>'
        f'<th class="n">with these settings, K rms</th></tr>{body}</table></div>{END}'
    )
    bare = re.sub(f"{BEGIN}.*?{END}", "", page, flags=re.S)
    at = bare.find("<h2")
    at = at if at >= 0 else bare.find("</main>")
    return bare[:at] + section + bare[at:]
