"""HTML read by tests: which elements a page has, and that each of them is closed in turn."""

from html.parser import HTMLParser

CLOSE_THEMSELVES = ("meta", "img", "br")


class Elements(HTMLParser):
    """Elements with their attributes, in order; fails where one is closed that is not the last that was opened."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: list[tuple[str, dict[str, str | None]]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.append((tag, dict(attrs)))
        if tag not in CLOSE_THEMSELVES:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag
