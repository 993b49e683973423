"""Draws what changed from generation 9000 to 30,000, from data/atlas: python docs/pictures/since_9000.py

Needs matplotlib. Left: QD score by seed. Right: share of audited robots that are physical, and their mean
accuracy with 95 % intervals, by task.
"""

import csv
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

ROOT = Path(__file__).resolve().parents[2]
ATLAS = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "data" / "atlas"
OUT = Path(sys.argv[2]) if len(sys.argv) > 2 else ROOT / "docs" / "pictures" / "paper-since-9000.png"
BEFORE, NOW, PAPER = "#8a8f98", "#0072b2", "#d55e00"
plt.rcParams.update({"font.family": "DejaVu Sans", "font.size": 8, "axes.spines.top": False, "axes.spines.right": False})


def table(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def lines(axes, experiment, title):
    for seed in range(1, 6):
        rows = table(ATLAS / f"{experiment}-{seed}" / "metrics.csv")
        done = [int(row["generation"]) + 1 for row in rows]
        axes.plot(done, [float(row["qd_score"]) for row in rows], color=NOW, linewidth=1)
    axes.set_title(title, loc="left", fontsize=8, fontweight="bold")
    axes.set_ylabel("QD score")
    axes.set_xlim(9000, 30000)
    axes.set_ylim(bottom=0)
    axes.set_xticks([9000, 15000, 20000, 25000, 30000], ["9000", "15,000", "20,000", "25,000", "30,000"])
    axes.grid(axis="y", color="#e2e2e2", linewidth=0.6)


figure = plt.figure(figsize=(7.2, 4.1), layout="constrained")
grid = figure.add_gridspec(2, 3, width_ratios=[1.25, 1, 1])
lines(figure.add_subplot(grid[0, 0]), "zero_one", "Zero or one, five seeds")
lower = figure.add_subplot(grid[1, 0])
lines(lower, "four_digit", "Four digits, five seeds")
lower.set_xlabel("generations")

before, now = (table(ATLAS / name) for name in ("reproduction-9000.csv", "reproduction.csv"))
share, accuracy = figure.add_subplot(grid[:, 1]), figure.add_subplot(grid[:, 2])
for place, (old, new) in enumerate(zip(before, now, strict=True)):
    assert old["task"] == new["task"]
    shares = [100 * float(row["physical"]) / float(row["audited"]) for row in (old, new)]
    share.plot(shares, [place] * 2, color="#c9ccd1", linewidth=1.2, zorder=1)
    for row, value, colour, shift in ((old, shares[0], BEFORE, -0.14), (new, shares[1], NOW, 0.14)):
        share.plot(value, place, "o", color=colour, markersize=5)
        low, mean, high = (float(row[key]) for key in ("accuracy_low", "accuracy", "accuracy_high"))
        accuracy.plot([low, high], [place + shift] * 2, color=colour, linewidth=1.4)
        accuracy.plot(mean, place + shift, "o", color=colour, markersize=5)
    accuracy.plot(float(new["paper_accuracy"]), place, "|", color=PAPER, markersize=13, markeredgewidth=1.8)
tasks = [row["task"] for row in now]
for axes, title, label in ((share, "Physical", "of audited robots [%]"), (accuracy, "Mean accuracy", "of ten robots [%]")):
    axes.set_title(title, loc="left", fontsize=8, fontweight="bold")
    axes.set_xlabel(label)
    axes.set_ylim(len(tasks) - 0.5, -0.5)
    axes.set_yticks(range(len(tasks)), tasks if axes is share else [""] * len(tasks))
    axes.tick_params(axis="y", length=0)
    axes.grid(axis="x", color="#e2e2e2", linewidth=0.6)
share.set_xlim(0, 100)
marks = [("o", BEFORE, "after 9000 generations"), ("o", NOW, "after 30,000"), ("|", PAPER, "the paper")]
handles = [
    plt.Line2D([], [], linestyle="", marker=marker, color=colour, markersize=5 if marker == "o" else 10, markeredgewidth=1.6, label=label)
    for marker, colour, label in marks
]
figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False)
figure.savefig(OUT, dpi=220)
