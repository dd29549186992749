"""compare, plan, simulate."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import groundcal


def test_cameras_are_compared(tripod: groundcal.Calibration, examples: Path) -> None:
    comparison = groundcal.compare(tripod, examples / "tripod" / "truth.json", tripod)
    assert len(comparison) == 2 and "fx" in repr(comparison)
    truth, itself = comparison
    assert truth.rms_px < 0.1 and itself.rms_px < 1e-9 and itself.p_value == 1
    fx = truth.parameters["fx"]
    assert fx["value"] == 705.0 and fx["reference"] == tripod.K[0, 0]
    assert abs(fx["difference_in_standard_deviations"]) < 5
    assert truth.p_value is not None and truth.figure.startswith("<svg")
    assert comparison.to_dict()["reference"]["image_size"] == [800, 600]
    with pytest.raises(TypeError, match="two cameras"):
        groundcal.compare(tripod)
    with pytest.raises(TypeError, match="camera 2: expected a Calibration or a path, not int"):
        groundcal.compare(tripod, 3)  # type: ignore[arg-type]
    with pytest.raises(groundcal.InputError):
        groundcal.compare(tripod, examples / "tripod" / "00a.jpg")


def test_pictures_are_planned(tripod: groundcal.Calibration) -> None:
    plan = groundcal.plan(rig="pan-head", hfov_deg=70, image_size=(1920, 1080), motions=3, lens="k1")
    assert len(plan.motions) == 3 and plan.figure.startswith("<svg") and plan.to_dict()["motions"]
    assert 'Then: calibration = groundcal.calibrate("pictures/", lens=\'k1\')' in repr(plan) and "--" not in repr(plan).split("Then:")[1]
    known = [m.f_percent for m in plan.motions if m.f_percent is not None]
    assert known and known == sorted(known, reverse=True)
    after = groundcal.plan(tripod, motions=1)
    assert len(after.motions) == 1 and after.motions[0].f_percent is not None
    for keywords, word in [
        ({"height_m": 0.0}, "height_m=0: give a number above 0"),
        ({"max_turn_deg": 400.0}, "0 to 180 degrees"),
        ({"motions": 0}, "from 1 to 50"),
        ({"rig": "tripot"}, 'Did you mean "tripod"'),
        ({"f": 700.0, "hfov_deg": 60.0}, "give one of them"),
        ({"after": tripod, "f": 700.0}, "comes from the calibration"),
    ]:
        with pytest.raises(groundcal.InputError, match=word):
            groundcal.plan(**keywords)  # type: ignore[arg-type]
    for keyword, value in [("tilts_deg", "20,30"), ("motions", 2.5), ("height_m", "1.5")]:
        with pytest.raises(TypeError, match=f"{keyword}= must be "):
            groundcal.plan(**{keyword: value})  # type: ignore[arg-type]
    with pytest.raises(groundcal.DegenerateError) as caught:
        groundcal.plan(max_turn_deg=0)
    assert any("max_turn_deg=" in remedy for remedy in caught.value.remedies)


def test_studies(tripod: groundcal.Calibration) -> None:
    study = groundcal.simulate("noise", trials=3, seed=1)
    assert study.table["value"].dtype == np.float64 and study.figure.startswith("<svg")
    assert study.to_csv().startswith("study,") and "noise" in repr(study)
    assert groundcal.simulate("noise", trials=3, seed=1, threads=1).to_csv() == study.to_csv()
    with pytest.raises(groundcal.InputError, match='Did you mean "noise"'):
        groundcal.simulate("noize")
    for keyword, value in [("trials", 0), ("trials", -1), ("seed", -1), ("threads", 0)]:
        with pytest.raises(groundcal.InputError, match=f"{keyword}={value}"):
            groundcal.simulate("noise", **{keyword: value})  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="trials= must be a whole number"):
        groundcal.simulate("noise", trials=2.5)  # type: ignore[arg-type]
