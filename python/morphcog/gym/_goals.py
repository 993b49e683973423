"""The goals of BidirectionalWalker."""

import operator

import numpy as np

from ._bodies import GymError


def drawn(random):
    """Columns to be reached one after another: at least 100 voxel lengths of ways, as EvoGym draws them."""
    goals, at, way = [], 35, 0
    while way < 100:
        goals.append(int(random.integers(20, 50)))
        way += abs(goals[-1] - at)
        at = goals[-1]
    return goals


def given(goals):
    """Columns that a user gives."""
    try:
        goals = [operator.index(goal) for goal in np.asarray(goals).ravel()]
    except TypeError:
        goals = []
    if not goals:
        raise GymError("goals: expected whole numbers, columns to be reached one after another")
    return goals
