"""The module's contract: shapes, units, the same bits as the command, clear refusals, Ctrl-C."""

import copy
import ctypes
import ctypes.util
import gzip
import io
import json
import os
import pathlib
import pickle
import platform
import re
import signal
import subprocess
import sys
import threading
import time

import morphcog as mc
import numpy as np
import pytest

WALKER = np.array([[4, 4, 4, 4, 2, 2], [4, 4, 4, 4, 2, 2], [3, 3, 3, 3, 1, 1], [3, 3, 0, 0, 1, 1]], dtype=np.uint8)
FLOOR = [{"column": 0, "row": 0, "grid": ["555"]}]
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
    assert robot.id in robot.page()


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


@pytest.mark.parametrize("name", ["climber0_2", "obstacletraverser1_2"])
def test_a_world_on_terrain_takes_evogyms_actions_and_follows_its_trajectory(name, tmp_path):
    golden = pathlib.Path(__file__).parents[2] / "crates/sim/tests/golden/terrain" / f"{name}.json.gz"
    run = json.loads(gzip.decompress(golden.read_bytes()))
    structure = np.array([[int(voxel) for voxel in row] for row in run["body"]])
    body = mc.from_evogym(structure)
    assert np.array_equal(body, np.where(structure >= 3, structure + 4, structure))
    terrain = [{key: item[key] for key in ("column", "row", "grid")} for item in run["terrain_objects"]]
    world = mc.World(body, terrain=terrain, start_column=run["start_column"], start_row=run["start_row"])
    phases = run["phase"] * np.arange((body >= 7).sum())
    com, before = [world.centre], world.points
    for step in range(len(run["com"]) - 1):
        world.step(1.1 + 0.5 * np.sin(2 * np.pi * step / 25 + phases))
        com.append(world.centre)
    assert np.abs(np.array(com) - run["com"]).max() < 1e-6
    assert world.velocities.shape == before.shape and np.abs(world.velocities).max() > 0
    assert world.render().save(tmp_path / "now.png").read_bytes().startswith(b"\x89PNG")
    # A grid of numbers is the same as text.
    numbers = [{**item, "grid": [[int(cell) for cell in row] for row in item["grid"]]} for item in terrain]
    again = mc.World(body, terrain=numbers, start_column=run["start_column"], start_row=run["start_row"])
    assert np.array_equal(again.points, before)


def test_velocities_are_those_of_the_points():
    world = mc.World([[3, 3], [4, 4]], start_row=9)
    world.step()
    y = world.points[:, 1]
    world.step()
    # Falls freely but for its muscles: 3 ms a control step.
    assert np.mean(world.points[:, 1] - y) / 0.003 == pytest.approx(world.velocities[:, 1].mean(), rel=0.5)


