"""Every kind of input, against the truth and against each other."""

from __future__ import annotations

import pickle
import warnings
from pathlib import Path

import numpy as np
import pytest
import scene

import groundcal

SIZE = scene.SIZE


def assert_true(calibration: groundcal.Calibration, deviations: float = 5.0) -> None:
    """Every intrinsic is as far from the truth as its error bar allows."""
    truth = {"fx": 300.0, "fy": 300.0, "cx": 161.0, "cy": 118.0}
    for name, value in truth.items():
        found = calibration.to_dict()["camera"][name]
        sigma = calibration.standard_deviation[name]
        assert 0 < sigma < 10, (name, sigma)
        assert abs(found - value) < deviations * sigma, (name, found, sigma)


def same_numbers(a: groundcal.Calibration, b: groundcal.Calibration) -> bool:
    return a.to_dict()["camera"] == b.to_dict()["camera"] and np.array_equal(a.covariance.matrix, b.covariance.matrix)


def test_a_folder(tripod: groundcal.Calibration) -> None:
    assert tripod.image_size == (800, 600)
    assert abs(tripod.K[0, 0] - 705) < 5 * tripod.standard_deviation["fx"]
    assert sum(m.used for m in tripod.motions) == 6
    assert len(tripod.views) == 12 and tripod.views[0].image == "00a.jpg"


def test_folder_paths_patterns_and_arrays_are_one(
    tmp_path: Path, pictures: list[scene.Array], made: groundcal.Calibration
) -> None:
    assert_true(made)
    for name, image in zip(scene.names(), pictures):
        scene.write_png(tmp_path / f"{name}.png", image)
    folder = groundcal.calibrate(tmp_path)
    assert same_numbers(folder, made)
    assert [v.image for v in folder.views] == [f"{n}.png" for n in scene.names()]
    assert groundcal.calibrate([*sorted(tmp_path.glob("*.png"))]) == folder
    assert groundcal.calibrate(str(tmp_path / "*.png")) == folder


def test_colour_has_red_first_unless_told(tmp_path: Path, pictures: list[scene.Array]) -> None:
    rgb = [scene.colour(p) for p in pictures]
    for name, image in zip(scene.names(), rgb):
        scene.write_png(tmp_path / f"{name}.png", image)
    of_files, of_arrays = groundcal.calibrate(tmp_path), groundcal.calibrate(rgb)
    assert same_numbers(of_files, of_arrays)
    # What cv2.imread gives is a view of the other order here, and a copy of it there.
    assert same_numbers(groundcal.calibrate([image[..., ::-1] for image in rgb], bgr=True), of_arrays)
    assert same_numbers(groundcal.calibrate([image[..., ::-1].copy() for image in rgb], bgr=True), of_arrays)
    assert not same_numbers(groundcal.calibrate(rgb, bgr=True), of_arrays)


def test_depths(tmp_path: Path, pictures: list[scene.Array], made: groundcal.Calibration) -> None:
    wide = [p.astype(np.uint16) * 257 for p in pictures]
    for name, image in zip(scene.names(), wide):
        scene.write_png(tmp_path / f"{name}.png", image)
    assert same_numbers(groundcal.calibrate(wide), groundcal.calibrate(tmp_path))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        from_unit = groundcal.calibrate([(p / 255).astype(np.float32) for p in pictures])
    assert_true(from_unit)
    assert abs(from_unit.K[0, 0] - made.K[0, 0]) < 0.5 * made.standard_deviation["fx"]


def test_floats_of_another_range_are_said(pictures: list[scene.Array]) -> None:
    with pytest.warns(groundcal.GroundcalWarning, match="from 0 .black. to 255 .white."):
        calibration = groundcal.calibrate([p.astype(np.float32) for p in pictures])
    assert_true(calibration)


def test_what_is_contiguous_or_not_or_read_only_is_the_same(
    pictures: list[scene.Array], made: groundcal.Calibration
) -> None:
    names = scene.names()
    padded = [np.pad(p, 5)[5:-5, 5:-5] for p in pictures]
    assert not padded[0].flags.c_contiguous
    assert groundcal.calibrate(padded, names=names) == made
    frozen = [p.copy() for p in pictures]
    for p in frozen:
        p.flags.writeable = False
    assert groundcal.calibrate(frozen, names=names) == made
    assert groundcal.calibrate([np.asfortranarray(p) for p in pictures], names=names) == made
    assert groundcal.calibrate(np.stack(pictures), names=names) == made
    assert groundcal.calibrate([p[..., None] for p in pictures], names=names) == made


