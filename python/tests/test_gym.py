"""EvoGym's tasks: its numbers, gymnasium's contract, the same bits for one environment and for many, clear refusals.

The data are EvoGym's own: whole episodes with actions 1.1 + 0.5 sin(2 pi t / 25 + phase k) for actuator k in step t,
the observations of resets, and episodes that end.
"""

import json
import lzma
import pathlib
import runpy
import subprocess
import sys
import types
import warnings

import gymnasium as gym
import morphcog as mc
import morphcog.gym as heir
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv

DATA = pathlib.Path(__file__).with_name("data")
WALKER = np.array([[3, 3, 3], [3, 0, 4], [4, 0, 4]])


def reference(name):
    return json.loads(lzma.decompress((DATA / f"evogym_{name}.json.xz").read_bytes()))


EPISODES, RESETS, ENDS = reference("episodes"), reference("resets"), reference("ends")


def waves(steps, actuators, phase):
    step, actuator = np.arange(steps)[:, None], np.arange(actuators)
    return 1.1 + 0.5 * np.sin(2 * np.pi * step / 25 + phase * actuator)


def make(task, body=WALKER, **options):
    with warnings.catch_warnings():
        # That a newer version of the task exists.
        warnings.simplefilter("ignore")
        return gym.make(f"morphcog/{task}", body=body, **options)


def named(episodes):
    return [pytest.param(episode, id=f"{k}-{episode['task']}") for k, episode in enumerate(episodes)]


def test_the_reference_is_whole():
    assert len(EPISODES) == 38 and len(RESETS) == 76 and len(ENDS) == 28
    assert {episode["task"] for episode in EPISODES} == set(heir.TASKS) == {reset["task"] for reset in RESETS}


@pytest.mark.parametrize("episode", named(EPISODES))
def test_rewards_and_observations_of_whole_episodes_are_evogyms(episode):
    env = make(episode["task"], np.array(episode["body"], dtype=float), start=(episode["robot_x"], episode["robot_y"]))
    goals = GOALS_OF.get(id(episode))
    observation, info = env.reset(options={"goals": goals} if goals else None)
    assert info == {} and env.action_space.shape == (episode["actuators"],)
    seen, rewards = {0: observation}, []
    for t, action in enumerate(waves(len(episode["rewards"]), episode["actuators"], 1.7)):
        observation, reward, terminated, truncated, info = env.step(action)
        assert not terminated and not truncated
        rewards.append(reward)
        seen[t + 1] = observation
    settled = SENSITIVE_FROM.get(EPISODES.index(episode), len(rewards))
    assert np.abs(np.array(rewards) - episode["rewards"])[:settled].max() < 1e-9
    for step, expected in zip(episode["observation_steps"], episode["observations"], strict=True):
        assert step > settled or np.abs(seen[step] - expected).max() < 1e-6, step


def test_the_episode_that_is_not_followed_to_its_end_depends_on_rounding():
    for number, step in SENSITIVE_FROM.items():
        episode, found = EPISODES[number], []
        for change in (0, 1e-15, 1e-14):
            env = make(episode["task"], episode["body"], start=(episode["robot_x"], episode["robot_y"]))
            env.reset()
            found.append([env.step(row + change)[1] for row in waves(200, episode["actuators"], 1.7)])
        different = np.abs(np.array(found[1:]) - found[0]).max(axis=0)
        assert different[:step].max() < 1e-11 and different[step:].max() > 1e-9


#: Contacts that the last bit decides: from this step on, changing the actions by 1e-14 changes rewards by over 1e-9.
SENSITIVE_FROM = {29: 180}
#: EvoGym draws goals without a seed; its rewards say which they were.
WALKERS = [episode for episode in EPISODES if episode["task"] == "BidirectionalWalker-v0"]
GOALS_OF = dict(zip(map(id, WALKERS), ([28], [38, 23]), strict=True))


@pytest.mark.parametrize("reset", named(RESETS))
def test_resets_are_evogyms(reset):
    env = make(reset["task"], np.array(reset["body"]))
    observation, _ = env.reset(options={"goals": [35]})
    expected = np.array(reset["observation"])
    if reset["task"] == "BidirectionalWalker-v0":
        # Goals are drawn.
        observation, expected = observation[:-2], expected[:-2]
    assert observation.dtype == np.float64 and observation.shape == expected.shape
    assert np.abs(observation - expected).max() < 1e-12
    assert list(env.unwrapped.get_actuator_indices("robot")) == reset["actuator_indices"]
    assert env.spec.max_episode_steps == reset["spec_max"]
    assert (env.observation_space.low[0], env.observation_space.high[0]) == tuple(reset["bounds"])


