"""``undistort`` and ``rectify``: pictures without their lens, and the floor from above."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Union

import numpy as np
import numpy.typing as npt

from . import _arrays, _groundcal
from ._calibration import Calibration
from ._errors import InputError
from ._keywords import named, say
from ._progress import Progress, listener

Path = Union[str, "os.PathLike[str]"]


def _of_calibration(image: npt.NDArray[Any], calibration: Calibration, name: str) -> npt.NDArray[Any]:
    (width, height), (h, w) = calibration.image_size, image.shape[:2]
    if (w, h) != (width, height):
        turned = ": it is turned" if (h, w) == (width, height) else ""
        raise InputError(f"{name}: {w} x {h} pixels, the calibration is of {width} x {height}{turned}", "unusable_input")
    return image


def _checked(calibration: object) -> Calibration:
    if not isinstance(calibration, Calibration):
        raise TypeError(f"calibration: expected a Calibration (groundcal.load reads files), not {type(calibration).__name__}")
    return calibration


@dataclass(frozen=True, eq=False)
class Undistorted:
    """A picture as an ideal lens would have taken it.

    Attributes:
        image: (H, W) or (H, W, 3), dtype and colours of the original; 0 where nothing was seen.
        mask: (H, W) uint8: 255 where the original shows it, 0 where it does not.
        K: (3, 3) camera matrix of the new picture, pixels.

    Example:
        >>> straight = groundcal.undistort(calibration, "examples/tripod/00a.jpg")
        >>> straight.image.shape, straight.K.shape
        ((600, 800, 3), (3, 3))
    """

    image: npt.NDArray[Any]
    mask: npt.NDArray[np.uint8]
    K: npt.NDArray[np.float64]


@named
def undistort(
    calibration: Calibration,
    image: npt.NDArray[Any] | Path,
    *,
    fit: Literal["same", "all", "crop"] = "same",
    fov_deg: float | None = None,
) -> Undistorted:
    """A picture without its lens distortion, whatever the lens's model, resampled without aliasing.

    Args:
        calibration: Of its camera.
        image: (H, W) or (H, W, 3) of uint8, uint16 or float32, colours in any order, or the path of a file.
        fit: ``"same"``: the camera matrix stays; ``"all"``: everything the original shows, with empty borders; ``"crop"``: as much as
            leaves no empty border.
        fov_deg: Field of view of the new picture from left to right, 1 to 175 degrees, instead of ``fit``.

    Raises:
        InputError: for a picture of another size or kind.

    Example:
        >>> bool(groundcal.undistort(calibration, image, fit="crop").mask.all())
        True
    """
    given: Any = image
    if not isinstance(image, (str, os.PathLike)):
        given = _of_calibration(_arrays.image(image, "image"), _checked(calibration), "image")
    picture, mask, K = _groundcal.undistort(_checked(calibration)._handle, given, fit, fov_deg)
    return Undistorted(picture, mask, np.array(K))


@named
def undistort_maps(
    calibration: Calibration, *, fit: Literal["same", "all", "crop"] = "same", fov_deg: float | None = None
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32], npt.NDArray[np.float64]]:
    """The maps of :func:`undistort` for ``cv2.remap``: for many pictures of one camera.

    Returns:
        ``map_x``, ``map_y``: (H, W) float32, for each pixel of the new picture the pixel of the original; -1 where there is none.
        ``K``: (3, 3) camera matrix of the new pictures.

    Example:
        >>> map_x, map_y, K = groundcal.undistort_maps(calibration)
        >>> straight = cv2.remap(image, map_x, map_y, cv2.INTER_LINEAR)  # doctest: +SKIP
        >>> map_x.shape
        (600, 800)
    """
    K, x, y = _groundcal.undistort_maps(_checked(calibration)._handle, fit, fov_deg)
    return x, y, np.array(K)


@dataclass(frozen=True, eq=False)
class FloorPicture:
    """The floor from above.

    Attributes:
        image: (h, w) or (h, w, 3), dtype and colours of the pictures; 0 where nothing was seen.
        mask: (h, w) uint8: 255 where floor was seen, 0 where it was not.
        floor_from_pixel: (3, 3): floor coordinates (X, Y, 1) from pixels (x, y, 1) of this picture.
        unit_per_px: Side of a pixel on the floor.
        unit: Of lengths: ``"m"`` or ``"camera height"``.
        views: Names of the images in it.

    Example:
        >>> floor = groundcal.rectify(calibration, "examples/tripod", mosaic=True, resolution=100)[0]
        >>> floor.unit, len(floor.views)
        ('camera height', 12)
    """

    image: npt.NDArray[Any]
    mask: npt.NDArray[np.uint8]
    floor_from_pixel: npt.NDArray[np.float64]
    unit_per_px: float
    unit: str
    views: tuple[str, ...]


@named
def rectify(
    calibration: Calibration,
    images: Path | Sequence[Path] | Mapping[str, npt.NDArray[Any]] | Sequence[npt.NDArray[Any]],
    *,
    mosaic: bool = False,
    resolution: float | None = None,
    extent: float | None = None,
    camera_height_m: float | None = None,
    up: Literal["heading", "y"] | None = None,
    threads: int | None = None,
    progress: Progress = False,
) -> list[FloorPicture]:
    """Metric bird's-eye pictures of the floor: of each view, or of all laid over each other.

    Args:
        calibration: With its views.
        images: The pictures that were calibrated, under the names they had: a folder, paths, a dictionary of arrays by name, or the list
            of arrays that ``calibrate`` was given without names.
        mosaic: One picture of all views that common points connect, instead of one for each.
        resolution: Pixels for a unit of length; by default that of the images' median pixel.
        extent: How far from the point below each camera the floor is shown, units of length; 5 camera heights by default.
        camera_height_m: Height of the camera at the first view in metres; by default that of the calibration, else lengths are in camera
            heights.
        up: Which way is up: ``"heading"``, the way the camera looks (default for single views), or ``"y"``, +Y of the world (default for
            mosaics).
        threads: As many as there are processors by default.
        progress: As for :func:`groundcal.calibrate`.

    Raises:
        InputError: where the calibration has no floor, or no picture is one of its views.

    Example:
        >>> views = groundcal.rectify(calibration, ["examples/tripod/00a.jpg"], resolution=100, extent=2)
        >>> views[0].views, views[0].unit_per_px
        (('00a.jpg',), 0.01)
    """
    options = {
        "mosaic": mosaic,
        "resolution": resolution,
        "extent": extent,
        "camera_height_m": camera_height_m,
        "up": up,
        "threads": threads,
    }
    paths: list[Any] = []
    arrays: list[tuple[str, Any]] | None = None
    if isinstance(images, Mapping):
        arrays = [(str(name), value) for name, value in images.items()]
    elif isinstance(images, (str, os.PathLike)):
        paths = [images]
    else:
        listed = list(images)
        if not listed:
            raise InputError("images: an empty list", "unusable_input")
        if all(isinstance(i, (str, os.PathLike)) for i in listed):
            paths = listed
        else:
            digits = len(str(len(listed) - 1))
            arrays = [(f"{i:0{digits}d}", value) for i, value in enumerate(listed)]
    if arrays is not None:
        checked = [(n, _of_calibration(_arrays.image(a, f"image {n}"), _checked(calibration), f"image {n}")) for n, a in arrays]
        if len({(a.dtype, a.ndim) for _, a in checked}) > 1:
            raise InputError("images: they have different dtypes or shapes: give all in one", "unusable_input")
        arrays = checked
    with listener(progress) as told:
        made, notes = _groundcal.rectify_floor(_checked(calibration)._handle, paths, arrays, options, told)
    say(notes)
    return [
        FloorPicture(m["image"], m["mask"], np.array(m["floor_from_pixel"]), m["unit_per_px"], m["unit"], tuple(m["views"]))
        for m in made
    ]
