"""Clouds of any format as dicts of arrays."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any, Dict, Iterable, Iterator, List, Mapping, Optional, Union

import numpy as np

from . import _surfeit
from ._arguments import Memory, PathLike, chunks_of, memory_bytes, options_of, path_of
from ._errors import DataWarning

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from .settings import ReadSettings, Up

# Rows that `read_chunks` takes at a time: some 50 MB of a usual cloud.
CHUNK_ROWS = 1_000_000

Arrays = Dict[str, np.ndarray]


class _Reader:
    """An open cloud, and where the columns of its channels stand."""

    def __init__(self, path: PathLike, only: Optional[Iterable[str]], settings: Mapping[str, Any]):
        self.input = _surfeit.CloudInput(path_of(path), options_of(settings))
        self.columns = dict(self.input.columns)
        self.channels = list(self.input.channels)
        if only is not None:
            wanted = [only] if isinstance(only, str) else list(only)
            names = [name for name, _ in self.channels]
            for name in wanted:
                if name not in names:
                    raise ValueError(f"{path_of(path)}: found no channel {name}, expected one of "
                                     + " ".join(names))
            self.channels = [each for each in self.channels if each[0] in wanted]

    def read(self, rows: int) -> Arrays:
        """At most so many rows; all arrays empty at the end."""
        targets: Dict[str, np.ndarray] = {}
        arrays: Arrays = {}
        for name, columns in self.channels:
            dtype = np.result_type(*(self.columns[column] for column in columns))
            is_same = all(self.columns[column] == dtype for column in columns)
            if len(columns) == 1:
                targets[columns[0]] = arrays[name] = np.empty(rows, dtype)
            elif is_same:
                arrays[name] = np.empty((rows, len(columns)), dtype)
                for i, column in enumerate(columns):
                    targets[column] = arrays[name][:, i]
            else:
                for column in columns:
                    targets[column] = np.empty(rows, self.columns[column])
        count = self.input.read(rows, [targets.get(column) for column in self.columns])
        for name, columns in self.channels:
            if name not in arrays:
                arrays[name] = np.stack([targets[column] for column in columns], axis=1)
        return {name: arrays[name][:count] for name, _ in self.channels}


def read(path: PathLike, only: Optional[Iterable[str]] = None,
         **settings: "Unpack[ReadSettings]") -> Arrays:
    """Reads a cloud of any format, or a scene as one, whole.

    only: channels to read; default: all.
    settings: how the file is read: surfeit.settings.ReadSettings.

    Returns arrays by channel, in the types of the file: "position" (n, 3), "normal" (n, 3),
    "radius" (n,), "radiosity" (n, 3), ... docs/files.md names the channels.
    """
    reader = _Reader(path, only, settings)
    return reader.read(max(1, reader.input.count))


def read_chunks(path: PathLike, rows: int = CHUNK_ROWS, only: Optional[Iterable[str]] = None,
                **settings: "Unpack[ReadSettings]") -> Iterator[Arrays]:
    """The same in chunks of at most `rows` rows. One chunk is in memory at a time."""
    if rows < 1:
        raise ValueError(f"rows: found {rows}, expected 1 or more")
    reader = _Reader(path, only, settings)

    def chunks() -> Iterator[Arrays]:
        left = reader.input.count
        while left > 0:
            chunk = reader.read(min(rows, left))
            count = len(next(iter(chunk.values()))) if chunk else 0
            if count == 0:
                return
            left -= count
            yield chunk

    return chunks()


def write(path: PathLike, arrays: Union[Mapping[str, Any], Iterable[Mapping[str, Any]]], *,
          up: "Optional[Up]" = None, comments: Iterable[str] = (), memory: Memory = None) -> int:
    """Writes a cloud; the name tells the format. The file appears when it is complete.

    arrays: a dict of arrays by channel, (n,) or (n, values), or an iterable of such dicts, which
        all have the same channels and types: one chunk is in memory at a time. float32, float64 and
        integers of up to 32 bits are not copied.
    up: axis that the file states to be up, where the format can.
    memory: budget of formats that hold all rows until the end (OpenVDB).

    Returns the number of rows.
    """
    is_whole = isinstance(arrays, Mapping)
    chunks = chunks_of(arrays)
    first = next(chunks, None)
    if first is None:
        raise ValueError(f"{path_of(path)}: found no chunk, expected one or more")
    options = options_of({}, up=up, comments=list(comments))
    if memory is not None:
        options["memory"] = memory_bytes(memory)
    if is_whole and first:
        options["count"] = len(first[0][1])
    output = _surfeit.CloudOutput(path_of(path), first, options)
    count = 0
    chunk: Optional[List[Any]] = first
    while chunk is not None:
        output.write(chunk)
        count += len(chunk[0][1])
        chunk = next(chunks, None)
    output.finish()
    for note in output.notes():
        warnings.warn(note, DataWarning, stacklevel=2)
    return count
