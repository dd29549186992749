"""What a calibration is in Python: a value, with its numbers as NumPy arrays."""

from __future__ import annotations

import html
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from . import _groundcal
from ._errors import InputError
from ._keywords import say

_Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class CalibrationWarning:
    """Doubt about a result.

    Attributes:
        code: Short name, stable across versions (``docs/warnings.md`` has them all).
        message: What it means and what to do, in the words of Python.
        remedies: Codes of what to do, any of which helps.
        numbers: Its numbers by name, with units in the names; may be empty.

    Example:
        >>> calibration.warnings
        []
        >>> "single_motion" in [w.code for w in calibration_of_one_motion.warnings]
        True
    """

    code: str
    message: str
    remedies: tuple[str, ...] = ()
    numbers: Mapping[str, Any] = field(default_factory=dict)

    def __str__(self) -> str:
        return f"[{self.code}] {self.message}"


@dataclass(frozen=True)
class Verdict:
    """Whether to trust a result.

    Attributes:
        level: ``"trustworthy"`` (what was assumed was tried against the images, and held), ``"usable"`` (the images decide less than
            all), ``"unchecked"`` (the error bars may not hold). ``docs/warnings.md`` has the table.
        checked: Whether more than the height ratio of a single motion tried how the camera turned.
        reasons: Why no better: codes, those of warnings or of the verdict's own, each with what it means. The gravest first.

    Example:
        >>> calibration.verdict.level
        'trustworthy'
    """

    level: str
    checked: bool
    reasons: Mapping[str, str] = field(default_factory=dict)

    def __str__(self) -> str:
        return self.level + "".join(f"; {code}: {message}" for code, message in self.reasons.items())


@dataclass(frozen=True)
class Motion:
    """A pair of images and what became of it.

    Attributes:
        images: Names of the two images.
        used: Whether it takes part in the camera as a motion.
        reason: Why it does not; ``None`` where it does.
        rotation_deg: Turn of the camera, degrees, anticlockwise seen from above; ``None`` without a homography.
        rotation_sigma_deg: Its standard deviation.
        height_ratio: Height over the floor in the second image over that in the first; ``None`` without a homography.
        matches: Matches that agree on one plane.
        rms_px: Root mean square residual of those, both images together, pixels.
        attitude: Index of its attitude in ``Calibration.to_dict()["attitudes"]``; ``None`` where it is not used.
        diagnosis: How it fits the others: ``"fits"``, ``"tilts"``, ``"off_camera"``, ``"not_judged"``, or ``None`` where not used.

    Example:
        >>> motion = next(m for m in calibration.motions if m.used)
        >>> motion.images, round(abs(motion.rotation_deg))
        (('00a.jpg', '00b.jpg'), 24)
    """

    images: tuple[str, str]
    used: bool
    reason: str | None
    rotation_deg: float | None
    rotation_sigma_deg: float | None
    height_ratio: float | None
    matches: int
    rms_px: float | None
    attitude: int | None
    diagnosis: str | None


@dataclass(frozen=True, eq=False)
class View:
    """Where an image was taken from.

    The world: Z up, the floor is Z = 0, the origin is the floor below the camera of the image ``origin``, +X the way that camera looks.
    The unit of length is that camera's height (metres with ``camera_height_m=``). Camera coordinates are x right, y down, z forward.

    Attributes:
        image: Name of the image.
        origin: Name of the image whose foot is the origin of its world.
        attitude: Index of its attitude; ``None`` where there is no floor.
        R: (3, 3) rotation: camera coordinates are ``R @ (X - position)``.
        t: (3,) translation of camera coordinates, ``-R @ position``; ``None`` where nothing shows where the camera was.
        position: (3,) optical centre x, y, height; ``None`` where nothing shows it.
        position_sigma: (3,) its standard deviations; ``None`` with it.
        pitch_down_deg: Angle of the optical axis below the horizon, degrees.
        roll_deg: Roll, degrees, positive with the camera's right-hand side down.
        yaw_deg: Heading, degrees, anticlockwise seen from above.
        floor_from_pixel: (3, 3) homography from *undistorted* pixels to points of the floor; ``None`` without a floor.

    Example:
        >>> view = calibration.views[0]
        >>> view.image, view.R.shape, bool(view.position[2] > 0)
        ('00a.jpg', (3, 3), True)
    """

    image: str
    origin: str
    attitude: int | None
    R: _Floats
    t: _Floats | None
    position: _Floats | None
    position_sigma: _Floats | None
    pitch_down_deg: float
    roll_deg: float
    yaw_deg: float
    floor_from_pixel: _Floats | None


