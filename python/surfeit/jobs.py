"""Jobs from files to files, in a memory budget. Their results appear when they are complete.

All of them release the GIL, stop on Ctrl-C within half a second and leave nothing behind then.
`progress` is True for a bar of tqdm, where that is installed, or a function of phase, done, total
and unit. They return statistics as dicts (docs/stats.md): times in seconds, sizes in bytes.
"""

from __future__ import annotations

import os
import tempfile
from typing import TYPE_CHECKING, Any, Dict, Iterable, List, Mapping, Optional, Sequence, Tuple, Union

from . import _surfeit
from ._arguments import Memory, PathLike, columns_of, options_of, path_of, paths_of
from ._errors import DamagedFile
from ._watch import ProgressLike, Watcher
from .clouds import write
from .engine import Scene

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from .settings import (GatherJobSettings, IndexSettings, JobSettings, LookupSettings, NormalSettings,
                           QualitySettings, ReadSettings, Up)

Stats = Dict[str, Any]


def _scene_path(scene: Union[PathLike, Scene]) -> str:
    return scene.path if isinstance(scene, Scene) else path_of(scene)


def _watch(progress: ProgressLike, settings: Mapping[str, Any]) -> Watcher:
    return Watcher(progress, bool(settings.get("strict")))


def index(source: Union[Mapping[str, Any], PathLike, Sequence[PathLike],
                        Iterable[Mapping[str, Any]]],
          output: PathLike, *, progress: ProgressLike = None,
          **settings: "Unpack[IndexSettings]") -> Stats:
    """Builds a scene (.sft).

    source: one of
        - a dict of arrays by channel: "position" (n, 3) is needed; "normal" (n, 3), "radius" (n,),
          "area" (n,), "radiosity" (n, 3), "albedo" (n, 3), "two_sided" (n,), "group" (n,),
          "long_side" (n, 3), "color" (n, 3: uint8 or uint16 sRGB, or linear floats). They are not
          copied and not counted in the budget;
        - a path or several, of clouds of any format;
        - an iterable of such dicts with the same channels. They go through a temporary file.
    settings: memory (default 1G), threads, normals="estimate", ...: surfeit.settings.IndexSettings.

    The scene depends on the surfels alone: the same arrays from a file give the same bytes. What is
    missing is filled in by the rules of docs/format.md, with a DataWarning each.
    """
    options = options_of(settings)
    with _watch(progress, settings) as watcher:
        if isinstance(source, Mapping):
            return _index_arrays(source, path_of(output), options, watcher)
        paths = paths_of(source)
        if paths is not None:
            return _surfeit.index_files(paths, path_of(output), options, watcher)
        return _index_chunks(source, path_of(output), options, watcher)


def _index_arrays(arrays: Mapping[str, Any], output: str, options: Stats,
                  watcher: Watcher) -> Stats:
    try:
        return _surfeit.index_arrays(columns_of(arrays), output, options, watcher)
    except DamagedFile as damage:  # what would be a damaged cloud are wrong arguments here
        raise ValueError(str(damage)) from None


def _index_chunks(chunks: Any, output: str, options: Stats,
                  watcher: Watcher) -> Stats:
    """The indexer reads its input twice, and an iterator cannot be read again."""
    directory = options.get("temporary_directory") or os.environ.get("SLURM_TMPDIR") or \
        os.environ.get("TMPDIR") or os.path.dirname(os.path.abspath(output))
    with tempfile.TemporaryDirectory(prefix=".surfeit_", dir=directory) as spool:
        cloud = os.path.join(spool, "chunks.ply")
        write(cloud, chunks)
        return _surfeit.index_files([cloud], output, options, watcher)


def gather(scene: Union[PathLike, Scene], receivers: PathLike, output: PathLike, *,
           progress: ProgressLike = None, **settings: "Unpack[GatherJobSettings]") -> Stats:
    """Gathers at every record of the cloud `receivers` and writes it with the outputs to `output`.

    For clouds of any size: receivers and results lie in files. For receivers in arrays see
    Engine.open and Scene.gather. Settings: surfeit.settings.GatherJobSettings.
    """
    with _watch(progress, settings) as watcher:
        return _surfeit.gather(_scene_path(scene), path_of(receivers), path_of(output),
                               options_of(settings), watcher)


def tune(scene: Union[PathLike, Scene], receivers: PathLike, *, sample_receivers: int = 500_000,
         check: bool = False, progress: ProgressLike = None,
         **settings: "Unpack[GatherJobSettings]") -> Stats:
    """Predicts cache misses and time of a gather for budgets of any size, from a sample.

    Returns a dict with "rows" and a denser "curve" of budgets, each with "memory_bytes",
    "cache_bytes" and "predicted": hit rates, bytes read and seconds; and "recommended", the
    smallest budget whose time is within 5 % of the time with the whole scene in memory.
    check: runs the gather in every budget; rows then have "measured".
    """
    options = options_of(settings, sample_receivers=sample_receivers, check=check)
    with _watch(progress, settings) as watcher:
        return _surfeit.tune(_scene_path(scene), path_of(receivers), options, watcher)


