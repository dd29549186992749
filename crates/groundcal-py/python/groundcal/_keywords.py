"""Keywords that are not known, and what was found out about an input."""

from __future__ import annotations

import functools
import inspect
import warnings
from collections.abc import Callable, Iterable
from typing import Literal, TypeVar

from . import _groundcal
from ._errors import GroundcalWarning

Constraint = Literal["auto", "full", "zero-skew", "square", "fixed-pp", "focal"]
Lens = Literal["none", "k1", "k1k2", "radtan", "fisheye"]

_Function = TypeVar("_Function", bound=Callable[..., object])


def named(function: _Function) -> _Function:
    """Has an unknown keyword raise a TypeError that names the nearest known one."""
    known = [p.name for p in inspect.signature(function).parameters.values() if p.kind is not p.POSITIONAL_ONLY]

    @functools.wraps(function)
    def checked(*args: object, **keywords: object) -> object:
        for name in keywords:
            if name not in known:
                raise TypeError(f"{function.__name__}(): {_groundcal.no_such(name, known[1:])}")
        return function(*args, **keywords)

    return checked  # type: ignore[return-value]


def say(notes: Iterable[str]) -> None:
    """Warns of what was found out; the warning points at the user's line."""
    frame, level = inspect.currentframe(), 0
    while frame is not None and frame.f_globals.get("__package__") == __package__:
        frame, level = frame.f_back, level + 1
    for note in notes:
        warnings.warn(note, GroundcalWarning, stacklevel=level + 1)
