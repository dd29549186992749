"""While it runs: other threads, Ctrl-C, progress, forked processes."""

from __future__ import annotations

import builtins
import os
import signal
import sys
import threading
import time
from pathlib import Path
from typing import Any

import pytest
import scene

import groundcal


def test_other_threads_run_on(examples: Path) -> None:
    """The lock is let go: a thread that counts is never held up for long."""
    longest, last, done = 0.0, time.monotonic(), False

    def count() -> None:
        nonlocal longest, last
        while not done:
            now = time.monotonic()
            longest, last = max(longest, now - last), now
            time.sleep(0.001)

    counter = threading.Thread(target=count)
    counter.start()
    try:
        started = time.monotonic()
        groundcal.calibrate(examples / "head")
        whole = time.monotonic() - started
    finally:
        done = True
        counter.join()
    assert longest < 0.5 * whole, (longest, whole)


@pytest.mark.skipif(not hasattr(signal, "raise_signal") or os.name == "nt", reason="signals of POSIX")
@pytest.mark.parametrize("delay", [0.05, 0.4, 1.0])
def test_ctrl_c_stops_it(examples: Path, delay: float) -> None:
    sent = 0.0

    def send() -> None:
        nonlocal sent
        sent = time.monotonic()
        os.kill(os.getpid(), signal.SIGINT)

    timer = threading.Timer(delay, send)
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        groundcal.simulate("transfer", trials=100_000) if delay == 0.4 else groundcal.calibrate(examples / "tripod")
        # Where it was done before, the signal comes now.
        timer.join()
        time.sleep(5)
    took = time.monotonic() - sent
    timer.join()
    # The promise is 0.2 s on an idle machine; no test judges the machine's other work.
    print(f"Ctrl-C after {delay} s: stopped within {1000 * took:.0f} ms")
    assert took < 2.0


def test_a_function_hears_of_the_progress(made: groundcal.Calibration, pictures: list[scene.Array]) -> None:
    heard: list[tuple[str, int, int]] = []
    thread = threading.get_ident()

    def hear(stage: str, done: int, total: int) -> None:
        assert threading.get_ident() == thread
        heard.append((stage, done, total))

    assert groundcal.calibrate(pictures, names=scene.names(), progress=hear) == made
    stages = list(dict.fromkeys(stage for stage, _, _ in heard))
    assert stages[:3] == ["features", "matching", "homographies"] and "camera" in stages
    assert ("features", 0, 6) in heard and ("features", 6, 6) in heard and ("matching", 15, 15) in heard
    assert all(0 <= done <= total for _, done, total in heard)


def test_a_function_may_stop_it(pictures: list[scene.Array]) -> None:
    def stop(stage: str, done: int, total: int) -> None:
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        groundcal.calibrate(pictures, progress=stop)


def test_a_bar_or_lines(
    pictures: list[scene.Array], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    groundcal.calibrate(pictures, progress=True)
    assert "features" in capsys.readouterr().err
    real = builtins.__import__

    def without(name: str, *args: Any, **keywords: Any) -> Any:
        if name.startswith("tqdm"):
            raise ImportError(name)
        return real(name, *args, **keywords)

    for name in [n for n in sys.modules if n.startswith("tqdm")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setattr("importlib.import_module", without)
    groundcal.calibrate(pictures, progress=True)
    assert "groundcal: features (6)" in capsys.readouterr().err


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
def test_a_forked_process_calibrates_too(made: groundcal.Calibration, pictures: list[scene.Array]) -> None:
    child = os.fork()
    if child == 0:
        same = groundcal.calibrate(pictures, names=scene.names()) == made
        os._exit(0 if same else 1)
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline:
        pid, status = os.waitpid(child, os.WNOHANG)
        if pid:
            assert os.waitstatus_to_exitcode(status) == 0
            return
        time.sleep(0.05)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    pytest.fail("the forked process hangs")
