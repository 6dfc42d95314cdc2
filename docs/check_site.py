"""Check a built site: every link and anchor inside it leads somewhere, and nothing is loaded from elsewhere.

Run as ``python docs/check_site.py docs/_build/html``.
"""

import re
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

LOADS = {"script": "src", "img": "src", "iframe": "src", "source": "src", "video": "src", "audio": "src"}
"""Tags that load what an attribute names; ``link`` loads unless it only relates pages."""
RELATES = {"canonical", "next", "prev", "search", "index", "author", "copyright", "genindex"}


class Page(HTMLParser):
    """The anchors, the links and the loaded files of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: list[str] = []
        self.loads: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note what the tag defines, links to and loads."""
        values = {name: value or "" for name, value in attrs}
        self.anchors |= {values[name] for name in ("id", "name") if name in values}
        if tag == "a" and "href" in values:
            self.links.append(values["href"])
        if tag == "link" and values.get("rel") not in RELATES:
            self.loads.append(values.get("href", ""))
        if tag in LOADS:
            self.loads.append(values.get(LOADS[tag], ""))


def is_elsewhere(address: str) -> bool:
    """Whether an address leaves the site."""
    parts = urlsplit(address)
    return bool(parts.netloc) or parts.scheme in {"http", "https", "mailto"}


def broken_links(site: Path, path: Path, pages: dict[Path, Page]) -> list[str]:
    """Links of a page, and files that it loads, that lead nowhere."""
    found = []
    for address in pages[path].links + pages[path].loads:
        if is_elsewhere(address) or address.startswith("data:") or not address:
            continue
        parts = urlsplit(address)
        target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
        target = target / "index.html" if target.is_dir() else target
        if not target.is_file():
            found.append(f"{path.relative_to(site)}: {address}: no such file")
        elif parts.fragment and target in pages and unquote(parts.fragment) not in pages[target].anchors:
            found.append(f"{path.relative_to(site)}: {address}: no such anchor")
    return found


def loads_from_elsewhere(site: Path, pages: dict[Path, Page]) -> list[str]:
    """Everything that pages and style sheets load from another site."""
    found = [
        f"{path.relative_to(site)} loads {address}"
        for path, page in pages.items()
        for address in page.loads
        if is_elsewhere(address)
    ]
    for path in site.rglob("*.css"):
        imports = re.findall(r"(?:url\(|@import)\s*['\"]?((?:https?:)?//[^'\")\s]+)", path.read_text(errors="replace"))
        found += [f"{path.relative_to(site)} loads {address}" for address in imports]
    return found


def faults(site: Path) -> list[str]:
    """Every fault of a site."""
    site = site.resolve()
    pages = {path: Page(path.read_text(encoding="utf-8")) for path in sorted(site.rglob("*.html"))}
    if not pages:
        return [f"{site} holds no page"]
    return [fault for path in pages for fault in broken_links(site, path, pages)] + loads_from_elsewhere(site, pages)


if __name__ == "__main__":
    found = faults(Path(sys.argv[1]))
    print("\n".join(found) or "every link and anchor leads somewhere; nothing is loaded from elsewhere")
    sys.exit(bool(found))
