"""Control steps a second at Walker-v0 beside EvoGym: the same robots and actions, in turns, by processor time.

    python benches/evogym_tasks.py EVOGYM_PYTHON [MORPHCOG_PYTHON [REPEATS]]

EVOGYM_PYTHON has evogym (Python 3.7 to 3.10, numpy below 2), MORPHCOG_PYTHON morphcog and gymnasium (default: this one).
Prints CSV: in each turn EvoGym's environment, one of ours through Python, and a vector of 64 of ours on two threads; then
their medians, and how many times EvoGym's steps they take. Processor time is that of all threads; two cores take twice
the steps of a second of it where they have nothing else to do, and the wall clock says what they took here.
"""

import json
import platform
import random
import statistics
import subprocess
import sys
import time

ROBOTS, STEPS, COPIES, THREADS = 4, 500, 64, 2


def sampled(rng):
    """A robot of 5 × 5 voxels, drawn as EvoGym draws them: connected, with an actuator."""
    while True:
        body = [rng.choices(range(5), [3, 1, 1, 1, 1], k=5) for _ in range(5)]
        filled = {(row, column) for row in range(5) for column in range(5) if body[row][column]}
        reached, edge = set(), list(filled)[:1]
        while edge:
            row, column = edge.pop()
            reached.add((row, column))
            beside = {(row + 1, column), (row - 1, column), (row, column + 1), (row, column - 1)}
            edge += beside & filled - reached
        if filled and reached == filled and any(max(row) >= 3 for row in body):
            return body


def gaits(actuators, count):
    """Actions of an episode: (steps, count, actuators), a phase for each actuator, shifted from one copy to the next."""
    import numpy as np

    phases = 1.7 * np.arange(actuators) + 0.1 * np.arange(count)[:, None]
    return 1.1 + 0.5 * np.sin(2 * np.pi * np.arange(STEPS)[:, None, None] / 25 + phases)


def measured(what, bodies):
    """Steps, processor and wall-clock time of episodes of all bodies."""
    import gymnasium
    import numpy as np

    if what == "evogym":
        import evogym.envs  # noqa: F401

        name, copies = "Walker-v0", 1
    else:
        import morphcog.gym  # noqa: F401

        name, copies = "morphcog/Walker-v0", COPIES if what == "vector" else 1
    # Enough to measure: ours are faster.
    episodes = {"evogym": 1, "one": 10, "vector": 1}[what]
    steps = processor = wall = 0
    for body in bodies:
        body = np.array(body, dtype=float)
        if what == "vector":
            env = gymnasium.make_vec(name, num_envs=copies, body=body, threads=THREADS)
        else:
            env = gymnasium.make(name, body=body)
        actions = gaits(int((body >= 3).sum()), copies)
        actions = actions if what == "vector" else actions[:, 0]
        for _ in range(episodes):
            env.reset(seed=1)
            before = time.process_time(), time.perf_counter()
            for action in actions:
                _, _, terminated, _, _ = env.step(action)
                steps += copies
                if what != "vector" and terminated:
                    break
            processor += time.process_time() - before[0]
            wall += time.perf_counter() - before[1]
        env.close()
    return {"steps": steps, "processor_s": processor, "wall_s": wall}


def processor():
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            about = dict(line.split(":", 1) for line in file.read().split("\n\n")[0].splitlines())
        about = {key.strip(): value.strip() for key, value in about.items()}
        return f"{about['model name']} (family {about['cpu family']})"
    except (OSError, KeyError, ValueError):
        return platform.processor() or platform.machine()


def main():
    if sys.argv[1] == "--measure":
        print(json.dumps(measured(sys.argv[2], json.load(sys.stdin))))
        return
    theirs = sys.argv[1]
    ours = sys.argv[2] if len(sys.argv) > 2 else sys.executable
    repeats = int(sys.argv[3]) if len(sys.argv) > 3 else 5
    rng = random.Random(1)
    bodies = json.dumps([sampled(rng) for _ in range(ROBOTS)])
    machine, found = processor(), {"evogym": [], "one": [], "vector": []}
    print("turn,what,robots,threads,steps,processor_s,wall_s,steps_per_processor_s,steps_per_wall_s,times_evogym,processor")

    def line(turn, what, steps, processor_s, wall_s, rate, wall_rate, times=""):
        count, threads = (COPIES, THREADS) if what == "vector" else (1, 1)
        print(
            f"{turn},{what},{count},{threads},{steps},{processor_s},{wall_s},{rate:.0f},{wall_rate:.0f},{times},{machine}",
            flush=True,
        )

    for turn in range(repeats):
        # Machines grow slower and faster, so they take turns in going first.
        for what in sorted(found, reverse=turn % 2 == 1):
            python = theirs if what == "evogym" else ours
            command = [python, "-W", "ignore", __file__, "--measure", what]
            done = subprocess.run(command, input=bodies, check=True, capture_output=True, text=True)
            one = json.loads(done.stdout.splitlines()[-1])
            rates = one["steps"] / one["processor_s"], one["steps"] / one["wall_s"]
            found[what].append(rates)
            line(turn, what, one["steps"], f"{one['processor_s']:.3f}", f"{one['wall_s']:.3f}", *rates)
    median = {what: [statistics.median(column) for column in zip(*rates)] for what, rates in found.items()}
    for what, rates in median.items():
        line("median", what, "", "", "", *rates, f"{rates[0] / median['evogym'][0]:.1f}")


main()
