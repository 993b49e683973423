"""morphcog.sklearn.BodyClassifier is a classifier as scikit-learn's are."""

import os
import pickle
import tempfile
import time

import morphcog as mc
import numpy as np
import pytest

pytest.importorskip("sklearn")

from morphcog.sklearn import BodyClassifier
from sklearn.utils.estimator_checks import parametrize_with_checks

# Checks of scikit-learn that do not fit, each with the reason.
UNFIT_CHECKS = {
    "check_classifiers_train": "wants 83 % of three blobs of two features, whatever the budget; the bodies of 5 × 5 "
    "voxels that a test can train in a second answer fewer",
}

FOLDER = tempfile.TemporaryDirectory()
GAITS = os.path.join(FOLDER.name, "gaits")
FEW = {"train.random_images": 20, "train.rounds": 1, "train.images": 4, "train.final_images": 10}
SMALL = BodyClassifier(gaits=GAITS, robots="top:1", challengers=0, settings=FEW, random_state=1)


@pytest.fixture(scope="module", autouse=True)
def small_gaits():
    """Gaits of 5 × 5 voxels that walk for one cycle."""
    changes = {"data.dataset": "builtin", "body": {"height": 5, "width": 5}, "protocol.control_steps": 50}
    changes |= {"map_elites": {"initial": 30, "parents": 30}, "validation.best": 0}
    mc.evolve("gaits.toml", generations=4, set=changes, quiet=True, out=GAITS)


@parametrize_with_checks([SMALL], expected_failed_checks=lambda estimator: UNFIT_CHECKS)
def test_it_passes_the_checks_of_scikit_learn_that_fit(estimator, check):
    check(estimator)


def rows(classes, seed=1):
    """Rows of nine features: one bright third for each of three classes."""
    rng = np.random.default_rng(seed)
    y = np.arange(30) % classes
    X = rng.random((30, 9))
    X.reshape(30, 3, 3)[np.arange(30), y] += 3
    return X, np.array(["bird", "cat", "dog"])[y]


def fresh(**changes):
    return SMALL.__class__(**{**SMALL.get_params(), **changes})


def test_two_classes_have_a_body_whose_displacement_decides():
    X, y = rows(2)
    found = fresh().fit(X, y)
    (body,), (config,) = found.bodies_, found.configs_
    assert body.shape == (5, 5) and found.pairs_ == [(0, 1)]
    walks = mc.displacements([body], mc.stimuli(found._images(X), config), config=config)[0]
    decided = found.decision_function(X)
    assert np.array_equal(np.abs(decided), np.abs(walks)) and (decided == walks * np.sign(decided[0] * walks[0])).all()
    assert found.predict(X).tolist() == np.where(decided > 0, "cat", "bird").tolist()
    assert found.score(X, y) == (found.predict(X) == y).mean()
    again = pickle.loads(pickle.dumps(found))
    assert np.array_equal(again.decision_function(X), decided)


def test_more_classes_have_a_team_of_pairs_that_vote():
    X, y = rows(3)
    found = fresh().fit(X, y)
    assert found.pairs_ == [(0, 1), (0, 2), (1, 2)] and len(found.bodies_) == 3
    decided = found.decision_function(X)
    votes = np.round(decided)
    assert decided.shape == (30, 3) and (votes.sum(axis=1) == 3).all() and votes.max() <= 2
    assert found.predict(X).tolist() == found.classes_[decided.argmax(axis=1)].tolist()


def test_a_deterministic_budget_gives_the_same_body_and_a_time_budget_ends_in_time():
    X, y = rows(2)
    one, other = (fresh(challengers=2, threads=threads).fit(X, y) for threads in (1, 2))
    assert np.array_equal(one.bodies_, other.bodies_)
    begun = time.monotonic()
    timed = fresh(time_budget=2).fit(X, y)
    assert time.monotonic() - begun >= 2 and timed.decision_function(X).shape == (30,)


def test_rows_become_images_that_cover_the_body_and_keep_their_order():
    X, y = rows(2)
    found = fresh(scale="feature").fit(X, y)
    images = found._images(X)
    assert images.shape == (30, 5, 5) and images.min() == 0 and images.max() == 255
    assert np.array_equal(images[:, [0, 2, 4]][:, :, [0, 2, 4]].reshape(30, 9)[:, 0], images[:, 0, 0])
    wide = fresh().fit(np.tile(X, 8), y)
    assert wide._images(np.tile(X, 8)).shape == (30, 9, 9)
    with pytest.raises(ValueError, match='scale=.*expected "all" or "feature"'):
        fresh(scale="some").fit(X, y)
