from __future__ import annotations

from pathlib import Path

import pytest
import scene

import groundcal

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="session")
def examples() -> Path:
    return ROOT / "examples"


@pytest.fixture(scope="session")
def tripod(examples: Path) -> groundcal.Calibration:
    """The calibration of examples/tripod. It does not change."""
    return groundcal.calibrate(examples / "tripod")


@pytest.fixture(scope="session")
def pictures() -> list[scene.Array]:
    return scene.pictures()


@pytest.fixture(scope="session")
def made(pictures: list[scene.Array]) -> groundcal.Calibration:
    """A calibration of arrays."""
    return groundcal.calibrate(pictures, names=scene.names())
