"""``calibrate``: from whatever there is to the camera."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any, Literal, Union

import numpy as np
import numpy.typing as npt

from . import _arrays, _groundcal
from ._calibration import Calibration
from ._errors import InputError
from ._keywords import Constraint, Lens, named, say
from ._progress import Progress, listener

Path = Union[str, "os.PathLike[str]"]
Points = Union[npt.NDArray[Any], Sequence[Sequence[float]]]
Source = Union[Path, Sequence[Path], Sequence[npt.NDArray[Any]], npt.NDArray[Any], Mapping[Any, Any]]

_SOURCES = (
    "source: expected a folder, paths, a list of arrays, or a dictionary of matches {(a, b): (points_a, points_b)}, tracks {image: (ids, "
    "points)} or homographies {(a, b): H}"
)


def _is_path(value: object) -> bool:
    return isinstance(value, (str, os.PathLike))


def _names(names: Sequence[str] | None, count: int) -> list[str]:
    if names is None:
        # As many digits as the last needs, so that they are in order.
        return [f"{i:0{len(str(max(count - 1, 0)))}d}" for i in range(count)]
    listed = [str(name) for name in names]
    if len(listed) != count:
        raise InputError(f"names=: {len(listed)} names for {count} images", "unusable_option")
    if len(set(listed)) != count:
        raise InputError("names=: a name is there twice", "unusable_option")
    return listed


def _pair_key(key: object) -> tuple[str, str]:
    if isinstance(key, tuple) and len(key) == 2:
        return str(key[0]), str(key[1])
    raise TypeError(f"{_SOURCES}; a key is {key!r}")


def _order(keys: list[tuple[str, str]]) -> dict[str, int]:
    order: dict[str, int] = {}
    for pair in keys:
        for name in pair:
            order.setdefault(name, len(order))
    return order


def _is_homography(value: Any) -> bool:
    if isinstance(value, Mapping):
        return "H" in value
    if isinstance(value, (tuple, list)) and len(value) == 2:
        first, second = value
        return all(isinstance(v, np.ndarray) for v in value) and first.shape == (3, 3) and second.shape == (9, 9)
    return isinstance(value, np.ndarray) and value.shape == (3, 3)


def _from_matches(source: Mapping[Any, Any], options: dict[str, Any], progress: Any) -> Any:
    keys = [_pair_key(key) for key in source]
    order = _order(keys)
    pairs = []
    for (a, b), value in zip(keys, source.values()):
        label = f"matches of {a!r} and {b!r}"
        if not isinstance(value, (tuple, list)) or len(value) not in (2, 3):
            raise TypeError(f"{label}: expected (points_a, points_b) or (points_a, points_b, sigma_px)")
        points_a, points_b = _arrays.points(value[0], label), _arrays.points(value[1], label)
        if len(points_a) != len(points_b):
            raise InputError(f"{label}: {len(points_a)} points in one and {len(points_b)} in the other", "unusable_input")
        sigma = None
        if len(value) == 3:
            sigma = np.broadcast_to(np.asarray(value[2], dtype=np.float64), (len(points_a),)).tolist()
        pairs.append((order[a], order[b], points_a, points_b, sigma))
    return _groundcal.calibrate_pairs(list(order), pairs, options, progress)


def _from_homographies(source: Mapping[Any, Any], options: dict[str, Any], progress: Any) -> Any:
    keys = [_pair_key(key) for key in source]
    order = _order(keys)
    all = []
    for (a, b), value in zip(keys, source.values()):
        label = f"the homography from {a!r} to {b!r}"
        covariance: Any = None
        matches = 0
        if isinstance(value, Mapping):
            covariance, matches, value = value.get("covariance"), int(value.get("matches", 0)), value["H"]
        elif isinstance(value, (tuple, list)) and len(value) == 2:
            value, covariance = value
        H = _arrays.matrix(value, label, 3)
        C = None if covariance is None else _arrays.matrix(covariance, f"{label}, its covariance", 9)
        all.append((order[a], order[b], H, C, matches))
    return _groundcal.calibrate_planes(list(order), all, options, progress)


def _from_tracks(source: Mapping[Any, Any], options: dict[str, Any], progress: Any) -> Any:
    images = []
    for image, value in source.items():
        label = f"tracks of {image!r}"
        if isinstance(value, Mapping):
            value = (list(value), list(value.values()))
        if not isinstance(value, (tuple, list)) or len(value) != 2:
            raise TypeError(f"{label}: expected (ids, points) or a dictionary {{id: (x, y)}}")
        ids, points = [str(i) for i in value[0]], _arrays.points(value[1], label)
        if len(ids) != len(points):
            raise InputError(f"{label}: {len(ids)} tracks and {len(points)} points", "unusable_input")
        images.append((str(image), ids, points))
    return _groundcal.calibrate_tracks(images, options, progress)


def _from_mapping(source: Mapping[Any, Any], options: dict[str, Any], progress: Any) -> Any:
    if not source:
        raise InputError("source: an empty dictionary", "unusable_input")
    if not any(isinstance(key, tuple) for key in source):
        return _from_tracks(source, options, progress)
    of_planes = [_is_homography(value) for value in source.values()]
    if all(of_planes):
        return _from_homographies(source, options, progress)
    if any(of_planes):
        raise TypeError(f"{_SOURCES}; this has both matches and homographies")
    return _from_matches(source, options, progress)


def _from_arrays(
    source: Sequence[Any], names: Sequence[str] | None, bgr: bool, options: dict[str, Any], progress: Any
) -> Any:
    labels = _names(names, len(source))
    images = [_arrays.image(value, f"image {name}") for name, value in zip(labels, source)]
    _arrays.one_size(images, [f"image {name}" for name in labels])
    return _groundcal.calibrate_arrays(labels, images, bgr, options, progress)


def _masks(mask: Any) -> Any:
    if mask is None or _is_path(mask):
        return mask
    listed = [mask] if isinstance(mask, np.ndarray) and mask.ndim == 2 else mask
    wrong = "mask= must be a path, an array (H, W), or a list of arrays (H, W), one for each image"
    if not isinstance(listed, (list, tuple, np.ndarray)) or len(listed) == 0:
        raise TypeError(wrong)
    arrays = []
    for value in listed:
        if not isinstance(value, np.ndarray) or value.ndim != 2:
            raise TypeError(wrong)
        arrays.append(np.ascontiguousarray(value != 0))
    return arrays


@named
def calibrate(
    source: Source,
    *,
    image_size: tuple[int, int] | None = None,
    names: Sequence[str] | None = None,
    bgr: bool = False,
    mask: Path | npt.NDArray[Any] | Sequence[npt.NDArray[Any]] | None = None,
    motion: Literal["auto", "plane-normal", "turning", "general"] = "auto",
    constraint: Constraint = "auto",
    method: Literal["joint", "linear", "kzr", "transferred", "rotating"] = "joint",
    homographies: Literal["linear", "nonlinear"] | None = None,
    radial: Literal["per-pair", "closed-form"] | None = None,
    lens: Lens = "k1k2",
    distortion: Mapping[str, Any] | Path | Calibration | None = None,
    priors: Mapping[str, tuple[float, float]] | None = None,
    principal_point_px: tuple[float, float] | None = None,
    aspect: float | None = None,
    attitude_sigma_deg: float | None = None,
    height_sigma: float | None = None,
    camera_height_m: float | None = None,
    pairs: Sequence[tuple[str | int, str | int]] | Path | None = None,
    all_pairs_limit: int = 40,
    min_plane_matches: int | None = None,
    features: Literal["auto", "dense"] = "auto",
    max_features: int = 3000,
    match_patches: bool = True,
    seed: int = 0,
    threads: int | None = None,
    progress: Progress = False,
) -> Calibration:
    """Calibrates a camera from pictures of a floor between which it turned about the floor's normal.

    Other Python threads run on meanwhile; Ctrl-C stops it within a fifth of a second. The result depends on neither threads nor progress.

    Args:
        source: One of

            - a folder, an image file, a glob pattern, or a list of them (JPEG, PNG, TIFF, WebP);
            - a list of arrays of one size: (H, W) or (H, W, 3), uint8, uint16 or float32. Colours are RGB (see ``bgr``). float32 runs
              from 0 (black) to 1 (white); where the values run otherwise, the range that they use is taken, and a
              :class:`GroundcalWarning` says so. Contiguous uint8 arrays are read where they are, others are copied;
            - matches ``{("a.jpg", "b.jpg"): (points_a, points_b)}``, points (N, 2) in pixels, row i of one being row i of the other; a
              third array (N,) may give their standard deviations in pixels;
            - tracks ``{"a.jpg": (ids, points)}`` or ``{"a.jpg": {id: (x, y)}}``: points of one id are one point of the floor;
            - homographies ``{("a.jpg", "b.jpg"): H}``, (3, 3), from pixels of the first to pixels of the second image; ``(H, C)`` with
              the covariance (9, 9) of its entries, row by row;
            - a file ``matches.csv`` or ``tracks.csv`` (``docs/formats.md``).
        image_size: Width and height in pixels: for matches, tracks and homographies.
        names: Names of arrays (default "0", "1", ...), by which ``pairs`` and results call them.
        bgr: Arrays have blue first, as those of ``cv2.imread``.
        mask: What of the images is used: an image file in which it is white, or a folder with one for each image (``a.png`` for
            ``a.jpg``); or an array (H, W) in which it is not zero, or a list of one for each image. What stands still in all images is
            found by itself.
        motion: How the camera moved: ``"auto"``, ``"plane-normal"`` (you vouch that it did not tilt between the images of a motion),
            ``"turning"`` (on the spot, about any axes).
        constraint: What is assumed of the camera matrix: ``"auto"`` (priors), ``"full"``, ``"zero-skew"``, ``"square"``,
            ``"fixed-pp"``, ``"focal"``.
        method: ``"joint"``, ``"linear"`` (the paper's closed form, weighted and polished, with patches and the lens), ``"kzr"`` (the
            paper's as published: no weights, no lens), ``"transferred"`` (one motion carried into other views of its plane),
            ``"rotating"`` (a pan-tilt camera on the spot).
        homographies: How those of ``"kzr"`` are fitted: ``"nonlinear"`` (the default) or ``"linear"``.
        radial: How ``"kzr"`` corrects a radial distortion of one parameter, in each pair by itself: ``"per-pair"`` (minimised with the
            homography) or ``"closed-form"`` (biased by noise); by default not at all.
        lens: What is estimated of the lens: ``"k1k2"``, ``"k1"``, ``"none"``.
        distortion: A known lens, which is held: ``{"k1": -0.1, "k2": 0.02}`` (with ``"model": "radtan"``, ``"division"``), a
            Calibration or the path of a camera file, fisheyes too.
        priors: What is known beforehand, ``{"cx": (640, 5)}``: mean and standard deviation of fx, aspect, cx, cy, skew (pixels),
            k1, k2, p1, p2, k3.
        principal_point_px: (x, y) where it is held, or the centre of its prior; the image centre by default.
        aspect: fy / fx where it is held, or the centre of its prior; 1 by default.
        attitude_sigma_deg: How far the camera pitches and rolls by itself between views, standard deviation in degrees; estimated.
        height_sigma: How far its height varies, relative standard deviation; estimated.
        camera_height_m: Height of the camera at the first view, metres: gives positions in metres.
        pairs: The pairs that are motions, of names or indices, or a CSV of them; they are found by default.
        all_pairs_limit: Up to so many images all pairs are compared, beyond it neighbours.
        min_plane_matches: Fewest matches that must agree on a plane.
        features: How many features are looked for: "auto", few first and many where these do not carry the answer, or "dense".
        max_features: Most features of an image, where many are looked for, 50 to 50000.
        match_patches: Whether the floor of the motions is matched again patch by patch (images only).
        seed: Of every random choice.
        threads: As many as there are processors by default.
        progress: ``True``: a bar (of tqdm, if there is one); or a function of ``(stage, done, total)``, which is called by the thread
            that called ``calibrate`` and may raise to stop the work.

    Returns:
        The calibration.

    Raises:
        DegenerateError: where the input cannot determine what was asked; it says what helps.
        InputError: where it cannot be read or used.
        TypeError: for a keyword that there is not, or a value of a wrong type.

    Example:
        >>> calibration = groundcal.calibrate("examples/tripod")
        >>> calibration.K.round(1)
        array([[705. ,   0. , 409.5],
               [  0. , 705. , 291. ],
               [  0. ,   0. ,   1. ]])
    """
    given: dict[str, Any] = {
        "image_size": image_size,
        "mask": _masks(mask),
        "motion": motion,
        "constraint": constraint,
        "method": method,
        "homographies": homographies,
        "radial": radial,
        "lens": lens,
        "distortion": distortion._handle if isinstance(distortion, Calibration) else distortion,
        "priors": dict(priors) if isinstance(priors, Mapping) else priors,
        "principal_point_px": principal_point_px,
        "aspect": aspect,
        "attitude_sigma_deg": attitude_sigma_deg,
        "height_sigma": height_sigma,
        "camera_height_m": camera_height_m,
        "pairs": pairs,
        "all_pairs_limit": all_pairs_limit,
        "min_plane_matches": min_plane_matches,
        "features": features,
        "max_features": max_features,
        "match_patches": match_patches,
        "seed": seed,
        "threads": threads,
    }
    if isinstance(distortion, Mapping):
        given["distortion"] = dict(distortion)
    with listener(progress) as told:
        handle, notes = _dispatch(source, names, bgr, given, told)
    say(notes)
    return Calibration(handle)


def _dispatch(source: Any, names: Sequence[str] | None, bgr: bool, given: dict[str, Any], told: Any) -> Any:
    if isinstance(source, Mapping):
        _only_arrays(names, bgr)
        return _from_mapping(source, given, told)
    if _is_path(source):
        _only_arrays(names, bgr)
        return _groundcal.calibrate_files([source], given, told)
    if isinstance(source, np.ndarray) and (source.ndim == 4 or source.ndim == 3 and source.shape[2] not in (1, 3, 4)):
        return _from_arrays(list(source), names, bgr, given, told)
    if isinstance(source, np.ndarray):
        raise InputError(
            f"source: one array of shape {source.shape}; expected a list of pictures (H, W) or (H, W, 3)", "unusable_input"
        )
    try:
        listed = list(source)
    except TypeError:
        raise TypeError(f"{_SOURCES}, not {type(source).__name__}") from None
    if not listed:
        raise InputError("source: an empty list. Give two or more pictures", "unusable_input")
    if all(_is_path(item) for item in listed):
        _only_arrays(names, bgr)
        return _groundcal.calibrate_files(listed, given, told)
    if any(_is_path(item) for item in listed):
        raise TypeError(f"{_SOURCES}; this has both paths and arrays")
    return _from_arrays(listed, names, bgr, given, told)


def _only_arrays(names: Sequence[str] | None, bgr: bool) -> None:
    for keyword, given in (("names", names is not None), ("bgr", bgr)):
        if given:
            raise InputError(f"{keyword}= goes with a list of arrays", "unusable_option")
