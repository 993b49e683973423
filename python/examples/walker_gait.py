"""A gait by hand on EvoGym's Walker-v0: a wave that runs through the body from back to front.

    pip install './python[gym]'
    python python/examples/walker_gait.py [--picture walker.png]
"""

import argparse

import gymnasium
import morphcog.gym  # registers the tasks
import numpy as np

# Row 0 on top: 0 empty, 2 soft, 3 horizontal and 4 vertical actuators. Two legs of vertical ones.
BODY = np.array(
    [
        [3, 3, 3, 3, 3],
        [3, 3, 3, 3, 3],
        [4, 4, 2, 4, 4],
        [4, 4, 0, 4, 4],
        [4, 4, 0, 4, 4],
    ]
)
PERIOD = 14  # control steps


def action(step, columns, kinds):
    """Lengths of all actuators: what a column does, the next one did a little earlier; widths follow heights by a
    quarter of a period."""
    wave = 2 * np.pi * (step / PERIOD + columns / 8)
    return 1.1 + 0.5 * np.sin(np.where(kinds == 4, wave, wave - np.pi / 2))


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--picture", help="PNG of the last moment (needs matplotlib)")
    options = arguments.parse_args()
    env = gymnasium.make("morphcog/Walker-v0", body=BODY, render_mode="rgb_array")
    places = env.unwrapped.get_actuator_indices("robot")
    columns, kinds = places % BODY.shape[1], BODY.ravel()[places]
    env.reset(seed=1)
    total, step, ended = 0.0, 0, False
    while not ended:
        observation, reward, terminated, truncated, info = env.step(action(step, columns, kinds))
        total, step, ended = total + reward, step + 1, terminated or truncated
        if step % 100 == 0 or ended:
            x, y = 10 * env.unwrapped.get_pos_com_obs("robot")
            print(f"step {step}: return {total:.3f}, centre at {x:.1f}, {y:.1f} voxel lengths")
    if options.picture:
        import matplotlib.image

        matplotlib.image.imsave(options.picture, env.render())


if __name__ == "__main__":
    main()
