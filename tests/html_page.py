"""An HTML page as a browser would see it, for tests."""

from __future__ import annotations

import re
from html.parser import HTMLParser

JOINT = "\0"  # between a word that no line breaks and what stands beside it
VOID = {"meta", "input", "br", "img", "link", "hr", "wbr"}


class Page(HTMLParser):
    """What a browser would see: tags with attributes, ids, scripts, texts."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.whole: list[int] = []  # tags open where words of an element of their own began
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.scripts: list[str] = []
        self.texts: list[str] = []
        self.unbalanced: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)
        if tag == "wbr":
            self.texts += [JOINT]
        if tag == "span" and dict(attrs).get("class") in ("whole", "key"):
            self.texts += [JOINT]
            self.whole.append(len(self.open))
        if tag == "script":
            self.scripts.append("")

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        if [len(self.open)] == self.whole[-1:]:
            self.texts += [JOINT]
            self.whole.pop()
        if not self.open or self.open.pop() != tag:
            self.unbalanced.append(tag)

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] == "script":
            self.scripts[-1] += data
        elif not (self.open and self.open[-1] == "style"):
            self.texts.append(data)

    @property
    def text(self) -> str:
        return re.sub(r"[ \n\t]+", " ", re.sub(f" ?{JOINT} ?", "", " ".join(self.texts)))

    def attribute(self, tag: str, name: str) -> list[str]:
        return [found[name] or "" for t, found in self.tags if t == tag and name in found]
