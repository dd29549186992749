"""What a calibration is: its numbers, files, pickles, and other programs' forms."""

from __future__ import annotations

import copy
import json
import os
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import scene

import groundcal


def test_same_digits_as_the_program(examples: Path, tripod: groundcal.Calibration) -> None:
    # The program itself where there is one (CI), else as a module: the same code.
    given = os.environ.get("GROUNDCAL_PROGRAM")
    program = [str(Path(given).resolve())] if given else [sys.executable, "-m", "groundcal"]
    run = subprocess.run([*program, "calibrate", "tripod", "--json"], cwd=examples, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    program_says, wheel_says = json.loads(run.stdout), tripod.to_dict()
    # The words of warnings are those of their front end.
    for said in (program_says, wheel_says):
        for warning in said["warnings"]:
            del warning["message"]
    assert program_says == wheel_says


def test_the_program_has_its_exit_codes(tmp_path: Path) -> None:
    def code(*args: str) -> int:
        return subprocess.run([sys.executable, "-m", "groundcal", *args], cwd=tmp_path, capture_output=True).returncode

    assert [code("--version"), code("calibrate"), code("calibrate", "nowhere")] == [0, 2, 4]


def test_numbers(tripod: groundcal.Calibration) -> None:
    K = tripod.K
    assert K.shape == (3, 3) and K[1, 0] == 0 and K[2].tolist() == [0, 0, 1] and K.dtype == np.float64
    assert tripod.dist.shape == (5,)
    with pytest.raises(ValueError):
        K[0, 0] = 1
    sigma, C = tripod.standard_deviation, tripod.covariance
    assert C.matrix.shape == (len(C.names), len(C.names)) and np.allclose(C.matrix, C.matrix.T, rtol=1e-9)
    for name, value in sigma.items():
        assert np.sqrt(C[name, name]) == pytest.approx(value)
    assert np.array_equal(np.asarray(C), C.matrix)
    assert C.of("cy", "fx")[0, 1] == C["cy", "fx"]
    with pytest.raises(KeyError, match='Did you mean "fx"'):
        C["fz", "fx"]
    assert tripod.rms_px is not None and 0.005 < tripod.rms_px < 0.2


def test_views_are_poses(tripod: groundcal.Calibration, examples: Path) -> None:
    truth = json.loads((examples / "tripod" / "truth.json").read_text())
    assert len(tripod.views) == 12
    for view in tripod.views:
        assert np.allclose(view.R @ view.R.T, np.eye(3)) and np.linalg.det(view.R) == pytest.approx(1)
        assert view.position is not None and view.t is not None and view.floor_from_pixel is not None
        assert np.allclose(view.t, -view.R @ view.position)
        # The point of the floor 2 units ahead goes to a pixel and back.
        X = np.array([view.position[0] + 1.0, view.position[1], 0.0])
        q = tripod.K @ (view.R @ X + view.t)
        back = view.floor_from_pixel @ (q / q[2])
        assert np.allclose(back[:2] / back[2], X[:2], atol=1e-9)
    assert truth["fx"] == 705.0


def test_saved_loaded_pickled_copied_it_is_equal(tmp_path: Path, tripod: groundcal.Calibration) -> None:
    paths = tripod.save(tmp_path / "out")
    names = [p.name for p in paths]
    assert names[:2] == ["calibration.json", "report.html"] and "camera_info.yaml" in names
    assert all(p.stat().st_size > 0 for p in paths)
    for path in (tmp_path / "out", paths[0]):
        loaded = groundcal.load(path)
        assert loaded == tripod and loaded is not tripod and hash(loaded) == hash(tripod)
        assert loaded.rms_px == tripod.rms_px and np.array_equal(loaded.K, tripod.K)
        assert repr(loaded) == repr(tripod)
    assert groundcal.Calibration.load(tmp_path / "out") == tripod
    assert pickle.loads(pickle.dumps(tripod)) == tripod == copy.deepcopy(tripod)
    assert tripod != groundcal.load(paths[names.index("camera_info.yaml")]) and tripod != 3
    # A later save takes the place of the earlier; a file of somebody else's is not touched.
    assert [p.name for p in tripod.save(tmp_path / "out", formats=["ros"], report=False)] == [
        "calibration.json",
        "camera_info.yaml",
    ]
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "report.html").write_text("mine")
    with pytest.raises(groundcal.InputError, match="overwrite=True"):
        tripod.save(tmp_path / "mine")
    assert (tmp_path / "mine" / "report.html").read_text() == "mine"
    tripod.save(tmp_path / "mine", overwrite=True)
    with pytest.raises(groundcal.InputError, match='Did you mean "colmap"'):
        tripod.save(tmp_path / "other", formats=["colmaps"])