@pytest.mark.parametrize(
    "call, words",
    [
        (lambda: mc.displacements([[[9]]], np.zeros((1, 1, 1))), ["body 0: 9 is not a material"]),
        (lambda: mc.displacements([[[1, 0, 1]]], np.zeros((1, 1, 3))), ["hang together"]),
        (lambda: mc.rollouts([SENSOR] * 3 + [SENSOR * 0], np.zeros((1, 2, 3))), ["body 3: expected at least one"]),
        (lambda: mc.rollouts([SENSOR], np.zeros((1, 2, 3)), every=0), ["every=0"]),
        (lambda: mc.show(SENSOR, np.zeros((21, 2, 3))), ["1 to 20 images", "21"]),
        (lambda: mc.show(SENSOR, np.zeros((2, 3, 3))), ["image 0", "2 × 3 pixels"]),
        (lambda: mc.show(SENSOR).save("body.pdf"), ["body.pdf", ".gif"]),
        (lambda: mc.Genome.random("quickstart.toml", -1), ["seed=-1"]),
        (lambda: mc.Genome.random("quickstart.toml", 1).from_json("{}", "quickstart.toml"), ["genome:", "cppn"]),
        (lambda: mc.load_run("gallery:")["APUKI"].genome, ["not published"]),
        (lambda: mc.load_run("gallery:zero_one-1").plot("pie"), ["kind=pie", "spacetime"]),
        (lambda: mc.load_run("gallery:zero_one-1").plot("archive", "best"), ["robot:", "archive"]),
        (lambda: mc.load_run("gallery:zero_one-1").metrics, ["there are no metrics"]),
        (lambda: mc.train("gallery:gaits-6", "4"), ["task"]),
        (lambda: mc.train([], "4|9"), ["expected one run or more"]),
        (lambda: mc.team("gallery:zero_one", split="train"), ["split=train"]),
        (lambda: mc.displacements([[[0]]], np.zeros((1, 1, 1))), ["at least one voxel"]),
        (lambda: mc.displacements([[1, 2]], np.zeros((1, 1, 2))), ["body 0", "shape (2,)"]),
        (lambda: mc.displacements([[[1.0]]], np.zeros((1, 1, 1))), ["float64"]),
        (lambda: mc.displacements([[[-1]]], np.zeros((1, 1, 1))), ["-1"]),
        (lambda: mc.displacements([[[True]]], np.zeros((1, 1, 1))), ["materials 0 to 8", "bool"]),
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
        (lambda: mc.from_evogym([[4, 3]], driven=True), ["vertical actuator", 'driven="targets"']),
        (lambda: mc.from_evogym([[3]], driven="often"), ["driven='often'"]),
        (lambda: mc.from_evogym([[5]]), ["0 to 4"]),
        (lambda: mc.World([[7, 8]]).set_targets([1.0]), ["targets", "expected 2"]),
        (lambda: mc.World([[7]]).step([np.nan]), ["targets", "not a number"]),
        (lambda: mc.World([[7]], terrain=FLOOR), ["start_column", "start_row"]),
        (lambda: mc.World([[7]], terrain=FLOOR, start_column=0, start_row=0), ["overlaps"]),
        (lambda: mc.World([[7]], terrain=FLOOR[0], start_column=0, start_row=1), ["terrain", "list of objects"]),
        (lambda: mc.World([[7]], terrain=[{"grid": []}], start_column=0, start_row=1), ["terrain[0]", "column"]),
        (lambda: mc.World([[7]], terrain=[{**FLOOR[0], "grid": ["56"]}], start_column=0, start_row=1), ["grid[0]"]),
        (lambda: mc.stimuli(np.zeros((1, 28, 28)), "zero_one.toml"), ["whole numbers", "float64", "(255 * images)"]),
        (lambda: mc.stimuli(np.full((1, 28, 28), 256), "zero_one.toml"), ["0 to 255", "256"]),
        (lambda: mc.stimuli(np.zeros((2**58, 28, 0), np.uint8), "zero_one.toml"), ["28 x 0 pixels"]),
        (lambda: mc.displacements([SENSOR], np.zeros((2**58, 2, 0))), ["2 × 3 pixels"]),
        (lambda: mc.stimuli(np.zeros((1, 30, 30), np.uint8), "zero_one.toml"), ["do not divide"]),
        (lambda: mc.load_run("nowhere"), ["nowhere"]),
        (lambda: mc.evolve("nothing.toml"), ["no built-in config"]),
        (lambda: mc.evolve("quickstart.toml", set={"map_elites.parents": 0}), ["map_elites.parents"]),
        (lambda: mc.evolve("quickstart.toml", set="map_elites.parents=0"), ["map_elites.parents = 0"]),
        (lambda: mc.evolve("quickstart.toml", set=["map_elites.parents"]), ["map_elites.parents", "key=value"]),
        (lambda: mc.evolve("quickstart.toml", set=[3]), ["set:", "dict"]),
        (lambda: mc.Config("quickstart.toml", {"body": {"hight": 3}}), ["body.hight=3", "unknown field"]),
        (lambda: mc.load_run("gallery:team"), ["expected one run", "load_runs", "these are 45: gallery:team-0v1, "]),
        (lambda: mc.load_run("gallery:zero_one-1").evaluate("first:3"), ["robots=first:3: expected all, top:N"]),
        (lambda: mc.load_run("gallery:zero_one-1").evaluate(images="many"), ["images=many"]),
        (lambda: mc.load_run("gallery:zero_one-1").evaluate(split="train"), ["split=train: expected test or validation"]),
        (lambda: mc.images("builtin", "validation"), ['expected "train" or "test"']),
        (lambda: mc.images("nowhere", data="no-folder"), ["no-folder"]),
    ],
)
def test_what_cannot_be_is_refused_with_what_was_expected(call, words):
    with pytest.raises(mc.Error) as error:
        call()
    for word in words:
        assert word in str(error.value)
    # Words of the command line mean nothing here.
    assert not re.search("--[a-z]", str(error.value))


def test_an_error_has_the_name_that_it_is_caught_by():
    for error in [mc.Error, mc.Unstable]:
        assert error is getattr(mc, error.__name__) and error.__module__ == "morphcog"
        assert str(pickle.loads(pickle.dumps(error("what")))) == "what"


def test_configs_are_equal_if_their_keys_are_and_say_what_they_are_of():
    config = mc.Config("quickstart.toml")
    other = mc.Config(config, {"seed": 2})
    assert config == mc.Config("quickstart") and config != other and config != "quickstart.toml"
    assert len({config, other, mc.Config(other, "seed=1")}) == 2
    assert repr(other) == "Config(quickstart, task=0|1, data=builtin, body=7×7, generations=200, seed=2)"
    assert "and 6 more" in repr(mc.Config("four_digit.toml"))


