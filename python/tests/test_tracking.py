"""What docs/tracking.md shows works, with a tracker that only notes what it is sent."""

import io
import pathlib
import re
import subprocess
import sys
import types

import morphcog as mc

PAGE = (pathlib.Path(__file__).parents[2] / "docs" / "tracking.md").read_text(encoding="utf-8")
LINES, SCRIPT = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)


class Tracker(types.ModuleType):
    def __init__(self):
        super().__init__("wandb")
        self.logged, self.begun = [], []

    def init(self, **about):
        self.begun.append(about)
        return self

    def log(self, values):
        self.logged.append(values)

    def log_metrics(self, values, step):
        self.logged.append((values, step))

    def add_scalar(self, key, value, step):
        self.logged.append((key, value, step))

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass


def test_one_line_attaches_each_tracker(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    trackers = {name: Tracker() for name in ["wandb", "mlflow", "writer"]}
    config = mc.Config("quickstart.toml", {"generations": 3})
    known = {**trackers, "mc": mc, "config": config, "SummaryWriter": lambda folder: trackers["writer"]}
    lines = LINES.replace("import morphcog as mc\n", "").replace("mc.evolve(config,", "mc.evolve(config, force=True, quiet=True,")
    exec(lines, known)
    wandb, mlflow, writer = (trackers[name].logged for name in trackers)
    assert [event["generation"] for event in wandb] == [1, 2, 3]
    assert trackers["wandb"].begun[0]["config"]["generations"] == 3
    assert mlflow == [(mc.numbers(event), event["generation"]) for event in wandb]
    assert writer == [(key, value, step) for values, step in mlflow for key, value in values.items()]
    assert {"best", "coverage", "qd_score", "evaluations"} <= set(mlflow[-1][0])


def test_the_script_sends_the_events_of_the_command(tmp_path, monkeypatch):
    words = "evolve -c quickstart.toml --generations 3 --json -o run".split()
    done = subprocess.run([sys.executable, "-m", "morphcog", *words], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    tracker, passed = Tracker(), io.StringIO()
    monkeypatch.setitem(sys.modules, "wandb", tracker)
    monkeypatch.setattr(sys, "stdin", io.StringIO(done.stdout))
    monkeypatch.setattr(sys, "stdout", passed)
    exec(SCRIPT, {"__name__": "__main__"})
    assert passed.getvalue() == done.stdout and tracker.begun == [{"project": "bodies"}]
    steps = [values["step"] for values in tracker.logged if "generation/qd_score" in values]
    assert steps == [0, 1, 2, 3]
    assert mc.load_run(tmp_path / "run").metrics.qd_score.iloc[-1] == [
        values["generation/qd_score"] for values in tracker.logged if "generation/qd_score" in values
    ][-1]


def test_an_error_ends_the_script(monkeypatch):
    known = {"__name__": "track"}
    exec(SCRIPT, known)
    try:
        known["track"](['{"event": "error", "message": "no such run"}\n'], print)
    except SystemExit as error:
        assert str(error) == "no such run"
    else:
        raise AssertionError("an error must end the script")
