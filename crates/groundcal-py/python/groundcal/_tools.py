"""``compare``, ``plan``, ``simulate``."""

from __future__ import annotations

import csv
import io
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Union

import numpy as np
import numpy.typing as npt

from . import _groundcal
from ._calibration import Calibration
from ._errors import InputError
from ._keywords import Constraint, Lens, named, say
from ._progress import Progress, listener

Path = Union[str, "os.PathLike[str]"]


@dataclass(frozen=True)
class Difference:
    """How far a camera is from the first.

    Attributes:
        name: What it is called.
        rms_px: Root mean square distance of the images of one and the same ray, pixels, after the rotation that fits best (it is taken
            up by every pose that is estimated with the camera).
        max_px: The largest.
        p_value: Probability that the errors of both make the parameters differ so much; ``None`` without errors.
        parameters: Of each parameter: reference, value, difference, standard_deviation, difference_in_standard_deviations.
        figure: The differences over the image, as SVG.

    Example:
        >>> groundcal.compare(calibration, truth)[0].rms_px < 0.1
        True
    """

    name: str
    rms_px: float
    max_px: float
    p_value: float | None
    parameters: Mapping[str, Mapping[str, Any]]
    figure: str


class Comparison(Sequence[Difference]):
    """Cameras, each compared with the first: a sequence of :class:`Difference`, printed as a table.

    Example:
        >>> comparison = groundcal.compare(calibration, truth)
        >>> len(comparison), "fx" in comparison.to_dict()["comparisons"][0]["parameters"][0]["parameter"]
        (1, True)
    """

    def __init__(self, data: str, text: str, figures: list[str]) -> None:
        self._json, self._text = data, text
        self._all = [
            Difference(
                name=c["camera"]["file"],
                rms_px=c["reprojection"]["rms_px"],
                max_px=c["reprojection"]["max_px"],
                p_value=None if c["joint"] is None else c["joint"]["p_value"],
                parameters={p["parameter"]: p for p in c["parameters"]},
                figure=figure,
            )
            for c, figure in zip(json.loads(data)["comparisons"], figures)
        ]

    def __getitem__(self, index: Any) -> Any:
        return self._all[index]

    def __len__(self) -> int:
        return len(self._all)

    def to_dict(self) -> dict[str, Any]:
        """Everything, as the program's ``comparison.json`` has it."""
        data: dict[str, Any] = json.loads(self._json)
        return data

    def __repr__(self) -> str:
        return self._text.rstrip("\n")


def compare(*cameras: Calibration | Path) -> Comparison:
    """How far cameras differ, in their parameters (with significance) and in pixels; each is compared with the first.

    Args:
        cameras: Two or more: calibrations, or paths of camera files as :func:`groundcal.load` reads them.

    Raises:
        InputError: where their images have different shapes, or a file is no camera.

    Example:
        >>> comparison = groundcal.compare(calibration, "examples/tripod/truth.json")
        >>> abs(comparison[0].parameters["fx"]["difference_in_standard_deviations"]) < 3
        True
    """
    if len(cameras) < 2:
        raise TypeError(f"compare() takes two cameras or more, {len(cameras)} given")
    given: list[Any] = []
    for i, camera in enumerate(cameras):
        if isinstance(camera, Calibration):
            given.append((f"camera {i + 1}", camera._handle))
        elif isinstance(camera, (str, os.PathLike)):
            given.append(camera)
        else:
            raise TypeError(f"camera {i + 1}: expected a Calibration or a path, not {type(camera).__name__}")
    data, text, figures, notes = _groundcal.compare_cameras(given, _groundcal.WIDTH)
    say(notes)
    return Comparison(data, text, figures)


@dataclass(frozen=True)
class PlannedMotion:
    """Two pictures to take.

    Attributes:
        pitch_down_deg: Tilt of the camera below the horizon, degrees.
        roll_deg: Roll, degrees, positive with the right-hand side down.
        turn_deg: Turn between the two pictures, degrees.
        f_percent: Standard deviation of the focal length once it is taken, per cent; ``None`` while there is no camera yet.

    Example:
        >>> groundcal.plan(motions=2).motions[0].turn_deg > 0
        True
    """

    pitch_down_deg: float
    roll_deg: float
    turn_deg: float
    f_percent: float | None


