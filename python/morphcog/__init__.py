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
>>> mc.rollouts([robot.body], x).path   # also energies, ground contacts and shapes, over time
>>> child = robot.genome.mutate(seed=1) # what evolves; child.body() is its body
"""

from __future__ import annotations

import dataclasses as _dataclasses
import html as _html
import io as _io
import json as _json
import os as _os
import pathlib as _pathlib
import threading as _threading

import numpy as _np

from . import _morphcog
from ._morphcog import Error, Stopped, Unstable, __version__
from ._pictures import Figure, Recording
from ._progress import Progress as _Progress
from ._progress import main_is_interrupted as _main_is_interrupted
from ._values import _MOST_COLUMN, _array, _body, _changes, _images, _path, _stimuli, _terrain, _threads, _whole

__all__ = [
    "Config",
    "Error",
    "Figure",
    "Genome",
    "Imported",
    "Recording",
    "Robot",
    "Rollouts",
    "Run",
    "Stopped",
    "Team",
    "Unstable",
    "World",
    "displacements",
    "evolve",
    "from_evogym",
    "images",
    "import_dataset",
    "load_run",
    "load_runs",
    "numbers",
    "rollouts",
    "show",
    "stimuli",
    "team",
    "train",
    "train_pairs",
]

_dataclass = _dataclasses.dataclass


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

    def to_dict(self):
        """The config as dicts, lists, numbers and texts."""
        return _json.loads(self.to_json())

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
        splits.append((_grey_pictures(pixels, "pixels"), _labels(labels, "labels")))
        if (test_pixels is None) != (test_labels is None):
            raise Error("test_pixels, test_labels: expected both or none")
        if test_pixels is not None:
            splits.append((_grey_pictures(test_pixels, "test_pixels"), _labels(test_labels, "test_labels")))
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


def _grey_pictures(value, what):
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


@_dataclass(frozen=True, repr=False)
class Rollouts:
    """What bodies do under images: arrays of (bodies, images), or of (bodies, images, moments) with a moment for
    each of steps. Lengths are voxel lengths, energies mass·wu²/s² (a wu is ten voxel lengths); nan from where a
    simulation became unstable."""

    displacement: _np.ndarray
    """(bodies, images): how far the centre of mass moved, right positive; as morphcog.displacements."""
    steps: _np.ndarray
    """(moments,): the control steps done at each moment, 0 first."""
    path: _np.ndarray
    """(bodies, images, moments, 2): the centre of mass, x from the start's left edge, y from the ground."""
    width: _np.ndarray
    """The width of the body."""
    height: _np.ndarray
    """The height of the body, from its lowest point."""
    ground: _np.ndarray
    """The share of the body's points that touch the ground."""
    kinetic: _np.ndarray
    """The energy of the points' motion."""
    elastic: _np.ndarray
    """The energy of the springs, relative to what muscles and sensors pull them to."""
    gravitational: _np.ndarray
    """The energy of the points' height."""
    drive: _np.ndarray
    """The energy that muscles and sensors have put in so far."""

    def __repr__(self):
        bodies, images = self.displacement.shape
        return f"Rollouts({bodies} bodies, {images} images, {len(self.steps)} moments to control step {self.steps[-1]})"


def rollouts(bodies, stimuli, *, control_steps=None, every=1, config=None, threads=None):
    """What each body does under each image, in a fresh simulation each: Rollouts, for fitnesses and descriptors
    of your own.

    every: control steps from one moment to the next; a cycle has 50. All else is as of morphcog.displacements,
    whose numbers are the same to the bit.
    """
    bodies = [_body(body, f"body {number}") for number, body in enumerate(bodies)]
    steps = _whole(control_steps, "control_steps", 1, _morphcog.MAX_STEPS)
    every = _whole(every, "every", 1, _morphcog.MAX_STEPS)
    walked, moments = _morphcog.rollouts(bodies, _stimuli(stimuli), steps, every, _config(config), _threads(threads))
    width, height, ground, kinetic, elastic, gravitational, drive = (moments[..., k] for k in range(2, 9))
    steps = every * _np.arange(moments.shape[2])
    return Rollouts(
        walked, steps, moments[..., :2], width, height, ground, kinetic, elastic, gravitational, drive
    )


