"""Trains a controller for EvoGym's Walker-v0 by PPO, with stable-baselines3.

    pip install './python[gym]' stable-baselines3
    python python/examples/ppo_walker.py --minutes 10 --out ppo-walker

Writes the learning curve (curve.csv, curve.png if matplotlib is there), the policy (policy.zip) and the scales of its
observations (scales.pkl).
"""

import argparse
import csv
import pathlib
import time

import morphcog.gym
import numpy as np
from gymnasium.spaces import Box
from stable_baselines3.common.vec_env import VecEnv

BODY = np.array(
    [
        [3, 3, 3, 3, 3],
        [3, 3, 3, 3, 3],
        [4, 4, 2, 4, 4],
        [4, 4, 0, 4, 4],
        [4, 4, 0, 4, 4],
    ]
)


class MorphcogVecEnv(VecEnv):
    """Environments of morphcog.gym as stable-baselines3 wants them. Actions are from -1 to 1: PPO begins around 0,
    and clips to the range, but does not scale to it."""

    def __init__(self, task, num_envs, body, **options):
        self._envs = morphcog.gym.TaskVectorEnv(num_envs, body=body, task=task, autoreset_mode="SameStep", **options)
        # Before VecEnv's own __init__, which asks for them.
        self.render_mode = self._envs.render_mode
        low, high = self._envs.single_action_space.low, self._envs.single_action_space.high
        self._middle, self._half = (low + high) / 2, (high - low) / 2
        actions = Box(-1.0, 1.0, low.shape, np.float32)
        super().__init__(num_envs, self._envs.single_observation_space, actions)

    def reset(self):
        seeds = self._seeds if any(seed is not None for seed in self._seeds) else None
        observations, _ = self._envs.reset(seed=seeds)
        self._reset_seeds()
        return observations

    def step_async(self, actions):
        self._actions = self._middle + self._half * actions

    def step_wait(self):
        observations, rewards, terminated, truncated, found = self._envs.step(self._actions)
        infos = [{} for _ in range(self.num_envs)]
        for k in np.flatnonzero(terminated | truncated):
            infos[k]["terminal_observation"] = found["final_obs"][k]
            infos[k]["TimeLimit.truncated"] = bool(truncated[k] and not terminated[k])
        return observations, rewards, terminated | truncated, infos

    def close(self):
        self._envs.close()

    def get_images(self):
        return list(self._envs.render() or [])

    def get_attr(self, attr_name, indices=None):
        return [getattr(self._envs, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name, value, indices=None):
        raise AttributeError(f"{attr_name}: the environments are one; make them anew")

    def env_method(self, method_name, *method_args, indices=None, **method_kwargs):
        raise AttributeError(f"{method_name}: the environments are one")

    def env_is_wrapped(self, wrapper_class, indices=None):
        return [False for _ in self._get_indices(indices)]


def main():
    from stable_baselines3 import PPO
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.vec_env import VecMonitor, VecNormalize

    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--minutes", type=float, default=10)
    arguments.add_argument("--envs", type=int, default=64)
    arguments.add_argument("--seed", type=int, default=1)
    arguments.add_argument("--out", type=pathlib.Path, default=pathlib.Path("ppo-walker"))
    options = arguments.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    began, curve = time.monotonic(), []

    class Curve(BaseCallback):
        """Notes the mean return of the last hundred episodes after every rollout; ends in time."""

        def _on_step(self):
            return time.monotonic() - began < 60 * options.minutes

        def _on_rollout_end(self):
            if self.model.ep_info_buffer:
                mean = float(np.mean([episode["r"] for episode in self.model.ep_info_buffer]))
                curve.append((round(time.monotonic() - began, 1), self.num_timesteps, mean))
                print(f"{curve[-1][0]:.0f} s, {self.num_timesteps} steps: mean return {mean:.3f}", flush=True)

    envs = VecNormalize(VecMonitor(MorphcogVecEnv("Walker-v0", options.envs, BODY)), gamma=0.99)
    model = PPO(
        "MlpPolicy", envs, n_steps=128, batch_size=2048, n_epochs=6, learning_rate=3e-4, gamma=0.99, gae_lambda=0.95,
        clip_range=0.2, ent_coef=0.0, policy_kwargs={"log_std_init": -0.7}, seed=options.seed, device="cpu",
    )  # fmt: skip
    model.learn(10**9, callback=Curve())
    model.save(options.out / "policy.zip")
    envs.save(str(options.out / "scales.pkl"))
    with open(options.out / "curve.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["seconds", "steps", "mean_return"])
        writer.writerows(curve)
    try:
        from matplotlib import pyplot
    except ImportError:
        return
    figure, axes = pyplot.subplots(figsize=(6, 4), layout="constrained")
    axes.plot([steps for _, steps, _ in curve], [mean for *_, mean in curve])
    axes.set(xlabel="environment steps", ylabel="mean return of 100 episodes", title="PPO on morphcog/Walker-v0")
    figure.savefig(options.out / "curve.png", dpi=150)


if __name__ == "__main__":
    main()
