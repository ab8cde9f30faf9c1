"""Makes docs/figures/dashboard.png: the page of a simulated board, eight springs held.

.venv/bin/python script/dashboard_picture.py      # a minute and a half; needs what script/setup installs
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

from playwright.sync_api import sync_playwright

ROOT = Path(__file__).resolve().parents[1]
PICTURE = ROOT / "docs" / "figures" / "dashboard.png"
HELD_AFTER_S = 90
"""After `Ring`, by the board's clock: all eight have transformed."""


def main() -> int:
    """Start the dashboard, do as a user does, look."""
    browser = next(filter(None, map(shutil.which, ("chromium", "google-chrome", "chromium-browser"))), None)
    words = (sys.executable, "-m", "ninespring", "dashboard", "--simulate", "--listen", "127.0.0.1:0")
    dashboard = subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env=os.environ | {"PYTHONUNBUFFERED": "1"})
    try:
        address = next(word for line in dashboard.stdout or () for word in line.split() if word.startswith("http://"))
        with sync_playwright() as playwright:
            chromium = playwright.chromium.launch(executable_path=browser, args=["--no-sandbox"])
            page = chromium.new_page(viewport={"width": 1280, "height": 1080})
            page.set_default_timeout(120_000)
            page.goto(address)
            page.click("#cold")
            page.get_by_role("button", name="Ring", exact=True).click()
            held_s = float(page.inner_text("#time")) + HELD_AFTER_S
            while float(page.inner_text("#time")) < held_s:
                page.wait_for_timeout(500)
            page.screenshot(path=PICTURE)
            chromium.close()
    finally:
        dashboard.terminate()
        dashboard.wait(30)
    print(f"-> {PICTURE}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
