"""Every public name has documentation with an example, and the examples are right."""

from __future__ import annotations

import doctest
import inspect
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scene

import groundcal


def documented() -> dict[str, Any]:
    """All public names, and what is public in the classes."""
    found: dict[str, Any] = {"groundcal": groundcal}
    for name in groundcal.__all__:
        value = getattr(groundcal, name)
        if name == "__version__":
            continue
        found[f"groundcal.{name}"] = value
        if not inspect.isclass(value) or issubclass(value, (Exception, tuple)):
            continue
        for member, of in vars(value).items():
            if not member.startswith("_") and (callable(of) or hasattr(of, "__get__")) and getattr(of, "__doc__", None):
                found[f"groundcal.{name}.{member}"] = of
    return found


def test_every_public_name_has_an_example() -> None:
    names = documented()
    assert len(names) > 40
    small = {"to_dict", "to_csv"}
    without = [n for n, v in names.items() if ">>>" not in (inspect.getdoc(v) or "") and n.split(".")[-1] not in small]
    assert without == []
    for name in groundcal.__all__:
        assert getattr(groundcal, name) is not None


def test_the_examples_are_right(
    tripod: groundcal.Calibration, examples: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(examples.parent)
    real = groundcal.calibrate

    def calibrate(source: Any, **options: Any) -> groundcal.Calibration:
        """The same, but for what was calibrated already."""
        return tripod if source == "examples/tripod" and not options else real(source, **options)

    monkeypatch.setattr(groundcal, "calibrate", calibrate)
    one = {("0a", "0b"): scene.matches()["0a", "0b"]}
    known = {
        "groundcal": groundcal,
        "np": np,
        "json": json,
        "calibration": tripod,
        "calibration_of_one_motion": groundcal.calibrate(one, image_size=scene.SIZE, motion="plane-normal"),
        "truth": groundcal.load("examples/tripod/truth.json"),
        "image": np.zeros((600, 800, 3), np.uint8),
        "folder": tmp_path,
    }
    finder = doctest.DocTestFinder(recurse=False)
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS)
    said: list[str] = []
    count = 0
    for name, value in documented().items():
        for test in finder.find(value, name, globs=dict(known)):
            count += len(test.examples)
            runner.run(test, out=said.append)
    assert count > 50
    assert runner.summarize(verbose=False).failed == 0, "".join(said)
