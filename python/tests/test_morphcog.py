"""The module's contract: shapes, units, the same bits as the command, clear refusals, Ctrl-C."""

import json
import os
import pickle
import signal
import subprocess
import sys
import threading
import time

import morphcog as mc
import numpy as np
import pytest

WALKER = np.array([[4, 4, 4, 4, 2, 2], [4, 4, 4, 4, 2, 2], [3, 3, 3, 3, 1, 1], [3, 3, 0, 0, 1, 1]], dtype=np.uint8)
SENSOR = np.array([[3, 3, 6], [4, 4, 6]], dtype=np.uint8)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    out = tmp_path_factory.mktemp("runs") / "quick"
    return mc.evolve("quickstart.toml", generations=20, seed=3, out=out)


def test_a_run_is_a_table_and_its_robots_are_arrays(run):
    elites = run.elites
    assert {"index", "objective", "measures_0", "measures_1", "solution_0", "id"} <= set(elites.columns)
    assert run.generations == 20 and len(elites) > 3
    robot = run["best"]
    assert robot.body.dtype == np.uint8 and robot.body.ndim == 2
    assert robot.objective == pytest.approx(elites.objective.max())
    row = elites[elites.id == robot.id].filter(regex="^solution_").to_numpy()[0]
    assert np.array_equal(row.reshape(robot.body.shape), robot.body)
    assert run[robot.id[:6]].id == robot.id
    assert "<iframe" in robot._repr_html_() and robot.id in robot.page()


def test_displacements_are_those_of_the_command(run):
    table = run.evaluate(robots="best", images=20)
    with open(os.path.join(os.path.dirname(run.path), "eval.json"), encoding="utf-8") as file:
        found = json.load(file)
    pixels, labels = mc.images("builtin", "test")
    shown = [image["index"] for image in found["images"]]
    assert [image["label"] for image in found["images"]] == list(labels[shown])
    robot = run[found["robots"][0]["id"]]
    walked = robot.displacements(mc.stimuli(pixels[shown], run.config), control_steps=500)
    assert walked.tolist() == found["robots"][0]["displacements"]
    assert table.accuracy[0] == pytest.approx(found["robots"][0]["accuracy"])


def test_displacements_do_not_depend_on_threads_and_have_a_row_for_each_body():
    bodies = [WALKER, WALKER[:, ::-1]]
    x = np.zeros((3, 4, 6))
    one = mc.displacements(bodies, x, threads=1, control_steps=100)
    assert one.shape == (2, 3) and one.dtype == np.float64
    assert np.array_equal(one, mc.displacements(bodies, x, threads=3, control_steps=100))
    assert mc.displacements([], x).shape == (0, 3) and mc.displacements(bodies, x[:0]).shape == (2, 0)


def test_a_world_ends_where_displacements_say():
    rng = np.random.default_rng(1)
    x = rng.random((1, 2, 3))
    world = mc.World(SENSOR)
    world.stimulus = x[0]
    begin = world.centre[0]
    world.step(60)
    world.step(40)
    assert world.control_step == 100
    assert world.centre[0] - begin == pytest.approx(mc.displacements([SENSOR], x, control_steps=100)[0, 0], abs=1e-12)
    assert world.points.shape == (12, 2) and world.voxels.shape == (6, 4)
    assert world.centre == pytest.approx(world.points.mean(axis=0))
    world.reset()
    assert world.control_step == 0 and world.points[:, 1].min() == pytest.approx(0, abs=1e-9)
    assert mc.World(SENSOR, start_row=3).points[:, 1].min() == pytest.approx(1)


def test_a_controller_can_drive_every_sensor_at_every_step():
    body = mc.from_evogym([[3, 3, 1], [3, 0, 1]], driven=True)
    assert body.tolist() == [[6, 6, 1], [6, 0, 1]]
    world, still = mc.World(body), mc.World(body)
    for step in range(200):
        action = 1.1 + 0.5 * np.sin(2 * np.pi * step / 50 + np.array([[0, 1, 2], [3, 4, 5]]))
        world.stimulus = action - 0.6
        world.step()
    still.step(200)
    assert abs(world.centre[0] - still.centre[0]) > 0.3
    # A pixel is EvoGym's action less 0.6: the goal of a sensor's width is the action.
    physics = json.loads(mc.Config("zero_one.toml").to_json())["physics"]
    assert (physics["sensor_expand_dark"], physics["sensor_swing"]) == (0.6, 1.0)
    widths = []
    for pixel in [0.0, 0.2, 0.4, 0.7, 1.0]:
        one = mc.World(np.array([[6]]))
        one.stimulus = [[pixel]]
        one.step(400)
        widths.append(np.ptp(one.points[:, 0]))
    assert widths == sorted(widths) and widths[2] == pytest.approx(1, abs=1e-3) and widths[4] - widths[0] > 0.4