def show(body, stimuli=None, *, control_steps=None, config=None):
    """A body that walks under one image or several, in a fresh simulation each: a Recording, which a notebook
    shows and which save writes.

    body: an array of materials, a Robot or a Genome. stimuli: (rows, columns) or (images, rows, columns), at
    most 20 images; default: dark, or of a Robot its training images. control_steps: how long each is shown
    (default: as the config says, 500). config: whose physics are used (default: the paper's, or the robot's).
    """
    config = getattr(getattr(body, "run", body), "config", None) if config is None else config
    if isinstance(body, Robot) and stimuli is None:
        return body.recording()
    name = repr(body) if isinstance(body, (Robot, Genome)) else ""
    body = body.body if isinstance(body, Robot) else body.body() if isinstance(body, Genome) else _body(body)
    stimuli = _np.zeros(body.shape) if stimuli is None else _np.asarray(stimuli)
    stimuli = _stimuli(stimuli[None] if stimuli.ndim == 2 else stimuli)
    if not 1 <= len(stimuli) <= 20:
        raise Error(f"stimuli: expected 1 to 20 images, found {len(stimuli)}")
    steps = _whole(control_steps, "control_steps", 1, _morphcog.MAX_STEPS)
    data = _morphcog.RecordingData(body, stimuli, steps, _config(config))
    walked = ", ".join(f"{walk:+.2f}" for walk in data.displacements)
    end = "; then unstable" if data.unstable else ""
    return Recording(data, f"Recording({name or f'body={body.shape[0]}×{body.shape[1]}'}, walked {walked}{end})")


class Genome:
    """What evolves: a network that describes a body, and voxels that differ from it. Its body is connected and
    has as many muscles as the config asks for. Genomes are equal if they describe bodies in the same way.

    The random streams are those of evolution: random(config, seed, child=k) is the individual that a run of the
    config with that seed begins with as its k-th.
    """

    @classmethod
    def _of(cls, data, config):
        genome = cls.__new__(cls)
        genome._data, genome.config = data, config
        return genome

    def __init__(self):
        raise TypeError("make a Genome by Genome.random(config, seed), Genome.from_json(text, config) or robot.genome")

    @classmethod
    def random(cls, config, seed, *, generation=0, child=0):
        """A random genome. config: whose sections [body] and [genome] say what is possible."""
        config = config if isinstance(config, Config) else Config(config)
        return cls._of(_morphcog.GenomeData.random(config._data, *_stream(seed, generation, child)), config)

    def mutate(self, seed, *, generation=1, child=0):
        """A mutated copy whose body is valid."""
        data = self._data.mutate(self.config._data, *_stream(seed, generation, child))
        return Genome._of(data, self.config)

    def body(self):
        """The body: uint8 (rows, columns)."""
        return self._data.body()

    @property
    def id(self):
        """Ten letters and digits that are the same for equal genomes; the id of a robot that has it."""
        return self._data.id

    def to_json(self):
        """The genome as JSON, as in run.json."""
        return self._data.to_json()

    @classmethod
    def from_json(cls, text, config):
        """A genome from the JSON of to_json, or of a robot in run.json."""
        config = config if isinstance(config, Config) else Config(config)
        return cls._of(_morphcog.GenomeData.parsed(str(text), config._data), config)

    def _repr_html_(self):
        return show(self)._repr_html_()

    def __eq__(self, other):
        return self.to_json() == other.to_json() if isinstance(other, Genome) else NotImplemented

    def __hash__(self):
        return hash(self.to_json())

    def __reduce__(self):
        return Genome.from_json, (self.to_json(), self.config)

    def __repr__(self):
        body = self.body()
        muscles, sensors = _np.isin(body, [3, 4]).sum(), _np.isin(body, [5, 6]).sum()
        size = f"{body.shape[0]}×{body.shape[1]}"
        return f"Genome({self.id}, body={size}, voxels={(body > 0).sum()}, muscles={muscles}, sensors={sensors})"


