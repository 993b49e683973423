"""A scikit-learn classifier whose model is a body: rows become images, and the answer is which way it walks.

>>> from morphcog.sklearn import BodyClassifier
>>> BodyClassifier(time_budget=120).fit(X, y).score(X_test, y_test)
"""

import os
import pathlib
import struct
import tempfile
import time

import numpy as np
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.utils import check_random_state
from sklearn.utils.multiclass import check_classification_targets
from sklearn.utils.validation import check_is_fitted, validate_data

import morphcog

# How a body is trained unless settings says otherwise.
_SETTINGS = {
    "stimulus.reduction": "area",
    "stimulus.encoding": "intensity",
    "stimulus.margin": 0,
    "train.windows": 0,
    "validation.best": 0,
}

# With a time budget, a first body is trained quickly; challengers get the rest.
_QUICK = {"train.rounds": 2, "train.images": 60, "train.final_images": 100}

# Challengers between two looks at the clock.
_AT_ONCE = 4


class BodyClassifier(ClassifierMixin, BaseEstimator):
    """A soft robot's body for two classes; for more, a body for each pair, which vote.

    A row of X becomes a square image, row by row, which the body's sensors see; images larger than the body are
    averaged down to it. The body is trained as by morphcog.train: it begins with a gait, a body that walks, and
    challengers that answer better replace it. Training uses three quarters of the rows of the scarcest class of a
    pair, and as many of the other.

    Parameters
    ----------
    time_budget : float or None
        Seconds for all of fit. Each body gets an equal share and is refined until that is over, at the least once
        trained. The result depends on the speed of the machine. None: challengers is the budget.
    challengers : int
        Challengers of each body if there is no time_budget. The result depends on nothing but the data and
        random_state.
    gaits : str, path or morphcog.Run
        The run whose gaits are tried, such as one evolved with the built-in config gaits.toml.
    robots : str
        Which of its gaits.
    scale : "all" or "feature"
        What spans the brightness from dark to full: the least and the largest value of all of X, as images need,
        or those of each feature.
    settings : dict or None
        Changes of keys of the training's config, as of morphcog.train, such as {"train.windows": 2000}.
    random_state : int, RandomState or None
        Seed of the training.
    threads : int or None
        Threads; results do not depend on it. None: one per core.
    verbose : bool
        Whether fit says how far it is.

    Attributes
    ----------
    classes_ : ndarray
        The classes.
    pairs_ : list of tuple
        The indices of the two classes that each body tells apart.
    bodies_ : list of ndarray
        The bodies: arrays of materials.
    configs_ : list of morphcog.Config
        Under which each body was trained.
    n_features_in_ : int
        The number of features.
    """

    def __init__(
        self,
        time_budget=None,
        *,
        challengers=30,
        gaits="gallery:gaits-6",
        robots="top:4",
        scale="all",
        settings=None,
        random_state=None,
        threads=None,
        verbose=False,
    ):
        self.time_budget = time_budget
        self.challengers = challengers
        self.gaits = gaits
        self.robots = robots
        self.scale = scale
        self.settings = settings
        self.random_state = random_state
        self.threads = threads
        self.verbose = verbose

    def fit(self, X, y):
        """Trains a body, or one for each pair of classes."""
        X, y = validate_data(self, X, y, dtype=np.float64)
        check_classification_targets(y)
        self.classes_, labels = np.unique(y, return_inverse=True)
        count = len(self.classes_)
        if not 2 <= count <= 256:
            raise ValueError(f"y: expected 2 to 256 classes, found {count} class{'es' * (count != 1)}")
        if self.scale not in ("all", "feature"):
            raise ValueError(f'scale={self.scale!r}: expected "all" or "feature"')
        axis = None if self.scale == "all" else 0
        self._low, span = X.min(axis), np.ptp(X, axis)
        self._span = np.where(span > 0, span, 1)
        seed = int(check_random_state(self.random_state).randint(2**31 - 1))
        gaits = self.gaits if isinstance(self.gaits, morphcog.Run) else morphcog.load_run(self.gaits)
        self._grid = next(iter(gaits)).body.shape
        images = self._images(X)
        self.pairs_ = [(a, b) for a in range(count) for b in range(a + 1, count)]
        self.bodies_, self.configs_, self._signs = [], [], []
        begun = time.monotonic()
        with tempfile.TemporaryDirectory() as folder:
            for number, pair in enumerate(self.pairs_, 1):
                until = None if self.time_budget is None else begun + self.time_budget * number / len(self.pairs_)
                robot = self._trained(gaits, images, labels, pair, seed, os.path.join(folder, str(number)), until)
                self.bodies_.append(robot.body)
                self.configs_.append(robot.run.config)
                self._signs.append(1 if 1 in robot.answers["right"] else -1)
        return self

    def _trained(self, gaits, images, labels, pair, seed, folder, until):
        """The robot that tells two classes apart: 0 and 1 in a dataset of their rows."""
        rows = [np.flatnonzero(labels == label) for label in pair]
        # Training needs two of a class.
        rows = [np.resize(own, max(len(own), 2)) for own in rows]
        both, classes = np.concatenate(rows), np.repeat([0, 1], [len(own) for own in rows])
        data = pathlib.Path(f"{folder}-data")
        _write_idx(data, images[both], classes)

        settings = {**_SETTINGS, **({} if until is None else _QUICK), **(self.settings or {})}

        def run(challengers, resume, callback=None):
            return morphcog.train(
                gaits, "0|1", robots=self.robots, seed=seed, dataset="rows", data=data, out=folder,
                set={**settings, "train.challengers": challengers}, resume=resume,
                audit=False, threads=self.threads, quiet=not self.verbose, callback=callback,
            )

        trained = run(self.challengers if until is None else 0, False)
        challengers = _AT_ONCE
        while until is not None and time.monotonic() < until:
            try:
                trained = run(challengers, True, lambda _: time.monotonic() >= until)
            except morphcog.Stopped:
                break
            challengers += _AT_ONCE
        return trained["best"]

    def _images(self, X):
        """Rows as square images of bytes, as large as the body at the least."""
        scaled = np.clip((X - self._low) / self._span, 0, 1)
        side = int(np.ceil(np.sqrt(X.shape[1])))
        images = np.zeros((len(X), side * side), np.uint8)
        images[:, : X.shape[1]] = np.round(255 * scaled)
        images = images.reshape(-1, side, side)
        least = max(self._grid)
        if side >= least:
            return images
        nearest = np.arange(least) * side // least
        return images[:, nearest[:, None], nearest]

    def _walks(self, X):
        """How far each body walks towards the second class of its pair: (rows, bodies)."""
        check_is_fitted(self)
        images = self._images(validate_data(self, X, dtype=np.float64, reset=False))
        walks = [
            sign * morphcog.displacements([body], morphcog.stimuli(images, config), config=config, threads=self.threads)[0]
            for body, config, sign in zip(self.bodies_, self.configs_, self._signs)
        ]
        # An unstable simulation is no answer.
        return np.nan_to_num(np.column_stack(walks), nan=0.0)

    def decision_function(self, X):
        """Of two classes, the displacement in voxel lengths towards the second: (rows,). Of more, the votes for
        each class, ties decided by the sum of displacements, squeezed to less than a vote: (rows, classes)."""
        walks = self._walks(X)
        if len(self.classes_) == 2:
            return walks[:, 0]
        votes, sums = (np.zeros((len(walks), len(self.classes_))) for _ in range(2))
        for walk, (first, second) in zip(walks.T, self.pairs_):
            votes[:, second] += walk > 0
            votes[:, first] += walk <= 0
            sums[:, second] += walk
            sums[:, first] -= walk
        return votes + sums / (3 * (np.abs(sums) + 1))

    def predict(self, X):
        """The class of each row."""
        decided = self.decision_function(X)
        return self.classes_[(decided > 0).astype(int) if decided.ndim == 1 else decided.argmax(axis=1)]


def _write_idx(folder, images, labels):
    """Writes training images as IDX files, which may be of one colour."""
    folder.mkdir()
    for name, array in [("train-images-idx3-ubyte", images), ("train-labels-idx1-ubyte", labels)]:
        head = struct.pack(f">BBBB{array.ndim}I", 0, 0, 8, array.ndim, *array.shape)
        (folder / name).write_bytes(head + array.astype(np.uint8).tobytes())