@pytest.mark.parametrize(
    "call, words",
    [
        (lambda: mc.displacements([[[7]]], np.zeros((1, 1, 1))), ["7 is not a material"]),
        (lambda: mc.displacements([[[1, 0, 1]]], np.zeros((1, 1, 3))), ["hang together"]),
        (lambda: mc.displacements([[[0]]], np.zeros((1, 1, 1))), ["at least one voxel"]),
        (lambda: mc.displacements([[1, 2]], np.zeros((1, 1, 2))), ["body 0", "shape (2,)"]),
        (lambda: mc.displacements([[[1.0]]], np.zeros((1, 1, 1))), ["float64"]),
        (lambda: mc.displacements([[[-1]]], np.zeros((1, 1, 1))), ["-1"]),
        (lambda: mc.displacements([SENSOR], np.zeros((2, 2))), ["shape (2, 2)", "(images, rows, columns)"]),
        (lambda: mc.displacements([SENSOR], np.zeros((1, 3, 3))), ["2 × 3 pixels", "3 × 3"]),
        (lambda: mc.displacements([SENSOR], np.full((1, 2, 3), 255.0)), ["from 0 to 1", "255"]),
        (lambda: mc.displacements([SENSOR], np.full((1, 2, 3), np.nan)), ["NaN"]),
        (lambda: mc.displacements([SENSOR], np.zeros((1, 2, 3)), control_steps=0), ["control_steps=0"]),
        (lambda: mc.displacements([SENSOR, WALKER], np.zeros((1, 2, 3))), ["image 0, body 1"]),
        (lambda: mc.World([[3, 3], [3]]), ["different lengths"]),
        (lambda: mc.World(SENSOR, start_row=1), ["start_row=1", "on the ground"]),
        (lambda: mc.World(SENSOR, start_row=-1), ["start_row=-1", "from 0 to"]),
        (lambda: mc.World(SENSOR).step(-1), ["count=-1"]),
        (lambda: mc.World(SENSOR).step(1.5), ["count=1.5", "whole number"]),
        (lambda: mc.displacements([SENSOR], np.zeros((1, 2, 3)), threads=0), ["threads=0", "from 1 to 1024"]),
        (lambda: mc.stimuli(np.zeros((1, 0, 28), np.uint8), "zero_one.toml"), ["0 x 28 pixels"]),
        (lambda: mc.evolve("quickstart.toml", resume=True, force=True), ["resume", "force"]),
        (lambda: mc.from_evogym([[4, 3]]), ["vertical actuator"]),
        (lambda: mc.from_evogym([[5]]), ["0 to 3"]),
        (lambda: mc.stimuli(np.zeros((1, 28, 28)), "zero_one.toml"), ["whole numbers", "float64"]),
        (lambda: mc.stimuli(np.zeros((1, 30, 30), np.uint8), "zero_one.toml"), ["do not divide"]),
        (lambda: mc.load_run("nowhere"), ["nowhere"]),
        (lambda: mc.evolve("nothing.toml"), ["no built-in config"]),
        (lambda: mc.evolve("quickstart.toml", set={"map_elites.parents": 0}), ["map_elites.parents"]),
        (lambda: mc.evolve("quickstart.toml", set="map_elites.parents=0"), ["map_elites.parents = 0"]),
        (lambda: mc.evolve("quickstart.toml", set=["map_elites.parents"]), ["map_elites.parents", "key=value"]),
        (lambda: mc.images("builtin", "validation"), ['expected "train" or "test"']),
        (lambda: mc.images("nowhere", data="no-folder"), ["no-folder"]),
    ],
)
def test_what_cannot_be_is_refused_with_what_was_expected(call, words):
    with pytest.raises(mc.Error) as error:
        call()
    for word in words:
        assert word in str(error.value)


def test_an_error_has_the_name_that_it_is_caught_by():
    for error in [mc.Error, mc.Unstable]:
        assert error is getattr(mc, error.__name__) and error.__module__ == "morphcog"
        assert str(pickle.loads(pickle.dumps(error("what")))) == "what"


def test_the_stimulus_of_a_world_changes_as_a_whole_only():
    world = mc.World(SENSOR)
    with pytest.raises(ValueError):
        world.stimulus[0, 0] = 1
    seen = np.ones((2, 3))
    world.stimulus = seen
    seen[0, 0] = 0
    assert world.stimulus.min() == 1


