"""Evolve soft robots whose bodies alone recognise images.

Bodies are arrays of materials, uint8 (rows, columns), row 0 on top: 0 empty, 1 rigid, 2 soft,
3 muscle in phase, 4 muscle in antiphase, 5 sensor that shrinks with its pixel, 6 sensor that expands.
Stimuli are arrays of pixels from 0 to 1, float64 (rows, columns), a pixel for each place of the body.
Lengths are voxel lengths; x grows to the right, y upwards from the ground. A control step is a fiftieth
of an actuation cycle.

>>> import morphcog as mc
>>> run = mc.evolve("quickstart.toml", generations=50, out="runs/quick")   # or mc.load_run("runs/quick")
>>> run.elites                          # pandas DataFrame, columns named as pyribs does
>>> robot = run["best"]                 # shows itself in a notebook
>>> x = mc.stimuli(pixels, run.config)  # uint8 (images, 28, 28) -> float64 (images, rows, columns)
>>> mc.displacements([robot.body], x)   # float64 (bodies, images)
"""

from __future__ import annotations

import base64 as _base64
import html as _html
import io as _io
import json as _json
import operator as _operator
import os as _os
import pathlib as _pathlib
import sys as _sys
import threading as _threading
import time as _time
import warnings as _warnings
from collections.abc import Mapping as _Mapping
from dataclasses import dataclass as _dataclass

import numpy as _np

from . import _morphcog
from ._morphcog import Error, Unstable, __version__

__all__ = [
    "Config",
    "Error",
    "Imported",
    "Robot",
    "Run",
    "Unstable",
    "World",
    "displacements",
    "evolve",
    "from_evogym",
    "images",
    "import_dataset",
    "load_run",
    "stimuli",
]


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
    return _array(value, _np.uint8, 2, what, "materials 0 to 6 of shape (rows, columns)")


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


class Config:
    """Everything that a run depends on.

    config: a file, the name of a built-in config, or another Config. set: a change of a key, as
    "map_elites.parents=10", several of them, or a dict. Configs are equal if all their keys are.
    """

    def __init__(self, config, set=()):
        if isinstance(config, Config):
            self._data = _morphcog.ConfigData.parsed(config.to_toml(), config._data.name, _changes(set))
        else:
            self._data = _morphcog.ConfigData(_path(config), _changes(set))

    @classmethod
    def _of(cls, data):
        config = cls.__new__(cls)
        config._data = data
        return config

    def to_toml(self):
        """The config as TOML, every key with its value."""
        return self._data.to_toml()

    def to_json(self):
        """The config as JSON."""
        return self._data.to_json()

    def __eq__(self, other):
        return self.to_toml() == other.to_toml() if isinstance(other, Config) else NotImplemented

    def __hash__(self):
        return hash(self.to_toml())

    def __reduce__(self):
        return _restored_config, (self.to_toml(), self._data.name)

    def __repr__(self):
        return f"Config({self._data.name}, {self._data.about()})"


def _restored_config(toml, name):
    return Config._of(_morphcog.ConfigData.parsed(toml, name, []))


def _config(config):
    """The simulator's config, from whatever stands for one; None stays."""
    if config is None:
        return None
    return (config if isinstance(config, Config) else Config(config))._data


class _Progress:
    """Says on stderr how far a command is: in a terminal and in a notebook in one line that changes, elsewhere in
    lines from time to time; warnings are Python's."""

    def __init__(self, quiet):
        self._stream = None if quiet else _sys.stderr
        moves = getattr(self._stream, "isatty", bool)() or type(self._stream).__module__.startswith("ipykernel")
        self._moves, self._least = moves, 0.5 if moves else 10.0
        self._begun = self._said = _time.monotonic()
        self._text, self._shown = "", ""

    def __call__(self, kind, text):
        if kind == "warning":
            _warnings.warn(text, stacklevel=3)
        elif kind == "note":
            self._write(f"{self._over(text)}\n")
            self._shown = ""
        else:
            self._text = text
            # The longer it takes, the less often: a log of hours stays short.
            now = _time.monotonic()
            if now - self._said >= max(self._least, (now - self._begun) / 200):
                self._said = now
                self._show()

    def _over(self, text):
        """A text in the place of the line that is shown."""
        return f"\r{text:<{len(self._shown)}}" if self._moves and self._shown else text

    def _show(self):
        end = "" if self._moves else "\n"
        self._write(self._over(self._text) + end)
        self._shown = self._text

    def _write(self, text):
        if self._stream is not None:
            self._stream.write(text)
            self._stream.flush()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self._text != self._shown:
            self._show()
        if self._moves and self._text:
            self._write("\n")


