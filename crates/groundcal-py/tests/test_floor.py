"""Pictures without their lens, and the floor from above."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scene
from test_calibration import camera

import groundcal


def test_undistorted_arrays_and_files_are_one(tripod: groundcal.Calibration, examples: Path, tmp_path: Path) -> None:
    lens = camera(tmp_path, model="radtan", k1=-0.2, k2=0.03)
    image = np.random.default_rng(0).integers(0, 256, (480, 640, 3), dtype=np.uint8)
    scene.write_png(tmp_path / "image.png", image)
    straight, of_file = groundcal.undistort(lens, image), groundcal.undistort(lens, tmp_path / "image.png")
    assert straight.image.shape == image.shape and straight.image.dtype == np.uint8
    assert np.array_equal(straight.image, of_file.image) and np.array_equal(straight.mask, of_file.mask)
    assert np.allclose(straight.K, lens.K)
    assert groundcal.undistort(lens, image, fit="crop").mask.min() > 127
    wide = groundcal.undistort(lens, image, fov_deg=100)
    assert wide.K[0, 0] == pytest.approx(320 / np.tan(np.radians(50)), rel=1e-2)
    for dtype in (np.uint16, np.float32):
        assert groundcal.undistort(lens, image[..., 0].astype(dtype)).image.dtype == dtype


def test_maps_are_those_of_the_picture(tmp_path: Path) -> None:
    lens = camera(tmp_path, model="radtan", k1=-0.2)
    x, y, K = groundcal.undistort_maps(lens)
    assert x.shape == y.shape == (480, 640) and x.dtype == np.float32 and np.allclose(K, lens.K)
    # Brown-Conrady at one pixel.
    u, v = (600 - 319.5) / 400, (40 - 239.5) / 400
    factor = 1 - 0.2 * (u * u + v * v)
    assert x[40, 600] == pytest.approx(400 * u * factor + 319.5, abs=1e-3)
    assert y[40, 600] == pytest.approx(400 * v * factor + 239.5, abs=1e-3)
    fisheye = camera(tmp_path, model="fisheye", k1=0.01)
    assert groundcal.undistort_maps(fisheye, fov_deg=90)[0].shape == (480, 640)


def test_what_cannot_be_undistorted(tmp_path: Path) -> None:
    lens = camera(tmp_path, model="radtan", k1=-0.2)
    with pytest.raises(groundcal.InputError, match="64 x 48 pixels, the calibration is of 640 x 480"):
        groundcal.undistort(lens, np.zeros((48, 64), np.uint8))
    with pytest.raises(groundcal.InputError, match="turned"):
        groundcal.undistort(lens, np.zeros((640, 480), np.uint8))
    with pytest.raises(groundcal.InputError, match='Did you mean "crop"'):
        groundcal.undistort(lens, np.zeros((480, 640), np.uint8), fit="crp")  # type: ignore[arg-type]
    with pytest.raises(groundcal.InputError, match="1 to 175"):
        groundcal.undistort_maps(lens, fov_deg=190)
    with pytest.raises(TypeError, match="expected a Calibration"):
        groundcal.undistort("camera.yaml", np.zeros((480, 640), np.uint8))  # type: ignore[arg-type]


def test_the_floor_is_as_it_is(made: groundcal.Calibration, pictures: list[scene.Array]) -> None:
    images = dict(zip(scene.names(), pictures))
    views = groundcal.rectify(made, images, resolution=64, extent=2)
    assert [v.views for v in views] == [(name,) for name in scene.names()]
    (all_of_it,) = groundcal.rectify(made, images, mosaic=True, resolution=64, extent=2)
    assert all_of_it.unit == "camera height" and set(all_of_it.views) == set(scene.names())
    assert all_of_it.image.shape == all_of_it.mask.shape and all_of_it.unit_per_px == 1 / 64
    # The world of the first view is the scene's own: its floor must show there.
    assert made.views[0].origin == "0a"
    rows, columns = np.nonzero(all_of_it.mask == 255)
    q = np.stack([columns, rows, np.ones_like(rows)], axis=-1) @ all_of_it.floor_from_pixel.T
    place = ((q[:, 1::-1] / q[:, 2:]) * 256 + 1024).astype(np.int64) % 2048
    blurred = scene._TEXTURE
    for axis in (0, 1):
        blurred = np.mean([np.roll(blurred, s, axis) for s in range(-2, 3)], axis=0)
    truth = blurred[place[:, 0], place[:, 1]]
    seen = all_of_it.image[rows, columns]
    assert np.corrcoef(truth, seen)[0, 1] > 0.9
    metres = groundcal.rectify(made, images, camera_height_m=1.5, resolution=32, extent=3)
    assert metres[0].unit == "m"


def test_files_are_found_by_name(tripod: groundcal.Calibration, examples: Path) -> None:
    (floor,) = groundcal.rectify(tripod, [examples / "tripod" / "00a.jpg"], resolution=50, extent=2)
    assert floor.views == ("00a.jpg",) and floor.image.ndim == 3 and floor.mask.max() == 255


def test_what_cannot_be_rectified(made: groundcal.Calibration, pictures: list[scene.Array], tmp_path: Path) -> None:
    images = dict(zip(scene.names(), pictures))
    with pytest.raises(groundcal.InputError, match="no image given is a view"):
        groundcal.rectify(made, {"x": pictures[0]})
    with pytest.warns(groundcal.GroundcalWarning, match="left out"):
        groundcal.rectify(made, {"x": pictures[0], "0a": pictures[0]}, resolution=20, extent=1)
    with pytest.raises(groundcal.InputError, match="different dtypes"):
        groundcal.rectify(made, {"0a": pictures[0], "0b": pictures[1].astype(np.uint16)}, mosaic=True)
    with pytest.raises(groundcal.InputError, match="megapixels"):
        groundcal.rectify(made, images, resolution=1e6)
    with pytest.raises(groundcal.InputError, match="resolution=-1"):
        groundcal.rectify(made, images, resolution=-1)
    with pytest.raises(groundcal.InputError, match="320 x 240"):
        groundcal.rectify(made, {"0a": pictures[0][:100]})
    with pytest.raises(groundcal.InputError, match="no images in the folder"):
        groundcal.rectify(made, tmp_path)
    with pytest.raises(groundcal.InputError, match="neither views nor attitudes"):
        groundcal.rectify(camera(tmp_path, model="none"), {"0a": np.zeros((480, 640), np.uint8)})
    linear = groundcal.calibrate(scene.matches(), image_size=scene.SIZE, method="linear")
    with pytest.raises(groundcal.InputError, match='method="joint"'):
        groundcal.rectify(linear, images, mosaic=True)