@pytest.mark.parametrize("end", named(ENDS))
def test_episodes_end_as_evogyms(end):
    body = np.array(end["body"])
    env = make(end["task"], body, start=(end["robot_x"], end["robot_y"]))
    observation, _ = env.reset(options={"goals": end["goals"]} if end["goals"] else None)
    rewards = []
    for action in waves(len(end["rewards"]), np.isin(body, (3, 4)).sum(), end["phase"]):
        observation, reward, terminated, _, _ = env.step(action)
        rewards.append(reward)
        assert terminated == (len(rewards) == end["ended_at"] + 1)
    assert np.abs(np.array(rewards) - end["rewards"]).max() < 1e-8
    assert np.abs(observation - end["last_observation"]).max() < 1e-6
    centre = env.unwrapped.sim.object_pos_at_time(env.unwrapped.get_time(), "robot").mean(axis=1)
    assert np.abs(centre - end["last_com"]).max() < 1e-6
    if end["unstable"] and env.unwrapped.get_time() > 0:
        # The penalty comes again at every step until the reset.
        again = env.step(action)
        assert again[1] <= -3 and again[2] and np.array_equal(again[0], observation)


@pytest.mark.parametrize("task", heir.TASKS)
def test_gymnasiums_own_check_passes(task):
    env = make(task, render_mode="rgb_array", render_options={"resolution": (60, 30)})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        check_env(env.unwrapped)


def test_the_32_tasks_are_registered_and_13_say_why_they_are_not_simulated():
    assert len(heir.TASKS) == 19 and len(heir.REFUSED) == 13
    sentence = "morphcog/Pusher-v0: this task has an object that moves, which morphcog does not simulate"
    with pytest.raises(ValueError, match=sentence):
        make("Pusher-v0")
    for task in heir.REFUSED:
        with pytest.raises(mc.Error, match="which morphcog does not simulate"):
            make(task)
        with warnings.catch_warnings(), pytest.raises(mc.Error, match="which morphcog does not simulate"):
            warnings.simplefilter("ignore")
            gym.make_vec(f"morphcog/{task}", num_envs=2, body=WALKER)


@pytest.mark.parametrize("mode", list(AutoresetMode))
@pytest.mark.parametrize("task", ["BidirectionalWalker-v0", "UpStepper-v0", "Flipper-v0"])
def test_many_environments_have_the_bits_of_single_ones(task, mode):
    count, most = 5, 17
    # Each is cut off after a few steps; some end before.
    single = lambda: gym.wrappers.TimeLimit(make(task).unwrapped, most)
    ours = gym.make_vec(f"morphcog/{task}", num_envs=count, body=WALKER, autoreset_mode=mode)
    ours.close()
    ours = heir.TaskVectorEnv(count, most, WALKER, autoreset_mode=mode, task=task)
    theirs = SyncVectorEnv([single] * count, autoreset_mode=mode)
    assert ours.metadata["autoreset_mode"] is mode
    assert ours.observation_space == theirs.observation_space and ours.action_space == theirs.action_space
    a, b = ours.reset(seed=3), theirs.reset(seed=3)
    assert np.array_equal(a[0], b[0]) and a[1] == b[1] == {}
    random, ended = np.random.default_rng(1), 0
    for t in range(60):
        actions = random.uniform(0.5, 1.7, ours.action_space.shape)
        a, b = ours.step(actions), theirs.step(actions)
        for mine, other in zip(a[:4], b[:4], strict=True):
            assert np.array_equal(mine, other) and mine.dtype == other.dtype, t
        assert a[4].keys() == b[4].keys()
        for key in a[4]:
            for mine, other in zip(a[4][key], b[4][key]):
                assert np.array_equal(mine, other), key
        done = a[2] | a[3]
        ended += done.sum()
        if mode == AutoresetMode.DISABLED and done.any():
            a, b = (envs.reset(options={"reset_mask": done.copy()}) for envs in (ours, theirs))
            assert np.array_equal(a[0], b[0])
    assert ended >= 3 * count - 3