def _main_is_interrupted():
    """True in another thread than the main one while Ctrl-C ends that, which would wait for this one."""
    main = _threading.main_thread()
    if _threading.current_thread() is main:
        return False
    handled = getattr(_sys, "_current_exceptions", dict)().get(main.ident)
    found = handled[1] if isinstance(handled, tuple) else handled
    return isinstance(found if main.is_alive() else getattr(_sys, "last_value", None), KeyboardInterrupt)


def images(dataset="builtin", split="train", data=None):
    """Images of a dataset: (uint8 (images, rows, columns), labels uint8 (images,)).

    dataset: "builtin" (digits that the program draws), "mnist", "fashion-mnist", or IDX files of your own.
    split: "train" or "test". data: folder with the files (default: MORPHCOG_DATA, then data/<dataset>).
    """
    return _morphcog.images(dataset, split, _path(data))


@_dataclass(frozen=True)
class Imported:
    """A dataset that was made: its folder, and by the name (or number) of each class a dict of its number and
    of its training and test images. about: what was done to the images, and which were left out."""

    name: str
    folder: _pathlib.Path
    size: tuple
    classes: dict
    about: dict


def import_dataset(
    pixels,
    labels=None,
    *,
    name,
    test_pixels=None,
    test_labels=None,
    test=0.2,
    seed=1,
    to=None,
    force=False,
    size=28,
    fit="auto",
    invert=None,
    transpose=None,
    quiet=False,
):
    """Makes a dataset of images, as `morphcog data import`, and returns what was made.

    pixels: images of one size, (images, rows, columns), also with 1, 3 or 4 channels, as whole numbers from 0
    to 255, fractions from 0 to 1, or bool; or a list of grey pictures of any size, uint8 (rows, columns).
    labels: whole numbers or texts, one for each. Without labels, pixels is a path, or several: folders and
    files as of the command. test_pixels, test_labels: test images; without them, a share test of each class is
    drawn by seed. to: folder to write (default: data/<name>). force: replaces a dataset there. size, fit, invert
    and transpose: how pictures are prepared, as the command's options; True and False for its yes and no.
    """
    paths, splits = [], []
    if labels is None:
        paths = [_path(path) for path in ([pixels] if isinstance(pixels, (str, bytes, _os.PathLike)) else pixels)]
        if test_pixels is not None or test_labels is not None:
            raise Error("test_pixels, test_labels: expected pixels and labels with them")
    else:
        splits.append((_pictures(pixels, "pixels"), _labels(labels, "labels")))
        if (test_pixels is None) != (test_labels is None):
            raise Error("test_pixels, test_labels: expected both or none")
        if test_pixels is not None:
            splits.append((_pictures(test_pixels, "test_pixels"), _labels(test_labels, "test_labels")))
    choices = [None if choice is None else bool(choice) for choice in (invert, transpose)]
    size, seed = _whole(size, "size", 0), _whole(seed, "seed", 0)
    with _Progress(quiet) as progress:
        folder, about = _morphcog.import_dataset(
            paths, splits, str(name), _path(to), float(test), seed, size, str(fit), choices, bool(force), progress
        )
    about = _json.loads(about)
    classes = {}
    for found in about.pop("classes"):
        called = found.pop("name")
        classes[found["class"] if called is None else called] = found
    return Imported(about.pop("name"), _pathlib.Path(folder), tuple(about.pop("size")), classes, about)


def _pictures(value, what):
    """Images as one array, or as a list of arrays of different sizes."""
    try:
        return _numbers(_np.asarray(value), what, "images, whole numbers or fractions")
    except ValueError:
        return [_array(picture, _np.uint8, 2, what, "grey pictures of bytes, (rows, columns)") for picture in value]


def _labels(value, what):
    given = _np.asarray(value)
    if given.dtype.kind in "UST" or given.dtype.kind == "O" and all(isinstance(one, str) for one in given.flat):
        return [one.decode() if isinstance(one, bytes) else str(one) for one in given.ravel().tolist()]
    return _numbers(given, what, "whole numbers or texts, one for each image")


def _numbers(given, what, expected):
    """Numbers in one of the four types that go over the bridge."""
    if given.dtype.kind not in "biuf":
        raise Error(f"{what}: expected {expected}, found type {given.dtype}")
    kinds = {"b": _np.bool_, "f": _np.float64}
    kind = kinds.get(given.dtype.kind, _np.uint8 if given.dtype == _np.uint8 else _np.int64)
    return _np.ascontiguousarray(given, dtype=kind)


def stimuli(images, config):
    """What the sensors of a config's robots see of images.

    images: (images, rows, columns), as MNIST's (n, 28, 28): whole numbers from 0 to 255 of any type, or
    bool, whose True is 255. config: a Config, a file or the name of a built-in config; its sections
    [body] and [stimulus] say how. Returns float64 (images, rows, columns) from 0 to 1, on the body's
    grid. Raises Error for arrays of another shape or type, and for sizes that do not go together.
    """
    return _morphcog.stimuli(_images(images), _config(config))