class Covariance:
    """The covariance of the camera's parameters, by name and as an array.

    Pixels squared; parameters of the lens have no unit. What was held has zeros.

    Attributes:
        names: Names of rows and columns.
        matrix: (n, n) array.

    Example:
        >>> calibration.covariance["fx", "fy"] > 0  # who sees one larger sees the other larger
        True
        >>> calibration.covariance.of("fx", "fy", "cx", "cy").shape
        (4, 4)
    """

    names: tuple[str, ...]
    matrix: _Floats

    def __init__(self, names: tuple[str, ...], matrix: _Floats) -> None:
        self.names = names
        self.matrix = matrix

    def _place(self, name: str) -> int:
        if name not in self.names:
            raise KeyError(_groundcal.no_such(name, list(self.names)))
        return self.names.index(name)

    def __getitem__(self, names: tuple[str, str]) -> float:
        a, b = names
        return float(self.matrix[self._place(a), self._place(b)])

    def of(self, *names: str) -> _Floats:
        """The matrix (n, n) of these, in this order.

        Example:
            >>> calibration.covariance.of("cx", "cy").shape
            (2, 2)
        """
        places = [self._place(name) for name in names]
        return self.matrix[np.ix_(places, places)]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> _Floats:
        return np.array(self.matrix, dtype=dtype) if copy or dtype is not None else self.matrix

    def __repr__(self) -> str:
        return f"Covariance({', '.join(self.names)})"


class OpenCV(NamedTuple):
    """A camera as the functions of OpenCV take it.

    Attributes:
        K: (3, 3) camera matrix, pixels.
        dist: (5,) k1, k2, p1, p2, k3 for ``cv2``; (4,) k1 to k4 for ``cv2.fisheye``.
        fisheye: Whether ``dist`` goes with ``cv2.fisheye``.

    Example:
        >>> K, dist, fisheye = calibration.to_opencv()
        >>> K.shape, dist.shape, fisheye
        ((3, 3), (5,), False)
    """

    K: _Floats
    dist: _Floats
    fisheye: bool


def _constant(values: Any) -> _Floats:
    array = np.array(values, dtype=np.float64)
    array.flags.writeable = False
    return array


def _maybe(values: Any) -> _Floats | None:
    return None if values is None else _constant(values)


_NAMES = ("fx", "fy", "cx", "cy", "skew", "k1", "k2", "p1", "p2", "k3")


