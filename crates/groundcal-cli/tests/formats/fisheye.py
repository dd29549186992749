"""Compares what groundcal makes of fisheye cameras with cv2.fisheye, and prints a number for each comparison, a line each.

Usage: fisheye.py FOLDER    (FOLDER: converted/camera_opencv.yaml of camera A, other.yaml of camera B as cv2.fisheye has it, written
here when it is missing; undistorted/ with camera_undistorted.json and maps; comparison.json of A and B)
"""

import json
import sys
from pathlib import Path

import cv2
import numpy as np

folder = Path(sys.argv[1])
SIZE = (1000, 1000)


def read(path):
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    assert int(storage.getNode("fisheye_model").real()) == 1
    assert int(storage.getNode("image_width").real()) == SIZE[0]
    return storage.getNode("camera_matrix").mat(), storage.getNode("distortion_coefficients").mat().ravel()


K, D = read(folder / "converted/camera_opencv.yaml")
if not (folder / "other.yaml").exists():
    # As OpenCV's calibration program writes a fisheye camera.
    storage = cv2.FileStorage(str(folder / "other.yaml"), cv2.FILE_STORAGE_WRITE)
    storage.write("image_width", SIZE[0])
    storage.write("image_height", SIZE[1])
    storage.write("fisheye_model", 1)
    storage.write("camera_matrix", K + np.array([[1.25, 0, 2.5], [0, 0.75, -1.5], [0, 0, 0]]))
    storage.write("distortion_coefficients", (D + np.array([0.002, 0, -1e-4, 0])).reshape(4, 1))
    storage.release()
    sys.exit()
KB, DB = read(folder / "other.yaml")

ZERO = np.zeros(3)


def project(rays, matrix, lens):
    pixels, _ = cv2.fisheye.projectPoints(rays.reshape(-1, 1, 3), ZERO, ZERO, matrix, lens)
    return pixels.reshape(-1, 2)


def project_anywhere(rays, matrix, lens):
    """As cv2.fisheye, on rays that may lie behind the camera."""
    rho = np.hypot(rays[:, 0], rays[:, 1])
    theta = np.arctan2(rho, rays[:, 2])
    theta_d = theta * (1 + sum(k * theta ** (2 * i + 2) for i, k in enumerate(lens)))
    scale = np.divide(theta_d, rho, out=np.ones_like(rho), where=rho > 0)
    d = rays[:, :2] * scale[:, None]
    return np.stack([matrix[0, 0] * d[:, 0] + matrix[0, 2], matrix[1, 1] * d[:, 1] + matrix[1, 2]], axis=1)


# Undistortion: single precision maps against cv2's, and against the rounding of its double precision.
new = json.loads((folder / "undistorted/camera_undistorted.json").read_text())["camera"]
new = np.array([[new["fx"], new["skew"], new["cx"]], [0, new["fy"], new["cy"]], [0, 0, 1]])
ours = np.stack([cv2.imread(str(folder / f"undistorted/map_{c}.tiff"), cv2.IMREAD_UNCHANGED) for c in "xy"], axis=-1)
theirs = np.stack(cv2.fisheye.initUndistortRectifyMap(K, D, np.eye(3), new, SIZE, cv2.CV_32FC1), axis=-1)
print("maps_px", np.abs(ours.astype(float) - theirs).max())
x, y = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
rays = np.stack([x, y, np.ones_like(x)], axis=-1).reshape(-1, 3) @ np.linalg.inv(new).T
exact = project(rays, K, D).reshape(ours.shape)
print("rounded_otherwise", np.mean(ours != exact.astype(np.float32)))
print("maps_from_exact_px", np.abs(ours - exact).max())

# Comparison over the grid: cv2.fisheye where it goes, in front of the camera; beyond, the same polynomial.
side = np.linspace(0, 999, 49)
pixels = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
edge = lambda v: np.where((v == 0) | (v == 999), 0.5, 1.0)
weights = edge(pixels[:, 0]) * edge(pixels[:, 1])
d = (pixels - [K[0, 2], K[1, 2]]) / [K[0, 0], K[1, 1]]
theta_d = np.hypot(d[:, 0], d[:, 1])
theta = theta_d.copy()
for _ in range(50):
    value = theta * (1 + sum(k * theta ** (2 * i + 2) for i, k in enumerate(D)))
    slope = 1 + sum((2 * i + 3) * k * theta ** (2 * i + 2) for i, k in enumerate(D))
    theta -= (value - theta_d) / slope
outward = np.divide(d, theta_d[:, None], out=np.zeros_like(d), where=theta_d[:, None] > 0)
rays = np.concatenate([outward * np.sin(theta)[:, None], np.cos(theta)[:, None]], axis=1)
front = theta < np.radians(89)
print("behind", np.mean(theta > np.pi / 2))
undone = cv2.fisheye.undistortPoints(pixels[front].reshape(-1, 1, 2), K, D, None, None, None, (3, 200, 1e-15)).reshape(-1, 2)
seen = project(np.concatenate([undone, np.ones((len(undone), 1))], axis=1), KB, DB)
comparison = json.loads((folder / "comparison.json").read_text())["comparisons"][0]["reprojection"]
for name, rotation in [("without_rotation_", np.eye(3)), ("", np.array(comparison["rotation"]))]:
    difference = project_anywhere(rays @ rotation.T, KB, DB) - pixels
    if not name:
        rest = project(rays[front] @ rotation.T, KB, DB)
    else:
        rest = seen
    print(f"{name}front_px", np.abs(difference[front] - (rest - pixels[front])).max())
    difference[front] = rest - pixels[front]
    length = np.hypot(difference[:, 0], difference[:, 1])
    key = "without_rotation_px" if name else "px"
    print(f"{name}max_px", abs(comparison[f"max_{key}"] - length.max()))
    print(f"{name}rms_px", abs(comparison[f"rms_{key}"] - np.sqrt(np.sum(weights * length**2) / weights.sum())))
