"""Reads a folder of `groundcal calibrate --out` with OpenCV, PyYAML, pycolmap and numpy, projects floor points with what each format
says, and prints the largest distance from the pixels the Rust side expects, a line for each format.

Usage: read_back.py FOLDER EXPECTED.json    (EXPECTED: [{"image", "point": [x, y, z], "pixel": [u, v]}, ...])
"""

import csv
import json
import sys
from pathlib import Path

import cv2
import numpy as np
import pycolmap
import yaml

folder = Path(sys.argv[1])
expected = json.loads(Path(sys.argv[2]).read_text())
assert expected
truth = np.array([e["pixel"] for e in expected])
model = pycolmap.Reconstruction(str(folder))
(camera,) = model.cameras.values()
pose_of = {image.name: image.cam_from_world() for image in model.images.values()}
in_camera = np.array([pose_of[e["image"]] * np.array(e["point"]) for e in expected])


def report(name, pixels):
    print(f"{name} {np.abs(np.asarray(pixels) - truth).max():.3e}")


def project(matrix, lens):
    """Pixels of OpenCV."""
    pixels, _ = cv2.projectPoints(in_camera.reshape(-1, 1, 3), np.zeros(3), np.zeros(3), matrix, np.asarray(lens, dtype=float))
    return pixels.reshape(-1, 2)


# COLMAP counts from the corner: half a pixel more.
report("colmap", np.array([camera.img_from_cam(p) for p in in_camera]).reshape(-1, 2) - 0.5)
assert (camera.width, camera.height) == tuple(json.loads((folder / "calibration.json").read_text())["camera"]["image_size"])

storage = cv2.FileStorage(str(folder / "camera_opencv.yaml"), cv2.FILE_STORAGE_READ)
assert int(storage.getNode("image_width").real()) == camera.width
report("opencv", project(storage.getNode("camera_matrix").mat(), storage.getNode("distortion_coefficients").mat()))

# The fields that ROS's camera_calibration_parsers asks for.
ros = yaml.safe_load((folder / "camera_info.yaml").read_text())
assert ros["image_width"] == camera.width and ros["image_height"] == camera.height
assert isinstance(ros["camera_name"], str) and ros["distortion_model"] == "plumb_bob"
shapes = {"camera_matrix": (3, 3), "distortion_coefficients": (1, 5), "rectification_matrix": (3, 3), "projection_matrix": (3, 4)}
matrices = {}
for name, shape in shapes.items():
    entry = ros[name]
    assert (entry["rows"], entry["cols"]) == shape, name
    assert all(isinstance(v, float) for v in entry["data"]), (name, entry["data"])
    matrices[name] = np.array(entry["data"]).reshape(shape)
assert (matrices["rectification_matrix"] == np.eye(3)).all()
assert (matrices["projection_matrix"] == np.hstack([matrices["camera_matrix"], np.zeros((3, 1))])).all()
report("ros", project(matrices["camera_matrix"], matrices["distortion_coefficients"]))

kalibr = yaml.safe_load((folder / "camchain.yaml").read_text())["cam0"]
assert (kalibr["camera_model"], kalibr["distortion_model"]) == ("pinhole", "radtan")
assert kalibr["resolution"] == [camera.width, camera.height] and kalibr["cam_overlaps"] == [] and kalibr["rostopic"]
assert all(isinstance(v, float) for v in kalibr["intrinsics"] + kalibr["distortion_coeffs"])
fx, fy, cx, cy = kalibr["intrinsics"]
report("kalibr", project(np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]), kalibr["distortion_coeffs"]))

# OpenGL axes: y up, looking along -z; pixels from the corner.
nerf = json.loads((folder / "transforms.json").read_text())
assert nerf["camera_model"] == "OPENCV" and (nerf["w"], nerf["h"]) == (camera.width, camera.height)
to_world = {f["file_path"]: np.array(f["transform_matrix"]) for f in nerf["frames"]}
seen = np.array([np.linalg.inv(to_world[e["image"]]) @ np.array(e["point"] + [1.0]) for e in expected])
assert (seen[:, 2] < 0).all()
in_camera_nerf = seen[:, :3] * [1, -1, -1]
matrix = np.array([[nerf["fl_x"], 0, nerf["cx"]], [0, nerf["fl_y"], nerf["cy"]], [0, 0, 1]])
pixels, _ = cv2.projectPoints(in_camera_nerf.reshape(-1, 1, 3), np.zeros(3), np.zeros(3), matrix, np.array([nerf[k] for k in ("k1", "k2", "p1", "p2")]))
report("nerfstudio", pixels.reshape(-1, 2) - 0.5)

# MATLAB: the centre of the top-left pixel is (1, 1).
with open(folder / "camera_matlab.csv", newline="") as f:
    rows = {row["parameter"]: float(row["value"]) for row in csv.DictReader(f)}
assert (rows["ImageSize_rows"], rows["ImageSize_columns"]) == (camera.height, camera.width)
matrix = np.array([[rows["FocalLength_x"], rows["Skew"], rows["PrincipalPoint_x"]], [0, rows["FocalLength_y"], rows["PrincipalPoint_y"]], [0, 0, 1]])
lens = [rows[k] for k in ("RadialDistortion_1", "RadialDistortion_2", "TangentialDistortion_1", "TangentialDistortion_2")]
report("matlab", project(matrix, lens) - 1.0)
