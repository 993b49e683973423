"""MkDocs' hook: adds the pages from outside docs/, and leads links to where they lead in the repository."""

import logging
import posixpath
import re
import tomllib
from pathlib import Path
from urllib.parse import urlsplit

from mkdocs.structure.files import File
from mkdocs.structure.nav import Link

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = tomllib.loads((ROOT / "Cargo.toml").read_text(encoding="utf-8"))["workspace"]["package"]
# Files from outside docs/, and their names on the site.
PAGES = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "python/README.md", "crates/sim/physics.md", "benches/README.md", "data/README.md")
OUTSIDE = {**{name: name for name in PAGES}, ".github/site/docs.css": "docs.css"}
# Of the page of `morphcog site`, which lies beside the documentation.
PAGE, ICON = "../index.html", "../icon.svg"
# Code, which stays as it is; else the target of a link in Markdown, or the address of a picture in HTML.
LINK = re.compile(r"^ *```.*?^ *```|`[^`\n]*`|(?<=\]\()[^)\s]+|(?<= src=\")[^\"]+", re.MULTILINE | re.DOTALL)
# Markdown that GitHub renders and Python-Markdown does not: a list without a blank line before it, code in a list.
RAW = re.compile(r"^(?:[-*] |\d+\. |\||```|<p>```).*", re.MULTILINE)

log = logging.getLogger("mkdocs.hooks.pages")


def on_config(config):
    # Both need the site's address.
    config.theme.static_templates -= {"404.html", "sitemap.xml"}
    config["site_favicon"] = ICON
    return config


def on_files(files, config):
    for name, uri in OUTSIDE.items():
        files.append(File.generated(config, uri, abs_src_path=str(ROOT / name)))
    for uri in ("sitemap.xml", "img/favicon.ico"):
        files.remove(files.get_file_from_path(uri))
    return files


def on_nav(nav, config, files):
    nav.items.insert(0, Link("Draw a digit", PAGE))
    return nav


def on_page_markdown(markdown, page, config, files):
    uri = page.file.src_uri
    folder = posixpath.dirname(uri if uri in OUTSIDE else f"docs/{uri}")

    def target(found):
        link = found[0]
        if link.startswith(("`", " ", "#")) or urlsplit(link).scheme:
            return link
        path, hash, anchor = link.partition("#")
        path = posixpath.normpath(posixpath.join(folder, path))
        file = files.get_file_from_path(OUTSIDE.get(path, path.removeprefix("docs/")))
        if file and file.inclusion.is_included():
            return posixpath.relpath(file.src_uri, posixpath.dirname(uri) or ".") + hash + anchor
        if not (ROOT / path).exists():
            log.warning("%s links to %s, which does not exist", uri, link)
        kind = "tree" if (ROOT / path).is_dir() else "blob"
        return f"{PACKAGE['repository']}/{kind}/v{PACKAGE['version']}/{path}"

    return LINK.sub(target, markdown)


def on_page_content(html, page, config, files):
    outside_code = re.sub(r"<pre>.*?</pre>", "", html, flags=re.DOTALL)
    for line in RAW.findall(outside_code):
        log.warning("%s has Markdown that was not rendered: %s", page.file.src_uri, line)
    # In a cell of a table GitHub reads `\|` in code as a bar.
    return re.sub(r"<td.*?</td>", lambda cell: cell[0].replace("\\|", "|"), html, flags=re.DOTALL)
