"""Lights and cameras of callers in the form that the binding takes."""

from __future__ import annotations

import math
from typing import Any, Dict, Iterable, List, Mapping, Optional, Set, Tuple

from ._arguments import is_path, path_of
from ._looks import numbers_of

_LIGHTS = {"light_point": 6, "light_directional": 6, "light_area": 12}

# A name or "", and numbers.
_Named = Tuple[str, Tuple[float, ...]]


def _several(given: Any) -> List[Any]:
    """One text or one run of numbers as a list of it; else the list."""
    if isinstance(given, str):
        return [given]
    items = list(given)
    return [items] if items and not hasattr(items[0], "__iter__") else items


def _lights_of(given: Any, count: int, name: str) -> List[_Named]:
    """Lights by name from a dict, or without; texts may have the name before the numbers."""
    if isinstance(given, Mapping):
        return [(str(key), numbers_of(value, (count,), name)) for key, value in given.items()]
    lights = []
    for each in _several(given):
        key = ""
        if isinstance(each, str) and "=" in each:
            key, each = each.split("=", 1)
        lights.append((key, numbers_of(each, (count,), name)))
    return lights


def _gains_of(gain: Any) -> Dict[str, float]:
    """Gains by name, of a dict or of "key=2,fill=.5"."""
    if isinstance(gain, Mapping):
        return {str(name): numbers_of(value, (1,), f"gain: {name}")[0]
                for name, value in gain.items()}
    gains: Dict[str, float] = {}
    for part in gain.split(","):
        name, equals, value = part.partition("=")
        if not equals or not name:
            raise ValueError(f'gain: found "{part}" in "{gain}", expected a factor, or factors of '
                             "lights by name, such as key=2,fill=.5")
        if name in gains:
            raise ValueError(f'gain: found "{name}" twice in "{gain}"')
        gains[name] = numbers_of(value, (1,), f"gain: {name}")[0]
    return gains


def _one_gain(gain: Any) -> Optional[float]:
    """The factor of all light, where it is no set of gains by name."""
    try:
        return None if isinstance(gain, Mapping) else float(gain)
    except ValueError:
        return None


def with_lights(options: Dict[str, Any], gain: Any = None) -> Dict[str, Any]:
    """The same options, with lights as numbers and the gain of each; `gain` of all stays one."""
    taken = dict(options)
    gains: Dict[str, float] = {}
    if gain is not None:
        of_all = _one_gain(gain)
        if of_all is None:
            gains = _gains_of(gain)
        else:
            taken["gain"] = of_all
    known: Set[str] = set()
    for name, count in _LIGHTS.items():
        if taken.get(name) is None:
            continue
        lights = _lights_of(taken[name], count, name)
        known.update(key for key, _ in lights if key)
        taken[name] = [(list(numbers), gains.get(key, 1.0) if key else 1.0)
                       for key, numbers in lights]
    for key, value in gains.items():
        if not 0 <= value <= 1e6:
            raise ValueError(f"gain: found {value} of {key}, expected a factor from 0 to 1e6")
        if key not in known:
            raise ValueError(f'gain: no light has the name "{key}": found '
                             f"{', '.join(sorted(known)) or 'none'}")
    for name in ("ground_albedo", "albedo"):
        if taken.get(name) is not None:
            taken[name] = list(numbers_of(taken[name], (3,), name))
    return taken


def size_of(size: Any) -> List[int]:
    """Width and height of (1280, 960) or "1280x960"."""
    words = size.lower().split("x") if isinstance(size, str) else size
    try:
        width, height = (int(word) for word in words)
    except (TypeError, ValueError):
        width = height = 0
    if width < 1 or height < 1:
        raise ValueError(f'size: found {size!r}, expected (width, height) or "1280x960"')
    return [width, height]


def crop_of(crop: Any) -> List[int]:
    """Columns x0 to x1 - 1 and rows y0 to y1 - 1 of a picture."""
    numbers = numbers_of(crop, (4,), "crop")
    x0, y0, x1, y1 = window = [int(number) for number in numbers]
    if list(numbers) != window or x0 >= x1 or y0 >= y1:
        raise ValueError(f"crop: found {crop!r}, expected x0, y0, x1, y1, whole numbers: columns x0 to "
                         "x1 - 1, rows y0 to y1 - 1")
    return window


_DETAILS = ("pixels", "max_solid_angle", "stereo", "fov", "size", "camera_crop")


def with_cameras(options: Mapping[str, Any]) -> Dict[str, Any]:
    """The same options, with cameras as seven numbers: eye, look-at, field of view (NaN: `fov`)."""
    taken = dict(options)
    if taken.get("camera") is not None:
        cameras = [numbers_of(each, (6, 7), "camera") for each in _several(taken["camera"])]
        taken["camera"] = [list((*camera, math.nan)[:7]) for camera in cameras]
    if taken.get("camera_file") is not None:
        files: Iterable[Any] = taken["camera_file"]
        taken["camera_file"] = [path_of(each) for each in ([files] if is_path(files) else files)]
    if taken.get("size") is not None:
        taken["size"] = size_of(taken["size"])
    if taken.get("camera_crop") is not None:
        taken["camera_crop"] = crop_of(taken["camera_crop"])
    if not taken.get("camera") and not taken.get("camera_file"):
        for name in _DETAILS:
            if taken.get(name) is not None:
                raise ValueError(f"{name.replace('camera_', '')}: found no camera, expected camera or "
                                 "camera_file with it")
    return taken