def _stream(seed, generation, child):
    most = 2**63 - 1
    return _whole(seed, "seed", 0, most), _whole(generation, "generation", 0, most), _whole(child, "child", 0, most)


class World:
    """One simulation of a body on flat ground or terrain, step by step; threads that share it take turns. A copy
    (copy.copy) goes on by itself from the same state.

    The stimulus, or the targets of all actuators, may change at every control step. config: whose physics and start
    are used (default: the paper's). start_row: row of the body's bottom row at the start, 2 stands on flat ground;
    start_column: of its left edge.

    terrain: objects of fixed cells instead of the flat ground, as dicts: column and row of the lower left cell, and
    grid, its rows from the top, 5 fixed and 0 empty: [{"column": 0, "row": 0, "grid": ["0005", "5555"]}]. Rows count
    from 0, and the start must be given. Points and centre are then in voxel lengths from column 0 and row 0.
    """

    def __init__(self, body, *, start_row=None, config=None, start_column=None, terrain=None):
        body = _body(body)
        start_row = _whole(start_row, "start_row", 0, _morphcog.MAX_ROW)
        start_column = _whole(start_column, "start_column", -_MOST_COLUMN, _MOST_COLUMN)
        if terrain is not None:
            terrain = _terrain(terrain)
            if start_row is None or start_column is None:
                raise Error("start_column, start_row: expected with terrain")
        self._world = _morphcog.WorldData(body, start_column, start_row, _config(config), terrain)
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

    def set_targets(self, targets):
        """Sets the length that each actuator aims at from the next control step on, in voxel lengths (EvoGym's
        action): float64 (actuators,), row-major, clipped to 0.6 to 1.6. Actuators are voxels of material 7 and 8."""
        targets = _array(targets, _np.float64, 1, "targets", "a length for each actuator")
        with self._turn:
            self._world.set_targets(targets)

    def step(self, count=1):
        """Simulates control steps: a number of them, or one with new targets, as step(actions) of EvoGym. Raises
        Unstable if the simulation ends in one of them."""
        if _np.ndim(count):
            with self._turn:
                self.set_targets(count)
                self._world.step(1)
            return
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
        """Corners of all voxels: float64 (points, 2), voxel lengths from the start's left edge and the ground; on
        terrain from column 0 and row 0."""
        with self._turn:
            return self._world.points

    @property
    def velocities(self):
        """Velocities of the points: float64 (points, 2), voxel lengths per second of simulated time (a control step
        has 3 ms of it)."""
        with self._turn:
            return self._world.velocities

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

    def render(self):
        """A picture of the present moment: a Recording of it alone, which a notebook shows and save writes."""
        with self._turn:
            return Recording(self._world.recorded(self._stimulus), repr(self), is_still=True)

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

    @property
    def genome(self):
        """Its genome."""
        return Genome._of(self.run._data.genome(self.id), self.run.config)

    @property
    def answers(self):
        """The classes that it answers by walking each way: {"left": [0], "right": [1]}; None for a gait."""
        answers = self.run._data.answers(self.id)
        return None if answers is None else dict(zip(["left", "right"], map(list, answers)))

    def recording(self):
        """The robot as it walks under its training images: a Recording."""
        return Recording(self.run._data.recorded(self.id), repr(self))

    def page(self):
        """A page for a browser in which it walks under its training images, as HTML."""
        return self.recording()._data.page()

    def gif(self, path, *, width=480, every=2, side_by_side=False):
        """Writes an animation of it under its training images, and returns the path; as Recording.save."""
        path = _path(path)
        if not path.lower().endswith(".gif"):
            raise Error(f"path={path}: expected a name that ends in .gif")
        return self.recording().save(path, width=width, every=every, side_by_side=side_by_side)

    def plot(self, kind="body", **options):
        """A figure of it: "body", "spacetime" or "snapshots"; as Run.plot."""
        return self.run.plot(kind, self.id, **options)

    def _repr_html_(self):
        try:
            return self.recording()._repr_html_()
        except Error as error:
            return f"<pre>{_html.escape(f'{self!r}: {error}')}</pre>"

    def __repr__(self):
        rows, columns = self.body.shape
        return f"Robot({self.id}, task={self.task}, objective={self.objective:.3f}, body={rows}×{columns})"


