"""Arrays that were given: looked at before they are used."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ._errors import InputError

_DTYPES = ("uint8", "uint16", "float32")


def _refuse(name: str, what: str) -> InputError:
    return InputError(f"{name}: {what}", "unusable_input")


def image(value: Any, name: str) -> npt.NDArray[Any]:
    """A picture as a C-contiguous array: the array itself where it is one."""
    array: npt.NDArray[Any] = np.asarray(value)
    if array.dtype == object:
        help = " (cv2.imread gives None for a file that it cannot read)" if value is None else ""
        raise TypeError(f"{name}: expected an array of pixels (H, W) or (H, W, 3), not {type(value).__name__}{help}")
    if array.ndim not in (2, 3):
        what = "a stack of pictures: give them as a list" if array.ndim == 4 else "no picture"
        raise _refuse(name, f"an array of shape {array.shape} is {what}; expected (H, W) or (H, W, 3)")
    if 0 in array.shape:
        raise _refuse(name, f"an empty array of shape {array.shape}; expected (H, W) or (H, W, 3)")
    if array.ndim == 3 and array.shape[2] not in (1, 3, 4):
        first = array.shape[0] in (1, 3, 4)
        help = ", which are first here: image.transpose(1, 2, 0)" if first else ""
        raise _refuse(name, f"an array of shape {array.shape}; expected (H, W) or (H, W, 3), channels last{help}")
    if array.dtype.name not in _DTYPES:
        help = {
            "float64": "convert it: image.astype(np.float32), 0 being black and 1 white",
            "float16": "convert it: image.astype(np.float32), 0 being black and 1 white",
            "bool": "convert it: image.astype(np.uint8) * 255",
        }.get(array.dtype.name, "convert it, for example: image.astype(np.uint16)")
        raise _refuse(name, f"dtype {array.dtype.name}; uint8, uint16 and float32 are pictures. {help[0].upper()}{help[1:]}")
    if array.dtype == np.float32 and not np.isfinite(array).all():
        count = int(array.size - np.count_nonzero(np.isfinite(array)))
        raise _refuse(name, f"{count} of its values are no finite numbers (NaN or infinite). Mend them: np.nan_to_num(image)")
    if array.dtype.isnative and array.flags.c_contiguous:
        return array
    return np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("="))


def points(value: Any, name: str) -> npt.NDArray[np.float64]:
    """Points (N, 2) in pixels."""
    try:
        array = np.ascontiguousarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise TypeError(f"{name}: expected an array of points (N, 2), not {type(value).__name__}") from None
    if array.ndim != 2 or array.shape[1] != 2:
        raise _refuse(name, f"an array of shape {array.shape}; expected points (N, 2), x and y in pixels")
    if not np.isfinite(array).all():
        row = int(np.argwhere(~np.isfinite(array))[0][0])
        raise _refuse(name, f"point {row} has a coordinate that is no finite number")
    return array


def matrix(value: Any, name: str, side: int) -> npt.NDArray[np.float64]:
    """A square matrix."""
    array = np.ascontiguousarray(value, dtype=np.float64)
    if array.shape != (side, side):
        raise _refuse(name, f"an array of shape {array.shape}; expected ({side}, {side})")
    return array


def one_size(images: list[npt.NDArray[Any]], names: list[str]) -> None:
    """Refuses pictures of different sizes, with their names."""
    for name, array in zip(names, images):
        if array.shape[:2] != images[0].shape[:2]:
            (h, w), (h0, w0) = array.shape[:2], images[0].shape[:2]
            turned = " (it is turned)" if (h, w) == (w0, h0) else ""
            raise _refuse(
                name,
                f"{w} x {h} pixels{turned}, {names[0]} has {w0} x {h0}. All must be of one camera at one zoom and size",
            )