def test_episodes_that_end_begin_anew_in_a_vector():
    # Both goals are reached in the first step.
    envs = heir.TaskVectorEnv(3, body=WALKER, task="BidirectionalWalker-v0", autoreset_mode="NextStep")
    first, _ = envs.reset(seed=1, options={"goals": [[34, 35], [49, 20, 49], [34]]})
    actions = np.full(envs.action_space.shape, 1.5)
    observations, rewards, terminated, truncated, _ = envs.step(actions)
    assert terminated.tolist() == [True, False, True] and not truncated.any() and rewards[0] > 0.9
    observations, rewards, terminated, _, _ = envs.step(np.where(terminated[:, None], np.nan, actions))
    assert rewards[0] == rewards[2] == 0 and rewards[1] != 0 and not terminated.any()
    assert np.array_equal(observations[0][:-3], first[0][:-3])
    envs = heir.TaskVectorEnv(1, body=WALKER, task="BidirectionalWalker-v0", autoreset_mode="Disabled")
    envs.reset(options={"goals": [34]})
    envs.step(actions[:1])
    with pytest.raises(ValueError, match="no goal is left: reset the environment"):
        envs.step(actions[:1])


def test_returned_arrays_are_fresh_and_resets_exact():
    env = make("DownStepper-v0")
    first, _ = env.reset()
    kept = first.copy()
    action = np.full(env.action_space.shape, 1.3, dtype=np.float32)
    steps = [env.step(action) for _ in range(20)]
    assert np.array_equal(first, kept) and not np.array_equal(steps[0][0], steps[1][0])
    again, _ = env.reset()
    assert np.array_equal(again, first)
    for observation, reward, *_ in steps:
        now = env.step(action)
        assert np.array_equal(now[0], observation) and now[1] == reward and type(now[1]) is np.float64


def test_whole_episodes_of_many_bodies_have_the_rewards_of_single_steps():
    bodies = [np.array([[3, 4], [4, 3]]), WALKER, heir.sample_robot((4, 6), seed=5)[0]]
    actions = [waves(60, np.isin(body, (3, 4)).sum(), 0.9) for body in bodies]
    found = heir.returns("morphcog/Hurdler-v0", bodies, actions, threads=2)
    for body, rows, total, steps, terminated in zip(bodies, actions, found.reward, found.steps, found.terminated):
        env = make("Hurdler-v0", body)
        env.reset()
        rewards, ended = [], False
        for action in rows:
            if not ended:
                _, reward, ended, _, _ = env.step(action)
                rewards.append(reward)
        assert (steps, terminated) == (len(rewards), ended)
        assert total == pytest.approx(sum(rewards), abs=1e-12)
    ended = heir.returns("BidirectionalWalker-v0", [WALKER], [waves(9, 7, 1)], goals=[34])
    assert ended.terminated.tolist() == [True] and ended.steps.tolist() == [1]


REFUSALS = [
    ({"body": [[3, 9]]}, "found 9"),
    ({"body": [[3, 1.5]]}, "voxels 0 to 4"),
    ({"body": [[3, np.nan]]}, "voxels 0 to 4"),
    ({"body": [3, 3]}, "shape"),
    ({"body": [[3, 3], [3]]}, "different lengths"),
    ({"body": [["a"]]}, "type"),
    ({"body": [[3, 0, 3]]}, "hang together"),
    ({"body": [[1, 2]]}, "actuator"),
    ({"body": [[0, 0]]}, "actuator"),
    ({"connections": [[0], [1]]}, "all neighbours"),
    ({"connections": [0, 1]}, "all neighbours"),
    ({"render_mode": "human", "unwrapped": True}, "RecordVideo"),
    ({"render_options": {"colour": 1}}, "colour"),
    ({"render_options": {"resolution": (2, 2)}}, "resolution"),
    ({"start": (1, 0)}, "overlaps ground"),
]


@pytest.mark.parametrize(("options", "words"), REFUSALS)
def test_what_is_wrong_is_refused_with_one_sentence(options, words):
    options = {"body": WALKER, **options}
    options.pop("unwrapped", None)
    for make_one in (heir.TaskEnv, lambda **given: heir.TaskVectorEnv(2, **given)):
        with pytest.raises(ValueError, match=words) as error:
            make_one(task="Walker-v0", **options)
        assert isinstance(error.value, mc.Error) and "\n" not in str(error.value)