def test_other_programs_files_come_back(tmp_path: Path, tripod: groundcal.Calibration) -> None:
    tripod.to_ros(tmp_path / "ros.yaml")
    tripod.to_kalibr(tmp_path / "kalibr.yaml")
    text = tripod.to_nerfstudio(tmp_path / "transforms.json")
    assert len(json.loads(text)["frames"]) == 12
    files = tripod.to_colmap(tmp_path / "colmap")
    assert (tmp_path / "colmap" / "cameras.txt").read_text() == files["cameras.txt"]
    for name in ("ros.yaml", "kalibr.yaml", "transforms.json", "colmap/cameras.txt"):
        read = groundcal.load(tmp_path / name)
        assert np.allclose(read.K, tripod.K, atol=1e-6) and np.allclose(read.dist, tripod.dist, atol=1e-9), name
        assert read.image_size == tripod.image_size and read.motions == [] and read.rms_px is None
        assert repr(read).startswith("groundcal.Calibration: 800 x 600 px\n")


def camera(tmp_path: Path, **distortion: object) -> groundcal.Calibration:
    fields = {"image_size": [640, 480], "fx": 400.0, "fy": 400.0, "cx": 319.5, "cy": 239.5}
    skew = distortion.pop("skew", 0.0)
    data = {"format_version": 1, "camera": {**fields, "skew": skew, "distortion": distortion}}
    (tmp_path / "camera.json").write_text(json.dumps(data))
    return groundcal.load(tmp_path / "camera.json")


def test_opencv_gets_what_it_has(tmp_path: Path) -> None:
    K, dist, fisheye = camera(tmp_path, model="radtan", k1=-0.1, k2=0.02, p1=1e-3, p2=-1e-3, k3=0.01).to_opencv()
    assert (dist.tolist(), fisheye, K[0, 0]) == ([-0.1, 0.02, 1e-3, -1e-3, 0.01], False, 400.0)
    _, dist, fisheye = camera(tmp_path, model="fisheye", k1=0.1, k2=0.02, k3=0.03, k4=0.04).to_opencv()
    assert (dist.tolist(), fisheye) == ([0.1, 0.02, 0.03, 0.04], True)
    assert camera(tmp_path, model="none").to_opencv().dist.tolist() == [0.0] * 5
    division = camera(tmp_path, model="division", **{"lambda": -0.1})
    skewed = camera(tmp_path, model="none", skew=2.5)
    for refused, word in ((division, "division"), (skewed, "skew of 2.500 px")):
        with pytest.raises(groundcal.InputError, match=word):
            refused.to_opencv()
    for form in (division.to_ros, division.to_kalibr, division.to_colmap, division.to_nerfstudio):
        with pytest.raises(groundcal.InputError, match="division"):
            form()
    with pytest.warns(groundcal.GroundcalWarning, match="skew of 2.500 px is left out"):
        skewed.to_kalibr()


def test_it_shows_itself(tripod: groundcal.Calibration, tmp_path: Path) -> None:
    lines = repr(tripod).splitlines()
    assert 3 <= len(lines) <= 6 and lines[0].startswith("groundcal.Calibration: 800 x 600 px, 6 motions of 66 pairs")
    assert "fx 70" in lines[1] and "\N{PLUS-MINUS SIGN}" in lines[1]
    page = tripod.report(tmp_path / "page.html")
    assert page == (tmp_path / "page.html").read_text(encoding="utf-8") and "data:image/jpeg" in page
    shown = tripod._repr_html_()
    assert shown.startswith("<iframe srcdoc=") and "&lt;!doctype html&gt;" in shown
    assert "Motions used:   6 of 66 pairs" in tripod.summary()
    assert len(tripod.summary(verbose=True)) > len(tripod.summary())
    with pytest.raises(TypeError, match="made by groundcal.calibrate"):
        groundcal.Calibration(3)


def test_a_calibration_of_matches_has_a_page_too() -> None:
    calibration = groundcal.calibrate(scene.matches(), image_size=scene.SIZE)
    assert calibration.report().startswith("<!doctype html>")
    metres = calibration.with_camera_height(2.0)
    assert metres != calibration and np.array_equal(metres.K, calibration.K)
    with pytest.raises(groundcal.InputError, match="camera height"):
        calibration.with_camera_height(-1)
