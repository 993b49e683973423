"""Checks a built site: python3 check.py OUT. What its files load lies in OUT, and its documentation can be searched."""

import json
import re
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

OUT = Path(sys.argv[1]).resolve()
MOST_BYTES = 12_000_000
# Addresses in styles, and in scripts those that are loaded rather than only named.
IN_STYLE = re.compile(r"""(?:url\(|@import\s+(?!url))\s*["']?([^"')\s;]+)""")
IN_SCRIPT = re.compile(r"""(?:\b(?:import|importScripts|fetch|Worker|open)\s*\(?|\bfrom|\.src\s*=)\s*["'`]([^"'`\s]+)""")


class Page(HTMLParser):
    """Collects what a page loads, and where its links within the site lead."""

    def __init__(self, text):
        super().__init__()
        self.loaded, self.linked, self.inside = [], [], None
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.inside = tag
        for name, value in attributes:
            if name == "style":
                self.loaded += IN_STYLE.findall(value)
            elif name in ("src", "srcset", "poster", "data") or (name == "href" and tag in ("link", "image", "use")):
                self.loaded.append(value)
            elif name in ("href", "action") and not urlsplit(value).scheme:
                self.linked.append(value)

    def handle_data(self, data):
        self.loaded += {"style": IN_STYLE, "script": IN_SCRIPT}[self.inside].findall(data) if self.inside in ("style", "script") else []

    def handle_endtag(self, tag):
        self.inside = None


def addresses(file):
    """Returns what a file loads, and where it leads within the site."""
    text = file.read_text(encoding="utf-8") if file.suffix in (".html", ".css", ".js", ".svg") else ""
    if file.suffix in (".html", ".svg"):
        page = Page(text)
        return page.loaded, page.linked
    return {".css": IN_STYLE, ".js": IN_SCRIPT}[file.suffix].findall(text) if text else [], []


def faults():
    pages = 0
    files = [file for file in OUT.rglob("*") if file.is_file()]
    for file in files:
        pages += file.suffix == ".html"
        loaded, linked = addresses(file)
        for address in loaded + linked:
            parts = urlsplit(address)
            if parts.scheme == "data" or not (parts.path or parts.netloc or parts.scheme):
                continue
            if parts.scheme or parts.netloc or parts.path.startswith("/"):
                yield f"{file.relative_to(OUT)}: {address} lies elsewhere"
            # Scripts may put addresses together, and name them from the page's folder.
            elif file.suffix != ".js" and not (file.parent / unquote(parts.path)).exists():
                yield f"{file.relative_to(OUT)}: {address} does not exist"
    index = OUT / "docs/search/search_index.json"
    entries = json.loads(index.read_text(encoding="utf-8"))["docs"] if index.exists() else []
    if len(entries) < 2 * pages or not any("voxel" in entry["text"] for entry in entries):
        yield f"{index.relative_to(OUT)}: {len(entries)} entries for {pages} pages"
    size = sum(file.stat().st_size for file in files)
    if size > MOST_BYTES:
        yield f"{size} bytes, more than {MOST_BYTES}"
    print(f"{OUT}: {len(files)} files, {pages} pages, {len(entries)} entries to search, {size / 1e6:.1f} MB")


found = list(faults())
for fault in found:
    print(fault, file=sys.stderr)
sys.exit(bool(found))
