"""``progress=``: a bar of tqdm, lines of text, or the caller's own function."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Union

Progress = Union[bool, Callable[[str, int, int], object]]


class _Bars:
    """A bar of tqdm for each stage."""

    def __init__(self, tqdm: Any) -> None:
        self._tqdm = tqdm
        self._bar: Any = None
        self._stage = ""

    def __call__(self, stage: str, done: int, total: int) -> None:
        if done == 0 or stage != self._stage:
            self.close()
            self._stage, self._bar = stage, self._tqdm(total=total, desc=stage)
        self._bar.update(done - self._bar.n)

    def close(self) -> None:
        if self._bar is not None:
            self._bar.close()


class _Lines:
    """A line on standard error for each stage, where there is no tqdm."""

    def __call__(self, stage: str, done: int, total: int) -> None:
        if done == 0:
            print(f"groundcal: {stage} ({total})", file=sys.stderr)

    def close(self) -> None:
        pass


@contextmanager
def listener(progress: Progress) -> Iterator[Callable[[str, int, int], object] | None]:
    """What hears of the work; it is called by the thread that called."""
    if progress is False or progress is None:
        yield None
        return
    if progress is not True:
        if not callable(progress):
            raise TypeError(
                f"progress= must be True, False or a function of (stage, done, total), not {type(progress).__name__}"
            )
        yield progress
        return
    shown: _Bars | _Lines
    try:
        tqdm = importlib.import_module("tqdm.auto").tqdm
    except ImportError:
        shown = _Lines()
    else:
        shown = _Bars(tqdm)
    try:
        yield shown
    finally:
        shown.close()