def displacements(bodies, stimuli, *, control_steps=None, config=None, threads=None):
    """How far each body walks under each image, in a fresh simulation each.

    bodies: arrays of materials, all of one size. stimuli: float64 (images, rows, columns) from 0 to 1.
    control_steps: how long each image is shown (default: as the config says, 500). config: whose physics
    and protocol are used (default: the paper's). threads: default one per core; results do not depend on
    it. Returns float64 (bodies, images) in voxel lengths, right positive, nan where a simulation became
    unstable. Other Python threads go on meanwhile; Ctrl-C ends it. Raises Error for arrays of another
    shape, type or range, and for bodies that are not connected.
    """
    bodies = [_body(body, f"body {number}") for number, body in enumerate(bodies)]
    steps = _whole(control_steps, "control_steps", 1, _morphcog.MAX_STEPS)
    return _morphcog.displacements(bodies, _stimuli(stimuli), steps, _config(config), _threads(threads))


class World:
    """One simulation of a body on flat ground, step by step; threads that share it take turns. A copy
    (copy.copy) goes on by itself from the same state.

    The stimulus may change at every control step. config: whose physics and start are used (default:
    the paper's). start_row: row of the body's bottom row at the start, 2 stands on the ground.
    """

    def __init__(self, body, *, start_row=None, config=None):
        body = _body(body)
        start_row = _whole(start_row, "start_row", 0, _morphcog.MAX_ROW)
        self._world = _morphcog.WorldData(body, start_row, _config(config))
        self._turn = _threading.RLock()
        self._seen(_np.zeros(body.shape))

    def _seen(self, pixels):
        # An assignment to one pixel would not reach the simulation.
        self._stimulus = pixels.copy()
        self._stimulus.flags.writeable = False

    @property
    def stimulus(self):
        """What the sensors see: float64 (rows, columns) from 0 to 1; dark at the start. To change it, assign an
        array of all pixels."""
        return self._stimulus

    @stimulus.setter
    def stimulus(self, pixels):
        pixels = _array(pixels, _np.float64, 2, "stimulus", "pixels from 0 to 1 of shape (rows, columns)")
        with self._turn:
            self._world.set_stimulus(pixels)
            self._seen(pixels)

    def step(self, count=1):
        """Simulates control steps. Raises Unstable if the simulation ends in one of them."""
        count = _whole(count, "count", 0)
        with self._turn:
            self._world.step(count)

    def reset(self):
        """Begins anew; the stimulus stays."""
        with self._turn:
            self._world.reset()

    @property
    def control_step(self):
        """Control steps so far."""
        with self._turn:
            return self._world.control_step

    @property
    def points(self):
        """Corners of all voxels: float64 (points, 2), voxel lengths from the start's left edge and the ground."""
        with self._turn:
            return self._world.points

    @property
    def voxels(self):
        """Corners of each voxel as indices into points, clockwise from the top left: (voxels, 4)."""
        with self._turn:
            return self._world.voxels

    @property
    def centre(self):
        """Centre of mass, the mean of all points: float64 (2,), voxel lengths."""
        with self._turn:
            return _np.array(self._world.centre)

    def __copy__(self):
        other = World.__new__(World)
        with self._turn:
            other._world, other._stimulus = self._world.copied(), self._stimulus
        other._turn = _threading.RLock()
        return other

    def __deepcopy__(self, memo):
        return self.__copy__()

    def __reduce__(self):
        raise TypeError("a World cannot be pickled: pickle its body and config, and make it anew")

    def __repr__(self):
        x, y = self.centre
        return f"World(control_step={self.control_step}, centre=({x:.2f}, {y:.2f}))"


@_dataclass(frozen=True, eq=False)
class Robot:
    """A robot of a run. In a notebook it shows itself, walking under its training images."""

    id: str
    task: str
    objective: float
    body: _np.ndarray
    run: "Run"

    def displacements(self, stimuli, **options):
        """As morphcog.displacements for this robot, with its run's config: float64 (images,)."""
        return displacements([self.body], stimuli, **{"config": self.run.config, **options})[0]

    def page(self):
        """A page for a browser in which it walks under its training images, as HTML."""
        return self.run._data.page(self.id)

    def _repr_html_(self):
        try:
            page, still = self.run._data.small_page(self.id)
        except Error as error:
            return f"<pre>{_html.escape(f'{self!r}: {error}')}</pre>"
        return _framed(page, still, repr(self))

    def __repr__(self):
        rows, columns = self.body.shape
        return f"Robot({self.id}, task={self.task}, objective={self.objective:.3f}, body={rows}×{columns})"


