"""Arguments of Python in the form that the binding takes."""

from __future__ import annotations

import os
import re
import warnings
from typing import Any, Dict, Iterator, List, Mapping, Optional, Sequence, Tuple, Union

import numpy as np

from . import _surfeit
from ._errors import DataWarning
from ._looks import look_of
from ._watch import _level_of_caller

PathLike = Union[str, "os.PathLike[str]"]
Memory = Union[int, str, None]

_SIZE = re.compile(r"\s*([0-9]*\.?[0-9]+)\s*(?:([KMGT])i?B?|B)?\s*", re.IGNORECASE)
_UNITS = {"K": 1, "M": 2, "G": 3, "T": 4}

# Columns of channels of three values whose names are not the channel's with _x, _y, _z.
_COLUMNS = {
    "position": ("x", "y", "z"),
    "normal": ("nx", "ny", "nz"),
    "color": ("red", "green", "blue"),
}
_COLORS = frozenset(
    "radiosity albedo power irradiance reflection environment fluence indirectdiffuse".split()
)


def path_of(path: PathLike) -> str:
    return os.fsdecode(os.fspath(path))


def memory_bytes(memory: Memory) -> int:
    """Bytes of a budget: 512 << 20, "512M" (powers of 1024), "80%" of what the job may hold."""
    if memory is None:
        return 0
    if not isinstance(memory, str):
        if memory < 1:
            raise ValueError(f"memory: found {memory}, expected 1 byte or more, or \"512M\"")
        return int(memory)
    text = memory.strip()
    if text.endswith("%"):
        try:
            percent = float(text[:-1])
        except ValueError:
            percent = 0
        if not 0 < percent <= 100:
            raise ValueError(f'memory: found "{memory}", expected more than 0% and at most 100%')
        return int(_surfeit.memory_limit() * percent / 100)
    match = _SIZE.fullmatch(text)
    size = int(float(match[1]) * 1024 ** _UNITS.get((match[2] or "").upper(), 0)) if match else 0
    if size < 1:
        raise ValueError(f'memory: found "{memory}", expected a size such as 512M or 2G, or 80%')
    return size


def matrix_of(transform: Any, name: str = "transform") -> Tuple[float, ...]:
    """The 12 numbers of a 3x4 matrix, or of a 4x4 one whose last row is 0 0 0 1."""
    if transform is None:
        return (1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0)
    matrix = np.asarray(transform, dtype=np.float64)
    if matrix.shape == (4, 4) and np.array_equal(matrix[3], (0, 0, 0, 1)):
        matrix = matrix[:3]
    if matrix.shape != (3, 4):
        raise ValueError(
            f"{name}: found shape {matrix.shape}, expected (3, 4), or (4, 4) with 0 0 0 1 last"
        )
    return tuple(float(value) for value in matrix.ravel())


# Metres of units, as `surfeit convert --units` has them.
_METRES = {"m": 1, "cm": 0.01, "mm": 0.001, "km": 1000, "in": 0.0254, "ft": 0.3048,
           "us-ft": 1200 / 3937}


def scaled(transform: Any, units: Optional[str]) -> Any:
    """The transform of what is scaled before, by "ft:m"."""
    if units is None:
        return transform
    try:
        before, after = (_METRES[word] if word in _METRES else float(word)
                         for word in units.split(":"))
    except (AttributeError, ValueError):
        before = after = 0
    if not (0 < before < float("inf") and 0 < after < float("inf")):
        raise ValueError(f"units: found {units!r}, expected FROM:TO, each {', '.join(_METRES)} or the "
                         "metres of a unit, such as ft:m or 0.5:m")
    matrix = np.array(matrix_of(transform)).reshape(3, 4)
    matrix[:, :3] *= before / after
    return matrix


