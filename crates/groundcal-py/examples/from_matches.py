"""A camera from matches of any matcher, here of a made-up scene: python from_matches.py"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

import groundcal

Points = npt.NDArray[np.float64]
K = np.array([[700.0, 0.0, 320.0], [0.0, 700.0, 240.0], [0.0, 0.0, 1.0]])


def look(pitch_deg: float, roll_deg: float, yaw_deg: float, place: tuple[float, float], floor: Points) -> Points:
    """Pixels of points of the floor from a camera at height 1."""
    p, r, y = np.radians([pitch_deg, roll_deg, yaw_deg])
    pitched = np.array([[0, -1, 0], [-np.sin(p), 0, -np.cos(p)], [np.cos(p), 0, -np.sin(p)]])
    rolled = np.array([[np.cos(r), np.sin(r), 0], [-np.sin(r), np.cos(r), 0], [0, 0, 1]])
    yawed = np.array([[np.cos(y), np.sin(y), 0], [-np.sin(y), np.cos(y), 0], [0, 0, 1]])
    rays = (np.column_stack([floor, np.zeros(len(floor))]) - [*place, 1.0]) @ (K @ rolled @ pitched @ yawed).T
    pixels: Points = rays[:, :2] / rays[:, 2:]
    return pixels


def main() -> None:
    random = np.random.default_rng(0)
    pairs: dict[tuple[str, str], tuple[Points, Points]] = {}
    for i, (pitch, roll) in enumerate([(45.0, 0.0), (50.0, -25.0), (55.0, 25.0)]):
        floor = np.array([1.0, 0.0]) + random.uniform(-0.3, 0.3, (200, 2))
        first = look(pitch, roll, 0.0, (0.0, 0.0), floor)
        second = look(pitch, roll, 15.0, (0.1, -0.15), floor)
        pairs[f"{i}a", f"{i}b"] = tuple(p + random.normal(0, 0.2, p.shape) for p in (first, second))  # type: ignore[assignment]
    calibration = groundcal.calibrate(pairs, image_size=(640, 480))
    print(calibration)
    for warning in calibration.warnings:
        print(f"{warning.code}: {warning.message}")
    for view in calibration.views:
        print(view.image, view.position)


if __name__ == "__main__":
    main()