class Plan:
    """Which pictures to take, and the error bars to expect; printed as a shot list.

    Attributes:
        motions: The motions, in order.
        figure: Error of f against the number of motions, as SVG.

    Example:
        >>> len(groundcal.plan(motions=3).motions)
        3
    """

    motions: list[PlannedMotion]
    figure: str

    def __init__(self, data: str, text: str, figure: str) -> None:
        self._json, self._text, self.figure = data, text, figure
        self.motions = [
            PlannedMotion(
                pitch_down_deg=m["pitch_down_deg"],
                roll_deg=m["roll_deg"],
                turn_deg=m["turn_deg"],
                f_percent=None if m["after"] is None else m["after"]["f_percent"],
            )
            for m in json.loads(data)["motions"]
        ]

    def to_dict(self) -> dict[str, Any]:
        """Everything, as the program's ``plan.json`` has it."""
        data: dict[str, Any] = json.loads(self._json)
        return data

    def __repr__(self) -> str:
        return self._text.rstrip("\n")


_OF_CAMERA = ("image_size", "f", "hfov_deg", "principal_point_px", "priors")


@named
def plan(
    after: Calibration | None = None,
    *,
    rig: Literal["tripod", "pan-head", "robot", "drone"] = "tripod",
    image_size: tuple[int, int] | None = None,
    f: float | None = None,
    hfov_deg: float | None = None,
    principal_point_px: tuple[float, float] | None = None,
    tilts_deg: Sequence[float] | None = None,
    rolls_deg: Sequence[float] | None = None,
    max_turn_deg: float | None = None,
    height_m: float | None = None,
    axis_offset_m: float | None = None,
    reach_m: float | None = None,
    noise_px: float | None = None,
    points: float | None = None,
    motions: int | None = None,
    constraint: Constraint = "auto",
    priors: Mapping[str, tuple[float, float]] | None = None,
    lens: Lens = "k1k2",
    attitude_sigma_deg: float | None = None,
    height_sigma: float | None = None,
) -> Plan:
    """Which pictures to take, and how well the camera will be known; after a calibration, the motions that improve it most.

    Args:
        after: A calibration to improve: camera, error bars, noise and matches come from it.
        rig: What carries the camera: ``"tripod"``, ``"pan-head"``, ``"robot"``, ``"drone"``; says what is usual for the others.
        image_size: Width and height, pixels; (1280, 960) by default.
        f: Rough focal length, pixels; the width by default.
        hfov_deg: Rough horizontal field of view, degrees, instead of ``f``.
        principal_point_px: As ``calibrate`` is going to be told.
        tilts_deg: Tilts that the camera can have, degrees below the horizon.
        rolls_deg: Rolls that it can have, degrees.
        max_turn_deg: Largest turn between two pictures, degrees.
        height_m: Height over the floor, metres.
        axis_offset_m: Distance from the camera back to the axis that it turns about, metres.
        reach_m: How far away the floor can still be matched, metres.
        noise_px: Standard deviation of each coordinate of a match, pixels; 0.3 by default.
        points: Matches of two pictures that show the same floor from border to border; 300 by default.
        motions: How many, 1 to 50; 4 by default, 2 after a calibration.
        constraint: As for ``calibrate``.
        priors: As for ``calibrate``.
        lens: As for ``calibrate``.
        attitude_sigma_deg: As for ``calibrate``; 0.1 by default.
        height_sigma: As for ``calibrate``.

    Raises:
        DegenerateError: where no motion of the rig can tell what is asked.

    Example:
        >>> plan = groundcal.plan(rig="pan-head", hfov_deg=70, image_size=(1920, 1080))
        >>> [m.f_percent is not None for m in plan.motions][-1]
        True
    """
    options: dict[str, Any] = {
        "rig": rig,
        "image_size": image_size,
        "f": f,
        "hfov_deg": hfov_deg,
        "principal_point_px": principal_point_px,
        "tilts_deg": tilts_deg,
        "rolls_deg": rolls_deg,
        "max_turn_deg": max_turn_deg,
        "height_m": height_m,
        "axis_offset_m": axis_offset_m,
        "reach_m": reach_m,
        "noise_px": noise_px,
        "points": points,
        "motions": motions,
        "constraint": constraint,
        "priors": dict(priors) if isinstance(priors, Mapping) else priors,
        "lens": lens,
        "attitude_sigma_deg": attitude_sigma_deg,
        "height_sigma": height_sigma,
    }
    if f is not None and hfov_deg is not None:
        raise InputError("f= and hfov_deg=: give one of them", "unusable_option")
    if after is not None:
        if not isinstance(after, Calibration):
            raise TypeError(f"after: expected a Calibration (groundcal.load reads files), not {type(after).__name__}")
        for name in _OF_CAMERA:
            if options[name] is not None:
                raise InputError(f"{name}= comes from the calibration given", "unusable_option")
    told = "".join(
        f", {name}={options[name]!r}"
        for name, usual in (
            ("constraint", "auto"),
            ("principal_point_px", None),
            ("priors", None),
            ("lens", "k1k2"),
            ("attitude_sigma_deg", None),
            ("height_sigma", None),
        )
        if options[name] != usual
    )
    both = "  # old and new pictures together" if after is not None else ""
    then = (
        f'Then: calibration = groundcal.calibrate("pictures/"{told}){both}\n'
        f'and:  groundcal.plan(calibration, rig="{rig}")'
    )
    handle = None if after is None else after._handle
    data, text, (figure,), _ = _groundcal.plan_motions(handle, options, then, _groundcal.WIDTH)
    return Plan(data, text, figure)


