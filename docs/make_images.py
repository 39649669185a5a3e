"""Draw the README's pictures anew: `python docs/make_images.py` from the repository's root.

Both are cut out of the report of `specs/uav_corridor.yaml` by a Chromium of this machine.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
from pathlib import Path

import syncline_design as sd
from syncline_design.report.checks import render_checks

SPEC = Path("specs/uav_corridor.yaml")
IMAGES = Path("docs/images").resolve()


def main() -> None:
    """Write both pictures."""
    browser = shutil.which("chromium") or shutil.which("chromium-browser")
    if browser is None:
        raise SystemExit("no Chromium on this machine; the pictures stay as they are")
    page = render_checks("html", [sd.check(SPEC)])
    plot = re.search(r'<svg[^>]*"fig-syncline-title.*?</svg>', page, re.DOTALL)
    style = re.search(r"<style.*?</style>", page, re.DOTALL)
    if plot is None or style is None:
        raise SystemExit("the report holds no Syncline figure")
    alone = f"<!doctype html>{style.group(0)}<body style='padding:12px'>{plot.group(0)}"
    _picture(browser, alone, "syncline.png", "720,560")
    _picture(browser, page, "report.png", "1100,1300")


def _picture(browser: str, page: str, name: str, size: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "page.html"
        source.write_text(page, "utf-8")
        subprocess.run(
            [browser, "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars",
             f"--user-data-dir={folder}/profile", f"--window-size={size}",
             f"--screenshot={IMAGES / name}", source.as_uri()],
            check=True, capture_output=True,
        )  # fmt: skip


if __name__ == "__main__":
    main()
