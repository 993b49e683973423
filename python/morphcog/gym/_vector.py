"""Many environments that are stepped in parallel, in one call."""

import gymnasium
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from .. import _morphcog
from .._morphcog import Error
from .._values import _threads, _whole
from . import _goals
from ._bodies import GymError, check_connections, voxels_of
from ._env import spaces
from ._pictures import Camera, check_mode


class TaskVectorEnv(VectorEnv):
    """Robots at one task of EvoGym, on all cores; make it by gymnasium.make_vec("morphcog/Walker-v0", num_envs=64,
    body=…).

    It gives the bits of as many single environments. body: one for all, or one each, (num_envs, rows, columns) or a
    list, all with as many points and actuators. max_episode_steps: after which an episode is truncated (default: the
    task's). autoreset_mode: of gymnasium, NEXT_STEP by default. threads: default one per core. All else is as of
    TaskEnv.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 50, "autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(
        self,
        num_envs=1,
        max_episode_steps=None,
        body=None,
        connections=None,
        render_mode=None,
        render_options=None,
        autoreset_mode=AutoresetMode.NEXT_STEP,
        *,
        task,
        start=None,
        threads=None,
    ):
        if body is None:
            raise GymError("body: expected a body, as body=morphcog.gym.sample_robot((5, 5))[0]")
        try:
            self.autoreset_mode = AutoresetMode(autoreset_mode)
        except ValueError:
            known = ", ".join(mode.value for mode in AutoresetMode)
            raise GymError(f"autoreset_mode={autoreset_mode!r}: expected one of {known}") from None
        self.metadata = {**self.metadata, "autoreset_mode": self.autoreset_mode}
        self.render_mode = check_mode(render_mode)
        several = isinstance(body, (list, tuple)) and np.ndim(body[0]) == 2 if len(body) else False
        several = several or (not isinstance(body, (list, tuple)) and np.ndim(body) == 3)
        bodies = [voxels_of(one, f"body {k}") for k, one in enumerate(body)] if several else [voxels_of(body)]
        try:
            self.num_envs = _whole(num_envs, "num_envs", 1, 10**6)
            most = _morphcog.task_steps(task) if max_episode_steps is None else max_episode_steps
            self._most = _whole(most, "max_episode_steps", 1)
            self._data = _morphcog.TasksData(task, bodies, self.num_envs, start, _threads(threads))
        except Error as error:
            raise GymError(str(error)) from None
        for voxels in bodies:
            check_connections(voxels, connections)
        self.single_observation_space, self.single_action_space = spaces(self._data)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._goals = [[] for _ in range(self.num_envs)]
        self._random = [None] * self.num_envs
        self._elapsed = np.zeros(self.num_envs, dtype=np.int64)
        self._ended = np.zeros(self.num_envs, dtype=bool)
        cameras = [Camera(self._data, k, render_options) for k in range(self.num_envs if render_mode else 1)]
        self._cameras = cameras if render_mode else []

    def reset(self, *, seed=None, options=None):
        options = options or {}
        seeds = [None] * self.num_envs
        if isinstance(seed, (list, tuple, np.ndarray)):
            seeds = list(seed)
            if len(seeds) != self.num_envs:
                raise GymError(f"seed: expected {self.num_envs} seeds or one, found {len(seeds)}")
            seeds = [own if own is None else int(own) for own in seeds]
        elif seed is not None:
            super().reset(seed=int(seed))
            seeds = [int(seed) + k for k in range(self.num_envs)]
        mask = options.get("reset_mask")
        mask = np.ones(self.num_envs, dtype=bool) if mask is None else np.asarray(mask)
        if mask.dtype != bool or mask.shape != (self.num_envs,) or not mask.any():
            raise GymError(f"reset_mask: expected {self.num_envs} truth values, at least one of them true, found {mask}")
        for k in np.flatnonzero(mask):
            if seeds[k] is not None:
                self._random[k], _ = seeding.np_random(seeds[k])
        return self._begin(mask, options.get("goals")), {}

    def _begin(self, mask, goals=None):
        """Resets some environments; returns all observations."""
        if self._data.has_goals:
            one_each = goals is not None and len(goals) == self.num_envs and all(np.ndim(own) == 1 for own in goals)
            for k in np.flatnonzero(mask):
                if goals is not None:
                    self._goals[k] = _goals.given(goals[k] if one_each else goals)
                    continue
                if self._random[k] is None:
                    self._random[k], _ = seeding.np_random()
                self._goals[k] = _goals.drawn(self._random[k])
        self._elapsed[mask], self._ended[mask] = 0, False
        for k in np.flatnonzero(mask) if self._cameras else ():
            self._cameras[k].cut()
        return self._data.reset(mask, self._goals)

    def step(self, actions):
        actions = np.asarray(actions, dtype=np.float64)
        if actions.ndim != 2:
            expected = self.action_space.shape
            raise GymError(f"actions: expected shape {expected}, found {actions.shape}")
        active = None
        if self.autoreset_mode == AutoresetMode.NEXT_STEP and self._ended.any():
            active = ~self._ended
            # Wrong actions must change nothing.
            if actions.shape != self.action_space.shape or np.isnan(actions[active]).any():
                self._take(actions, active)
            self._begin(~active)
        observations, rewards, terminated = self._take(actions, active)
        self._elapsed += 1 if active is None else active
        truncated = self._elapsed >= self._most
        self._ended = terminated | truncated
        infos = {}
        if self.autoreset_mode == AutoresetMode.SAME_STEP and self._ended.any():
            ended = self._ended
            for k in np.flatnonzero(ended):
                infos = self._add_info(infos, {"final_obs": observations[k].copy(), "final_info": {}}, k)
            observations = self._begin(ended.copy())
        return observations, rewards, terminated, truncated, infos

    def _take(self, actions, active):
        try:
            return self._data.step(actions, active)
        except Error as error:
            raise GymError(str(error)) from None

    def render(self):
        """A picture of every environment."""
        if self.render_mode is None:
            gymnasium.logger.warn('render() needs environments made with render_mode="rgb_array"')
            return None
        return tuple(camera.picture() for camera in self._cameras)
