"""`__init__.pyi` has every public name, and every function and method the parameters that it has."""

import ast
import inspect
import pathlib

import morphcog as mc
import pytest

STUB = ast.parse(pathlib.Path(mc.__file__).with_name("__init__.pyi").read_text(encoding="utf-8"))
NAMES = {item.name: item for item in STUB.body if isinstance(item, (ast.ClassDef, ast.FunctionDef))}


def parameters(item):
    of = item.args
    return [one.arg for one in [*of.posonlyargs, *of.args, of.vararg, *of.kwonlyargs, of.kwarg] if one is not None]


def test_every_public_name_is_typed():
    assert set(NAMES) == set(mc.__all__)


@pytest.mark.parametrize("name", sorted(NAMES))
def test_parameters_and_members_are_those_of_the_module(name):
    item, found = NAMES[name], getattr(mc, name)
    if isinstance(item, ast.FunctionDef):
        assert parameters(item) == list(inspect.signature(found).parameters)
        return
    typed = {}
    for member in item.body:
        if isinstance(member, ast.FunctionDef):
            typed.setdefault(member.name, parameters(member))
        elif isinstance(member, ast.AnnAssign):
            typed[member.target.id] = None
    fields = set(getattr(found, "__dataclass_fields__", ())) | ({"config"} if found is mc.Genome else set())
    public = {one for one in vars(found) if not one.startswith("_")} | fields
    assert public == {one for one in typed if not one.startswith("_")}
    for member, own in typed.items():
        value = inspect.getattr_static(found, member, None)
        value = value.__func__ if isinstance(value, classmethod) else value
        if inspect.isfunction(value):
            assert own == list(inspect.signature(value).parameters), member
