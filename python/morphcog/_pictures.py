"""Figures, and pictures of bodies that walk."""

import base64
import html
import os
import pathlib
import secrets

from ._morphcog import Error
from ._values import _path, _whole


class Figure:
    """A figure for print or screen. A notebook shows it; save writes it."""

    def __init__(self, data):
        self._data = data

    def save(self, path, dpi=None):
        """Writes the figure; the ending of the name says as what: .svg, .png or .pdf. dpi: pixels of a PNG per
        inch (default: 300, as for print). Returns the path."""
        path, dpi = pathlib.Path(_path(path)), _whole(dpi, "dpi", 36, 2400)
        ending = path.suffix.lower()
        if ending == ".svg":
            return written(path, self._data.svg_file().encode())
        if ending == ".png":
            return written(path, self._data.png(dpi))
        if ending == ".pdf":
            return written(path, self._data.pdf())
        raise Error(f"path={path}: expected a name that ends in .svg, .png or .pdf")

    def _repr_svg_(self):
        return self._data.svg()

    def __repr__(self):
        return f"Figure({self._data.title!r})"


class Recording:
    """A body that was simulated for pictures. A notebook shows it walking, over a still picture for viewers
    without scripts; save writes a page, an animation or a picture."""

    def __init__(self, data, words, is_still=False):
        self._data, self._words, self._is_still = data, words, is_still

    @property
    def displacements(self):
        """How far it walked under each image, in voxel lengths; fewer if it became unstable."""
        return self._data.displacements

    def save(self, path, *, width=480, every=2, side_by_side=False):
        """Writes it; the ending of the name says as what: a page (.html), an animation (.gif) or its last moment
        (.png). Of animations, width: pixels; every: control steps from one frame to the next (2: in real time); side_by_side: all
        images at once. Returns the path."""
        path = pathlib.Path(_path(path))
        width, every = _whole(width, "width", 1, 2**32 - 1), _whole(every, "every", 1)
        ending = path.suffix.lower()
        if ending == ".html":
            return written(path, self._data.page().encode())
        if ending == ".gif":
            return written(path, self._data.gif(width, every, bool(side_by_side)))
        if ending == ".png":
            return written(path, self._data.still(True))
        raise Error(f"path={path}: expected a name that ends in .html, .gif or .png")

    def _repr_html_(self):
        still = self._data.still(False)
        return picture(still, self._words) if self._is_still else framed(self._data.small_page(), still, self._words)

    def __repr__(self):
        return self._words


def written(path, content):
    """Writes a file whole or not at all, through a temporary one in its folder, and returns its path."""
    target = path.resolve()  # a link stays
    if target.exists() and not target.is_file():
        path.write_bytes(content)  # a device, a pipe
        return path
    temporary = target.with_name(f".{target.name}.{secrets.token_hex(4)}.tmp")
    try:
        temporary.write_bytes(content)
        os.replace(temporary, target)
    finally:
        temporary.unlink(missing_ok=True)
    return path


def picture(still, title):
    """A GIF as an element of a page."""
    return f'<img src="data:image/gif;base64,{base64.b64encode(still).decode()}" alt="{html.escape(title)}">'


def framed(page, still, title):
    """A page over a picture, which is left where a viewer takes away the page and its scripts."""
    place = "position:absolute;top:0;left:0;width:100%;height:100%;border:0"
    frame = f'<iframe srcdoc="{html.escape(page)}" style="{place}" title="{html.escape(title)}"></iframe>'
    return f'<div style="position:relative;height:560px">{picture(still, title)}{frame}</div>'