def options_of(options: Mapping[str, Any], **more: Any) -> Dict[str, Any]:
    """Options for the binding: without None, paths as text, arrays of few numbers as lists."""
    taken = {**options, **more}
    if "memory" in taken:
        taken["memory"] = memory_bytes(taken["memory"])
    for name in ("transform", "from_space", "to_space"):
        if taken.get(name) is not None:
            taken[name] = matrix_of(taken[name], name)
    if isinstance(taken.get("stage_limit"), str):
        taken["stage_limit"] = memory_bytes(taken["stage_limit"])
    for name in ("temporary_directory", "stage", "trajectory", "like", "passes", "brick", "caustic_photons"):
        if taken.get(name) is not None:
            taken[name] = path_of(taken[name])
    for name in ("origin", "cube", "eye", "sensor", "crop"):
        if isinstance(taken.get(name), np.ndarray):
            taken[name] = taken[name].tolist()
    if isinstance(taken.get("environment"), os.PathLike):
        taken["environment"] = path_of(taken["environment"])
    if taken.get("text") is not None:
        text = f"--text={taken.pop('text')}"
        taken["channels"] = f"{taken['channels']},{text}" if taken.get("channels") else text
    look_of(taken)
    return {name: value for name, value in taken.items() if value is not None}


# What arrays are called that mean a channel of ours, and are not read as one.
_MISNOMERS = {
    "color": ("colors", "colour", "colours", "rgb", "rgba", "cd"),
    "normal": ("normals", "n"),
    "position": ("positions", "points", "point", "xyz", "vertices", "p"),
    "radius": ("radii",),
    "area": ("areas",),
    "albedo": ("albedos", "reflectance"),
    "group": ("groups",),
}
# Channels of a number of values that is fixed.
_VALUES = {"position": (3,), "normal": (3,), "color": (3, 4), "radiosity": (3,), "albedo": (3,),
           "long_side": (3,), "radius": (1,), "area": (1,), "coverage": (1,), "opacity": (1, 3),
           "group": (1,), "two_sided": (1,)}
_LARGEST_EXACT = 2**53


def _warn(message: str) -> None:
    warnings.warn(message, DataWarning, stacklevel=_level_of_caller())


def _check_channels(arrays: Mapping[str, Any]) -> None:
    """Refuses known channels of another shape, and tells what is called like them."""
    for name, value in arrays.items():
        shape = np.shape(value)
        expected = _VALUES.get(name)
        values = shape[1] if len(shape) == 2 else 1
        if expected and len(shape) in (1, 2) and values not in expected:
            wanted = " or ".join("(n,)" if count == 1 else f"(n, {count})" for count in expected)
            raise ValueError(f"{name}: found shape {shape}, expected {wanted}")
        for channel, others in _MISNOMERS.items():
            is_like = len(shape) == (2 if _VALUES[channel][0] == 3 else 1)
            if is_like and name.lower() in others and channel not in arrays:
                _warn(f"{name}: not read as {channel}, which is its name here")


def _plain(array: np.ndarray, name: str) -> np.ndarray:
    """The same numbers in a type that clouds have; a copy only where they have another one."""
    dtype = array.dtype
    if dtype == np.bool_:
        return array.view(np.uint8)
    if dtype.kind == "f":
        wanted = np.float32 if dtype.itemsize <= 4 else np.float64
        return array.astype(wanted, copy=False)
    if dtype.kind not in "iu":
        return array  # refused by the binding, which names it
    if dtype.itemsize <= 4:
        return array.astype(dtype.newbyteorder("="), copy=False)
    for integer in ("int32", "uint32"):
        limits = np.iinfo(integer)
        if array.size == 0 or (array.min() >= limits.min and array.max() <= limits.max):
            return array.astype(integer)
    if array.max() > _LARGEST_EXACT or array.min() < -_LARGEST_EXACT:
        _warn(f"{name}: integers of 64 bits become float64, exact to 2^53")
    return array.astype(np.float64)


def _unmasked(values: Any, name: str) -> np.ndarray:
    """As an array; masked values have no number, and are refused."""
    if isinstance(values, np.ma.MaskedArray) and np.ma.is_masked(values):
        raise ValueError(f"{name}: found {np.ma.count_masked(values)} masked values, expected numbers: "
                         "leave their rows out, or give them numbers with .filled()")
    return np.asarray(values)