class Study:
    """A study of the paper: errors of the focal length on synthetic matches; printed as a page of text.

    Attributes:
        name: Its name.
        table: Columns by name, (n,) arrays: of numbers where all are numbers (NaN where there is none), else of strings.
        figure: The figure, as SVG.

    Example:
        >>> study = groundcal.simulate("noise", trials=5)
        >>> float(study.table["value"].max())
        4.0
    """

    name: str
    table: dict[str, npt.NDArray[Any]]
    figure: str

    def __init__(self, name: str, table: str, text: str, figure: str) -> None:
        self.name, self._csv, self._text, self.figure = name, table, text, figure
        header, *rows = csv.reader(io.StringIO(table))
        self.table = {column: _column([row[i] for row in rows]) for i, column in enumerate(header)}

    def to_csv(self) -> str:
        """The table as CSV, as the program writes it."""
        return self._csv

    def __repr__(self) -> str:
        return self._text.rstrip("\n")


def _column(values: list[str]) -> npt.NDArray[Any]:
    try:
        return np.array([float(v) if v else np.nan for v in values])
    except ValueError:
        return np.array(values)


@named
def simulate(
    study: str,
    *,
    matches: int | None = None,
    roll_deg: float | None = None,
    noise_px: float | None = None,
    image_size: tuple[int, int] | None = None,
    trials: int = 200,
    seed: int = 0,
    threads: int | None = None,
    progress: Progress = False,
) -> Study:
    """A study of the paper: synthetic matches, methods and the Cramér-Rao bound.

    Args:
        study: What is varied: ``"noise"``, ``"offset"``, ``"motions"``, ``"angle"``, ``"axis"``, ``"radial"``, ``"transfer"``,
            ``"subsets"``, ``"general"``.
        matches: Of each motion; 200, and 20 by default.
        roll_deg: Rolls within so many degrees of level; wide attitudes and narrow ones (10) by default. Not of ``"general"``.
        noise_px: Standard deviation of each image coordinate where the study does not vary it; 1 by default.
        image_size: Width and height in pixels, the field of view staying as it is; (1280, 960) by default.
        trials: For each point of a curve.
        seed: Of every random choice.
        threads: As many as there are processors by default.
        progress: As for :func:`groundcal.calibrate`.

    Example:
        >>> study = groundcal.simulate("axis", trials=3)
        >>> study.figure[:4]
        '<svg'
    """
    for name, value, least, most in (("trials", trials, 1, 10**6), ("seed", seed, 0, 2**64 - 1), ("threads", threads, 1, 256)):
        if value is not None and not isinstance(value, (int, np.integer)):
            raise TypeError(f"{name}= must be a whole number, not {value!r} ({type(value).__name__})")
        if value is not None and not least <= value <= most:
            raise InputError(f"{name}={value}: it must lie between {least} and {most}", "unusable_option")
    given = {"matches": matches, "roll_deg": roll_deg, "noise_px": noise_px, "image_size": image_size}
    with listener(progress) as told:
        table, text, figure = _groundcal.run_study(study, given, trials, seed, threads, told)
    return Study(study, table, text, figure)