class Run:
    """A run folder: an archive of robots with its config. Iteration gives its robots, len their number. A pickled
    one is its path, and is read again."""

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

    def __iter__(self):
        for identity, task, objective, body in self._data.robots():
            yield Robot(identity, task, objective, body, self)

    def __len__(self):
        return len(self._data.robots())

    @property
    def metrics(self):
        """How it went, a row for each generation, as a pandas DataFrame: qd_score, coverage, obj_max, evaluations, …"""
        path = self.path.with_name("metrics.csv")
        if not path.is_file():
            raise Error(f"{path}: there are no metrics of this run; runs that ship with morphcog have none")
        return _table_in(path)

    def plot(
        self, kind="archive", robot=None, *, every=None, width=None, title=True, transparent=False, data=None
    ):
        """A Figure, as `morphcog plot` makes it.

        kind: of the run, "archive", "progress", "accuracy" (of its evaluation), "capacity" or "gates"; of a robot,
        "body", "spacetime" or "snapshots". robot: its id, the beginning of that, or "best" (default). every:
        control steps between the poses of snapshots (default: fits the walk). width: in millimetres, 60 to 1000
        (default: a journal's column or page); letters keep their size.
        """
        every = _whole(every, "every", 1) or 0
        style = (_whole(width, "width", 60, 1000), bool(title), bool(transparent))
        return Figure(self._data.figure(str(kind), robot, every, style, _path(data)))

    def response(
        self, robots="best", *, task=None, set=(), images=1000, error=0.2, seed=None, data=None, quiet=False
    ):
        """How far each soft voxel and sensor moves robots, as `morphcog response`: a DataFrame with a row for each
        robot and place: slope, its standard error, material.

        task: two groups of classes, as "4|9", to write the accuracy that training could reach to response.json
        beside the run. images: most rollouts of a robot. error: relative error of the slopes at which it ends.
        response.svg, .png and .pdf beside the run show the slopes; of several robots, one each.
        """
        images, seed = _whole(images, "images", 0), _whole(seed, "seed", 0)
        with _Progress(quiet) as progress:
            return _table_in(
                self._data.response(
                    str(robots), task, _changes(set), images, float(error), seed, _path(data), progress
                )
            )

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
        robots = len(self)
        best = max((robot[2] for robot in self._data.robots()), default=None)
        best = "" if best is None else f", best={best:.2f}"
        return f"Run({str(self.path)!r}, generations={self.generations}, robots={robots}{best})"


def _restored_run(path, settings):
    run = Run(path)
    if run._data.settings() != settings:
        raise Error(f"{path}: another run is there now than the one that was pickled; load it anew")
    return run


def _pandas():
    try:
        import pandas
    except ImportError:
        raise ImportError("tables need pandas: pip install pandas") from None
    return pandas


def _table(file):
    return _pandas().read_csv(file, dtype={"id": str})


def _table_in(path):
    with open(path, encoding="utf-8") as file:
        return _table(file)


def load_run(folder):
    """A run by its folder or its run.json; one that ships with morphcog, as "gallery:zero_one-1"; or "gallery:",
    the five robots that the paper's authors published."""
    return Run(folder)


def load_runs(folder):
    """All runs in a folder, or of a set that ships with morphcog, as "gallery:zero_one" or "gallery:team"."""
    return [Run(path) for path in _morphcog.runs(_path(folder))]


