"""A camera from pictures that OpenCV reads, and a picture without its lens: python from_opencv.py PICTURES"""

from __future__ import annotations

import sys
from pathlib import Path

import cv2

import groundcal


def main(folder: str) -> None:
    files = sorted(Path(folder).glob("*.jpg"))
    pictures = []
    for file in files:
        picture = cv2.imread(str(file))
        if picture is None:
            sys.exit(f"{file} cannot be read")
        pictures.append(picture)
    try:
        calibration = groundcal.calibrate(pictures, names=[file.name for file in files], bgr=True, progress=True)  # blue first
    except groundcal.DegenerateError as error:
        print(error, *error.remedies, sep="\n- ")
        return
    print(calibration)
    K, dist, fisheye = calibration.to_opencv()
    if not fisheye:
        cv2.undistort(pictures[0], K, dist)
    sigma = calibration.standard_deviation["fx"]
    print(f"fx = {K[0, 0]:.2f} +- {1.96 * sigma:.2f} px (95 %)")


if __name__ == "__main__":
    main(sys.argv[1])
