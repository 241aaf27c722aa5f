"""Tells callers about the progress of a call, and about what was done to their data."""

from __future__ import annotations

import logging
import sys
import warnings
from types import FrameType
from typing import Callable, Optional, Tuple, Union

from ._errors import DataWarning

# Called with phase, done, total (0: not known) and unit, such as ("gather", 4096, 100000,
# "receivers"). What it raises stops the work and reaches the caller.
ProgressCallback = Callable[[str, int, int, str], object]
ProgressLike = Union[bool, ProgressCallback, None]

_logger = logging.getLogger("surfeit")


class _Bars:
    """A bar of tqdm for each phase."""

    def __init__(self, tqdm):
        self._tqdm = tqdm
        self._bar = None
        self._phase = None

    def __call__(self, phase: str, done: int, total: int, unit: str) -> None:
        if phase != self._phase:
            self.close()
            self._phase = phase
            self._bar = self._tqdm(total=total or None, desc=phase, unit=f" {unit}", unit_scale=True)
        self._bar.update(done - self._bar.n)

    def close(self) -> None:
        if self._bar is not None:
            self._bar.close()
            self._bar = None


def _callback(progress: ProgressLike) -> Optional[ProgressCallback]:
    if progress is None or progress is False:
        return None
    if progress is not True:
        return progress
    try:
        from tqdm.auto import tqdm  # type: ignore[import]  # its types are a package of their own
    except ImportError:
        return None
    return _Bars(tqdm)


def _level_of_caller() -> int:
    """The stack level of the first frame outside this package, for warnings."""
    level = 1
    frame: Optional[FrameType] = sys._getframe(1)
    while frame is not None and frame.f_globals.get("__name__", "").split(".")[0] == "surfeit":
        frame = frame.f_back
        level += 1
    return level


class Watcher:
    """What the binding tells: phases, notes about data, and facts."""

    def __init__(self, progress: ProgressLike = None, strict: bool = False):
        self._call = _callback(progress)
        self.strict = strict
        self._told: Optional[Tuple[str, int, int, str]] = None

    def update(self, phase: str, done: int, total: int, unit: str) -> None:
        now = (phase, done, total, unit)
        if self._call is None or now == self._told:
            return
        self._told = now
        self._call(*now)

    def note(self, message: str) -> None:
        if self.strict:
            raise DataWarning(message)
        warnings.warn(message, DataWarning, stacklevel=_level_of_caller())

    def inform(self, message: str) -> None:
        _logger.info("%s", message)

    def __enter__(self) -> "Watcher":
        return self

    def __exit__(self, *_: object) -> None:
        if isinstance(self._call, _Bars):
            self._call.close()
