"""The schemas of `morphcog schema`: what the program writes is valid, what it refuses is not."""

import copy
import json
import pathlib
import subprocess
import sys

import jsonschema
import pytest

# From Python 3.11 on.
tomllib = pytest.importorskip("tomllib")

ROOT = pathlib.Path(__file__).parents[2]
CONFIG = """
seed = 3
generations = 12
[body]
height = 5
width = 5
[task]
groups = [[0], [1]]
[data]
dataset = "builtin"
train_images = [0, 1]
[stimulus]
reduction = "area"
[protocol]
rollout = "fresh"
control_steps = 20
[map_elites]
initial = 8
parents = 8
"""


def morphcog(folder, *words):
    return subprocess.run(
        [sys.executable, "-m", "morphcog", *words], cwd=folder, capture_output=True, text=True, timeout=300
    )


def printed(*words):
    done = morphcog(None, *words)
    assert done.returncode == 0, done.stderr
    return done.stdout


def listed(command):
    """The names in a table, below its heading."""
    return [line.split()[0] for line in printed(command).splitlines()[2:]]


NAMES = listed("schema")


def validator(name):
    return jsonschema.Draft7Validator(json.loads(printed("schema", name)))


def wrong(schema, value):
    return [f"{error.json_path}: {error.message}" for error in schema.iter_errors(value)]


def keys(schema, place):
    """Every key of a schema, with its description."""
    if isinstance(schema, dict):
        for key, value in schema.get("properties", {}).items():
            yield f"{place}.{key}", value.get("description")
        for key, value in schema.items():
            yield from keys(value, f"{place}.{key}")
    elif isinstance(schema, list):
        for value in schema:
            yield from keys(value, place)


@pytest.mark.parametrize("name", NAMES)
def test_a_schema_is_one_and_has_a_name_a_version_and_a_description_of_every_key(name):
    schema = json.loads(printed("schema", name))
    jsonschema.Draft7Validator.check_schema(schema)
    assert schema["$id"] == f"morphcog-{name}-1.schema.json"
    described = list(keys(schema, name))
    assert described
    # Marks of Rust's documentation mean nothing to others.
    assert [place for place, text in described if text is None or "[`" in text] == []


def test_there_is_a_schema_of_everything_that_is_read_and_written():
    assert {"config", "sweep", "plan", "run", "eval", "audit", "response", "team", "capacity", "scenario"} <= set(NAMES)


def test_shipped_configs_are_valid_as_they_are_and_with_all_their_keys():
    schemas = {name: validator(name) for name in ["config", "plan"]}
    files = sorted((ROOT / "configs").glob("*.toml"))
    assert [file.name for file in files] == sorted(listed("config"))
    for file in files:
        schema = schemas["plan" if file.name == "paper.toml" else "config"]
        for text in [file.read_text(), printed("config", file.name)]:
            assert wrong(schema, tomllib.loads(text)) == [], file.name


@pytest.mark.parametrize(
    ("section", "key", "value"),
    [
        (None, "generations", "many"),
        (None, "generations", -1),
        (None, "seeed", 1),
        ("body", "hieght", 3),
        ("protocol", "rollout", "eternal"),
        ("physics", "mass", "heavy"),
        ("stimulus", "encoding", "colour"),
        ("task", "groups", [[0], [1], [2]]),
    ],
)
def test_what_the_program_refuses_in_a_config_is_invalid(tmp_path, section, key, value):
    schema, config = validator("config"), tomllib.loads(CONFIG)
    assert wrong(schema, config) == []
    (config if section is None else config.setdefault(section, {}))[key] = value
    assert wrong(schema, config) != []
    (tmp_path / "bad.json").write_text(json.dumps(config))
    assert morphcog(tmp_path, "evolve", "-c", "bad.json", "-o", "bad").returncode in (2, 3)


def test_what_the_program_refuses_in_a_scenario_is_invalid(tmp_path):
    schema = validator("scenario")
    ground = {"column": 0, "row": 0, "grid": ["555"]}
    scenario = {"body": [[7, 8]], "terrain": [ground], "start_column": 0, "start_row": 1, "control_steps": 2}
    scenario["targets"] = {"mean": 1, "amplitude": 0.5, "period": 25, "phases": [0, 1]}
    (tmp_path / "good.json").write_text(json.dumps(scenario))
    assert wrong(schema, scenario) == [] and morphcog(tmp_path, "simulate", "good.json").returncode == 0
    assert wrong(schema, {**scenario, "targets": [[1, 1.2]]}) == []
    for key, value in [
        ("body", [[9]]),
        ("terrain", [{**ground, "colour": "red"}]),
        ("terrain", [{**ground, "column": -1}]),
        ("targets", {"mean": 1}),
        ("targets", 7),
        ("start", 1),
    ]:
        other = {**scenario, key: value}
        assert wrong(schema, other) != [], f"{key}: {value}"
        (tmp_path / "bad.json").write_text(json.dumps(other))
        assert morphcog(tmp_path, "simulate", "bad.json").returncode == 3, f"{key}: {value}"


def test_written_results_are_valid_and_those_of_another_format_are_not(tmp_path):
    (tmp_path / "run.toml").write_text(CONFIG)
    (tmp_path / "gallery").mkdir()
    sets = ["train.random_images=20", "train.rounds=1", "train.images=4", "train.final_images=4", "train.challengers=1"]
    sets += ["protocol.control_steps=50", "validation.images=40"]
    for command in [
        "evolve -c run.toml -o run",
        "eval -a run --images 20 --cycles 1",
        "eval --robots gallery --dataset builtin --images 4 --cycles 1 -o gallery/eval.json",
        "train -a run --task 0|1 -o taught " + " ".join(f"--set {key}" for key in sets),
        "response -a taught --images 60 --task 0|1",
        "capacity --eval run/eval.json --set trainings=2 --set sizes=[1,3]",
        "team -a run --classes 0,1 --images 20",
    ]:
        done = morphcog(tmp_path, *command.split(), "-q")
        assert done.returncode == 0, f"{command}: {done.stderr}"
    for file in [
        "run/run.json",
        "run/team.json",
        "taught/run.json",
        "run/eval.json",
        "gallery/eval.json",
        "taught/audit.json",
        "taught/response.json",
        "run/capacity.json",
    ]:
        schema, value = validator(pathlib.Path(file).stem), json.loads((tmp_path / file).read_text())
        assert wrong(schema, value) == [], file
        for key, other in [("format", "other"), ("format_version", 2)]:
            changed = copy.deepcopy(value)
            changed[key] = other
            assert wrong(schema, changed) != [], f"{file}: {key}"
