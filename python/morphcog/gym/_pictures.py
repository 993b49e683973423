"""Pictures of environments, in which the camera follows the robot."""

import numpy as np

from .._morphcog import Error
from ._bodies import GymError

_OPTIONS = {"resolution", "verbose", "hide_background", "hide_grid", "hide_edges", "hide_voxels"}
#: Columns and rows around the robot's box, and how much more is seen.
_PADDING, _MORE = np.array([10.0, 6.0]), 1.21
#: How far the camera moves towards where it should be, each picture.
_FOLLOWS = 0.1


def check_mode(render_mode):
    """Refuses what EvoGym shows in a window."""
    if render_mode not in (None, "rgb_array"):
        raise GymError(
            f"render_mode={render_mode!r}: expected 'rgb_array' or None; films are made by gymnasium.wrappers.RecordVideo"
        )
    return render_mode


class Camera:
    """Follows one robot smoothly; the first picture after a reset has it in the middle."""

    def __init__(self, data, number, options):
        options = dict(options or {})
        unknown = set(options) - _OPTIONS
        if unknown:
            raise GymError(f"render_options: expected {', '.join(sorted(_OPTIONS))}, found {', '.join(sorted(unknown))}")
        try:
            width, height = (int(side) for side in options.get("resolution", (1200, 600)))
        except (TypeError, ValueError):
            width, height = 0, 0
        if not (16 <= width <= 4096 and 16 <= height <= 4096):
            found = options.get("resolution")
            raise GymError(f"render_options: resolution={found!r}: expected (width, height) from 16 to 4096 pixels")
        self._data, self._number, self._size = data, number, (width, height)
        self._shown = [not options.get(f"hide_{what}") for what in ("background", "grid", "voxels", "edges")]
        self._seen = None

    def cut(self):
        """Begins anew at the robot."""
        self._seen = None

    def picture(self):
        """The present moment: uint8 (height, width, 3)."""
        points = self._data.points(self._number) / 0.1
        low, high = points.min(axis=1), points.max(axis=1)
        width, height = _MORE * (high - low + _PADDING)
        wanted = np.array([*(low + high) / 2, max(width, height * self._size[0] / self._size[1])])
        self._seen = wanted if self._seen is None else self._seen + _FOLLOWS * (wanted - self._seen)
        x, y, width = self._seen.tolist()
        try:
            return self._data.picture(self._number, ((x, y), width), self._size, self._shown)
        except Error as error:
            raise GymError(str(error)) from None
