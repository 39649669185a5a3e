"""Pages in a Chromium of this machine: one browser a file of tests, one load a page."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import page_looks

FLAGS = (
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
)  # fmt: skip
UNFOLD = "() => document.querySelectorAll('details.part').forEach(d => { d.open = true; })"


def chromium_path() -> str | None:
    """A Chromium of this machine: SYNCLINE_CHROMIUM, or one on the PATH."""
    named = os.environ.get("SYNCLINE_CHROMIUM")
    found = (shutil.which(name) for name in ("chromium", "chromium-browser", "google-chrome"))
    return named or next((path for path in found if path), None)


def launched() -> Iterator[Any]:
    """A browser for as long as it is asked for; the test is skipped where there is none."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    path = chromium_path()
    if path is None:
        pytest.skip("no Chromium on this machine")
    with sync_api.sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path=path, args=list(FLAGS))
        yield found
        found.close()


class Opened:
    """A page with everything it said and asked for; its parts unfolded."""

    def __init__(self, browser: Any, path: Path, *, unfolded: bool = True, **options: Any) -> None:
        self.context = browser.new_context(**options)
        self.page = self.context.new_page()
        self.console: list[str] = []
        self.requests: list[str] = []
        self.dialogs: list[str] = []
        self.page.on("console", lambda message: self.console.append(message.text))
        self.page.on("pageerror", lambda error: self.console.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.failed: dict[str, str] = {}
        self.page.on("requestfailed", lambda r: self.failed.update({r.url: r.failure or ""}))
        self.page.on("dialog", lambda dialog: (self.dialogs.append("x"), dialog.dismiss()))
        self.page.goto(path.as_uri())
        if unfolded and options.get("java_script_enabled", True):
            self.page.evaluate(UNFOLD)

    def __enter__(self) -> Opened:
        return self

    def __exit__(self, *_: object) -> None:
        self.context.close()


def flaws_of(browser: Any, path: Path) -> list[object]:
    """What is wrong with a page: at three widths, by axe in both themes, said, or asked for."""
    with Opened(browser, path, viewport={"width": 1300, "height": 900}) as opened:
        found: list[object] = [*page_looks.flaws(opened.page)]
        opened.page.set_viewport_size({"width": 420, "height": 900})
        found += [*page_looks.barriers(opened.page), *opened.console]
        return found + [url for url in opened.requests if url != path.as_uri()]