def _framed(page, still, title):
    """A page over a picture, which is left where a viewer takes away the page and its scripts."""
    title, page = _html.escape(title), _html.escape(page)
    picture = f'<img src="data:image/gif;base64,{_base64.b64encode(still).decode()}" alt="{title}">'
    place = "position:absolute;top:0;left:0;width:100%;height:100%;border:0"
    frame = f'<iframe srcdoc="{page}" style="{place}" title="{title}"></iframe>'
    return f'<div style="position:relative;height:560px">{picture}{frame}</div>'


class Run:
    """A run folder: an archive of robots with its config. A pickled one is its path, and is read again."""

    def __init__(self, folder):
        self._data = _morphcog.RunData(_path(folder))

    def __reduce__(self):
        return _restored_run, (self._data.place, self._data.settings())

    @property
    def path(self):
        """Its run.json."""
        return self._data.path

    @property
    def config(self):
        """Its config."""
        return Config._of(self._data.config)

    @property
    def generations(self):
        """Generations done when it was loaded."""
        return self._data.generations

    @property
    def elites(self):
        """Its robots, a row each, as a pandas DataFrame: index, objective, measures_…, solution_…, id, …"""
        return _table(_io.StringIO(self._data.elites_csv()))

    def __getitem__(self, robot):
        """A robot by its id, the beginning of that, or "best"."""
        identity, task, objective, body = self._data.robot(robot)
        return Robot(identity, task, objective, body, self)

    def evaluate(self, robots="top:10", images=None, split="test", data=None, quiet=False):
        """Tests robots on held-out images, as `morphcog eval`: a DataFrame with a row for each robot.

        images: how many, or "all"; None: 1000, or all if there are fewer. quiet: says nothing of how far it is.
        """
        with _Progress(quiet) as progress:
            return _table_in(self._data.evaluate(str(robots), images and str(images), str(split), _path(data), progress))

    def audit(self, robots="all", data=None, quiet=False):
        """Whether robots walk or exploit the simulator, as `morphcog audit`: a DataFrame with a row for each
        robot and change. quiet: says nothing of how far it is."""
        with _Progress(quiet) as progress:
            return _table_in(self._data.audit(str(robots), _path(data), progress))

    def __repr__(self):
        return f"Run({str(self.path)!r}, generations={self.generations})"


def _restored_run(path, settings):
    run = Run(path)
    if run._data.settings() != settings:
        raise Error(f"{path}: another run is there now than the one that was pickled; load it anew")
    return run


def _table(file):
    try:
        import pandas
    except ImportError:
        raise ImportError("tables need pandas: pip install pandas") from None
    return pandas.read_csv(file, dtype={"id": str})


def _table_in(path):
    with open(path, encoding="utf-8") as file:
        return _table(file)


def load_run(folder):
    """A run by its folder or its run.json; or one that ships with morphcog, as "gallery:zero_one-1"."""
    return Run(folder)


def evolve(
    config,
    *,
    generations=None,
    seed=None,
    set=(),
    out=None,
    resume=False,
    force=False,
    data=None,
    threads=None,
    quiet=False,
):
    """Evolves an archive of robots, as `morphcog evolve`, and returns its Run.

    config: a Config, a file or the name of a built-in config. set: a change of a key, as
    "map_elites.parents=10", several of them, or a dict. out: run folder (default: runs/<config>-seed<seed>).
    resume: goes on with the run in the folder. force: replaces it. quiet: says nothing of how far it is. Ctrl-C
    saves the run, which resume goes on with. Raises Error with what is wrong.
    """
    if resume and force:
        raise Error("resume=True, force=True: expected one of them: resume goes on with a run, force replaces it")
    changes = _changes(set)
    changes += [] if seed is None else [f"seed={seed}"]
    changes += [] if generations is None else [f"generations={generations}"]
    config, threads = Config(config, changes)._data, _threads(threads)
    with _Progress(quiet) as progress:
        folder = _morphcog.evolve_run(config, _path(out), bool(resume), bool(force), _path(data), threads, progress)
    return Run(folder)


def from_evogym(structure, *, driven=False):
    """A body from EvoGym's numbers of voxels (0 empty, 1 rigid, 2 soft, 3 horizontal actuator).

    Actuators become muscles in phase, which oscillate by themselves. With driven=True they become expanding
    sensors, whose pixel is EvoGym's action less 0.6: a controller sets World.stimulus at every step. Raises
    Error for 4, the vertical actuator, which morphcog's physics does not have.
    """
    structure = _array(structure, _np.uint8, 2, "structure", "EvoGym's voxels 0 to 3 of shape (rows, columns)")
    if (structure == 4).any():
        raise Error("structure: 4 is EvoGym's vertical actuator, which morphcog does not have: voxels change in width only")
    if (structure > 4).any():
        raise Error(f"structure: expected EvoGym's voxels 0 to 3, found {structure.max()}")
    body = structure.copy()
    body[structure == 3] = 6 if driven else 3
    return body