def test_configs_runs_and_robots_can_be_pickled(run, tmp_path, monkeypatch):
    config = mc.Config("quickstart.toml", {"physics.time_step": 1 / 3e4})
    assert pickle.loads(pickle.dumps(config)) == config == copy.deepcopy(config)
    monkeypatch.chdir(os.path.dirname(run.path))
    here = mc.load_run(".")
    monkeypatch.chdir(tmp_path)
    robot = pickle.loads(pickle.dumps(here["best"]))
    best = run["best"]
    assert (robot.id, robot.run.config) == (best.id, run.config) and np.array_equal(robot.body, best.body)
    shipped = mc.load_run("gallery:zero_one-1")
    assert repr(pickle.loads(pickle.dumps(shipped))) == repr(shipped)
    # Another run in the same place is not taken for it.
    place = tmp_path / "place"
    pickled = pickle.dumps(mc.evolve("quickstart.toml", generations=1, out=place, quiet=True))
    mc.evolve("quickstart.toml", generations=1, seed=2, out=place, force=True, quiet=True)
    with pytest.raises(mc.Error, match="another run"):
        pickle.loads(pickled)


def test_a_pool_of_processes_takes_robots_and_configs(run):
    joblib = pytest.importorskip("joblib")
    x = np.zeros((1, *run["best"].body.shape))
    jobs = [joblib.delayed(mc.displacements)([run["best"].body], x, control_steps=50, config=run.config)]
    jobs += [joblib.delayed(mc.Robot.displacements)(run["best"], x, control_steps=50)]
    one, other = joblib.Parallel(n_jobs=2)(jobs)
    assert np.array_equal(one[0], other)


def test_a_copy_of_a_world_goes_on_by_itself():
    world = mc.World(SENSOR)
    world.stimulus = np.ones((2, 3))
    world.step(30)
    for copied in [copy.copy(world), copy.deepcopy(world)]:
        assert np.array_equal(copied.points, world.points)
        before = world.points
        copied.step(30)
        assert np.array_equal(world.points, before)
    world.step(30)
    assert np.array_equal(copied.points, world.points)
    with pytest.raises(TypeError, match="cannot be pickled: pickle its body and config"):
        pickle.dumps(world)


def test_images_of_bool_are_black_and_white_and_whole_numbers_may_have_any_type():
    images = np.arange(2 * 28 * 28).reshape(2, 28, 28) % 3 == 0
    full = mc.stimuli(images, "zero_one.toml")
    assert full.max() == 1 and np.array_equal(full, mc.stimuli(255 * images.astype(np.uint8), "zero_one.toml"))
    for kind in [np.int64, np.uint16, np.int8]:
        bright = (100 * images).astype(kind)
        assert np.array_equal(mc.stimuli(bright, "zero_one.toml"), mc.stimuli(bright.astype(np.uint8), "zero_one.toml"))
    with pytest.warns(UserWarning, match="1 of 255"):
        mc.stimuli(images.astype(int), "zero_one.toml")