def test_threads_that_share_a_world_take_turns():
    world = mc.World(WALKER)
    worker = threading.Thread(target=lambda: world.step(300))
    worker.start()
    while worker.is_alive():
        assert world.points.shape[1] == 2 and world.control_step in (0, 300)
    assert world.control_step == 300


def test_keys_take_numbers_of_numpy(tmp_path):
    changes = {"map_elites.parents": np.int64(3), "task.groups": np.array([[0], [1]])}
    config = mc.evolve("quickstart.toml", generations=1, set=changes, out=tmp_path / "run").config
    config = json.loads(config.to_json())
    assert config["map_elites"]["parents"] == 3 and config["task"]["groups"] == [[0], [1]]


def test_a_folder_that_holds_a_run_is_not_written_over(run):
    folder = os.path.dirname(run.path)
    with pytest.raises(mc.Error, match="force=True"):
        mc.evolve("quickstart.toml", generations=20, seed=3, out=folder)
    again = mc.evolve("quickstart.toml", generations=22, seed=3, out=folder, resume=True)
    assert again.generations == 22


def test_an_unstable_simulation_says_so():
    # A time step a hundred times as long.
    config = mc.Config("quickstart.toml", ["physics.time_step=0.01"])
    with pytest.raises(mc.Unstable, match="unstable in control step"):
        mc.World(WALKER, config=config).step(100)
    assert np.isnan(mc.displacements([WALKER], np.zeros((1, 4, 6)), config=config)).all()


def test_other_threads_go_on_while_bodies_are_simulated():
    body, x = np.full((14, 14), 3, np.uint8), np.zeros((1, 14, 14))
    body[:7] = 4
    done = threading.Event()
    worker = threading.Thread(target=lambda: (mc.displacements([body] * 40, x), done.set()))
    worker.start()
    count = 0
    while not done.is_set():
        time.sleep(0.001)
        count += 1
    worker.join()
    assert count > 50


def test_ctrl_c_ends_a_batch_within_0_3_seconds():
    # In a process that a shell began in the background, Ctrl-C is ignored unless it is asked for.
    code = """
import signal, time, numpy as np, morphcog as mc
signal.signal(signal.SIGINT, signal.default_int_handler)
body = np.full((14, 14), 3, np.uint8); body[:7] = 4
print("begins", flush=True)
try:
    mc.displacements([body] * 4000, np.zeros((1, 14, 14)))
except KeyboardInterrupt:
    print(time.time())
"""
    child = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert child.stdout.readline() == "begins\n"
    time.sleep(1)
    sent = time.time()
    child.send_signal(signal.SIGINT)
    said, _ = child.communicate(timeout=20)
    assert child.returncode == 0 and float(said) - sent < 0.3


def test_the_command_has_the_same_words_and_exit_codes(tmp_path):
    def command(*words):
        return subprocess.run(
            [sys.executable, "-m", "morphcog", *words], capture_output=True, text=True, cwd=tmp_path, timeout=100
        )

    assert command("--version").stdout.split()[1].replace("-dev", ".dev0") == mc.__version__.replace("-dev", ".dev0")
    assert command("evolv").returncode == 2
    said = command("eval", "--archive", "nowhere")
    assert said.returncode == 3 and said.stderr.startswith("error: nowhere")
    plan = tmp_path / "plan.toml"
    plan.write_text('config = "quickstart.toml"\nset = ["generations=2"]\n')
    listed = command("sweep", "plan.toml", "--list").stdout
    assert f"{os.path.normpath(sys.executable)} -m morphcog sweep" in listed
    subprocess.run(listed, shell=True, check=True, cwd="/", timeout=100)
    assert "1 done" in command("sweep", "plan.toml", "--status").stdout


def test_sigint_stops_the_command_and_the_run_goes_on(tmp_path):
    words = [sys.executable, "-m", "morphcog", "evolve", "-c", "quickstart.toml", "--out", "run", "--generations", "100000"]
    child = subprocess.Popen(words, cwd=tmp_path, stderr=subprocess.DEVNULL)
    until = time.time() + 60
    while not (tmp_path / "run" / "metrics.csv").exists() and time.time() < until:
        time.sleep(0.05)
    time.sleep(0.5)
    child.send_signal(signal.SIGINT)
    assert child.wait(timeout=30) == 75
    assert mc.load_run(tmp_path / "run").generations >= 0


def test_runs_that_ship_with_morphcog_are_loaded_by_name():
    run = mc.load_run("gallery:zero_one")
    assert run["best"].task == "0|1" and len(run.elites) == 1
    with pytest.raises(mc.Error, match="gallery:zero_one"):
        mc.load_run("gallery:nobody")