class Calibration:
    """A calibrated camera, what it was made from, and what to beware of.

    Made by :func:`groundcal.calibrate` or :func:`groundcal.load`. It does not change. Two are equal when they say the same; one that was
    saved and loaded, or pickled, is equal to what it was (but has forgotten its images, so that its page is without pictures).

    Pixel (0, 0) is the **centre** of the top-left pixel, as in OpenCV.

    Example:
        >>> calibration = groundcal.calibrate("examples/tripod")
        >>> bool(abs(calibration.K[0, 0] - 705) < 3 * calibration.standard_deviation["fx"])
        True
    """

    _handle: _groundcal.Handle

    def __init__(self, _handle: object) -> None:
        if not isinstance(_handle, _groundcal.Handle):
            raise TypeError("a Calibration is made by groundcal.calibrate() or groundcal.load()")
        self._handle = _handle

    @cached_property
    def _data(self) -> dict[str, Any]:
        data: dict[str, Any] = json.loads(self._handle.json())
        return data

    # The camera.

    @property
    def image_size(self) -> tuple[int, int]:
        """Width and height in pixels.

        Example:
            >>> calibration.image_size
            (800, 600)
        """
        width, height = self._data["camera"]["image_size"]
        return int(width), int(height)

    @cached_property
    def K(self) -> _Floats:
        """The camera matrix (3, 3): fx, skew, cx; 0, fy, cy; 0, 0, 1. Pixels.

        Example:
            >>> calibration.K.shape
            (3, 3)
        """
        c = self._data["camera"]
        return _constant([[c["fx"], c["skew"], c["cx"]], [0.0, c["fy"], c["cy"]], [0.0, 0.0, 1.0]])

    @property
    def lens_model(self) -> str:
        """The model of the lens: ``"none"``, ``"radtan"`` (Brown-Conrady, as OpenCV), ``"fisheye"`` (equidistant), ``"division"``.

        Example:
            >>> calibration.lens_model
            'radtan'
        """
        return str(self._data["camera"]["distortion"]["model"])

    @cached_property
    def dist(self) -> _Floats:
        """The lens's coefficients in the order of OpenCV, no unit.

        (5,) k1, k2, p1, p2, k3, for ``cv2.undistort(image, K, dist)``; (4,) k1 to k4 of a fisheye, for ``cv2.fisheye``; zeros for a lens
        without distortion.

        Raises:
            InputError: for a lens of the division model, which OpenCV does not have.

        Example:
            >>> calibration.dist.shape
            (5,)
        """
        lens = self._data["camera"]["distortion"]
        if self.lens_model == "division":
            raise InputError(
                "OpenCV has no lens of the division model: use groundcal.undistort(), or its maps with cv2.remap",
                "unusable_input",
            )
        names = ("k1", "k2", "k3", "k4") if self.lens_model == "fisheye" else ("k1", "k2", "p1", "p2", "k3")
        return _constant([lens.get(name, 0.0) for name in names])

    @cached_property
    def standard_deviation(self) -> dict[str, float]:
        """One standard deviation of each number that was estimated, by name; pixels (those of the lens: no unit).

        What was held or given is not in it.

        Example:
            >>> sorted(calibration.standard_deviation)[:4]
            ['cx', 'cy', 'fx', 'fy']
        """
        return {name: float(v) for name, v in self._data["standard_deviation"].items() if v is not None}

    @cached_property
    def covariance(self) -> Covariance:
        """The covariance of the camera's parameters: ``covariance["fx", "cx"]``, ``covariance.matrix``.

        Example:
            >>> variance = calibration.covariance["fx", "fx"]
            >>> abs(variance - calibration.standard_deviation["fx"] ** 2) < 1e-9 * variance
            True
        """
        c = self._data["covariance"]
        n = len(c["parameters"])
        return Covariance(tuple(c["parameters"]), _constant(np.reshape(c["matrix"], (n, n))))

    # What it was made from.

    @cached_property
    def motions(self) -> list[Motion]:
        """Every pair of images that was looked at, used or not.

        Example:
            >>> sum(m.used for m in calibration.motions)
            6
        """
        return [
            Motion(
                images=(m["from"], m["to"]),
                used=m["used"],
                reason=m["reason"],
                rotation_deg=m["rotation_deg"],
                rotation_sigma_deg=m["rotation_sigma_deg"],
                height_ratio=m["height_ratio"],
                matches=m["matches"],
                rms_px=m["rms_px"],
                attitude=m["attitude"],
                diagnosis=None if m["diagnosis"] is None else m["diagnosis"]["verdict"]["code"],
            )
            for m in self._data["motions"]
        ]

    @cached_property
    def views(self) -> list[View]:
        """Where each image was taken from; empty for ``method="linear"``, which has no positions.

        Example:
            >>> len(calibration.views)
            12
        """
        return [self._view(v, R) for v, R in zip(self._data["views"], self._handle.rotations())]

    @staticmethod
    def _view(v: dict[str, Any], rotation: list[list[float]]) -> View:
        R, position = _constant(rotation), _maybe(v["position"])
        floor = v["floor_from_image"]
        return View(
            image=v["image"],
            origin=v["origin"],
            attitude=v["attitude"],
            R=R,
            t=None if position is None else _constant(-R @ position),
            position=position,
            position_sigma=_maybe(v["position_sigma"]),
            pitch_down_deg=v["pitch_down_deg"],
            roll_deg=v["roll_deg"],
            yaw_deg=v["yaw_deg"],
            floor_from_pixel=None if floor is None else _constant(floor["matrix"]),
        )

    @property
    def rms_px(self) -> float | None:
        """Root mean square residual of the points of all motions used from this one camera, both images together, pixels.

        Each motion counts with its matches. ``None`` where there are no residuals (homographies, a camera file). With
        ``method="linear"`` or ``"rotating"``, which have no camera of all points, from each motion's homography.

        Example:
            >>> calibration.rms_px < 0.2
            True
        """
        squares, count = 0.0, 0
        for m in self._data["motions"]:
            diagnosis = m["diagnosis"] or {}
            joint = diagnosis.get("joint_rms_px")
            rms = m["rms_px"] if joint is None else joint
            if m["used"] and rms is not None and m["matches"] > 0:
                squares += m["matches"] * rms**2
                count += m["matches"]
        return float(np.sqrt(squares / count)) if count and squares > 0 else None

    @cached_property
    def verdict(self) -> Verdict | None:
        """Whether to trust it, in one word and with reasons. ``None``: nobody asked (a camera from a file of another program).

        Example:
            >>> calibration.verdict.checked
            True
        """
        v = self._data.get("verdict")
        return v and Verdict(v["level"], v["checked"], {r["code"]: r["message"] for r in v["reasons"]})

    @cached_property
    def warnings(self) -> list[CalibrationWarning]:
        """What to beware of, worded in Python's keywords. Empty: nothing.

        Example:
            >>> [w.code for w in calibration.warnings]
            []
        """
        return [
            CalibrationWarning(w["code"], w["message"], tuple(w.get("remedies", ())), w.get("numbers") or {})
            for w in self._data["warnings"]
        ]

    def to_dict(self) -> dict[str, Any]:
        """Everything, as ``calibration.json`` has it (``docs/formats.md``). A copy.

        Example:
            >>> calibration.to_dict()["method"]
            'joint'
        """
        data: dict[str, Any] = json.loads(self._handle.json())
        return data

    # For other programs.

    def to_opencv(self) -> OpenCV:
        """``(K, dist, fisheye)`` for OpenCV.

        Raises:
            InputError: for a camera with a skew, which ``cv2`` passes over, and for a lens of the division model.

        Example:
            >>> K, dist, fisheye = calibration.to_opencv()
            >>> undistorted = cv2.undistort(image, K, dist)  # doctest: +SKIP
        """
        skew = float(self.K[0, 1])
        if skew != 0.0:
            raise InputError(
                f"a skew of {skew:.3f} px, which OpenCV passes over. Calibrate with another constraint=, or use "
                "groundcal.undistort(), or its maps with cv2.remap",
                "unusable_input",
            )
        return OpenCV(self.K, self.dist, self.lens_model == "fisheye")

    def _rendered(self, format: str) -> dict[str, str]:
        files, notes = self._handle.rendered(format)
        if not files:
            raise InputError(f"{format}: {'; '.join(notes)}", "unusable_input")
        say(notes)
        return dict(files)

    def _one(self, format: str, path: str | os.PathLike[str] | None) -> str:
        (text,) = self._rendered(format).values()
        if path is not None:
            Path(path).write_text(text, encoding="utf-8")
        return text

    def to_ros(self, path: str | os.PathLike[str] | None = None) -> str:
        """The text of ``camera_info.yaml``; written to the file ``path`` as well, if given.

        Example:
            >>> "camera_matrix" in calibration.to_ros()
            True
        """
        return self._one("ros", path)

    def to_kalibr(self, path: str | os.PathLike[str] | None = None) -> str:
        """The text of Kalibr's ``camchain.yaml``; written to the file ``path`` as well, if given.

        Example:
            >>> "cam0:" in calibration.to_kalibr()
            True
        """
        return self._one("kalibr", path)

    def to_nerfstudio(self, path: str | os.PathLike[str] | None = None) -> str:
        """The text of ``transforms.json`` with the poses of the views; written to the file ``path`` as well, if given.

        Example:
            >>> len(json.loads(calibration.to_nerfstudio())["frames"])
            12
        """
        return self._one("nerfstudio", path)

    def to_colmap(self, folder: str | os.PathLike[str] | None = None) -> dict[str, str]:
        """Names and texts of COLMAP's files, the poses of the views in them; written into ``folder`` as well, if given.

        COLMAP counts pixels from the corner: half a pixel is added to the principal point.

        Example:
            >>> sorted(calibration.to_colmap())
            ['cameras.txt', 'images.txt', 'points3D.txt']
        """
        files = self._rendered("colmap")
        if folder is not None:
            Path(folder).mkdir(parents=True, exist_ok=True)
            for name, text in files.items():
                (Path(folder) / name).write_text(text, encoding="utf-8")
        return files

    # Files.

    def save(
        self,
        folder: str | os.PathLike[str],
        *,
        formats: list[str] | None = None,
        report: bool = True,
        overwrite: bool = False,
    ) -> list[Path]:
        """Writes ``calibration.json``, ``report.html`` and the camera in the formats of other programs into a folder.

        All files appear together or none. What an earlier run wrote there is replaced; files that no run wrote, or that were changed
        since, are not, unless ``overwrite=True``. Images that the calibration was made from are never replaced.

        Args:
            folder: It is made if need be.
            formats: Some of ``"opencv"``, ``"ros"``, ``"kalibr"``, ``"colmap"``, ``"nerfstudio"``, ``"matlab"``; all by default.
            report: Whether the page is written.
            overwrite: Whether other files are replaced.

        Returns:
            The paths of the files.

        Example:
            >>> [p.name for p in calibration.save(folder, formats=["ros"])]
            ['calibration.json', 'report.html', 'camera_info.yaml']
        """
        paths, notes = self._handle.save(folder, formats, report, overwrite)
        say(notes)
        return [Path(p) for p in paths]

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Calibration:
        """As :func:`groundcal.load`.

        Example:
            >>> paths = calibration.save(folder)
            >>> groundcal.Calibration.load(folder) == calibration
            True
        """
        handle, notes = _groundcal.load(path)
        say(notes)
        return cls(handle)

    def report(self, path: str | os.PathLike[str] | None = None) -> str:
        """The page that shows the calibration, as HTML with everything inside; written to the file ``path`` as well, if given.

        Example:
            >>> page = calibration.report(folder / "report.html")
            >>> page[:15]
            '<!doctype html>'
        """
        page = self._handle.page()
        if path is not None:
            Path(path).write_text(page, encoding="utf-8")
        return page

    def summary(self, *, verbose: bool = False, width: int = _groundcal.WIDTH) -> str:
        """The page of text that the program prints. ``verbose``: every pair and every view; ``width``: columns.

        Example:
            >>> "Motions used:   6 of 66 pairs" in calibration.summary()
            True
        """
        return self._handle.summary(verbose, width)

    def with_camera_height(self, height_m: float) -> Calibration:
        """The same with lengths in metres: the camera of each world's origin is ``height_m`` over the floor.

        Example:
            >>> round(float(calibration.with_camera_height(1.5).views[0].position[2]), 2)
            1.5
        """
        return Calibration(self._handle.with_camera_height(height_m))

    # What Python asks.

    def __repr__(self) -> str:
        (width, height), sigma = self.image_size, self.standard_deviation
        used = sum(m.used for m in self.motions)

        def number(name: str) -> str:
            c = self._data["camera"]
            value = c[name] if name in c else c["distortion"].get(name, 0.0)
            if name not in sigma:
                return f"{name} {value:.6g}"
            # Two digits of the deviation.
            s = sigma[name]
            digits = min(max(1 - int(np.floor(np.log10(s))), 0), 9) if s > 0 else 3
            return f"{name} {value:.{digits}f} \N{PLUS-MINUS SIGN} {s:.{digits}f}"

        lines = [f"groundcal.Calibration: {width} x {height} px"]
        if self.motions:
            rms = "" if self.rms_px is None else f", rms {self.rms_px:.3f} px"
            lines[0] += f", {used} motions of {len(self.motions)} pairs{rms}"
        lines.append("  K     " + "   ".join(number(n) for n in ("fx", "fy", "cx", "cy")))
        if "skew" in sigma or self.K[0, 1] != 0.0:
            lines.append("        " + number("skew"))
        lens = self._data["camera"]["distortion"]
        if self.lens_model != "none":
            names = [n for n in lens if n not in ("model", "source") and (n in sigma or lens[n] != 0.0)]
            shown = "   ".join(number(n) for n in names)
            lines.append(f"  lens  {self.lens_model}, {lens['source']}: {shown}")
        else:
            source = {"estimated": "none found", "not modelled": "not modelled", "given": "none"}
            lines.append(f"  lens  {source.get(lens['source'], lens['source'])}")
        if self.verdict is not None:
            lines.append(f"  verdict {self.verdict.level}")
        lines.extend(f"  warning [{w.code}]" for w in self.warnings)
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        # A frame of its own: the page has a style and a script.
        page = html.escape(self.report(), quote=True)
        return (
            f'<iframe srcdoc="{page}" title="groundcal calibration" sandbox="allow-scripts" '
            'style="width: 100%; height: 800px; border: 1px solid #ccc"></iframe>'
        )

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Calibration):
            return NotImplemented
        return self._handle.equals(other._handle)

    def __hash__(self) -> int:
        c = self._data["camera"]
        return hash((c["fx"], c["fy"], c["cx"], c["cy"]))

    def __reduce__(self) -> tuple[Any, tuple[str]]:
        return _from_json, (self._handle.json(),)


def _from_json(text: str) -> Calibration:
    return Calibration(_groundcal.from_json(text))


def load(path: str | os.PathLike[str]) -> Calibration:
    """Reads a calibration, or a camera of another program.

    Args:
        path: ``calibration.json`` or the folder it is in; or a camera file of OpenCV (YAML, XML), ROS, Kalibr, COLMAP or nerfstudio: the
            content tells the format. ``"FILE#NAME"`` names one camera of several. Of a camera alone there are no motions and no views.

    Raises:
        InputError: for a file that is none of these; it says what is wrong with it.

    Example:
        >>> truth = groundcal.load("examples/tripod/truth.json")
        >>> float(truth.K[0, 0])
        705.0
    """
    return Calibration.load(path)
