"""Whole episodes of many bodies in one call."""

import dataclasses

import numpy as np

from .. import _morphcog
from .._morphcog import Error
from .._values import _threads
from . import _goals
from ._bodies import GymError, voxels_of


@dataclasses.dataclass(frozen=True)
class Returns:
    """What episodes came to, one each."""

    reward: np.ndarray
    """The sum of its rewards."""
    steps: np.ndarray
    """Its steps."""
    terminated: np.ndarray
    """Whether the task ended: a goal was reached, it fell, or became unstable."""


def returns(task, bodies, actions, *, goals=None, start=None, threads=None):
    """Whole episodes of bodies whose actions are known beforehand, on all cores in one call: Returns.

    task: "Walker-v0" or "morphcog/Walker-v0". bodies: of any sizes. actions: for each body (steps, actuators), the
    lengths from 0.6 to 1.6. An episode lasts until the task ends, the actions are used up, or the task's steps. goals:
    the columns of BidirectionalWalker. start: as of TaskEnv. Ctrl-C ends it.
    """
    bodies, actions = list(bodies), list(actions)
    if len(bodies) != len(actions):
        raise GymError(f"actions: expected those of {len(bodies)} bodies, found {len(actions)}")
    voxels = [voxels_of(body, f"body {number}") for number, body in enumerate(bodies)]
    rows = []
    for number, given in enumerate(actions):
        given = np.asarray(given, dtype=np.float64)
        if given.ndim != 2:
            raise GymError(f"actions {number}: expected shape (steps, actuators), found {given.shape}")
        rows.append(given)
    goals = [] if goals is None else _goals.given(goals)
    try:
        task = str(task).removeprefix("morphcog/")
        return Returns(*_morphcog.returns(task, voxels, rows, goals, start, _threads(threads)))
    except Error as error:
        raise GymError(str(error)) from None