def test_everything_that_takes_a_config_takes_all_its_forms(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    file = tmp_path / "own.toml"
    file.write_text(mc.Config("quickstart.toml", ["seed=5"]).to_toml())
    pixels, x = np.zeros((1, 28, 28), np.uint8), np.zeros((1, 4, 6))
    forms = [mc.Config(file), file, str(file), "~/own.toml", pathlib.Path("~/own.toml")]
    for number, form in enumerate(forms):
        assert mc.Config(form) == forms[0]
        assert mc.stimuli(pixels, form).shape == (1, 7, 7)
        assert mc.displacements([WALKER], x, config=form, control_steps=1).shape == (1, 1)
        mc.World(WALKER, config=form).step()
        run = mc.evolve(form, generations=1, out=f"~/runs/{number}", quiet=True)
        assert run.path == tmp_path / "runs" / str(number) / "run.json"
        assert mc.load_run(f"~/runs/{number}").config == run.config == mc.Config(form, {"generations": 1})
    with pytest.raises(mc.Error, match=re.escape(str(tmp_path / "nowhere"))):
        mc.images("mnist", data="~/nowhere")
    with pytest.raises(mc.Error, match=re.escape(str(tmp_path / "nowhere"))):
        mc.load_run("gallery:zero_one-1").evaluate(data="~/nowhere")


def test_changes_of_keys_are_text_several_or_a_dict():
    made = [
        mc.Config("quickstart.toml", changes)
        for changes in [
            ["body.height=5", "body.width=6", "data.dir=/a b"],
            {"body.height": 5, "body": {"width": np.int64(6)}, "data.dir": pathlib.Path("/a b")},
            {"body": {"height": 5, "width": 6}, "data": {"dir": "/a b"}},
        ]
    ]
    assert made[0] == made[1] == made[2] == mc.Config(made[0], "seed=1")
    assert mc.Config(made[0], {"data.dir": None}) == mc.Config("quickstart.toml", {"body": {"height": 5, "width": 6}})
    assert mc.Config("quickstart.toml", "seed=7") == mc.Config("quickstart.toml", {"seed": 7})


def test_errors_call_options_as_this_module_does(run, tmp_path):
    with pytest.raises(mc.Error, match="^map_elites.parents=0: map_elites.parents = 0: expected 1 or more"):
        mc.evolve("quickstart.toml", set={"map_elites.parents": 0})
    with pytest.raises(mc.Error) as error:
        mc.images("mnist", data=tmp_path)
    assert "as given" in str(error.value) and "morphcog data fetch mnist --to" in str(error.value)


def test_evolve_says_how_far_it_is_unless_it_is_quiet(tmp_path, capsys, monkeypatch):
    mc.evolve("quickstart.toml", generations=2, out=tmp_path / "said")
    said = capsys.readouterr()
    assert re.search(r"evolving in .*said; .*\n(.*\n)?generation 2/2 · .*best .* evaluations/s\n$", said.err), said.err
    assert said.out == ""
    mc.evolve("quickstart.toml", generations=2, out=tmp_path / "quiet", quiet=True).evaluate(images=4, quiet=True)
    assert capsys.readouterr() == ("", "")
    mc.load_run(tmp_path / "said").evaluate(images=4)
    assert "rollouts" in capsys.readouterr().err
    # In a terminal without tqdm it is one line that changes.
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    monkeypatch.setitem(sys.modules, "tqdm.auto", None)
    progress = mc._Progress(quiet=False)
    progress._least = 0
    with progress:
        progress("progress", "a long line", "{}")
        progress("progress", "short", "{}")
        progress("note", "a note", "null")
        progress("progress", "end", "{}")
    assert capsys.readouterr().err == "a long line\rshort      \ra note\nend\n"
    with pytest.warns(UserWarning, match="careful"):
        mc._Progress(quiet=True)("warning", "careful", "null")


def test_in_a_terminal_tqdm_shows_a_bar_if_it_is_installed(tmp_path, capsys, monkeypatch):
    pytest.importorskip("tqdm")
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    run = mc.evolve("quickstart.toml", generations=3, out=tmp_path / "run")
    said = capsys.readouterr().err
    assert re.search(r"evolving: 100%\|.*\| 3/3 \[.*best=.*coverage=", said), said
    run.evaluate("best", images=4)
    assert re.search(r"100%\|.*\| 4/4 \[.* rollouts/s", capsys.readouterr().err)


def test_a_callback_sees_every_generation_and_ends_evolution_where_it_says(tmp_path):
    seen = []
    whole = mc.evolve("quickstart.toml", generations=6, out=tmp_path / "whole", quiet=True, callback=seen.append)
    assert [event["generation"] for event in seen] == [1, 2, 3, 4, 5, 6]
    last, metrics = seen[-1], whole.metrics.iloc[-1]
    assert (last["event"], last["generations"]) == ("generation", 6)
    for key, column in [("best", "obj_max"), ("coverage", "coverage"), ("qd_score", "qd_score")]:
        assert last[key] == metrics[column]
    assert last["evaluations"] == metrics.evaluations

    def at_three(event):
        if event["generation"] == 3:
            raise StopIteration

    for number, callback in enumerate([at_three, lambda event: event["generation"] == 3]):
        out = tmp_path / str(number)
        assert mc.evolve("quickstart.toml", generations=6, out=out, quiet=True, callback=callback).generations == 3
        again = mc.evolve("quickstart.toml", generations=6, out=out, quiet=True, resume=True)
        assert again.path.read_bytes() == whole.path.read_bytes()
    with pytest.raises(ZeroDivisionError):
        mc.evolve("quickstart.toml", generations=6, out=tmp_path / "x", quiet=True, callback=lambda event: 1 / 0)
    assert mc.load_run(tmp_path / "x").generations == 1
    # What a callback returns by chance stops nothing.
    mc.evolve("quickstart.toml", generations=2, out=tmp_path / "y", quiet=True, callback=lambda event: [1])
    assert mc.load_run(tmp_path / "y").generations == 2


@pytest.mark.skipif(not hasattr(os, "killpg"), reason="signals of Unix")
@pytest.mark.parametrize("call", ["evaluate(images=100_000)", "audit()"])
def test_sigterm_leaves_no_process_that_goes_on(run, call):
    code = f"import sys, morphcog as mc; run = mc.load_run(sys.argv[1]); print('begins', flush=True); run.{call}"
    # All of them are in a group of their own.
    child = subprocess.Popen(
        [sys.executable, "-c", code, str(run.path)], stdout=subprocess.PIPE, text=True, start_new_session=True
    )
    assert child.stdout.readline() == "begins\n"
    time.sleep(0.3)
    child.terminate()
    child.wait(timeout=20)
    with pytest.raises(ProcessLookupError):
        os.killpg(child.pid, 0)


def test_a_launcher_of_mpi_is_no_obstacle(run, monkeypatch):
    monkeypatch.setenv("OMPI_COMM_WORLD_SIZE", "2")
    assert len(run.evaluate("best", images=4, quiet=True)) == 1
    assert run.audit("best", quiet=True).id[0] == run["best"].id


def test_a_signal_handler_may_read_a_world_that_steps():
    code = """
import signal, numpy as np, morphcog as mc
body = np.full((14, 14), 3, np.uint8); body[:7] = 4
world = mc.World(body)
seen = []
signal.signal(signal.SIGALRM, lambda *_: seen.append((world.control_step, world.points.shape, repr(world))))
signal.setitimer(signal.ITIMER_REAL, 0.05)
while not seen:
    world.step(200)
print(seen[0][1])
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert (done.stdout, done.stderr) == ("(225, 2)\n", "")


def test_the_first_ctrl_c_ends_threads_that_simulate():
    code = """
import signal, sys, numpy as np, morphcog as mc
from concurrent.futures import ThreadPoolExecutor
from threading import Thread
signal.signal(signal.SIGINT, signal.default_int_handler)
body = np.full((14, 14), 3, np.uint8); body[:7] = 4
work = lambda *_: mc.displacements([body] * 4000, np.zeros((1, 14, 14)), threads=1)
def pool():
    with ThreadPoolExecutor(2) as executor:
        print("begins", flush=True)
        list(executor.map(work, range(100)))
def thread():
    thread = Thread(target=lambda: mc.World(body).step(10**9))
    thread.start()
    print("begins", flush=True)
    thread.join()
{"pool": pool, "thread": thread}[sys.argv[1]]()
"""
    for kind in ["pool", "thread"]:
        child = subprocess.Popen(
            [sys.executable, "-c", code, kind], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )
        assert child.stdout.readline() == "begins\n"
        time.sleep(1)
        child.send_signal(signal.SIGINT)
        assert child.wait(timeout=5) == -signal.SIGINT


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="limits of Linux")
def test_too_little_memory_is_a_memory_error():
    code = """
import resource, numpy as np, morphcog as mc
config = mc.Config("zero_one.toml")
images = np.zeros((400_000, 28, 28), np.uint8)
x = np.broadcast_to(np.zeros((1, 64, 64)), (20_000, 64, 64)).copy()
resource.setrlimit(resource.RLIMIT_AS, (1_500_000_000,) * 2)
for call in [lambda: mc.stimuli(images, config), lambda: mc.displacements([np.full((64, 64), 3)], x)]:
    try:
        call()
    except MemoryError as error:
        print(error)
print(mc.stimuli(images[:1], config).shape)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.stdout == 2 * "there is no memory for the stimuli\n" + "(1, 14, 14)\n", done.stderr


def test_stimuli_and_images_see_ctrl_c():
    code = """
import signal, sys, time, numpy as np, morphcog as mc
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGALRM, signal.default_int_handler)
config = mc.Config("zero_one.toml", ["stimulus.reduction=area", "body.height=13"])
images = np.zeros((100_000, 28, 28), np.uint8)
mc.stimuli(images[:1], config)
signal.setitimer(signal.ITIMER_REAL, 0.2)
begun = time.time()
try:
    mc.stimuli(images, config) if sys.argv[1] == "stimuli" else mc.images("builtin")
except KeyboardInterrupt:
    print(time.time() - begun)
"""
    for call in ["stimuli", "images"]:
        done = subprocess.run([sys.executable, "-c", code, call], capture_output=True, text=True, timeout=60)
        assert 0.2 <= float(done.stdout) < 0.5, call


def test_a_thread_that_cannot_be_started_is_an_error():
    # Root may start as many as it likes: a stack that no address space holds stands for the limit.
    code = """
import numpy as np, morphcog as mc
try:
    mc.stimuli(np.zeros((1, 28, 28), np.uint8), "zero_one.toml")
except mc.Error as error:
    print(error)
"""
    env = {**os.environ, "RUST_MIN_STACK": str(2**50)}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, env=env)
    assert done.stdout.startswith("no threads: "), done.stderr


