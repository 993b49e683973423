import os
import pathlib
from collections.abc import Iterable, Mapping
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
import pandas as pd

_Path = str | os.PathLike[str]
_Changes = str | Iterable[str] | Mapping[str, Any]
_Body = npt.NDArray[np.uint8]
_Floats = npt.NDArray[np.float64]

__version__: str

class Error(Exception): ...
class Unstable(Error): ...

class Config:
    def __init__(self, config: Config | _Path, set: _Changes = ()) -> None: ...
    def to_toml(self) -> str: ...
    def to_json(self) -> str: ...
    def __eq__(self, other: object) -> bool: ...
    def __hash__(self) -> int: ...

class Robot:
    id: str
    task: str
    objective: float
    body: _Body
    run: Run
    def displacements(self, stimuli: npt.ArrayLike, **options: Any) -> _Floats: ...
    def page(self) -> str: ...

class Run:
    def __init__(self, folder: _Path) -> None: ...
    @property
    def path(self) -> pathlib.Path: ...
    @property
    def config(self) -> Config: ...
    @property
    def generations(self) -> int: ...
    @property
    def elites(self) -> pd.DataFrame: ...
    def __getitem__(self, robot: str) -> Robot: ...
    def evaluate(
        self,
        robots: str = "top:10",
        images: int | Literal["all"] | None = None,
        split: Literal["test", "validation"] = "test",
        data: _Path | None = None,
        quiet: bool = False,
    ) -> pd.DataFrame: ...
    def audit(self, robots: str = "all", data: _Path | None = None, quiet: bool = False) -> pd.DataFrame: ...

class World:
    def __init__(
        self, body: npt.ArrayLike, *, start_row: int | None = None, config: Config | _Path | None = None
    ) -> None: ...
    @property
    def stimulus(self) -> _Floats: ...
    @stimulus.setter
    def stimulus(self, pixels: npt.ArrayLike) -> None: ...
    def step(self, count: int = 1) -> None: ...
    def reset(self) -> None: ...
    @property
    def control_step(self) -> int: ...
    @property
    def points(self) -> _Floats: ...
    @property
    def voxels(self) -> npt.NDArray[np.uintp]: ...
    @property
    def centre(self) -> _Floats: ...
    def __copy__(self) -> World: ...
    def __deepcopy__(self, memo: object) -> World: ...

def load_run(folder: _Path) -> Run: ...
def evolve(
    config: Config | _Path,
    *,
    generations: int | None = None,
    seed: int | None = None,
    set: _Changes = (),
    out: _Path | None = None,
    resume: bool = False,
    force: bool = False,
    data: _Path | None = None,
    threads: int | None = None,
    quiet: bool = False,
) -> Run: ...
def images(
    dataset: str = "builtin", split: Literal["train", "test"] = "train", data: _Path | None = None
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.uint8]]: ...
class Imported:
    name: str
    folder: pathlib.Path
    size: tuple[int, int]
    classes: dict[str | int, dict[str, int]]
    about: dict[str, Any]

def import_dataset(
    pixels: npt.ArrayLike | _Path | Iterable[_Path] | Iterable[npt.ArrayLike],
    labels: npt.ArrayLike | None = None,
    *,
    name: str,
    test_pixels: npt.ArrayLike | Iterable[npt.ArrayLike] | None = None,
    test_labels: npt.ArrayLike | None = None,
    test: float = 0.2,
    seed: int = 1,
    to: _Path | None = None,
    force: bool = False,
    size: int = 28,
    fit: Literal["auto", "whole", "content", "keep"] = "auto",
    invert: bool | None = None,
    transpose: bool | None = None,
    quiet: bool = False,
) -> Imported: ...
def stimuli(images: npt.ArrayLike, config: Config | _Path) -> _Floats: ...
def displacements(
    bodies: Iterable[npt.ArrayLike],
    stimuli: npt.ArrayLike,
    *,
    control_steps: int | None = None,
    config: Config | _Path | None = None,
    threads: int | None = None,
) -> _Floats: ...
def from_evogym(structure: npt.ArrayLike, *, driven: bool = False) -> _Body: ...
