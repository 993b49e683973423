"""Values that users give, checked and converted."""

import json as _json
import operator as _operator
import os as _os
import warnings as _warnings
from collections.abc import Mapping as _Mapping

import numpy as _np

from . import _morphcog
from ._morphcog import Error


_MOST_COLUMN = 10**6


def _given(value, what, expected):
    try:
        return _np.asarray(value)
    except ValueError:
        raise Error(f"{what}: expected {expected}, found rows of different lengths") from None


def _array(value, dtype, dimensions, what, expected):
    """An array of a type and a number of dimensions; nothing is rounded or cut off on the way."""
    given = _given(value, what, expected)
    if given.ndim != dimensions:
        raise Error(f"{what}: expected {expected}, found shape {given.shape}")
    kinds = {"u": "iu", "f": "biuf"}[_np.dtype(dtype).kind]
    if given.dtype.kind not in kinds:
        raise Error(f"{what}: expected {expected}, found type {given.dtype}")
    converted = given.astype(dtype, copy=False)
    if _np.dtype(dtype).kind == "u" and not _np.array_equal(converted, given):
        raise Error(f"{what}: expected {expected}, found numbers from {given.min()} to {given.max()}")
    return _np.ascontiguousarray(converted)


def _whole(value, what, least, most=2**63 - 1):
    """A whole number within bounds, or none."""
    if value is None:
        return None
    try:
        number = _operator.index(value)
    except TypeError:
        number = None
    if number is None or not least <= number <= most:
        raise Error(f"{what}={value!r}: expected a whole number from {least} to {most}")
    return number


def _threads(value):
    return _whole(value, "threads", 1, _morphcog.MOST_THREADS)


def _body(value, what="body"):
    return _array(value, _np.uint8, 2, what, "materials 0 to 8 of shape (rows, columns)")


def _terrain(value):
    """Objects of fixed cells: their column, row, and rows of the grid as text."""
    keys, objects = {"column", "row", "grid"}, []
    if isinstance(value, (str, bytes, _Mapping)):
        raise Error("terrain: expected a list of objects, each a dict of column, row and grid")
    for number, given in enumerate(value):
        what = f"terrain[{number}]"
        if not isinstance(given, _Mapping) or set(given) != keys:
            raise Error(f"{what}: expected a dict of column, row and grid")
        grid = given["grid"]
        if not all(isinstance(row, str) for row in grid):
            rows = _array(grid, _np.uint8, 2, f"{what}.grid", "rows of 0 (empty) and 5 (fixed)")
            grid = ["".join(map(str, row)) for row in rows]
        column = _whole(given["column"], f"{what}.column", 0, _MOST_COLUMN)
        row = _whole(given["row"], f"{what}.row", 0, _morphcog.MAX_ROW)
        if column is None or row is None:
            raise Error(f"{what}: expected whole numbers as column and row")
        objects.append((column, row, list(grid)))
    return objects


def _stimuli(value):
    return _array(value, _np.float64, 3, "stimuli", "pixels from 0 to 1 of shape (images, rows, columns)")


def _images(value):
    """Images as bytes: bool is black and white; fractions are refused, since 1.0 may be full or 1 of 255."""
    expected = "whole numbers from 0 to 255, or bool, of shape (images, rows, columns)"
    given = _given(value, "images", expected)
    if given.dtype.kind == "b":
        given = _np.multiply(given, 255, dtype=_np.uint8)
    elif given.dtype.kind == "f":
        remedy = "if 1 is full, (255 * images).astype('uint8')"
        raise Error(f"images: expected {expected}, found type {given.dtype}; {remedy}")
    images = _array(given, _np.uint8, 3, "images", expected)
    if images.size and images.max() == 1:
        _warnings.warn("images: the largest pixel is 1 of 255, nearly black; pass bool if 1 is full", stacklevel=3)
    return images


def _path(value):
    """A path as text, from text or any path-like object; ~ is the home folder. None stays."""
    return None if value is None else _os.path.expanduser(_os.fsdecode(value))


def _value(value):
    """A value of a config's key as TOML; None is its default."""
    if value is None:
        return ""
    if isinstance(value, str):
        return value
    if isinstance(value, _os.PathLike):
        return _json.dumps(_path(value), ensure_ascii=False)
    return _json.dumps(value, default=lambda other: _np.asarray(other).tolist())


def _changes(set, before=""):
    """Changes of keys, as key=value: from one text, several, or a dict, also of dicts."""
    if isinstance(set, str):
        return [set]
    if not isinstance(set, _Mapping):
        changes = list(set)
        if not all(isinstance(change, str) for change in changes):
            raise Error('set: expected a dict, or changes of keys as "map_elites.parents=10"')
        return changes
    changes = []
    for key, value in set.items():
        inner = isinstance(value, _Mapping)
        changes += _changes(value, f"{before}{key}.") if inner else [f"{before}{key}={_value(value)}"]
    return changes
