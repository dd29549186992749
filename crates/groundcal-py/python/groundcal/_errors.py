"""Exceptions and the class of warnings."""

from __future__ import annotations


class _WithRemedies(ValueError):
    code: str
    remedies: tuple[str, ...]
    notes: tuple[str, ...]

    def __init__(self, message: str, code: str = "", remedies: object = (), notes: object = ()) -> None:
        super().__init__(message)
        self.code = code
        self.remedies = tuple(str(remedy) for remedy in remedies) if isinstance(remedies, (list, tuple)) else ()
        self.notes = ()
        self._note(notes)

    def _note(self, notes: object) -> None:
        new = tuple(str(note) for note in notes) if isinstance(notes, (list, tuple)) else ()
        self.notes += new
        add_note = getattr(self, "add_note", None)  # shown under a traceback, from Python 3.11 on
        if add_note is not None:
            for note in new:
                add_note(note)

    def __reduce__(self) -> tuple[type, tuple[str, str, tuple[str, ...], tuple[str, ...]]]:
        return type(self), (str(self), self.code, self.remedies, self.notes)


class DegenerateError(_WithRemedies):
    """The images, matches or motions are well formed but cannot determine what was asked.

    Attributes:
        code: Short name of what is wrong, stable across versions (``"no_usable_motion"``, ``"too_few_attitudes"``; all of them are in
            ``docs/warnings.md``).
        remedies: What to do about it, any of these, worded with the keywords of :func:`groundcal.calibrate`.
        notes: What was noted of the input before, which may be the reason: a damaged JPEG, what stands still in all images.

    Example:
        >>> import groundcal, numpy as np
        >>> try:
        ...     groundcal.calibrate([np.zeros((60, 80), np.uint8)])
        ... except groundcal.DegenerateError as error:
        ...     print(error.code)
        too_few_images
    """


class InputError(_WithRemedies):
    """An input or the value of a keyword that cannot be used: a file, an array, a number out of its range.

    Attributes:
        code: ``"unusable_input"`` or ``"unusable_option"``.
        remedies: What to do about it; usually the message says it.
        notes: What was noted of the input before.

    Example:
        >>> import groundcal
        >>> try:
        ...     groundcal.calibrate("no/such/folder")
        ... except groundcal.InputError as error:
        ...     print(error.code)
        unusable_input
    """


class GroundcalWarning(UserWarning):
    """What there is to say about an input that does not stop the work: a damaged JPEG, floats that do not run from 0 to 1.

    Doubts about a *result* are values: :attr:`groundcal.Calibration.warnings`.

    Example:
        >>> import warnings, groundcal
        >>> warnings.simplefilter("error", groundcal.GroundcalWarning)  # raise them instead
        >>> warnings.simplefilter("default", groundcal.GroundcalWarning)
    """
