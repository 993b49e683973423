"""Evolves 5 × 5 bodies for EvoGym's Walker-v0 with pyribs, under one fixed controller.

    pip install './python[gym]' ribs
    python python/examples/evolve_walker.py [--generations 60]

The controller is a wave through the body's columns, so whole episodes are known beforehand: `returns` simulates all
bodies of a generation on all cores in one call. MAP-Elites keeps the best body for each share of actuators and of
empty places.
"""

import argparse
import time

import numpy as np
from morphcog.gym import has_actuator, is_connected, returns, sample_robot
from ribs.archives import GridArchive

SIDE, STEPS, PERIOD = 5, 500, 16


def actions(body):
    """The lengths of all actuators in each step: 1.1 + 0.5 sin, a sixth of a period later from column to column."""
    columns = np.nonzero(np.isin(body.ravel(), (3, 4)))[0] % SIDE
    step = np.arange(STEPS)[:, None]
    return 1.1 + 0.5 * np.sin(2 * np.pi * (step / PERIOD + columns / 6))


def mutated(body, random):
    """A copy with one to three other voxels that is still a robot."""
    while True:
        child = body.copy()
        places = random.choice(child.size, size=random.integers(1, 4), replace=False)
        child.flat[places] = random.integers(0, 5, size=len(places))
        if is_connected(child) and has_actuator(child):
            return child


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--generations", type=int, default=60)
    arguments.add_argument("--batch", type=int, default=64)
    arguments.add_argument("--seed", type=int, default=1)
    options = arguments.parse_args()
    random = np.random.default_rng(options.seed)
    archive = GridArchive(solution_dim=SIDE * SIDE, dims=[10, 10], ranges=[(0, 1), (0, 0.6)], seed=options.seed)
    began = time.perf_counter()
    for generation in range(options.generations + 1):
        if generation == 0:
            bodies = [sample_robot((SIDE, SIDE), seed=random)[0] for _ in range(options.batch)]
        else:
            parents = archive.sample_elites(options.batch)["solution"].reshape(-1, SIDE, SIDE)
            bodies = [mutated(parent, random) for parent in parents]
        found = returns("Walker-v0", bodies, [actions(body) for body in bodies])
        flat = np.array(bodies).reshape(len(bodies), -1)
        measures = np.column_stack([np.isin(flat, (3, 4)).mean(axis=1), (flat == 0).mean(axis=1)])
        archive.add(flat, found.reward, measures)
        if generation % 10 == 0:
            steps = (generation + 1) * options.batch * STEPS / (time.perf_counter() - began)
            stats = archive.stats
            print(
                f"generation {generation}: best return {stats.obj_max:.3f}, {stats.num_elites} elites,"
                f" at most {steps:.0f} steps/s"
            )
    best = archive.best_elite
    print("\n".join(" ".join(str(int(voxel)) for voxel in row) for row in best["solution"].reshape(SIDE, SIDE)))


if __name__ == "__main__":
    main()
