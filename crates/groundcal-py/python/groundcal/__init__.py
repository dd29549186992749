"""Calibrate a camera from the floor it looks at: no checkerboard, no target.

Take a few pictures while the camera turns about an axis normal to a floor (a tripod, a pan head, a robot), and get the camera matrix
with an error bar on every number.

    >>> import groundcal
    >>> calibration = groundcal.calibrate("examples/tripod")
    >>> K, dist = calibration.K, calibration.dist  # ready for cv2.undistort(image, K, dist)

Everything counts pixels as OpenCV does: (0, 0) is the centre of the top-left pixel.
"""

from __future__ import annotations

from ._calibrate import calibrate
from ._calibration import Calibration, CalibrationWarning, Covariance, Motion, OpenCV, Verdict, View, load
from ._errors import DegenerateError, GroundcalWarning, InputError
from ._floor import FloorPicture, Undistorted, rectify, undistort, undistort_maps
from ._groundcal import VERSION as __version__
from ._tools import Comparison, Difference, Plan, PlannedMotion, Study, compare, plan, simulate

__all__ = [
    "Calibration",
    "CalibrationWarning",
    "Comparison",
    "Covariance",
    "DegenerateError",
    "Difference",
    "FloorPicture",
    "GroundcalWarning",
    "InputError",
    "Motion",
    "OpenCV",
    "Plan",
    "PlannedMotion",
    "Study",
    "Undistorted",
    "Verdict",
    "View",
    "__version__",
    "calibrate",
    "compare",
    "load",
    "plan",
    "rectify",
    "simulate",
    "undistort",
    "undistort_maps",
]
