"""A camera over a floor, with its truth: matches, tracks, homographies and pictures made from NumPy alone."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

SIZE = (320, 240)
K = np.array([[300.0, 0.0, 161.0], [0.0, 300.0, 118.0], [0.0, 0.0, 1.0]])
TURN_DEG = 25.0
#: Pitch below the horizon and roll of each attitude, degrees.
ATTITUDES = [(50.0, 0.0), (55.0, -30.0), (45.0, 30.0)]
#: Place over the floor and heading of the first picture of each.
PLACES = [((0.0, 0.0), 0.0), ((0.4, 0.5), -20.0), ((-0.3, -0.4), 15.0)]

Array = npt.NDArray[Any]


def rotation(pitch_deg: float, roll_deg: float, yaw_deg: float) -> Array:
    """Camera coordinates from the world's."""
    p, r, y = np.radians([pitch_deg, roll_deg, yaw_deg])
    pitched = np.array([[0, -1, 0], [-np.sin(p), 0, -np.cos(p)], [np.cos(p), 0, -np.sin(p)]])
    rolled = np.array([[np.cos(r), np.sin(r), 0], [-np.sin(r), np.cos(r), 0], [0, 0, 1]])
    yawed = np.array([[np.cos(y), np.sin(y), 0], [-np.sin(y), np.cos(y), 0], [0, 0, 1]])
    found: Array = rolled @ pitched @ yawed
    return found


def names() -> list[str]:
    return [f"{i}{view}" for i in range(len(ATTITUDES)) for view in "ab"]


def floor_homography(name: str) -> Array:
    """Pixels from points (X, Y, 1) of the floor."""
    pitch, roll = ATTITUDES[int(name[0])]
    second = name[1] == "b"
    # Each attitude at a place of its own: a camera that only tilted on the spot between them would be another scene.
    place, yaw_deg = PLACES[int(name[0])]
    R = rotation(pitch, roll, yaw_deg + (TURN_DEG if second else 0.0))
    centre = np.array([*place, 1.0]) + (np.array([0.15, -0.1, 0.0]) if second else 0.0)
    found: Array = K @ np.column_stack([R[:, 0], R[:, 1], -R @ centre])
    return found


def pixels(name: str, floor: Array) -> tuple[Array, Array]:
    """Pixels of points of the floor, and which are in the picture."""
    q = np.column_stack([floor, np.ones(len(floor))]) @ floor_homography(name).T
    with np.errstate(divide="ignore", invalid="ignore"):
        xy = q[:, :2] / q[:, 2:]
    inside = (q[:, 2] > 0) & (xy > 0).all(axis=1) & (xy < np.array(SIZE) - 1).all(axis=1)
    return xy, inside


def floor_points() -> Array:
    """Points of the floor, drawn once."""
    return np.random.default_rng(1).uniform(-3, 3, (4000, 2))


def matches(noise_px: float = 0.05, seed: int = 2) -> dict[tuple[str, str], tuple[Array, Array]]:
    """Matches of each motion."""
    random, floor = np.random.default_rng(seed), floor_points()
    found = {}
    for i in range(len(ATTITUDES)):
        (a, seen_a), (b, seen_b) = pixels(f"{i}a", floor), pixels(f"{i}b", floor)
        both = seen_a & seen_b
        found[f"{i}a", f"{i}b"] = tuple(xy[both] + random.normal(0, noise_px, (both.sum(), 2)) for xy in (a, b))
    return found  # type: ignore[return-value]


def tracks(noise_px: float = 0.05) -> dict[str, tuple[list[int], Array]]:
    """What each picture sees of the floor's points."""
    random, floor = np.random.default_rng(3), floor_points()
    found = {}
    for name in names():
        xy, seen = pixels(name, floor)
        ids = np.flatnonzero(seen)
        found[name] = (ids.tolist(), xy[ids] + random.normal(0, noise_px, (len(ids), 2)))
    return found


def matches_between(a: str, b: str, noise_px: float = 0.05) -> tuple[Array, Array]:
    """Matches of any two pictures."""
    random, floor = np.random.default_rng(5), floor_points()
    (xy_a, seen_a), (xy_b, seen_b) = pixels(a, floor), pixels(b, floor)
    both = seen_a & seen_b
    found = [xy[both] + random.normal(0, noise_px, (both.sum(), 2)) for xy in (xy_a, xy_b)]
    return found[0], found[1]


def homographies() -> dict[tuple[str, str], Array]:
    """Pixels of the second picture of each motion from those of the first."""
    return {
        (f"{i}a", f"{i}b"): floor_homography(f"{i}b") @ np.linalg.inv(floor_homography(f"{i}a"))
        for i in range(len(ATTITUDES))
    }


def texture() -> Array:
    """A floor of random blotches, 2048 x 2048 over 8 x 8 units, values 0 to 1."""
    random = np.random.default_rng(4)
    total: Array = np.zeros((2048, 2048))
    for cells in (64, 128, 256, 512):
        coarse = random.normal(size=(cells, cells))
        total += np.kron(coarse, np.ones((2048 // cells, 2048 // cells)))
    total = (total - total.min()) / (total.max() - total.min())
    return total


_TEXTURE = texture()


def picture(name: str) -> Array:
    """A picture (H, W) of uint8."""
    width, height = SIZE
    inverse = np.linalg.inv(floor_homography(name))
    total = np.zeros((height, width))
    steps = np.arange(4) / 4 - 0.375
    for dy in steps:
        for dx in steps:
            x, y = np.meshgrid(np.arange(width) + dx, np.arange(height) + dy)
            q = np.stack([x, y, np.ones_like(x)], axis=-1) @ inverse.T
            with np.errstate(divide="ignore", invalid="ignore"):
                u, v = (q[..., i] / q[..., 2] * 256 + 1024 for i in (0, 1))
            # The floor repeats; above the horizon there is a flat grey.
            here = np.nan_to_num(np.stack([v, u]), posinf=0, neginf=0).astype(np.int64) % 2048
            above = (q[..., 2] * (inverse @ [width / 2, height - 1.0, 1.0])[2]) <= 0
            total += np.where(above, 0.5, _TEXTURE[here[0], here[1]])
    return np.round(255 * total / 16).astype(np.uint8)


def pictures() -> list[Array]:
    return [picture(name) for name in names()]


def colour(grey: Array) -> Array:
    """An RGB picture (H, W, 3) whose channels differ."""
    g = grey.astype(np.int64)
    return np.stack([g, np.minimum(g + 40, 255), 255 - g // 4], axis=-1).astype(np.uint8)


def write_png(path: Path, image: Array) -> None:
    """8 or 16 bits, grey or RGB."""
    height, width = image.shape[:2]
    kind = 0 if image.ndim == 2 else 2
    bits = 8 * image.dtype.itemsize
    rows = image.reshape(height, -1).astype(image.dtype.newbyteorder(">"))
    data = b"".join(b"\0" + row.tobytes() for row in rows)

    def chunk(name: bytes, content: bytes) -> bytes:
        return struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))

    header = struct.pack(">IIBBBBB", width, height, bits, kind, 0, 0, 0)
    path.write_bytes(
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(data)) + chunk(b"IEND", b"")
    )