def columns_of_channel(name: str, values: int) -> Sequence[str]:
    """Names of the columns of a channel: "normal" and 3 values are nx, ny, nz."""
    if values == 1:
        return (name,)
    if values == 3 and name in _COLUMNS:
        return _COLUMNS[name]
    if values == 4 and name == "color":
        return (*_COLUMNS[name], "alpha")
    if values == 3:
        return [f"{name}_{letter}" for letter in ("rgb" if name in _COLORS else "xyz")]
    return [f"{name}_{i}" for i in range(values)]


def _sh_columns(coefficients: int) -> List[str]:
    return [f"sh{i}_{letter}" for i in range(coefficients) for letter in "rgb"]


def columns_of(arrays: Mapping[str, Any]) -> List[Tuple[str, np.ndarray]]:
    """Columns of one dimension, from channels (n,), (n, k) or, for radiance_sh, (n, 9, 3)."""
    _check_channels(arrays)
    columns: List[Tuple[str, np.ndarray]] = []
    for name, value in arrays.items():
        array = _plain(_unmasked(value, name), name)
        if array.ndim == 1:
            columns.append((name, array))
            continue
        if array.ndim == 3 and name == "radiance_sh":
            names: Sequence[str] = _sh_columns(array.shape[1])
            array = array.reshape(len(array), -1)
        elif array.ndim == 2:
            names = columns_of_channel(name, array.shape[1])
        else:
            raise ValueError(f"{name}: found shape {array.shape}, expected (n,) or (n, values)")
        columns += [(column, array[:, i]) for i, column in enumerate(names)]
    return columns


def is_path(source: Any) -> bool:
    return isinstance(source, (str, os.PathLike))


def paths_of(source: Any) -> Optional[List[str]]:
    """The paths where `source` is a path or a list of paths, else None."""
    if is_path(source):
        return [path_of(source)]
    if isinstance(source, (list, tuple)) and source and all(is_path(each) for each in source):
        return [path_of(each) for each in source]
    return None


def listed(source: Any, name: str) -> List[str]:
    """A path or several as a list of paths."""
    paths = paths_of(source)
    if paths is None:
        raise TypeError(f"{name}: found {type(source).__name__}, expected a path or several")
    return paths


def shard_of(shard: Any) -> Tuple[int, int, int]:
    """First, last and count of (3, 16) or "3/16"."""
    words = shard.split("/") if isinstance(shard, str) else shard
    try:
        number, count = (int(word) for word in words)
    except (TypeError, ValueError):
        number = count = 0
    if not 1 <= number <= count:
        raise ValueError(f'shard: found {shard!r}, expected (I, N) or "I/N", such as "3/16", with I '
                         "from 1 to N")
    return number, number, count


def component(name: str, function: str) -> Any:
    """A function of the binding that needs a component of the library."""
    found = getattr(_surfeit, function, None)
    if found is None:
        raise NotImplementedError(f"{function}: this build of surfeit lacks the component {name}: "
                                  f"build it with -D SURFEIT_BUILD_{name.upper()}=ON")
    return found


def leading_shape(positions: Any) -> Tuple[np.ndarray, Tuple[int, ...]]:
    """Positions (..., 3) as (n, 3), and what stood in place of n."""
    array = _unmasked(positions, "positions")
    if array.ndim == 0 or array.shape[-1] != 3:
        raise ValueError(f"positions: found shape {array.shape}, expected (..., 3)")
    return array.reshape(-1, 3), array.shape[:-1]


def flat(vectors: Any) -> Optional[np.ndarray]:
    if vectors is None:
        return None
    array = _unmasked(vectors, "normals or views")
    return array if array.ndim == 2 else array.reshape(-1, array.shape[-1] if array.ndim else 1)


def chunks_of(source: Any) -> Iterator[List[Tuple[str, np.ndarray]]]:
    """The columns of each dict of an iterable, or of the one dict."""
    for chunk in [source] if isinstance(source, Mapping) else source:
        if not isinstance(chunk, Mapping):
            raise TypeError(f"found a chunk of type {type(chunk).__name__}, expected a dict of arrays")
        yield columns_of(chunk)
