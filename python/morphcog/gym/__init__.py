"""EvoGym's tasks as gymnasium's environments, where the ground stands still: morphcog/Walker-v0 and 18 others.

Importing this module registers them. Names, bodies, actions, observations, rewards and ends are EvoGym's; docs of
what differs: "Coming from EvoGym".

>>> import gymnasium, morphcog.gym
>>> body, connections = morphcog.gym.sample_robot((5, 5), seed=1)
>>> env = gymnasium.make("morphcog/Walker-v0", body=body)
>>> observation, info = env.reset(seed=1)
>>> envs = gymnasium.make_vec("morphcog/Walker-v0", num_envs=64, body=body)   # on all cores, one call a step
>>> morphcog.gym.returns("Walker-v0", [body], [actions]).reward               # whole episodes, for evolution

Bodies are (rows, columns), row 0 on top: 0 empty, 1 rigid, 2 soft, 3 horizontal and 4 vertical actuator. Observations
and rewards are in EvoGym's world units, a tenth of a voxel length; env.unwrapped.sim has voxel lengths.
"""

try:
    import gymnasium as _gymnasium
except ImportError:
    raise ImportError("morphcog.gym needs gymnasium: pip install 'gymnasium>=1.1'") from None

from .. import _morphcog
from ._bodies import GymError, get_full_connectivity, has_actuator, is_connected, sample_robot
from ._env import TaskEnv
from ._episodes import Returns, returns
from ._sim import Simulation
from ._vector import TaskVectorEnv

__all__ = [
    "GymError",
    "REFUSED",
    "Returns",
    "Simulation",
    "TASKS",
    "TaskEnv",
    "TaskVectorEnv",
    "get_full_connectivity",
    "has_actuator",
    "is_connected",
    "returns",
    "sample_robot",
]


def _refused(*_, task, **__):
    """Says why a task of EvoGym is not simulated."""
    try:
        _morphcog.task_steps(task)
    except _morphcog.Error as error:
        raise GymError(f"morphcog/{error}") from None


def _register():
    steps, refused = _morphcog.tasks()
    for task, most in steps:
        _gymnasium.register(
            f"morphcog/{task}",
            entry_point="morphcog.gym:TaskEnv",
            vector_entry_point="morphcog.gym:TaskVectorEnv",
            max_episode_steps=most,
            kwargs={"task": task},
        )
    for task in refused:
        _gymnasium.register(
            f"morphcog/{task}",
            entry_point="morphcog.gym:_refused",
            vector_entry_point="morphcog.gym:_refused",
            kwargs={"task": task},
        )
    return tuple(task for task, _ in steps), tuple(refused)


TASKS, REFUSED = _register()
