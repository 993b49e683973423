"""The simulation behind an environment, by EvoGym's names of methods."""

import numpy as np

from .._morphcog import Error
from ._bodies import GymError

ROBOT = "robot"


class Simulation:
    """As EvoGym's EvoSim: lengths are voxel lengths, arrays of points (2, points). Of past times it knows only 0."""

    def __init__(self, data, number=0):
        self._data, self._number = data, number
        self._rest = data.points(number)
        self._action = None
        self.goals = []

    def get_time(self):
        """Control steps since the start; a step that became unstable does not count."""
        return self._data.steps(self._number)

    def get_actuator_indices(self, robot_name):
        """The places of the actuators in the flattened body, in the order of actions."""
        self._robot(robot_name)
        return np.array(self._data.actuators, dtype=np.int64)

    def get_dim_action_space(self, robot_name):
        """The number of actuators."""
        self._robot(robot_name)
        return len(self._data.actuators)

    def object_pos_at_time(self, time, object_name):
        """The points of the robot or of an object of the ground, now or at time 0."""
        return self.points(time, object_name) / 0.1

    def object_vel_at_time(self, time, object_name):
        """The velocities of the points of an object, a second."""
        return self.velocities(time, object_name) / 0.1

    def object_orientation_at_time(self, time, object_name):
        """How far an object has turned since the start, counter-clockwise, from 0 to 2 pi."""
        now = self._is_now(time)
        if object_name != ROBOT:
            self._fixed(object_name)
            return 0.0
        return self._data.orientation(self._number) if now else 0.0

    def pos_at_time(self, time):
        """The points of all objects, the robot's first."""
        return np.hstack([self.object_pos_at_time(time, name) for name in [ROBOT, *self._data.objects]])

    def vel_at_time(self, time):
        """The velocities of all points, a second."""
        return np.hstack([self.object_vel_at_time(time, name) for name in [ROBOT, *self._data.objects]])

    def set_action(self, robot_name, action):
        """Sets the lengths of the actuators for the steps that follow, clipped to [0.6, 1.6]."""
        self._robot(robot_name)
        action = np.asarray(action, dtype=np.float64)
        if action.shape != (len(self._data.actuators),) or np.isnan(action).any():
            raise GymError(f"action: expected {len(self._data.actuators)} numbers, found {action!r}")
        self._action = action.copy()

    def step(self):
        """Simulates a control step; returns whether the simulation is unstable, and so has not moved."""
        action, self._action = self._action, None
        return self._data.simulate(self._number, action)

    def reset(self):
        """Returns to the start."""
        mask = np.arange(self._data.sizes[0]) == self._number
        goals = [self.goals if own else [] for own in mask]
        self._data.reset(mask, goals)

    # In world units, for the environment.

    def points(self, time, name):
        if name != ROBOT:
            self._is_now(time)
            return self._fixed(name)
        return self._data.points(self._number) if self._is_now(time) else self._rest.copy()

    def velocities(self, time, name):
        if name != ROBOT or not self._is_now(time):
            return np.zeros_like(self.points(time, name))
        return self._data.velocities(self._number)

    def heights(self, name, objects, distance, reach, above):
        self._robot(name)
        try:
            return self._data.heights(self._number, list(objects), int(distance), float(reach), above)
        except (Error, OverflowError) as error:
            raise GymError(str(error)) from None

    def _is_now(self, time):
        """True for the present, False for the start."""
        now = self.get_time()
        if time not in (0, now):
            raise GymError(f"time={time!r}: expected 0 or the present, {now}; other moments are not kept")
        return time == now

    def _robot(self, name):
        if name != ROBOT:
            raise GymError(f"{name!r}: expected the name of the robot, {ROBOT!r}")

    def _fixed(self, name):
        try:
            return self._data.object_points(str(name))
        except Error:
            known = ", ".join([ROBOT, *self._data.objects])
            raise GymError(f"{name!r}: expected the name of an object of {known}") from None
