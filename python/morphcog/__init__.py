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

import html as _html
import io as _io
import json as _json
import operator as _operator
import os as _os
import subprocess as _subprocess
import sys as _sys
import threading as _threading
from collections.abc import Mapping as _Mapping
from dataclasses import dataclass as _dataclass

import numpy as _np

from . import _morphcog
from ._morphcog import Config, Error, Unstable, __version__

__all__ = [
    "Config",
    "Error",
    "Robot",
    "Run",
    "Unstable",
    "World",
    "displacements",
    "evolve",
    "from_evogym",
    "images",
    "load_run",
    "stimuli",
]


def _array(value, dtype, dimensions, what, expected):
    """An array of a type and a number of dimensions; nothing is rounded or cut off on the way."""
    try:
        given = _np.asarray(value)
    except ValueError:
        raise Error(f"{what}: expected {expected}, found rows of different lengths") from None
    if given.ndim != dimensions:
        raise Error(f"{what}: expected {expected}, found shape {given.shape}")
    kinds = {"u": "biu", "f": "biuf"}[_np.dtype(dtype).kind]
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


def _config(config):
    return config if config is None or isinstance(config, Config) else Config(_os.fspath(config))


def images(dataset="builtin", split="train", data=None):
    """Images of a dataset: (uint8 (images, rows, columns), labels uint8 (images,)).

    dataset: "builtin" (digits that the program draws), "mnist", "fashion-mnist", or IDX files of your own.
    split: "train" or "test". data: folder with the files (default: MORPHCOG_DATA, then data/<dataset>).
    """
    return _morphcog.images(dataset, split, None if data is None else _os.fspath(data))


def stimuli(images, config):
    """What the sensors of a config's robots see of images.

    images: uint8 (images, rows, columns), as MNIST's (n, 28, 28). config: a Config, a file or the name
    of a built-in config; its sections [body] and [stimulus] say how. Returns float64 (images, rows,
    columns) from 0 to 1, on the body's grid. Raises Error for arrays of another shape or type, and for
    sizes that do not go together.
    """
    expected = "whole numbers from 0 to 255 of shape (images, rows, columns)"
    return _morphcog.stimuli(_array(images, _np.uint8, 3, "images", expected), _config(config))


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
    """One simulation of a body on flat ground, step by step; threads that share it take turns.

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
        return self.run._data.player(self.id)

    def _repr_html_(self):
        return _framed(self.page())

    def __repr__(self):
        rows, columns = self.body.shape
        return f"Robot({self.id}, task={self.task}, objective={self.objective:.3f}, body={rows}×{columns})"


def _framed(page):
    source = _html.escape(page, quote=True)
    return f'<iframe srcdoc="{source}" style="width:100%;height:560px;border:0" title="a robot walks"></iframe>'


class Run:
    """A run folder: an archive of robots with its config."""

    def __init__(self, folder):
        self._data = _morphcog.RunData(_os.fspath(folder))

    @property
    def path(self):
        """Its run.json."""
        return self._data.path

    @property
    def config(self):
        """Its config."""
        return self._data.config

    @property
    def generations(self):
        """Generations done when it was loaded."""
        return self._data.generations

    @property
    def elites(self):
        """Its robots, a row each, as a pandas DataFrame: index, objective, measures_…, solution_…, id, …"""
        return _table(self._data.elites_csv())

    def __getitem__(self, robot):
        """A robot by its id, the beginning of that, or "best"."""
        identity, task, objective, body = self._data.robot(robot)
        return Robot(identity, task, objective, body, self)

    def evaluate(self, robots="top:10", images=1000, split="test", data=None):
        """Tests robots on held-out images, as `morphcog eval`: a DataFrame with a row for each robot.

        images: how many, or "all".
        """
        self._command("eval", "--robots", robots, "--images", images, "--split", split, data=data)
        name = "eval.csv" if split == "test" else "eval-validation.csv"
        return self._beside(name)

    def audit(self, robots="all", data=None):
        """Whether robots walk or exploit the simulator, as `morphcog audit`: a DataFrame with a row for each
        robot and change."""
        self._command("audit", "--robots", robots, data=data)
        return self._beside("audit.csv")

    def _command(self, name, *options, data=None):
        more = [] if data is None else ["--data", _os.fspath(data)]
        words = [_sys.executable, "-m", "morphcog", name, "--json", "--archive", str(self.path), *options, *more]
        done = _subprocess.run([str(word) for word in words], capture_output=True, text=True)
        if done.returncode != 0:
            said = [_json.loads(line) for line in done.stdout.splitlines()]
            errors = [event for event in said if event["event"] == "error"]
            texts = [text for event in errors for text in (event["message"], event["hint"]) if text]
            raise Error("; ".join(texts) or done.stderr.strip())

    def _beside(self, name):
        with open(self._data.beside(name), encoding="utf-8") as file:
            return _table(file.read())

    def __repr__(self):
        return f"Run({str(self.path)!r}, generations={self.generations})"


def _table(text):
    try:
        import pandas
    except ImportError:
        raise ImportError("tables need pandas: pip install pandas") from None
    return pandas.read_csv(_io.StringIO(text), dtype={"id": str})


def load_run(folder):
    """A run by its folder or its run.json; or one that ships with morphcog, as "gallery:zero_one"."""
    return Run(folder)


def _value(value):
    """A value of a config's key as text; numpy's numbers and arrays too."""
    return value if isinstance(value, str) else _json.dumps(value, default=lambda other: _np.asarray(other).tolist())


def evolve(
    config, *, generations=None, seed=None, set=(), out=None, resume=False, force=False, data=None, threads=None
):
    """Evolves an archive of robots, as `morphcog evolve`, and returns its Run.

    config: a file or the name of a built-in config. set: a change of a key, as "map_elites.parents=10", several
    of them, or a dict. out: run folder (default: runs/<config>-seed<seed>). resume: goes on with the run in the
    folder. force: replaces it. Ctrl-C saves the run, which resume goes on with. Raises Error with what is wrong.
    """
    if isinstance(set, str):
        changes = [set]
    elif isinstance(set, _Mapping):
        changes = [f"{key}={_value(value)}" for key, value in set.items()]
    else:
        changes = list(set)
    if resume and force:
        raise Error("resume=True, force=True: expected one of them: resume goes on with a run, force replaces it")
    changes += [] if seed is None else [f"seed={seed}"]
    changes += [] if generations is None else [f"generations={generations}"]
    path = lambda value: None if value is None else _os.fspath(value)
    return Run(
        _morphcog.evolve_run(_os.fspath(config), changes, path(out), resume, force, path(data), _threads(threads))
    )


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