def _either(resume, force):
    if resume and force:
        raise Error("resume=True, force=True: expected one of them: resume goes on with a run, force replaces it")
    return bool(resume), bool(force)


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
    callback=None,
):
    """Evolves an archive of robots, as `morphcog evolve`, and returns its Run.

    config: a Config, a file or the name of a built-in config. set: a change of a key, as
    "map_elites.parents=10", several of them, or a dict. out: run folder (default: runs/<config>-seed<seed>).
    resume: goes on with the run in the folder. force: replaces it. quiet: says nothing of how far it is. Ctrl-C
    saves the run, which resume goes on with. Raises Error with what is wrong.

    callback: called after every generation with a dict: generation, generations, best, coverage, qd_score,
    evaluations; best is None as long as no robot has a fitness. If it returns True or raises StopIteration,
    evolution stops there and the Run so far is returned; another exception is raised once the run is saved.
    """
    resume, force = _either(resume, force)
    changes = _changes(set)
    changes += [] if seed is None else [f"seed={seed}"]
    changes += [] if generations is None else [f"generations={generations}"]
    config, threads = Config(config, changes)._data, _threads(threads)
    with _Progress(quiet, callback) as progress:
        folder = _morphcog.evolve_run(
            config, _path(out), resume, force, _path(data), threads, progress, progress.waits
        )
    return Run(folder)


def numbers(event):
    """What of a callback's event is a number, for a tracker of experiments."""
    return {key: value for key, value in event.items() if type(value) in (int, float)}


def _archives(runs):
    """The run.json files that runs, folders or names mean."""
    several = [runs] if isinstance(runs, (str, bytes, _os.PathLike, Run)) else runs
    return [path for run in several for path in ([run._data.place] if isinstance(run, Run) else _morphcog.runs(_path(run)))]


def train(
    runs,
    task,
    *,
    robots=None,
    seed=None,
    set=(),
    dataset=None,
    out=None,
    resume=False,
    force=False,
    audit=True,
    data=None,
    threads=None,
    quiet=False,
    callback=None,
):
    """Trains a gait to tell two groups of images apart, as `morphcog train`, and returns the Run of the robot.

    runs: the Run of the gaits, its folder or its name, such as "gallery:gaits-6"; of several, the gait with the
    highest predicted accuracy is trained. task: two groups of classes, as "4|9" or "cat|dog". robots: whose gaits
    are tried (default: "top:4", of several runs "top:5"). set: changes of keys, as of evolve. dataset: its name
    (default: that of the gaits). out: run folder (default: that of the gaits and the task). audit: audits the
    robot, too.

    callback: called with a dict whenever there is news: event is "window", "round" or "challenge", and the
    fields are those of `morphcog train --json`. If it returns True or raises StopIteration, training stops and
    Stopped is raised: resume=True goes on. Another exception is raised once all rollouts are saved.
    """
    resume, force = _either(resume, force)
    changes = ([] if dataset is None else [f"data.dataset={_path(dataset)}"]) + _changes(set)
    seed, threads = _whole(seed, "seed", 0), _threads(threads)
    robots = None if robots is None else str(robots)
    with _Progress(quiet, callback) as progress:
        folder = _morphcog.train_run(
            _archives(runs), str(task), robots, seed, changes, _path(out), resume, force, bool(audit), _path(data),
            threads, progress, progress.waits,
        )
    return Run(folder)


def train_pairs(
    runs="gallery:gaits",
    *,
    classes=None,
    dataset=None,
    robots=None,
    seed=None,
    set=(),
    out=None,
    data=None,
    threads=None,
    quiet=False,
):
    """Trains a robot for each pair of classes, as `morphcog train --pairs`, and returns their Runs: a team.

    runs: of the gaits, as of train. classes: names or numbers (default: all of the dataset). dataset: its name
    (default: that of the gaits). robots: of each run (default: "top:5"). set: changes of keys; the others are
    those of the team that ships. out: folder of all runs (default: runs/<dataset>-team). Ctrl-C keeps what is
    done, and pairs that are done are not trained again: the same call goes on.
    """
    classes = None if classes is None else [str(name) for name in classes]
    robots = None if robots is None else str(robots)
    dataset, seed, threads = _path(dataset), _whole(seed, "seed", 0), _threads(threads)
    with _Progress(quiet) as progress:
        paths = _morphcog.train_pairs(
            _archives(runs), robots, classes, dataset, seed, _changes(set), _path(out), _path(data), threads, progress
        )
    return [Run(path) for path in paths]