def test_contiguous_bytes_are_not_copied(pictures: list[scene.Array]) -> None:
    from groundcal import _arrays

    assert _arrays.image(pictures[0], "image") is pictures[0]
    copied = _arrays.image(pictures[0][::2], "image")
    assert copied.flags.c_contiguous and not np.shares_memory(copied, pictures[0])


def test_masks(tmp_path: Path, pictures: list[scene.Array], made: groundcal.Calibration) -> None:
    names = scene.names()
    rng = np.random.default_rng(5)
    bumper = np.kron(rng.integers(0, 255, (15, 80)), np.ones((4, 4))).astype(np.uint8)
    painted = [p.copy() for p in pictures]
    for p in painted:
        p[180:] = bumper if p.ndim == 2 else bumper[..., None]
    found = groundcal.calibrate(painted, names=names)
    assert_true(found)
    assert [w.code for w in found.warnings].count("still_in_all_images") == 1
    # One motion for five unknowns. The error has what was set aside with it.
    with pytest.raises(groundcal.DegenerateError) as caught:
        groundcal.calibrate(painted[:3], names=names[:3], pairs=[(names[0], names[1])], constraint="full")
    (note,) = caught.value.notes
    assert "stands still in all images" in note
    assert getattr(caught.value, "__notes__", [note]) == [note]
    again = pickle.loads(pickle.dumps(caught.value))
    assert (str(again), again.code, again.notes) == (str(caught.value), caught.value.code, (note,))
    used = np.zeros(SIZE[::-1], dtype=np.uint8)
    used[:176] = 1
    masked = groundcal.calibrate(painted, names=names, mask=used)
    assert_true(masked)
    assert "still_in_all_images" not in [w.code for w in masked.warnings]
    assert groundcal.calibrate(painted, names=names, mask=[used > 0] * len(names)) == masked
    scene.write_png(tmp_path / "mask.png", used * 255)
    assert groundcal.calibrate(painted, names=names, mask=tmp_path / "mask.png") == masked
    assert groundcal.calibrate(pictures, names=names, mask=np.ones_like(used)) == made
    with pytest.raises(groundcal.InputError, match="320x239.*320x240"):
        groundcal.calibrate(painted, mask=used[1:])
    with pytest.raises(groundcal.InputError, match="2 masks for 6 images"):
        groundcal.calibrate(painted, mask=[used, used])
    with pytest.raises(groundcal.InputError, match="nothing of it is used"):
        groundcal.calibrate(painted, mask=used * 0)
    with pytest.raises(TypeError, match="mask= must be a path"):
        groundcal.calibrate(painted, mask=5)  # type: ignore[arg-type]
    with pytest.raises(groundcal.InputError, match="mask= goes with images"):
        groundcal.calibrate(scene.matches(), image_size=SIZE, mask=used)


def test_matches() -> None:
    calibration = groundcal.calibrate(scene.matches(), image_size=SIZE)
    assert_true(calibration)
    assert calibration.views[0].position is not None
    sigma = {pair: (a, b, np.full(len(a), 0.05)) for pair, (a, b) in scene.matches().items()}
    assert_true(groundcal.calibrate(sigma, image_size=SIZE))
    lists = {pair: (a.tolist(), b.tolist()) for pair, (a, b) in scene.matches().items()}
    assert groundcal.calibrate(lists, image_size=SIZE) == calibration


def test_tracks() -> None:
    calibration = groundcal.calibrate(scene.tracks(), image_size=SIZE)
    assert_true(calibration)
    by_id = {image: dict(zip(ids, xy)) for image, (ids, xy) in scene.tracks().items()}
    assert groundcal.calibrate(by_id, image_size=SIZE) == calibration
    motions = [("0a", "0b"), ("1a", "1b"), ("2a", "2b")]
    assert_true(groundcal.calibrate(scene.tracks(), image_size=SIZE, pairs=motions))


