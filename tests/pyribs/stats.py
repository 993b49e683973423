"""Figures of archives as pyribs has them, for a test in src/qd/archive.rs.

    python3 -m venv venv && venv/bin/pip install ribs==0.12.0 numpy==2.4.6
    venv/bin/python tests/pyribs/stats.py > tests/pyribs/stats.json

Robots come one after the other, into cells drawn at random: some find theirs empty, some are fitter than who is there, some are
not. pyribs has no impossible cells, so an archive of as many cells as are possible stands for one of ours.
"""

import json

import numpy as np
import ribs

assert ribs.__version__ == "0.12.0", ribs.__version__


def case(cells, offset, told):
    archive = ribs.archives.GridArchive(
        solution_dim=1,
        dims=[cells],
        ranges=[(0, cells)],
        qd_score_offset=offset,
        dtype=np.float64,
    )
    for cell, objective in told:
        archive.add_single([0.0], objective, [cell + 0.5])
    stats = archive.stats
    number = lambda value: None if value is None else float(value)
    names = ["coverage", "qd_score", "norm_qd_score", "obj_max", "obj_mean"]
    figures = {"num_elites": int(stats.num_elites)} | {name: number(getattr(stats, name)) for name in names}
    return {"cells": cells, "qd_score_offset": offset, "told": told, "stats": figures}


def drawn(random, cells, robots, middle):
    cell = random.integers(0, cells, robots)
    objective = random.normal(middle, 4.0, robots).round(6)
    return [[int(c), float(o)] for c, o in zip(cell, objective)]


random = np.random.default_rng(1)
cases = [
    case(90, 0.0, []),
    case(12, 0.0, [[7, 4.0], [2, -3.0], [5, 2.0]]),
    case(12, -5.0, [[7, 4.0], [2, -3.0], [5, 2.0]]),
    case(90, 0.0, drawn(random, 90, 60, -1.0)),
    case(90, 0.0, drawn(random, 90, 200, -6.0)),
    case(90, -20.0, drawn(random, 90, 200, -6.0)),
    case(270, 2.5, drawn(random, 270, 300, 5.0)),
]
print("[" + ",\n".join(json.dumps(one) for one in cases) + "]")