def test_a_notebook_shows_a_robot_small_and_with_a_picture(run):
    shown = run["best"]._repr_html_()
    found = re.search(r'<img src="data:image/gif;base64,([^"]+)" alt="Robot.*<iframe srcdoc="([^"]+)"', shown)
    picture, page = found.groups()
    assert len(shown) < 150_000 and len(picture) > 4000 and run["best"].id in page


def test_a_robot_of_the_usual_size_is_shown_in_less_than_150_kilobytes(tmp_path):
    changes = {"data.dataset": "builtin", "data.train_images": None, "map_elites.parents": 1, "validation.best": 0}
    run = mc.evolve("zero_one.toml", generations=1, set=changes, out=tmp_path / "run", quiet=True)
    assert run["best"].body.shape == (14, 14)
    assert len(run["best"]._repr_html_()) < 150_000


def test_a_robot_whose_images_are_not_there_is_shown_with_the_reason(tmp_path, monkeypatch):
    monkeypatch.setenv("MORPHCOG_DATA", str(tmp_path))
    shown = mc.load_run("gallery:zero_one-1")["best"]._repr_html_()
    assert shown.startswith("<pre>Robot(") and str(tmp_path) in shown


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


def test_ids_are_text_also_where_they_look_like_numbers():
    table = mc._table(io.StringIO("id,objective\n0636890406,1\n18e2354970,2\n"))
    assert list(table.id) == ["0636890406", "18e2354970"]


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
    run = mc.load_run("gallery:zero_one-1")
    assert run["best"].task == "0|1" and len(run.elites) == 1
    with pytest.raises(mc.Error, match="gallery:zero_one-1"):
        mc.load_run("gallery:nobody")


