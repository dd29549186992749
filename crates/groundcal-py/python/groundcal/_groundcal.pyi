"""The native part. Use the package; this has no documentation and no promises."""

from os import PathLike
from typing import Any, Callable, final

import numpy as np
import numpy.typing as npt

__all__ = [
    "Handle",
    "STUDIES",
    "VERSION",
    "WIDTH",
    "calibrate_arrays",
    "calibrate_files",
    "calibrate_pairs",
    "calibrate_planes",
    "calibrate_tracks",
    "compare_cameras",
    "from_json",
    "load",
    "no_such",
    "plan_motions",
    "rectify_floor",
    "run_program",
    "run_study",
    "undistort",
    "undistort_maps",
]

VERSION: str
WIDTH: int
STUDIES: list[str]

_Array = npt.NDArray[Any]
_Rows = list[list[float]]
_Path = str | PathLike[str]
_Progress = Callable[[str, int, int], object] | None
_Made = tuple["Handle", list[str]]

@final
class Handle:
    def json(self) -> str: ...
    def summary(self, verbose: bool, width: int) -> str: ...
    def page(self) -> str: ...
    def rendered(self, format: str) -> tuple[list[tuple[str, str]], list[str]]: ...
    def rotations(self) -> list[_Rows]: ...
    def with_camera_height(self, height_m: float) -> Handle: ...
    def equals(self, other: Handle) -> bool: ...
    def save(
        self, folder: _Path, formats: list[str] | None, report: bool, overwrite: bool
    ) -> tuple[list[Any], list[str]]: ...

def no_such(name: str, known: list[str]) -> str: ...
def load(path: _Path) -> _Made: ...
def from_json(text: str) -> Handle: ...
def calibrate_files(paths: list[_Path], options: dict[str, Any], progress: _Progress) -> _Made: ...
def calibrate_arrays(
    names: list[str], images: list[_Array], bgr: bool, options: dict[str, Any], progress: _Progress
) -> _Made: ...
def calibrate_pairs(
    names: list[str],
    pairs: list[tuple[int, int, npt.NDArray[np.float64], npt.NDArray[np.float64], list[float] | None]],
    options: dict[str, Any],
    progress: _Progress,
) -> _Made: ...
def calibrate_tracks(
    images: list[tuple[str, list[str], npt.NDArray[np.float64]]], options: dict[str, Any], progress: _Progress
) -> _Made: ...
def calibrate_planes(
    names: list[str],
    homographies: list[tuple[int, int, npt.NDArray[np.float64], npt.NDArray[np.float64] | None, int]],
    options: dict[str, Any],
    progress: _Progress,
) -> _Made: ...
def undistort_maps(
    calibration: Handle, fit: str, fov_deg: float | None
) -> tuple[_Rows, npt.NDArray[np.float32], npt.NDArray[np.float32]]: ...
def undistort(
    calibration: Handle, image: _Array | _Path, fit: str, fov_deg: float | None
) -> tuple[_Array, npt.NDArray[np.uint8], _Rows]: ...
def rectify_floor(
    calibration: Handle,
    paths: list[_Path],
    arrays: list[tuple[str, _Array]] | None,
    options: dict[str, Any],
    progress: _Progress,
) -> tuple[list[dict[str, Any]], list[str]]: ...
def compare_cameras(
    cameras: list[tuple[str, Handle] | _Path], width: int
) -> tuple[str, str, list[str], list[str]]: ...
def plan_motions(
    after: Handle | None, options: dict[str, Any], then: str, width: int
) -> tuple[str, str, list[str], list[str]]: ...
def run_study(
    study: str,
    given: dict[str, Any], trials: int, seed: int, threads: int | None, progress: _Progress
) -> tuple[str, str, str]: ...
def run_program(args: list[str]) -> int: ...
