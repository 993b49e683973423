"""What a batch costs through Python, beside `morphcog eval`: the same robot, the same images, processor time of one thread.

    python benches/python.py MORPHCOG [ARCHIVE [IMAGES [REPEATS]]]

MORPHCOG is the program; the module is the one that Python finds. Both have the same threads (RAYON_NUM_THREADS=1) and take turns.
Prints CSV: a line for each turn, the fastest of each, and the median of the ratios.
"""

import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

os.environ["RAYON_NUM_THREADS"] = "1"
import morphcog as mc  # noqa: E402

program = sys.argv[1]
archive = sys.argv[2] if len(sys.argv) > 2 else "data/trained/zero-one-1"
images = int(sys.argv[3]) if len(sys.argv) > 3 else 40
repeats = int(sys.argv[4]) if len(sys.argv) > 4 else 20


def of_program(count: int, out: Path) -> float:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [program, "eval", "--quiet", "--archive", archive, "--robots", "best", "--dataset", "builtin"]
    subprocess.run([*command, "--images", str(count), "--threads", "1", "--out", str(out)], check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def of_module(body, stimuli, config, walks: list[float]) -> float:
    before = resource.getrusage(resource.RUSAGE_SELF)
    found = mc.displacements([body], stimuli, config=config)
    after = resource.getrusage(resource.RUSAGE_SELF)
    assert list(found[0]) == walks, "the same images, other numbers"
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


run = mc.load_run(archive)
pixels, _ = mc.images("builtin", "test")
body = run["best"].body
ratios, turns = [], []
print("turn,images,eval_s,start_s,python_s,ratio")
with tempfile.TemporaryDirectory() as folder:
    out = Path(folder) / "eval.json"
    of_program(images, out)
    tested = json.loads(out.read_text())
    walks = tested["robots"][0]["displacements"]
    stimuli = mc.stimuli(pixels[[image["index"] for image in tested["images"]]], run.config)
    for turn in range(repeats):
        # What eval does besides (reading, baselines, writing) is that of an evaluation of two images, less those two. Machines grow
        # slower and faster, so the two take turns in going first.
        start = of_program(2, out)
        by_turns = [lambda: of_program(images, out), lambda: of_module(body, stimuli, run.config, walks)]
        times = {job: by_turns[job]() for job in ((0, 1) if turn % 2 else (1, 0))}
        whole, seconds = times[0], times[1]
        simulated = (whole - start) * images / (images - 2)
        ratios.append(seconds / simulated)
        turns.append((whole, start, seconds))
        print(f"{turn},{images},{whole:.3f},{start:.3f},{seconds:.3f},{ratios[-1]:.4f}", flush=True)
# On a noisy machine the least disturbed turn of each says more than the median.
whole, start, seconds = (min(times) for times in zip(*turns))
print(f"fastest,{images},{whole:.3f},{start:.3f},{seconds:.3f},{seconds / ((whole - start) * images / (images - 2)):.4f}")
print(f"median,{images},,,,{statistics.median(ratios):.4f}")
