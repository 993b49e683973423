"""EvoGym's bodies: checks, and random ones."""

import numpy as np

from .._morphcog import Error
from .._values import _given


class GymError(Error, ValueError):
    """What morphcog.gym refuses; a ValueError, too, as EvoGym raises."""


def voxels_of(body, what="body"):
    """A body as bytes; whole floats are whole numbers, as EvoGym's own samplers give them."""
    expected = "EvoGym's voxels 0 to 4 of shape (rows, columns)"
    try:
        given = _given(body, what, expected)
    except Error as error:
        raise GymError(str(error)) from None
    if given.ndim != 2 or given.dtype.kind not in "biuf":
        found = f"shape {given.shape}" if given.ndim != 2 else f"type {given.dtype}"
        raise GymError(f"{what}: expected {expected}, found {found}")
    with np.errstate(invalid="ignore"):
        voxels = given.astype(np.uint8)
    if not np.array_equal(voxels, given):
        raise GymError(f"{what}: expected {expected}, found numbers from {given.min()} to {given.max()}")
    return np.ascontiguousarray(voxels)


def check_connections(voxels, connections):
    """Refuses connections that leave out neighbours: they would split points."""
    if connections is None:
        return
    expected = "None, or all neighbours as get_full_connectivity(body) gives them"
    given = np.asarray(connections)
    pairs = given.reshape(2, -1) if given.size == 0 else given
    if pairs.ndim != 2 or len(pairs) != 2:
        raise GymError(f"connections: expected {expected}, found shape {given.shape}")
    found = {tuple(sorted(pair)) for pair in pairs.T.tolist()}
    if found != {tuple(pair) for pair in get_full_connectivity(voxels).T.tolist()}:
        raise GymError(f"connections: expected {expected}; bodies whose neighbours are not joined are not simulated")


def get_full_connectivity(body):
    """All pairs of neighbours of a body: int64 (2, pairs), indices of the flattened body."""
    body = np.asarray(body)
    rows, columns = body.shape
    pairs = []
    for row, column in zip(*np.nonzero(body)):
        here = row * columns + column
        if column + 1 < columns and body[row, column + 1]:
            pairs.append((here, here + 1))
        if row + 1 < rows and body[row + 1, column]:
            pairs.append((here, here + columns))
    return np.array(pairs, dtype=np.int64).reshape(-1, 2).T


def is_connected(body):
    """Whether a body's voxels all hang together through their sides; a body without voxels does not."""
    body = np.asarray(body)
    filled = set(zip(*(places.tolist() for places in np.nonzero(body))))
    open_ = [next(iter(filled))] if filled else []
    left = filled - set(open_)
    while open_:
        row, column = open_.pop()
        for near in ((row - 1, column), (row + 1, column), (row, column - 1), (row, column + 1)):
            if near in left:
                left.remove(near)
                open_.append(near)
    return bool(filled) and not left


def has_actuator(body):
    """Whether a body has an actuator, horizontal or vertical."""
    return bool(np.isin(np.asarray(body), (3, 4)).any())


def sample_robot(robot_shape, pd=None, *, seed=None):
    """A random body that is connected and has an actuator, and its connections.

    robot_shape: (rows, columns). pd: weights of the five materials (default: 0.6 empty, 0.2 each other). seed: whole
    number or numpy Generator (default: another body at every call).
    """
    weights = np.array([0.6, 0.2, 0.2, 0.2, 0.2] if pd is None else pd, dtype=np.float64).ravel()
    usable = weights.shape == (5,) and np.isfinite(weights).all() and (weights >= 0).all() and weights[3:].sum() > 0
    if not usable:
        raise GymError(f"pd={pd!r}: expected five weights from 0, one of the last two above 0")
    shape = tuple(int(side) for side in robot_shape)
    if len(shape) != 2 or min(shape) < 1:
        raise GymError(f"robot_shape={robot_shape!r}: expected (rows, columns)")
    random = np.random.default_rng(seed)
    while True:
        body = random.choice(5, size=shape, p=weights / weights.sum()).astype(np.float64)
        if is_connected(body) and has_actuator(body):
            return body, get_full_connectivity(body)
