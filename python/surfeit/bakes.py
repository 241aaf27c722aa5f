"""What makes clouds and maps beside the gather: brick maps, surfels of photons, generated scenes.

Notes, progress and statistics are as in surfeit.jobs.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Dict, List, Sequence, Tuple, Union

import numpy as np

from . import _surfeit
from ._arguments import (Memory, PathLike, flat, leading_shape, listed, memory_bytes, options_of,
                         path_of)
from ._looks import numbers_of
from ._watch import ProgressLike, Watcher
from .gathers import watch

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from .settings import BrickSettings, GenerateSettings, RadianceSettings

Stats = Dict[str, Any]


def brick(clouds: Union[PathLike, Sequence[PathLike]], output: PathLike, *,
          dry_run: bool = False, progress: ProgressLike = None,
          **settings: "Unpack[BrickSettings]") -> Stats:
    """Writes baked values of clouds into a brick map (.vdb), for surfeit.BrickMap and `lookup`.

    Settings: surfeit.settings.BrickSettings. dry_run: writes nothing, and returns an estimate of
    memory, files and time.
    """
    taken: Dict[str, Any] = dict(settings)
    if isinstance(taken.get("channel"), str):
        taken["channel"] = taken["channel"].split(",")
    with watch(progress, settings) as watcher:
        return _surfeit.brick(listed(clouds, "clouds"), path_of(output),
                              options_of(taken, dry_run=dry_run), watcher)


class BrickMap:
    """An open brick map (docs/brick.md). Safe from any thread.

    memory: budget of its pages: bytes or "64M" (default).
    """

    def __init__(self, path: PathLike, memory: Memory = None):
        self._map = _surfeit.BrickMap(path_of(path), memory_bytes(memory))

    @property
    def channels(self) -> List[Tuple[str, List[str]]]:
        """Names of the channels, and of the numbers of each."""
        return self._map.channels

    @property
    def voxel_sizes(self) -> List[float]:
        """Edges of the voxels of each level, the finest first."""
        return self._map.voxel_sizes

    @property
    def stats(self) -> Dict[str, int]:
        """Bytes of the pages in the cache now, and of the list of pages."""
        return {"cached_bytes": self._map.cached_bytes,
                "directory_bytes": self._map.directory_bytes}

    def lookup(self, positions: Any, normals: Any = None, *, filter_width: float = 0,
               missing: float = float("nan"), progress: ProgressLike = None
               ) -> Dict[str, np.ndarray]:
        """The values at places on surfaces, by channel: float32 arrays (...) or (..., values).

        positions: (..., 3), in units of the map. normals: (..., 3), or None: of any surface.
        filter_width: width over which values are averaged; 0: the finest voxels.
        missing: where no point that faces that way is near.
        """
        places, shape = leading_shape(positions)
        with Watcher(progress) as watcher:
            values, found = self._map.lookup(places, flat(normals), filter_width, watcher)
        values[~found] = missing
        arrays: Dict[str, np.ndarray] = {}
        begin = 0
        for name, properties in self.channels:
            end = begin + len(properties)
            part = np.ascontiguousarray(values[:, begin:end])
            arrays[name] = part.reshape(shape if len(properties) == 1 else (*shape, len(properties)))
            begin = end
        return arrays


def radiance(photons: Union[PathLike, Sequence[PathLike]], output: PathLike, *,
             dry_run: bool = False, progress: ProgressLike = None,
             **settings: "Unpack[RadianceSettings]") -> Stats:
    """Writes surfels with the radiosity that a photon map stands for, one for each photon.

    Settings: surfeit.settings.RadianceSettings. dry_run: writes nothing, and returns an estimate of
    memory, files and time.
    """
    taken: Dict[str, Any] = dict(settings)
    if taken.get("albedo") is not None:
        taken["albedo"] = list(numbers_of(taken["albedo"], (3,), "albedo"))
    with watch(progress, settings) as watcher:
        return _surfeit.radiance(listed(photons, "photons"), path_of(output),
                                 options_of(taken, dry_run=dry_run), watcher)


def generate(output: PathLike, *, surfels: Union[int, str, None] = None, part: Any = None,
             recipe: bool = False, progress: ProgressLike = None,
             **settings: "Unpack[GenerateSettings]") -> Stats:
    """Writes a generated scene, the same on every machine (docs/generate.md).

    surfels: number, or "500k", "10M", "1G". part: (2, 5) or "2/5", the second of five runs.
    recipe: writes a file of a few lines that stands for the cloud instead, and returns {}.
    settings: kind, seed, order, ...: surfeit.settings.GenerateSettings.
    """
    if isinstance(surfels, str):
        surfels = _surfeit.parse_surfel_count(surfels)
    if part is not None and not isinstance(part, str):
        part = "/".join(str(number) for number in part)
    options = options_of(settings, surfels=surfels, part=part, recipe=recipe)
    with Watcher(progress) as watcher:
        return _surfeit.generate(path_of(output), options, watcher)
