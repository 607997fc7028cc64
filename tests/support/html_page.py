"""An HTML page taken apart: what a screen reader, a keyboard and a browser without network find in it."""

from __future__ import annotations

import re
from collections import Counter
from html.parser import HTMLParser
from itertools import pairwise

VOID = {"area", "base", "br", "col", "embed", "hr", "img", "input", "link", "meta", "source", "track", "wbr"}
FETCHES = {"src", "href", "srcset", "data", "poster", "action", "background", "cite", "formaction"}


class HtmlPage(HTMLParser):
    """Elements of a page, in order, and what is wrong with how they are nested."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.text = text
        self.elements: list[tuple[str, dict[str, str]]] = []
        self.words: list[str] = []
        self.misnested: list[str] = []
        self._open: list[str] = []
        self._text_of: dict[str, str] = {}
        self._inside: list[str] = []
        self.feed(text)
        self.close()
        self.misnested += [f"<{tag}> is never closed" for tag in self._open]

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = {name: value or "" for name, value in attrs}
        self.elements.append((tag, found))
        if tag not in VOID:
            self._open.append(tag)
            self._inside.append(found.get("id", ""))

    def handle_endtag(self, tag: str) -> None:
        if not self._open or self._open[-1] != tag:
            self.misnested.append(f"</{tag}> ends {self._open[-1:]}")
        elif self._open:
            self._open.pop()
            self._inside.pop()

    def handle_data(self, data: str) -> None:
        if not {"style", "script"} & set(self._open):
            self.words.append(data)
        for name in filter(None, self._inside):
            self._text_of[name] = self._text_of.get(name, "") + data

    def all(self, tag: str) -> list[dict[str, str]]:
        """Attributes of every element of a kind."""
        return [attributes for name, attributes in self.elements if name == tag]

    def faults(self) -> list[str]:
        """Everything that would trouble a reader."""
        return [
            *self.misnested,
            *self._ids(),
            *self._headings(),
            *self._pictures(),
            *self._tables(),
            *self._landmarks(),
            *self._fetched(),
        ]

    def _ids(self) -> list[str]:
        ids = Counter(found["id"] for _, found in self.elements if "id" in found)
        twice = [f"id {name!r} is there {count} times" for name, count in ids.items() if count > 1]
        pointers = [
            found.get(name, "") for _, found in self.elements for name in ("aria-labelledby", "aria-describedby")
        ]
        targets = [name for pointer in pointers for name in pointer.split()]
        targets += [found["href"][1:] for found in self.all("a") if found.get("href", "").startswith("#")]
        return [*twice, *(f"nothing has the id {name!r}" for name in targets if name not in ids)]

    def _headings(self) -> list[str]:
        levels = [int(tag[1]) for tag, _ in self.elements if re.fullmatch("h[1-6]", tag)]
        skips = [f"h{one} is followed by h{two}" for one, two in pairwise(levels) if two > one + 1]
        return skips if levels[:1] == [1] and levels.count(1) == 1 else [*skips, f"headings begin {levels[:3]}"]

    def _pictures(self) -> list[str]:
        return [
            f"a picture has no {name}"
            for one in self.all("img")
            for name in ("alt", "width", "height")
            if not one.get(name)
        ]

    def _tables(self) -> list[str]:
        bare = [found for found in self.all("th") if found.get("scope") not in ("col", "row")]
        captions = len(self.all("table")) - len(self.all("caption"))
        return ["a head of a table has no scope"] * len(bare) + ["a table has no caption"] * captions

    def _landmarks(self) -> list[str]:
        lacking = [tag for tag in ("header", "nav", "main", "footer", "title") if len(self.all(tag)) != 1]
        unlabelled = [
            tag
            for tag, found in self.elements
            if found.get("role") == "region" and not {"aria-label", "aria-labelledby"} & set(found)
        ]
        names = Counter(found["aria-labelledby"] for found in self.all("section") if "aria-labelledby" in found)
        words = Counter(self._text_of[name].strip() for name in names)
        alike = [f"{count} sections are called {name!r}" for name, count in words.items() if count > 1]
        language = [] if self.all("html")[0].get("lang") else ["the page has no language"]
        return [
            *(f"<{tag}> is not there once" for tag in lacking),
            *(f"a region <{tag}> has no name" for tag in unlabelled),
            *alike,
            *language,
        ]

    def _fetched(self) -> list[str]:
        """Whatever is not inside the page; scripts, and handlers of events too."""
        found = [
            f"<{tag}>" for tag, _ in self.elements if tag in ("script", "iframe", "object", "embed", "base", "form")
        ]
        for tag, attributes in self.elements:
            for name, value in attributes.items():
                if name in FETCHES and not value.startswith(("#", "data:")):
                    found.append(f"<{tag} {name}={value[:40]!r}>")
                if name.startswith("on"):
                    found.append(f"<{tag} {name}>")
        styles = re.findall(r"<style>(.*?)</style>", self.text, re.DOTALL)
        return [*found, *(f"style: {use}" for style in styles for use in re.findall(r"@import|url\([^)]*\)", style))]