def test_no_choice_of_the_host_for_its_numbers_changes_ours(tmp_path):
    """Rounding upwards, as a library of the host may have chosen it."""
    if platform.machine() not in ("x86_64", "AMD64") or sys.platform == "win32":
        pytest.skip("the name of the mode is that of x86-64 with a libm")
    libm = ctypes.CDLL(ctypes.util.find_library("m"))
    upwards, nearest = 0x800, 0
    runs = []
    for mode in (nearest, upwards):
        assert libm.fesetround(mode) == 0
        try:
            out = tmp_path / str(mode)
            mc.evolve("quickstart.toml", generations=2, out=out)
            runs.append((out / "run.json").read_bytes())
            mc.load_run(out)
            assert libm.fegetround() == mode
        finally:
            libm.fesetround(nearest)
    assert runs[0] == runs[1]


def test_a_wrong_instruction_set_is_refused():
    words = "MORPHCOG_ISA=avx1024: expected one of baseline"
    code = "import morphcog as mc; mc.Config('quickstart.toml')"
    env = {**os.environ, "MORPHCOG_ISA": "avx1024"}
    said = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True, check=False)
    assert said.returncode == 1 and words in said.stderr.splitlines()[-1], said.stderr


def test_arrays_become_a_dataset_that_is_read_as_any_other(tmp_path):
    generator = np.random.default_rng(1)
    pixels = generator.integers(0, 255, (20, 8, 8)).astype(np.uint8)
    pixels[:, [0, -1]] = 0  # a dark ground: nothing is inverted
    pixels[:, :, [0, -1]] = 0
    pixels[:, 3, 3] = 255
    labels = np.array(["cat", "dog"])[np.arange(20) % 2]
    made = mc.import_dataset(pixels, labels, name="pets", to=tmp_path / "pets", quiet=True)
    assert made.folder == tmp_path / "pets" and made.size == (8, 8)
    assert made.classes == {
        "cat": {"class": 0, "train": 8, "test": 2},
        "dog": {"class": 1, "train": 8, "test": 2},
    }
    read, numbers = mc.images("pets", "train", data=made.folder)
    assert read.shape == (16, 8, 8) and set(numbers) == {0, 1}
    assert all(any((image == one).all() for one in pixels) for image in read)
    with pytest.raises(mc.Error, match="force=True"):
        mc.import_dataset(pixels, labels, name="pets", to=tmp_path / "pets", quiet=True)
    # Fractions, colours and a split of one's own.
    colours = np.repeat(pixels[..., None] / 255, 3, axis=-1)
    whole = np.arange(20) % 2
    made = mc.import_dataset(
        colours, whole, name="own", test_pixels=colours[:4], test_labels=whole[:4], to=tmp_path / "own", quiet=True
    )
    assert made.classes == {0: {"class": 0, "train": 10, "test": 2}, 1: {"class": 1, "train": 10, "test": 2}}
    assert (mc.images("own", "train", data=made.folder)[0] == pixels).all()
    # Pictures of different sizes.
    pictures = [np.pad(image, number % 3) for number, image in enumerate(pixels)]
    made = mc.import_dataset(pictures, whole.tolist(), name="some", to=tmp_path / "some", fit="whole", quiet=True)
    assert made.size == (28, 28) and made.about["fit"] == "whole"
    for wrong in [{"labels": labels[:3]}, {"name": "mnist"}, {"test": 2}, {"fit": "no"}, {"test_pixels": pixels}]:
        with pytest.raises(mc.Error):
            mc.import_dataset(**{"pixels": pixels, "labels": labels, "name": "x", "to": tmp_path / "x", **wrong})
    with pytest.raises(mc.Error, match="none: cannot be read"):
        mc.import_dataset(tmp_path / "none", name="x", quiet=True)
    assert not (tmp_path / "x").exists()