@_dataclass(frozen=True, repr=False)
class Team:
    """Robots that were tested together. accuracy: of the answers by most votes, with its 95 % interval; walks:
    of those by the largest sum of walks. members: a DataFrame with a row for each robot. confusion and bodies:
    Figures of the answers and of all bodies. about: all of team.json. path: that file."""

    accuracy: float
    interval: tuple
    walks: float
    members: object
    confusion: Figure
    bodies: Figure
    about: dict
    path: _pathlib.Path

    def __repr__(self):
        robots, images = len(self.about["members"]), len(self.about["images"])
        low, high = self.interval
        return f"Team({robots} robots, {images} images, accuracy={self.accuracy:.3f} [{low:.3f}, {high:.3f}])"


def team(
    runs="gallery:team",
    *,
    robots="best",
    classes=None,
    images=None,
    split="test",
    seed=1,
    out=None,
    data=None,
    threads=None,
    quiet=False,
):
    """Tests robots that answer together, as `morphcog team`, and returns a Team.

    runs: Runs, folders or names; default: a robot for each pair of digits. classes: names or numbers of those to
    tell apart (default: all). images: how many, or "all"; None: 1000, or all if there are fewer. out: result file
    (default: team.json in the folder above all runs). Ctrl-C keeps what is done; the same call goes on.
    """
    classes = None if classes is None else [str(name) for name in classes]
    seed, threads = _whole(seed, "seed", 0), _threads(threads)
    with _Progress(quiet) as progress:
        table, confusion, bodies = _morphcog.team_test(
            _archives(runs), str(robots), classes, images and str(images), str(split), seed, _path(out), _path(data),
            threads, progress,
        )
    path = table.with_suffix(".json") if out is None else _pathlib.Path(_path(out))
    about = _json.loads(path.read_text(encoding="utf-8"))
    votes, walks = about["answers"]["votes"]["accuracy"], about["answers"]["walks"]["accuracy"]
    confusion, bodies = (None if figure is None else Figure(figure) for figure in (confusion, bodies))
    return Team(
        votes["accuracy"], tuple(votes["interval"]), walks["accuracy"], _members(about), confusion, bodies, about, path
    )


def _members(about):
    columns = ["id", "run", "task", "first_group_walks", "not_moved"]
    rows = [[member[key] for key in columns] + [member["own"]["accuracy"]] for member in about["members"]]
    return _pandas().DataFrame(rows, columns=[*columns, "accuracy"])


def from_evogym(structure, *, driven=None):
    """A body from EvoGym's numbers of voxels (0 empty, 1 rigid, 2 soft, 3 horizontal and 4 vertical actuator).

    driven="targets" makes actuators (7 and 8), whose lengths World.step(actions) sets, as in EvoGym; a structure with
    vertical actuators has them without asking. Otherwise horizontal actuators become muscles in phase, which oscillate
    by themselves, or, with driven=True, expanding sensors, whose pixel is EvoGym's action less 0.6: a controller sets
    World.stimulus at every step.
    """
    structure = _array(structure, _np.uint8, 2, "structure", "EvoGym's voxels 0 to 4 of shape (rows, columns)")
    if (structure > 4).any():
        raise Error(f"structure: expected EvoGym's voxels 0 to 4, found {structure.max()}")
    vertical = (structure == 4).any()
    if driven is None:
        driven = "targets" if vertical else False
    if driven not in (True, False, "targets"):
        raise Error(f'driven={driven!r}: expected True, False or "targets"')
    if vertical and driven != "targets":
        raise Error(f'driven={driven!r}: 4 is EvoGym\'s vertical actuator, which only World.step(actions) drives: expected driven="targets"')
    body = structure.copy()
    body[structure == 3] = {True: 6, False: 3, "targets": 7}[driven]
    body[structure == 4] = 8
    return body