def test_bodies_that_are_too_wide_are_refused_even_with_empty_columns():
    wide = np.zeros((2, 6))
    wide[0, 0] = 3
    with pytest.raises(ValueError, match="overlaps pipe of Climber-v0"):
        make("Climber-v0", wide)
    assert make("Climber-v0", wide[:, :5])


def test_actions_that_are_wrong_change_nothing():
    env = make("Walker-v0").unwrapped
    before, _ = env.reset()
    size = env.action_space.shape[0]
    for wrong in (np.ones(size + 1), np.ones((1, size)), np.full(size, np.nan), np.ones(0)):
        with pytest.raises(ValueError, match="action"):
            env.step(wrong)
    assert env.get_time() == 0
    envs = heir.TaskVectorEnv(2, body=WALKER, task="Walker-v0", max_episode_steps=1)
    with pytest.raises(ValueError, match="environment 1: action"):
        envs.step(np.array([np.ones(size), np.full(size, np.nan)]))
    envs.reset()
    envs.step(np.ones((2, size)))
    with pytest.raises(ValueError, match="actions"):
        envs.step(np.ones((2, size + 1)))
    # Beyond the range is clipped, as EvoGym does.
    env.reset()
    a = env.step(np.full(size, 1.6))[0]
    env.reset()
    assert np.array_equal(env.step(np.full(size, np.inf))[0], a)


def test_bodies_and_connections_as_evogyms_samplers_give_them_are_taken():
    body, connections = heir.sample_robot((5, 5), seed=7)
    assert body.dtype == np.float64 and connections.dtype == np.int64 and connections.shape[0] == 2
    assert heir.is_connected(body) and heir.has_actuator(body)
    assert np.array_equal(body, heir.sample_robot((5, 5), seed=7)[0])
    backwards = connections[::-1, ::-1].astype(float)
    assert np.array_equal(
        make("Walker-v0", body, connections=connections).reset()[0],
        make("Walker-v0", body, connections=np.hstack([backwards, backwards])).reset()[0],
    )
    assert not heir.is_connected(np.array([[3, 0], [0, 3]])) and not heir.is_connected(np.zeros((2, 2)))
    full = heir.get_full_connectivity(np.array([[1, 2], [0, 3]]))
    assert full.tolist() == [[0, 1], [1, 3]]
    with pytest.raises(ValueError, match="pd"):
        heir.sample_robot((3, 3), pd=[1, 1, 1, 0, 0])


def test_evogyms_methods_are_there():
    env = make("PlatformJumper-v0").unwrapped
    first, _ = env.reset()
    n = env.sim.object_pos_at_time(0, "robot").shape[1]
    assert env.get_dim_action_space("robot") == 7 and env.VOXEL_SIZE == 0.1
    for _ in range(3):
        observation, *_ = env.step(np.full(7, 1.2))
    assert env.get_time() == env.sim.get_time() == 3
    seen = [
        env.get_vel_com_obs("robot"), env.get_ort_obs("robot"), env.get_relative_pos_obs("robot"),
        env.get_floor_obs("robot", [f"platform_{k}" for k in range(1, 8)], 5),
    ]
    assert np.abs(np.concatenate(seen) - observation).max() < 1e-12
    assert np.allclose(env.object_pos_at_time(3, "robot"), env.sim.object_pos_at_time(3, "robot") * 0.1)
    assert env.sim.pos_at_time(0).shape == (2, n + 2 * 21 + 6 * 22)
    assert np.allclose(env.sim.object_pos_at_time(3, "platform_2").min(axis=1), [21, 7])
    assert env.get_ceil_obs("robot", ["platform_1"], 2).tolist() == [0.5] * 5
    with pytest.raises(ValueError, match="other moments are not kept"):
        env.object_pos_at_time(2, "robot")
    with pytest.raises(ValueError, match="platform_7"):
        env.get_floor_obs("robot", ["ground"], 2)
    # The simulation alone goes on with the last lengths.
    twin = make("PlatformJumper-v0").unwrapped
    twin.reset()
    twin.sim.set_action("robot", np.full(7, 1.2))
    assert [twin.sim.step() for _ in range(3)] == [False] * 3
    assert np.array_equal(twin.object_pos_at_time(3, "robot"), env.object_pos_at_time(3, "robot"))
    twin.sim.reset()
    assert np.abs(twin.get_relative_pos_obs("robot") - first[3 : 3 + 2 * n]).max() < 1e-12