def convert(inputs: Union[PathLike, Sequence[PathLike]], output: PathLike, *,
            every: Optional[int] = None, spacing: Optional[float] = None, transform: Any = None,
            up: "Optional[Up]" = None, crop: Any = None, keep: Optional[Sequence[str]] = None,
            drop: Optional[Sequence[str]] = None,
            assignments: Optional[Sequence[str]] = None, like: Optional[PathLike] = None,
            memory: Memory = None, temporary_directory: Optional[PathLike] = None,
            strict: bool = False, progress: ProgressLike = None,
            **settings: "Unpack[ReadSettings]") -> Stats:
    """Writes the records of all inputs to one cloud; its name tells the format.

    every: takes every n-th record. spacing: keeps one record per cell of a grid of this edge.
    transform: affine (3, 4) or (4, 4) matrix. up: turns this axis up. crop: corners ((x, y, z),
    (x, y, z)) of a box in the output. keep, drop: channels. assignments: channel arithmetic, such as
    "radiosity *= 0.5 where group == 3". like: a file of the output's format
    with the data that is not in rows.
    """
    paths = paths_of(inputs)
    if paths is None:
        raise TypeError(f"inputs: found {type(inputs).__name__}, expected a path or several")
    options = options_of(settings, every=every, spacing=spacing, transform=transform, up=up,
                         crop=crop, keep=keep, drop=drop, assignments=assignments, like=like,
                         memory=memory,
                         temporary_directory=temporary_directory)
    with Watcher(progress, strict) as watcher:
        return _surfeit.convert(paths, path_of(output), options, watcher)


def normals(cloud: PathLike, output: PathLike, *, sizes: bool = False, up: "Optional[Up]" = None,
            progress: ProgressLike = None,
            **settings: "Unpack[_NormalsSettings]") -> Stats:
    """Writes the cloud with normals from the neighbours of every point.

    toward: "up" (default), "outward", "consistent", "sensor" with sensor=(x, y, z), "trajectory"
    with trajectory=path. thin: "spheres" or "two-sided", for points on no surface. sizes: writes
    radius and area, too.
    """
    with _watch(progress, settings) as watcher:
        return _surfeit.normals(path_of(cloud), path_of(output),
                                options_of(settings, sizes=sizes, up=up), watcher)


def bounce(scene: Union[PathLike, Scene], output: PathLike, bounces: int = 1, *,
           surfels_per_receiver: Optional[int] = None, groups: Any = None,
           progress: ProgressLike = None, **settings: "Unpack[_BounceSettings]") -> Stats:
    """Writes the scene with the radiosity after 1 to 100 bounces of light.

    surfels_per_receiver: all bounces but the last are gathered at one surfel of so many, 1 to 64,
    and interpolated.
    """
    options = options_of(settings, bounces=bounces, surfels_per_receiver=surfels_per_receiver,
                         groups=groups)
    with _watch(progress, settings) as watcher:
        return _surfeit.bounce(_scene_path(scene), path_of(output), options, watcher)


def lookup(map: PathLike, receivers: PathLike, output: PathLike, *,
           progress: ProgressLike = None, **settings: "Unpack[LookupSettings]") -> Stats:
    """Writes the receivers with the values that the baked cloud or brick map has at their places.

    Only values count whose surface faces as the receiver does. Returns counts, among them
    "missing_receivers", which found none. Settings: surfeit.settings.LookupSettings.
    """
    with _watch(progress, settings) as watcher:
        return _surfeit.lookup(path_of(map), path_of(receivers), path_of(output),
                               options_of(settings), watcher)


def verify(scene: Union[PathLike, Scene], *, memory: Memory = None, threads: Optional[int] = None,
           progress: ProgressLike = None) -> Stats:
    """Checks every checksum and invariant of a scene.

    Returns "findings", a line for each damage (at most 100), "finding_count", "pages_checked" and
    "bytes_checked". A sound scene has no findings.
    """
    with Watcher(progress) as watcher:
        return _surfeit.verify(_scene_path(scene), options_of({}, memory=memory, threads=threads),
                               watcher)


def info(path: Union[PathLike, Scene], *, progress: ProgressLike = None,
         **settings: "Unpack[ReadSettings]") -> Stats:
    """Contents and density of a scene or a cloud; "kind" is "scene" or "cloud"."""
    with Watcher(progress) as watcher:
        return _surfeit.info(_scene_path(path), options_of(settings), watcher)


def cube(scene: Union[PathLike, Scene], at: Sequence[float], normal: Optional[Sequence[float]] = None,
         view: Optional[Sequence[float]] = None, *, progress: ProgressLike = None,
         **settings: "Unpack[GatherJobSettings]") -> Dict[str, Any]:
    """The raster cube of one receiver: what it sees, pixel by pixel.

    at: position; normal: default: the whole sphere; view: with glossy.

    Returns arrays (faces, n, n): "coverage" and "pixel_occlusion" (0 to 1), "depth" (inf: open),
    "solid_angle" (steradians), "weight", "layers", "filled", "kind" (surfeit.CUBE_KINDS); arrays
    (faces, n, n, 3): "direction", "light", "pixel_environment"; "faces": forward, u and v of each
    of the six (one for a narrow cone); and the results "occlusion", "irradiance", "environment".
    """
    def numbers(vector: Any) -> Tuple[float, ...]:
        return tuple(float(value) for value in (vector if vector is not None else (0, 0, 0)))

    with _watch(progress, settings) as watcher:
        return _surfeit.cube(_scene_path(scene), numbers(at), numbers(normal), numbers(view),
                             options_of(settings), watcher)


if TYPE_CHECKING:

    class _NormalsSettings(NormalSettings, ReadSettings, JobSettings, total=False):
        pass

    class _BounceSettings(QualitySettings, JobSettings, total=False):
        cache_split: float
        direct_io: bool
