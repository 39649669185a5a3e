"""Draw the pictures of pages anew: `python docs/make_images.py` from the repository's root.

They are taken of the reports of shipped files by a Chromium of this machine.
"""

from __future__ import annotations

import re
import shutil
import tempfile
from pathlib import Path
from typing import Any

from playwright.sync_api import sync_playwright

from syncline_design.report.checks import render_checks
from syncline_design.report.studies import render_study
from syncline_design.studies import StudySettings, run_study
from syncline_design.verdict.settings import CheckSettings
from syncline_design.verdict.verify import check_files

SPEC = Path("specs/uav_corridor.yaml")
STUDY = Path("specs/studies/usv_speed.yaml")
IMAGES = Path("docs/images").resolve()
SCREEN, TABLET, PHONE, CUT = (1300, 900), (768, 900), (420, 900), (560, 545)


def main() -> None:
    """Write every picture."""
    browser = shutil.which("chromium") or shutil.which("chromium-browser")
    if browser is None:
        raise SystemExit("no Chromium on this machine; the pictures stay as they are")
    page = render_checks("html", check_files([SPEC], CheckSettings(cloud=True)))
    plot = re.search(r'<svg[^>]*"fig-syncline-title.*?</svg>', page, re.DOTALL)
    style = re.search(r"<style.*?</style>", page, re.DOTALL)
    if plot is None or style is None:
        raise SystemExit("the report holds no Syncline figure")
    alone = (
        f"<!doctype html>{style.group(0)}<body style='padding:12px'>"
        f"<figure><div class='drawing'>{plot.group(0)}</div></figure>"
    )
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        study = str(render_study("html", run_study(STUDY, StudySettings(store=Path(folder)))))
        launched = playwright.chromium.launch(executable_path=browser, args=["--no-sandbox"])
        _picture(launched, alone, "syncline.png", CUT)
        _picture(launched, page, "report.png", SCREEN)
        _picture(launched, page, "page_phone.png", PHONE, "dark")
        _picture(launched, study, "page_study.png", TABLET)
        launched.close()


def _picture(
    browser: Any, page: str, name: str, size: tuple[int, int], theme: str = "light"
) -> None:  # fmt: skip
    view = {"width": size[0], "height": size[1]}
    opened = browser.new_page(viewport=view, color_scheme=theme)
    opened.set_content(page)
    opened.screenshot(path=IMAGES / name)
    opened.close()


if __name__ == "__main__":
    main()
