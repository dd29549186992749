"""Every exception: its class, its code, and words that help."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scene

import groundcal

SIZE = scene.SIZE


def refused(kind: type[Exception], words: list[str], source: Any, **options: Any) -> Exception:
    with pytest.raises(kind) as caught:
        groundcal.calibrate(source, **options)
    for word in words:
        assert word in str(caught.value), f"{word!r} is missing in: {caught.value}"
    return caught.value


def test_unknown_keywords_are_told_the_nearest() -> None:
    refused(TypeError, ["calibrate()", "'constrain'".replace("'", '"'), 'Did you mean "constraint"?'], [], constrain="square")
    refused(TypeError, ['Did you mean "attitude_sigma_deg"'], [], atitude_sigma=0.1)
    for function, keyword in [
        (groundcal.plan, "motion"),
        (groundcal.simulate, "trial"),
        (groundcal.rectify, "mosaik"),
        (groundcal.undistort, "fits"),
    ]:
        with pytest.raises(TypeError, match=f'there is no "{keyword}". Did you mean'):
            function(**{keyword: 1})  # type: ignore[operator]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"motion": 3}, ["motion= must be a string", "not 3 (int)"]),
        ({"aspect": "wide"}, ["aspect= must be a number", "str"]),
        ({"principal_point_px": 640}, ["principal_point_px= must be a pair of numbers"]),
        ({"priors": {"cx": 640}}, ["priors= must be a mapping", '{"cx": (640, 5)}']),
        ({"priors": [1]}, ["priors= must be a mapping"]),
        ({"seed": -1}, ["seed= must be a whole number"]),
        ({"image_size": 640}, ["image_size= must be a pair of whole numbers"]),
        ({"distortion": 0.1}, ["distortion= must be a mapping"]),
        ({"pairs": [("0a",)]}, ["pairs= must be a list of pairs"]),
        ({"progress": 3}, ["progress= must be True, False or a function"]),
    ],
)
def test_values_of_wrong_types(options: dict[str, Any], words: list[str]) -> None:
    refused(TypeError, words, scene.matches(), **{"image_size": SIZE, **options})


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"motion": "plane"}, ['motion="plane"', 'Did you mean "plane-normal"?']),
        ({"motion": "general", "method": "linear"}, ["general motion"]),
        ({"image_size": (0, 240)}, ["image_size=(0, 240)", "between 2 and"]),
        ({"image_size": (10**5, 10**5)}, ["megapixels"]),
        ({"constraint": "squre"}, ['Did you mean "square"?']),
        ({"method": "magic"}, ['there is no "magic"', '"joint", "linear", "kzr", "transferred", "rotating"']),
        ({"homographies": "linear"}, ["kzr"]),
        ({"lens": "k3"}, ['"none", "k1", "k1k2", "radtan", "fisheye"']),
        ({"aspect": -1.0}, ["aspect ratio -1"]),
        ({"aspect": float("nan")}, ["aspect ratio NaN"]),
        ({"principal_point_px": (1e9, 0)}, ["principal point"]),
        ({"priors": {"cz": (640, 5)}}, ['"cz"', '"cx"']),
        ({"priors": {"cx": (160, -5)}}, ["prior cx"]),
        ({"priors": {"skew": (0, 5)}, "constraint": "square"}, ["prior of skew"]),
        ({"attitude_sigma_deg": 50.0}, ["attitude sigma 50"]),
        ({"height_sigma": -1.0}, ["height sigma"]),
        ({"camera_height_m": 0.0}, ["camera height 0"]),
        ({"max_features": 3}, ["max_features=3"]),
        ({"threads": 0}, ["threads=0"]),
        ({"distortion": {"k9": 1.0}}, ['"k9"', '"k1"']),
        ({"distortion": {"model": "omni"}}, ["omni", "fisheye"]),
        ({"distortion": {"k1": float("inf")}}, ["k1 is inf"]),
        ({"pairs": [("0a", "9z")]}, ['there is no "9z"']),
        ({"pairs": [(0, 99)]}, ["there is no image 99 of 6"]),
        ({"names": ["a"]}, ["names= goes with a list of arrays"]),
        ({"bgr": True}, ["bgr= goes with a list of arrays"]),
    ],
)
def test_values_that_cannot_be_used(options: dict[str, Any], words: list[str]) -> None:
    error = refused(groundcal.InputError, words, scene.matches(), **{"image_size": SIZE, **options})
    assert isinstance(error, ValueError) and isinstance(error, groundcal.InputError)
    assert error.code == "unusable_option", error.code


def test_unusable_arrays(pictures: list[scene.Array]) -> None:
    first, *others = pictures
    nan = first.astype(np.float32)
    nan[3, 4] = np.nan
    bad: list[tuple[Any, list[str]]] = [
        (first.astype(np.float64), ["image 0", "float64", "astype(np.float32)"]),
        (first > 100, ["bool", "* 255"]),
        (first.astype(np.int32), ["int32"]),
        (nan, ["1 of its values", "NaN"]),
        (first[:0], ["empty array of shape (0, 320)"]),
        (first[0], ["shape (320,)"]),
        (np.zeros((3, 240, 320), np.uint8), ["channels last", "transpose(1, 2, 0)"]),
        (np.zeros((240, 320, 7), np.uint8), ["(240, 320, 7)"]),
        (np.zeros((1, 2, 240, 320), np.uint8), ["stack of pictures"]),
    ]
    for image, words in bad:
        error = refused(groundcal.InputError, words, [image, *others])
        assert isinstance(error, groundcal.InputError) and error.code == "unusable_input"
    refused(groundcal.InputError, ["image 1", "240 x 320", "turned", "320 x 240"], [first, others[0].T])
    refused(groundcal.InputError, ["100 x 100"], [first, np.zeros((100, 100), np.uint8)])
    refused(groundcal.InputError, ["one array of shape (240, 320)"], first)
    refused(groundcal.InputError, ["empty list"], [])
    refused(groundcal.InputError, ["2 names for 6 images"], pictures, names=["a", "b"])
    refused(groundcal.InputError, ["twice"], pictures, names=["a"] * 6)
    refused(groundcal.InputError, ["image_size="], pictures, image_size=SIZE)
    refused(TypeError, ["not dict"], [first, {}])
    refused(TypeError, ["both paths and arrays"], [first, "a.png"])
    refused(TypeError, ["expected a folder", "not int"], 3)


def test_unusable_matches() -> None:
    good = scene.matches()
    (a, b) = good["0a", "0b"]
    refused(groundcal.InputError, ["image_size=(width, height)"], good)
    refused(groundcal.InputError, ["empty dictionary"], {})
    refused(groundcal.InputError, ["'0a' and '0b'", "(N, 2)"], {("0a", "0b"): (a[:, :1], b)}, image_size=SIZE)
    refused(groundcal.InputError, ["in one and", "in the other"], {("0a", "0b"): (a[1:], b)}, image_size=SIZE)
    far = a.copy()
    far[7, 0] = np.nan
    refused(groundcal.InputError, ["point 7"], {("0a", "0b"): (far, b)}, image_size=SIZE)
    refused(groundcal.InputError, ["outside an image of"], good, image_size=(32, 24))
    refused(TypeError, ["expected (points_a, points_b)"], {("0a", "0b"): a}, image_size=SIZE)
    refused(TypeError, ["a key is"], {("0a", "0b", "0c"): (a, b)}, image_size=SIZE)
    refused(groundcal.InputError, ["is not invertible"], {("a", "b"): np.zeros((3, 3))}, image_size=SIZE)
    refused(groundcal.InputError, ["tracks of '0a'", "3 tracks and"], {"0a": ([1, 2, 3], a)}, image_size=SIZE)
    refused(groundcal.InputError, ["share a track"], {"0a": ([1], a[:1]), "0b": ([2], a[:1])}, image_size=SIZE)


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    refused(groundcal.InputError, ["does not exist"], tmp_path / "nowhere")
    refused(groundcal.InputError, ["no images in the folder"], tmp_path)
    (tmp_path / "a.png").write_bytes(b"no picture")
    refused(groundcal.InputError, ["a.png", "not an image"], tmp_path)
    for path in (tmp_path / "a.png", tmp_path / "nothing.json"):
        with pytest.raises(groundcal.InputError):
            groundcal.load(path)


def test_what_cannot_be_determined_says_what_helps() -> None:
    one = {("0a", "0b"): scene.matches()["0a", "0b"]}
    error = refused(groundcal.DegenerateError, ["constraint="], one, image_size=SIZE, constraint="full", motion="plane-normal")
    assert isinstance(error, groundcal.DegenerateError) and isinstance(error, ValueError)
    assert error.code == "too_few_attitudes"
    assert any('constraint="auto"' in remedy for remedy in error.remedies)
    assert "--" not in str(error) and "--" not in " ".join(error.remedies)
    # It tilted: nothing shows that the axis was normal to the floor; that may be vouched for.
    tilted = {("0a", "1b"): scene.matches_between("0a", "1b")}
    error = refused(groundcal.DegenerateError, ['motion="plane-normal"'], tilted, image_size=SIZE)
    assert isinstance(error, groundcal.DegenerateError) and error.code == "no_usable_motion"
    assert any('motion="plane-normal"' in remedy for remedy in error.remedies), error.remedies
    assert groundcal.calibrate(one, image_size=SIZE, motion="plane-normal").warnings
    again = pickle.loads(pickle.dumps(error))
    assert (str(again), again.code, again.remedies) == (str(error), error.code, error.remedies)


def test_a_picture_alone_and_pictures_of_nothing(pictures: list[scene.Array]) -> None:
    error = refused(groundcal.DegenerateError, ["1 image"], [pictures[0]])
    assert isinstance(error, groundcal.DegenerateError) and error.code == "too_few_images"
    grey = [np.full((240, 320), 128, np.uint8), np.full((240, 320), 129, np.uint8)]
    error = refused(groundcal.DegenerateError, ["common plane"], grey)
    assert isinstance(error, groundcal.DegenerateError) and error.code == "no_common_plane"


def test_warnings_are_worded_for_python() -> None:
    one = {("0a", "0b"): scene.matches()["0a", "0b"]}
    calibration = groundcal.calibrate(one, image_size=SIZE, motion="plane-normal", lens="none")
    codes = {w.code for w in calibration.warnings}
    assert {"single_motion", "distortion_not_modelled"} & codes, codes
    for warning in calibration.warnings:
        assert "--" not in warning.message and warning.code in str(warning)
    lens = next(w for w in calibration.warnings if w.code == "distortion_not_modelled")
    assert 'lens="k1k2"' in lens.message and "estimate_lens" in lens.remedies and lens.numbers
