"""Tables of benchmarks in the pages of docs, between two comments."""

from __future__ import annotations

from pathlib import Path


def put(page: Path, text: str, begin: str, end: str) -> None:
    """Exchange what stands in a page between its two comments."""
    before, _, rest = page.read_text("utf-8").partition(begin)
    _, _, after = rest.partition(end)
    page.write_text(f"{before}{begin}\n{text}{end}{after}", "utf-8")