def test_pictures_show_the_robot_in_the_middle():
    env = make("Walker-v0", np.full((3, 3), 3), render_mode="rgb_array")
    env.reset()
    picture = env.render()
    assert picture.shape == (600, 1200, 3) and picture.dtype == np.uint8
    hidden = make("Walker-v0", np.full((3, 3), 3), render_mode="rgb_array", render_options={"hide_voxels": True})
    hidden.reset()
    different = np.argwhere((picture != hidden.render()).any(axis=2))
    middle = (different.min(axis=0) + different.max(axis=0)) / 2
    assert np.abs(middle - [300, 600]).max() < 4
    envs = heir.TaskVectorEnv(
        2, body=WALKER, task="Climber-v2", render_mode="rgb_array", render_options={"resolution": (80, 40)}
    )
    envs.reset()
    assert [frame.shape for frame in envs.render()] == [(40, 80, 3)] * 2


def test_different_bodies_in_a_vector_must_have_one_size():
    other = np.where(WALKER == 3, 4, WALKER)
    envs = heir.TaskVectorEnv(2, body=[WALKER, other], task="Walker-v0")
    observations, _ = envs.reset()
    for _ in range(3):
        observations, *_ = envs.step(np.full(envs.action_space.shape, 1.4))
    assert not np.array_equal(*observations)
    with pytest.raises(ValueError, match="returns"):
        heir.TaskVectorEnv(2, body=[WALKER, np.full((3, 3), 3)], task="Walker-v0")
    with pytest.raises(ValueError, match="one body or 3, found 2"):
        heir.TaskVectorEnv(3, body=[WALKER, other], task="Walker-v0")


def test_without_gymnasium_one_sentence_says_what_is_missing():
    program = "import sys; sys.modules['gymnasium'] = None\nimport morphcog\nimport morphcog.gym"
    failed = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    last = failed.stderr.strip().splitlines()[-1]
    assert failed.returncode == 1 and last == "ImportError: morphcog.gym needs gymnasium: pip install 'gymnasium>=1.1'"


EXAMPLES = pathlib.Path(__file__).parents[1] / "examples"


class VecEnv:
    """What stable-baselines3's class of this name does, as far as the example needs it: torch is too large for tests."""

    def __init__(self, num_envs, observation_space, action_space):
        self.num_envs, self.observation_space, self.action_space = num_envs, observation_space, action_space
        self._reset_seeds()
        assert self.get_attr("render_mode") == [None] * num_envs

    def seed(self, seed):
        self._seeds = [seed + k for k in range(self.num_envs)]

    def _reset_seeds(self):
        self._seeds = [None] * self.num_envs

    def _get_indices(self, indices):
        return range(self.num_envs) if indices is None else indices

    def step(self, actions):
        self.step_async(actions)
        return self.step_wait()


def test_the_examples_adapter_gives_stable_baselines3_what_it_needs(monkeypatch):
    for name in ("stable_baselines3", "stable_baselines3.common", "stable_baselines3.common.vec_env"):
        monkeypatch.setitem(sys.modules, name, types.ModuleType(name))
    sys.modules["stable_baselines3.common.vec_env"].VecEnv = VecEnv
    adapter = runpy.run_path(str(EXAMPLES / "ppo_walker.py"))["MorphcogVecEnv"]
    envs = adapter("Walker-v0", 3, WALKER, max_episode_steps=4)
    envs.seed(1)
    first = envs.reset()
    env = make("Walker-v0")
    assert np.array_equal(first[1], env.reset()[0])
    for t in range(4):
        observations, rewards, dones, infos = envs.step(np.full((3, 7), 0.4, dtype=np.float32))
        last, reward, *_ = env.step(np.full(7, 1.1 + 0.5 * np.float64(np.float32(0.4))))
        assert rewards.tolist() == pytest.approx([reward] * 3, abs=1e-12) and dones.tolist() == [t == 3] * 3
    assert np.array_equal(observations, first)
    assert np.allclose(infos[2]["terminal_observation"], last, atol=1e-12) and infos[2]["TimeLimit.truncated"] is True
    envs.close()


@pytest.mark.parametrize("example", ["walker_gait.py", "evolve_walker.py"])
def test_examples_run(example):
    short = ["--generations", "1", "--batch", "4"] if example.startswith("evolve") else []
    done = subprocess.run([sys.executable, EXAMPLES / example, *short], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "return" in done.stdout