def test_homographies() -> None:
    H = scene.homographies()
    exact = groundcal.calibrate(H, image_size=SIZE, constraint="zero-skew", attitude_sigma_deg=0)
    assert np.allclose(exact.K, scene.K, rtol=1e-6)
    # A covariance in pixels of the matrix as it is: whatever its scale, the answer is the same.
    C = {pair: (h, np.diag((1e-6 * np.abs(h).ravel() + 1e-9) ** 2)) for pair, h in H.items()}
    scaled = {pair: (-7 * h, 49 * c) for pair, (h, c) in C.items()}
    one = groundcal.calibrate(C, image_size=SIZE, constraint="zero-skew", attitude_sigma_deg=0)
    other = groundcal.calibrate(scaled, image_size=SIZE, constraint="zero-skew", attitude_sigma_deg=0)
    assert np.allclose(one.K, scene.K, rtol=1e-5)
    assert np.allclose(one.covariance.matrix, other.covariance.matrix, rtol=1e-6)
    named = {pair: {"H": h, "covariance": c, "matches": 200} for pair, (h, c) in C.items()}
    assert np.allclose(groundcal.calibrate(named, image_size=SIZE, constraint="zero-skew", attitude_sigma_deg=0).K, one.K)


def test_a_table_of_matches(tmp_path: Path) -> None:
    rows = ["image_a,image_b,xa,ya,xb,yb"]
    for (a, b), (pa, pb) in scene.matches().items():
        rows += [f"{a},{b},{x},{y},{u},{v}" for (x, y), (u, v) in zip(pa.tolist(), pb.tolist())]
    (tmp_path / "matches.csv").write_text("\n".join(rows))
    of_table = groundcal.calibrate(tmp_path / "matches.csv", image_size=SIZE)
    assert of_table == groundcal.calibrate(scene.matches(), image_size=SIZE)


def test_options_reach_the_library(tripod: groundcal.Calibration) -> None:
    def of(**options: object) -> groundcal.Calibration:
        return groundcal.calibrate(scene.matches(), image_size=SIZE, **options)  # type: ignore[arg-type]

    square = of(constraint="square", aspect=1.0)
    assert square.K[0, 0] == square.K[1, 1] and square.to_dict()["constraint"] == "square"
    held = of(constraint="fixed-pp", principal_point_px=(161, 118))
    assert held.K[0, 2] == 161 and "cx" not in held.standard_deviation
    told = of(priors={"cx": (161.0, 0.01)})
    # The error bar is that of the prior, and has what the images leave open.
    assert 0.0099 < told.standard_deviation["cx"] < 0.2 * of().standard_deviation["cx"]
    assert of(method="linear").to_dict()["method"] == "linear"
    assert of(motion="plane-normal") is not None
    assert of(lens="none").lens_model == "none" and "k1" not in of(lens="none").standard_deviation
    assert set(of(lens="k1").standard_deviation) >= {"k1"} and "k2" not in of(lens="k1").standard_deviation
    known = of(distortion={"k1": 0.001})
    assert known.dist.tolist() == [0.001, 0, 0, 0, 0] and "k1" not in known.standard_deviation
    assert of(attitude_sigma_deg=0.3).to_dict()["attitude_sigma_deg"] == 0.3
    metres = of(camera_height_m=1.5)
    view = next(v for v in metres.views if v.image == v.origin)
    assert view.position is not None and view.position[2] == pytest.approx(1.5)
    two = of(pairs=[("0a", "0b"), (2, 3)], constraint="square")
    assert sorted(m.images for m in two.motions if m.used) == [("0a", "0b"), ("1a", "1b")]
    assert of(threads=1) == of(threads=3)


def test_a_known_lens_of_a_calibration_or_a_file(tmp_path: Path) -> None:
    lens = groundcal.calibrate(scene.matches(), image_size=SIZE, distortion={"k1": 0.01, "k2": -0.001})
    again = groundcal.calibrate(scene.matches(), image_size=SIZE, distortion=lens)
    assert again.dist.tolist() == lens.dist.tolist()
    lens.to_ros(tmp_path / "camera_info.yaml")
    of_file = groundcal.calibrate(scene.matches(), image_size=SIZE, distortion=tmp_path / "camera_info.yaml")
    assert np.allclose(of_file.dist, lens.dist)