def test_rollouts_tell_what_displacements_and_worlds_tell():
    x = np.random.default_rng(1).random((3, 4, 6))
    bodies = [WALKER, WALKER[:, ::-1], np.where(WALKER == 2, 6, WALKER)]
    found = mc.rollouts(bodies, x, control_steps=90, every=20)
    assert np.array_equal(found.displacement, mc.displacements(bodies, x, control_steps=90))
    assert found.steps.tolist() == [0, 20, 40, 60, 80] and found.path.shape == (3, 3, 5, 2)
    world = mc.World(bodies[2])
    world.stimulus = x[1]
    world.step(60)
    points = world.points
    assert found.path[2, 1, 3] == pytest.approx(world.centre, abs=1e-12)
    shape = (found.width[2, 1, 3], found.height[2, 1, 3])
    assert shape == pytest.approx(np.ptp(points, axis=0), abs=1e-12)
    assert found.ground[2, 1, 3] == pytest.approx((points[:, 1] <= 0.01).mean())
    assert (found.kinetic[..., 0] == 0).all() and (found.kinetic[..., 1:] > 0).all()
    assert (np.diff(found.drive) > 0).all() and (found.elastic[..., 1:] > 0).all()
    assert repr(found) == "Rollouts(3 bodies, 3 images, 5 moments to control step 80)"
    assert mc.rollouts([], x).path.shape == (0, 3, 501, 2)
    # From where a simulation became unstable, all is nan.
    config = mc.Config("quickstart.toml", ["physics.time_step=0.01"])
    wild = mc.rollouts([WALKER], x[:1], control_steps=60, config=config)
    assert np.isnan(wild.displacement).all() and np.isnan(wild.path[0, 0, -1]).all()
    assert np.isfinite(wild.path[0, 0, 0]).all()


def test_genomes_are_those_of_evolution(run):
    config = mc.Config("quickstart.toml", {"seed": 3})
    first = {mc.Genome.random(config, 3, child=child).id for child in range(20)}
    one = mc.evolve(config, generations=1, out=run.path.parent / "one", quiet=True)
    assert {robot.id for robot in one} <= first
    robot = run["best"]
    genome = robot.genome
    assert genome.id == robot.id and np.array_equal(genome.body(), robot.body)
    child = genome.mutate(7)
    assert child == genome.mutate(7) and child not in (genome, genome.mutate(8))
    assert child == pickle.loads(pickle.dumps(child)) == mc.Genome.from_json(child.to_json(), config)
    assert re.fullmatch(r"Genome\(\w{10}, body=7×7, voxels=\d+, muscles=\d+, sensors=\d+\)", repr(child))
    x = np.zeros((1, 7, 7))
    assert mc.rollouts([child.body()], x, control_steps=20).displacement.shape == (1, 1)


def test_runs_are_iterated_and_say_what_they_are(run):
    robots = list(run)
    assert len(run) == len(robots) == len(run.elites) and [robot.id for robot in robots] == list(run.elites.id)
    assert repr(run).startswith("Run('") and f"robots={len(run)}, best={run['best'].objective:.2f}" in repr(run)
    assert list(run.metrics.generation)[: run.generations] == list(range(run.generations))
    published = mc.load_run("gallery:")
    assert [robot.id for robot in published] == ["APUKI", "IHSUJ", "QMAXD", "XFJPI", "YJTLA"]
    assert published["yjtla"].answers == {"left": [0], "right": [1]}
    assert [shipped["best"].task for shipped in mc.load_runs("gallery:zero_one")] == ["0|1"] * 3


def test_figures_are_shown_and_saved_by_their_ending(run, tmp_path):
    for kind in ["archive", "progress", "body", "spacetime", "snapshots"]:
        figure = run.plot(kind)
        assert figure._repr_svg_().startswith("<svg") and repr(figure).startswith("Figure('")
    assert figure.save(tmp_path / "walk.svg").read_text() == figure._data.svg_file()
    assert figure.save(tmp_path / "walk.pdf").read_bytes().startswith(b"%PDF-")
    small, large = (figure.save(tmp_path / f"{dpi}.png", dpi=dpi).read_bytes() for dpi in (50, 100))
    assert small.startswith(b"\x89PNG") and len(small) < len(large)
    assert run["best"].plot("body")._repr_svg_() == run.plot("body", run["best"].id)._repr_svg_()
    with pytest.raises(mc.Error, match=r"ends in \.svg, \.png or \.pdf"):
        figure.save(tmp_path / "walk.txt")


def test_files_are_written_whole_or_not_at_all(run, tmp_path, monkeypatch):
    figure, path = run.plot("body"), tmp_path / "body.svg"
    path.write_text("old")
    link = tmp_path / "link.svg"
    link.symlink_to(path)

    def fails(source, target):
        raise OSError("no space")

    with monkeypatch.context() as broken:
        broken.setattr("os.replace", fails)
        with pytest.raises(OSError, match="no space"):
            figure.save(path)
    assert path.read_text() == "old" and sorted(file.name for file in tmp_path.iterdir()) == ["body.svg", "link.svg"]
    assert figure.save(link) == link and link.is_symlink()
    assert path.read_text() == figure._data.svg_file()


def test_recordings_that_would_fill_the_memory_are_refused():
    with pytest.raises(mc.Error, match="control_steps = 1000000: expected at most .* under 20 images; show fewer"):
        mc.show(np.full((14, 14), 3, np.uint8), np.zeros((20, 14, 14)), control_steps=1_000_000)


