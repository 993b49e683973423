"""One environment."""

import gymnasium
import numpy as np
from gymnasium.spaces import Box

from .. import _morphcog
from .._morphcog import Error
from . import _goals
from ._bodies import GymError, check_connections, voxels_of
from ._pictures import Camera, check_mode
from ._sim import ROBOT, Simulation


def spaces(data):
    """The spaces of an environment's observations and actions."""
    _, observed, actuators = data.sizes
    return Box(-data.bound, data.bound, (observed,), np.float64), Box(0.6, 1.6, (actuators,), np.float64)


class TaskEnv(gymnasium.Env):
    """A task of EvoGym with one robot; make it by gymnasium.make("morphcog/Walker-v0", body=…).

    body: (rows, columns), row 0 on top: 0 empty, 1 rigid, 2 soft, 3 horizontal and 4 vertical actuator. connections:
    None or all neighbours. render_mode: "rgb_array" or None. render_options: resolution (width, height), hide_grid,
    hide_background, hide_edges, hide_voxels. start: column and row of the lower left cell of the body's box (default:
    EvoGym's). reset's options may have the goals of BidirectionalWalker, as {"goals": [38, 23]}.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 50}
    VOXEL_SIZE = 0.1

    def __init__(self, body, connections=None, render_mode=None, render_options=None, *, task, start=None):
        voxels = voxels_of(body)
        self.render_mode = check_mode(render_mode)
        try:
            self._data = _morphcog.TasksData(task, [voxels], 1, start, 1)
        except Error as error:
            raise GymError(str(error)) from None
        check_connections(voxels, connections)
        self.observation_space, self.action_space = spaces(self._data)
        self.sim = Simulation(self._data)
        self._camera = Camera(self._data, 0, render_options)
        self._whole = np.ones(1, dtype=bool)
        self._take, self._shape = self._data.step, self.action_space.shape

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        if self._data.has_goals:
            asked = (options or {}).get("goals")
            self.sim.goals = _goals.drawn(self.np_random) if asked is None else _goals.given(asked)
        self._camera.cut()
        return self._data.reset(self._whole, [self.sim.goals])[0], {}

    def step(self, action):
        action = np.asarray(action, dtype=np.float64)
        if action.shape != self._shape:
            raise GymError(f"action: expected {self._shape[0]} numbers, found shape {action.shape}")
        try:
            observations, rewards, terminated = self._take(action[None], None)
        except Error as error:
            raise GymError(str(error)) from None
        return observations[0], rewards[0], bool(terminated[0]), False, {}

    def render(self):
        if self.render_mode is None:
            gymnasium.logger.warn('render() needs an environment made with render_mode="rgb_array"')
            return None
        return self._camera.picture()

    # EvoGym's methods, in world units: a tenth of a voxel length.

    def get_actuator_indices(self, robot_name):
        """The places of the actuators in the flattened body, in the order of actions."""
        return self.sim.get_actuator_indices(robot_name)

    def get_dim_action_space(self, robot_name):
        """The number of actuators."""
        return self.sim.get_dim_action_space(robot_name)

    def get_time(self):
        """Control steps since the start."""
        return self.sim.get_time()

    def object_pos_at_time(self, time, object_name):
        """The points (2, points) of the robot or of an object of the ground, now or at time 0."""
        return self.sim.points(time, object_name)

    def object_vel_at_time(self, time, object_name):
        """The velocities (2, points) of an object, a second."""
        return self.sim.velocities(time, object_name)

    def object_orientation_at_time(self, time, object_name):
        """How far an object has turned since the start, counter-clockwise, from 0 to 2 pi."""
        return self.sim.object_orientation_at_time(time, object_name)

    def pos_at_time(self, time):
        """The points of all objects, the robot's first."""
        return np.hstack([self.sim.points(time, name) for name in [ROBOT, *self._data.objects]])

    def vel_at_time(self, time):
        """The velocities of all points, a second."""
        return np.hstack([self.sim.velocities(time, name) for name in [ROBOT, *self._data.objects]])

    def get_pos_com_obs(self, object_name):
        """The mean of an object's points (2,)."""
        return self.sim.points(self.get_time(), object_name).mean(axis=1)

    def get_vel_com_obs(self, object_name):
        """The mean velocity of an object's points (2,)."""
        return self.sim.velocities(self.get_time(), object_name).mean(axis=1)

    def get_relative_pos_obs(self, object_name):
        """An object's points from their mean: every x, then every y."""
        points = self.sim.points(self.get_time(), object_name)
        return (points - points.mean(axis=1, keepdims=True)).ravel()

    def get_ort_obs(self, object_name):
        """An object's orientation (1,)."""
        return np.array([self.object_orientation_at_time(self.get_time(), object_name)])

    def get_floor_obs(self, object_name, terrain_list, sight_dist, sight_range=5):
        """Free heights below the robot's centre, to sight_dist voxels on either side (2 sight_dist + 1,)."""
        return self.sim.heights(object_name, terrain_list, sight_dist, sight_range, False)

    def get_ceil_obs(self, object_name, terrain_list, sight_dist, sight_range=5):
        """Free heights above the robot's centre, to sight_dist voxels on either side (2 sight_dist + 1,)."""
        return self.sim.heights(object_name, terrain_list, sight_dist, sight_range, True)
