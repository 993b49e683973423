import os
import pathlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
import pandas as pd

_Path = str | os.PathLike[str]
_Changes = str | Iterable[str] | Mapping[str, Any]
_Body = npt.NDArray[np.uint8]
_Floats = npt.NDArray[np.float64]
_Callback = Callable[[dict[str, Any]], object]
_FigureKind = Literal[
    "archive", "progress", "accuracy", "capacity", "gates", "body", "spacetime", "snapshots"
]

__version__: str

class Error(Exception): ...
class Stopped(Error): ...
class Unstable(Error): ...

class Config:
    def __init__(self, config: Config | _Path, set: _Changes = ()) -> None: ...
    def to_toml(self) -> str: ...
    def to_json(self) -> str: ...
    def to_dict(self) -> dict[str, Any]: ...
    def __eq__(self, other: object) -> bool: ...
    def __hash__(self) -> int: ...

class Figure:
    def save(self, path: _Path, dpi: int | None = None) -> pathlib.Path: ...
    def _repr_svg_(self) -> str: ...

class Recording:
    @property
    def displacements(self) -> list[float]: ...
    def save(
        self, path: _Path, *, width: int = 480, every: int = 2, side_by_side: bool = False
    ) -> pathlib.Path: ...
    def _repr_html_(self) -> str: ...

class Genome:
    config: Config
    @classmethod
    def random(cls, config: Config | _Path, seed: int, *, generation: int = 0, child: int = 0) -> Genome: ...
    def mutate(self, seed: int, *, generation: int = 1, child: int = 0) -> Genome: ...
    def body(self) -> _Body: ...
    @property
    def id(self) -> str: ...
    def to_json(self) -> str: ...
    @classmethod
    def from_json(cls, text: str, config: Config | _Path) -> Genome: ...
    def _repr_html_(self) -> str: ...
    def __eq__(self, other: object) -> bool: ...
    def __hash__(self) -> int: ...

@dataclass(frozen=True)
class Robot:
    id: str
    task: str
    objective: float
    body: _Body
    run: Run
    @property
    def genome(self) -> Genome: ...
    @property
    def answers(self) -> dict[Literal["left", "right"], list[int]] | None: ...
    def displacements(self, stimuli: npt.ArrayLike, **options: Any) -> _Floats: ...
    def recording(self) -> Recording: ...
    def page(self) -> str: ...
    def gif(
        self, path: _Path, *, width: int = 480, every: int = 2, side_by_side: bool = False
    ) -> pathlib.Path: ...
    def plot(
        self, kind: Literal["body", "spacetime", "snapshots"] = "body", **options: Any
    ) -> Figure: ...
    def _repr_html_(self) -> str: ...

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
    @property
    def metrics(self) -> pd.DataFrame: ...
    def __getitem__(self, robot: str) -> Robot: ...
    def __iter__(self) -> Iterator[Robot]: ...
    def __len__(self) -> int: ...
    def plot(
        self,
        kind: _FigureKind = "archive",
        robot: str | None = None,
        *,
        every: int | None = None,
        width: int | None = None,
        title: bool = True,
        transparent: bool = False,
        data: _Path | None = None,
    ) -> Figure: ...
    def response(
        self,
        robots: str = "best",
        *,
        task: str | None = None,
        set: _Changes = (),
        images: int = 1000,
        error: float = 0.2,
        seed: int | None = None,
        data: _Path | None = None,
        quiet: bool = False,
    ) -> pd.DataFrame: ...
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
        self,
        body: npt.ArrayLike,
        *,
        start_row: int | None = None,
        config: Config | _Path | None = None,
        start_column: int | None = None,
        terrain: Iterable[Mapping[str, Any]] | None = None,
    ) -> None: ...
    @property
    def stimulus(self) -> _Floats: ...
    @stimulus.setter
    def stimulus(self, pixels: npt.ArrayLike) -> None: ...
    def set_targets(self, targets: npt.ArrayLike) -> None: ...
    def step(self, count: int | npt.ArrayLike = 1) -> None: ...
    def reset(self) -> None: ...
    def render(self) -> Recording: ...
    @property
    def control_step(self) -> int: ...
    @property
    def points(self) -> _Floats: ...
    @property
    def velocities(self) -> _Floats: ...
    @property
    def voxels(self) -> npt.NDArray[np.uintp]: ...
    @property
    def centre(self) -> _Floats: ...
    def __copy__(self) -> World: ...
    def __deepcopy__(self, memo: object) -> World: ...

@dataclass(frozen=True)
class Rollouts:
    displacement: _Floats
    steps: npt.NDArray[np.int_]
    path: _Floats
    width: _Floats
    height: _Floats
    ground: _Floats
    kinetic: _Floats
    elastic: _Floats
    gravitational: _Floats
    drive: _Floats

@dataclass(frozen=True)
class Team:
    accuracy: float
    interval: tuple[float, float]
    walks: float
    members: pd.DataFrame
    confusion: Figure | None
    bodies: Figure | None
    about: dict[str, Any]
    path: pathlib.Path

@dataclass(frozen=True)
class Imported:
    name: str
    folder: pathlib.Path
    size: tuple[int, int]
    classes: dict[str | int, dict[str, int]]
    about: dict[str, Any]

def load_run(folder: _Path) -> Run: ...
def load_runs(folder: _Path) -> list[Run]: ...
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
    callback: _Callback | None = None,
) -> Run: ...
def train(
    runs: Run | _Path | Iterable[Run | _Path],
    task: str,
    *,
    robots: str | None = None,
    seed: int | None = None,
    set: _Changes = (),
    dataset: str | None = None,
    out: _Path | None = None,
    resume: bool = False,
    force: bool = False,
    audit: bool = True,
    data: _Path | None = None,
    threads: int | None = None,
    quiet: bool = False,
    callback: _Callback | None = None,
) -> Run: ...
def train_pairs(
    runs: Run | _Path | Iterable[Run | _Path] = "gallery:gaits",
    *,
    classes: Iterable[str | int] | None = None,
    dataset: str | None = None,
    robots: str | None = None,
    seed: int | None = None,
    set: _Changes = (),
    out: _Path | None = None,
    data: _Path | None = None,
    threads: int | None = None,
    quiet: bool = False,
) -> list[Run]: ...
def team(
    runs: Run | _Path | Iterable[Run | _Path] = "gallery:team",
    *,
    robots: str = "best",
    classes: Iterable[str | int] | None = None,
    images: int | Literal["all"] | None = None,
    split: Literal["test", "validation"] = "test",
    seed: int = 1,
    out: _Path | None = None,
    data: _Path | None = None,
    threads: int | None = None,
    quiet: bool = False,
) -> Team: ...
def numbers(event: Mapping[str, Any]) -> dict[str, int | float]: ...
def images(
    dataset: str = "builtin", split: Literal["train", "test"] = "train", data: _Path | None = None
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.uint8]]: ...
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
def rollouts(
    bodies: Iterable[npt.ArrayLike],
    stimuli: npt.ArrayLike,
    *,
    control_steps: int | None = None,
    every: int = 1,
    config: Config | _Path | None = None,
    threads: int | None = None,
) -> Rollouts: ...
def show(
    body: npt.ArrayLike | Robot | Genome,
    stimuli: npt.ArrayLike | None = None,
    *,
    control_steps: int | None = None,
    config: Config | _Path | None = None,
) -> Recording: ...
def from_evogym(structure: npt.ArrayLike, *, driven: bool | Literal["targets"] | None = None) -> _Body: ...