def test_any_body_is_shown_small_and_saved_as_page_animation_or_picture(run, tmp_path):
    x = np.random.default_rng(1).random((10, 14, 14))
    body = np.full((14, 14), 6, np.uint8)
    body[10:], body[12:, 3:9] = 4, 0
    shown = mc.show(body, x)
    assert len(shown._repr_html_()) < 150_000
    assert shown.displacements == pytest.approx(mc.displacements([body], x)[0].tolist(), abs=1e-12)
    small = mc.show(SENSOR, x[0, :2, :3], control_steps=20)
    for name, begin in [("a.html", b"<!"), ("a.gif", b"GIF8"), ("a.png", b"\x89PNG")]:
        assert small.save(tmp_path / name, every=5).read_bytes().startswith(begin)
    assert run["best"].gif(tmp_path / "robot.gif", every=50).read_bytes().startswith(b"GIF8")
    assert run["best"].genome._repr_html_().startswith("<div")
    world = mc.World(SENSOR)
    world.step(10)
    picture = world.render()
    assert "control_step=10" in repr(picture) and len(picture._repr_html_()) < 30_000
    assert picture._repr_html_().startswith("<img") and picture.save(tmp_path / "world.png").stat().st_size > 1000


FEW = {
    "data.dataset": "builtin",
    "protocol.control_steps": 50,
    "train.random_images": 20,
    "train.rounds": 1,
    "train.images": 4,
    "train.final_images": 4,
    "train.challengers": 1,
    "validation.images": 40,
}


def test_a_gait_is_trained_measured_and_tested_as_a_team(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(mc.Stopped, match="stopped"):
        mc.train(run, "0|1", robots="top:1", set=FEW, out="trained", quiet=True, callback=lambda event: True)
    seen = []
    trained = mc.train(
        run, "0|1", robots="top:1", set=FEW, out="trained", resume=True, quiet=True, callback=seen.append
    )
    assert {event["event"] for event in seen} == {"round", "challenge"}
    assert len(trained) == 1 and trained.path.with_name("audit.json").exists()
    answers = trained["best"].answers
    assert sorted(answers["left"] + answers["right"]) == [0, 1]
    table = trained.response(images=60, task="0|1", set={"protocol.control_steps": 50}, quiet=True)
    assert list(table.columns) == ["id", "row", "column", "material", "slope", "error"] and len(table) > 0
    pictures = [trained.path.with_name(f"response.{ending}") for ending in ("svg", "png", "pdf")]
    assert all(picture.is_file() for picture in pictures)
    # Other results have other pictures.
    trained.response(images=120, error=0, set={"protocol.control_steps": 50}, task="0|1", quiet=True)
    assert all(picture.is_file() for picture in pictures)
    team = mc.team(trained, classes=[0, 1], images=20, quiet=True, out="team.json")
    assert 0 <= team.interval[0] <= team.accuracy <= team.interval[1] <= 1
    assert list(team.members.id) == [trained["best"].id] and team.confusion._repr_svg_().startswith("<svg")
    assert repr(team).startswith("Team(1 robots, 20 images, accuracy=")


def test_pairs_are_trained_once_and_answer_as_a_team(tmp_path):
    few = {key: value for key, value in FEW.items() if not key.startswith("data.")} | {"train.windows": 0}
    gaits = {"data.dataset": "builtin", "body": {"height": 5, "width": 5}, "protocol.control_steps": 50, "validation.best": 0}
    gaits = mc.evolve("gaits.toml", generations=2, set=gaits, quiet=True, out=tmp_path / "gaits")
    options = {"classes": [0, 1, 2], "robots": "top:1", "set": few, "out": tmp_path / "team", "quiet": True}
    runs = mc.train_pairs(gaits, **options)
    assert [run["best"].task for run in runs] == ["0|1", "0|2", "1|2"]
    before = [run.path.stat().st_mtime_ns for run in runs]
    assert [run.path.stat().st_mtime_ns for run in mc.train_pairs(gaits, **options)] == before
    assert len(mc.team(runs, classes=[0, 1, 2], images=30, quiet=True).members) == 3


@pytest.mark.parametrize(
    "work",
    ["mc.rollouts([body] * 4000, np.zeros((1, 14, 14)), every=100)", "mc.show(body, control_steps=220_000)"],
)
def test_ctrl_c_ends_rollouts(work):
    code = f"""
import signal, time, numpy as np, morphcog as mc
signal.signal(signal.SIGINT, signal.default_int_handler)
body = np.full((14, 14), 3, np.uint8); body[:7] = 4
print("begins", flush=True)
try:
    {work}
except KeyboardInterrupt:
    print(time.time())
"""
    child = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert child.stdout.readline() == "begins\n"
    time.sleep(1)
    sent = time.time()
    child.send_signal(signal.SIGINT)
    said, _ = child.communicate(timeout=20)
    assert child.returncode == 0 and float(said) - sent < 10
