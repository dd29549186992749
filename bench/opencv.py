"""Time of a whole calibration beside that of OpenCV's front end on the same pictures.

    pip install opencv-python-headless numpy
    python bench/opencv.py FOLDER [--ring] [--groundcal target/release/groundcal] [--runs 5]

OpenCV's part: read, SIFT with its defaults, brute-force matching with a ratio of 0.8, USAC_MAGSAC; of the pairs 1-2, 3-4, ... or, with
--ring, of all neighbours and of the last with the first. groundcal's part: `calibrate FOLDER --json`, start-up included, all pairs. They run
in turn, and the ratio is that of each pair of runs; OpenCV's time is without the start of Python.
"""

import argparse
import pathlib
import subprocess
import sys
import tempfile
import time

import cv2
import numpy as np

RATIO = 0.8
MAX_SIGMA_PX = 1.5


def front_end(files: list[pathlib.Path], ring: bool) -> float:
    """Seconds of OpenCV's features, matches and homographies."""
    start = time.perf_counter()
    sift = cv2.SIFT_create()
    images = [cv2.imread(str(file), cv2.IMREAD_GRAYSCALE) for file in files]
    features = [sift.detectAndCompute(image, None) for image in images]
    count = len(files)
    pairs = [(i, (i + 1) % count) for i in range(count)] if ring else [(i, i + 1) for i in range(0, count - 1, 2)]
    for a, b in pairs:
        (points_a, a_descriptors), (points_b, b_descriptors) = features[a], features[b]
        candidates = cv2.BFMatcher().knnMatch(a_descriptors, b_descriptors, 2)
        good = [first for first, second in candidates if first.distance < RATIO * second.distance]
        from_a = np.float32([points_a[match.queryIdx].pt for match in good])
        to_b = np.float32([points_b[match.trainIdx].pt for match in good])
        cv2.findHomography(from_a, to_b, cv2.USAC_MAGSAC, MAX_SIGMA_PX)
    return time.perf_counter() - start


def whole_run(program: str, folder: pathlib.Path) -> float:
    """Seconds of a calibration, from the start of the program to its end."""
    with tempfile.TemporaryDirectory() as out:
        command = [program, "calibrate", str(folder), "--json", "--no-report", "--out", str(pathlib.Path(out, "result"))]
        start = time.perf_counter()
        code = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False).returncode
        seconds = time.perf_counter() - start
    if code not in (0, 3):
        sys.exit(f"{' '.join(command)} ended with {code}")
    return seconds


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--ring", action="store_true")
    parser.add_argument("--groundcal", default="target/release/groundcal")
    parser.add_argument("--runs", type=int, default=5)
    options = parser.parse_args()
    files = sorted(file for file in options.folder.iterdir() if file.suffix.lower() in {".jpg", ".jpeg", ".png"})
    if len(files) < 2:
        sys.exit(f"{options.folder}: fewer than two images")
    # Both once for the disk's cache.
    front_end(files, options.ring), whole_run(options.groundcal, options.folder)
    rows = [(whole_run(options.groundcal, options.folder), front_end(files, options.ring)) for _ in range(options.runs)]
    ours, theirs, ratios = (np.median(column) for column in zip(*[(a, b, a / b) for a, b in rows]))
    print(f"groundcal {ours:.2f} s, OpenCV's front end {theirs:.2f} s, ratio {ratios:.2f} (medians of {options.runs} runs in turn)")


if __name__ == "__main__":
    main()
