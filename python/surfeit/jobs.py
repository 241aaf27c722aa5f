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
from ._arguments import (Memory, PathLike, columns_of, is_path, listed, options_of, path_of,
                         paths_of, scaled, shard_of)
from ._errors import DamagedFile
from ._groups import group_corrections, group_glosses, names_of_scene, with_numbers
from ._lights import with_cameras
from ._watch import ProgressLike, Watcher
from .clouds import write
from .engine import Scene
from .gathers import scene_path, watch

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from .settings import (BounceSettings, ConvertSettings, IndexSettings, JobSettings, LookupSettings,
                           NormalsSettings, ReadSettings, Up)

Stats = Dict[str, Any]


def index(source: Union[Mapping[str, Any], PathLike, Sequence[PathLike],
                        Iterable[Mapping[str, Any]]],
          output: PathLike, *, group: Any = None, pass_: Optional[str] = None, shard: Any = None,
          shards: Optional[int] = None, remove_shards: bool = False, dry_run: bool = False,
          progress: ProgressLike = None, **settings: "Unpack[IndexSettings]") -> Stats:
    """Builds a scene (.sft).

    source: one of
        - a dict of arrays by channel: "position" (n, 3) is needed; "normal" (n, 3), "radius" (n,),
          "area" (n,), "radiosity" (n, 3), "albedo" (n, 3), "two_sided" (n,), "group" (n,),
          "long_side" (n, 3), "opacity" (n,) or, for red, green and blue, (n, 3), "color" (n, 3:
          uint8 or uint16 sRGB, or linear floats). They are not copied and not counted in the budget;
        - a path or several, of clouds of any format;
        - an iterable of such dicts with the same channels. They go through a temporary file.
    group: {"lamp": path or paths, ...}, clouds whose surfels are an object group of that name, for
        groups="lamp" of a gather; `source` may then be an empty list.
    settings: memory (default 1G), threads, normals="estimate", ...: surfeit.settings.IndexSettings.
    dry_run: writes nothing, and returns an estimate of memory, files and time. Files alone.

    An index by many processes, of files alone (docs/farm.md): pass_="count", "distribute" and
    "build", each with shard=(1, 4) to (4, 4) or "1/4"; where sizes or normals follow from
    neighbours, "places" with shard=(1, 4) and "sizes" with every shard; then pass_="merge",
    shards=4, with remove_shards=True to remove their files.

    The scene depends on the surfels alone: the same arrays from a file give the same bytes. What is
    missing is filled in by the rules of docs/format.md, with a DataWarning each.
    """
    options = _index_options(settings, group)
    with watch(progress, settings) as watcher:
        paths = [] if group and not isinstance(source, Mapping) and source in ([], ()) else \
            paths_of(source)
        if paths is None and (group or pass_ or shard or shards or dry_run):
            raise ValueError("group, pass_, shard, shards and dry_run are of clouds in files, found "
                             "arrays: surfeit.write makes files of them")
        if paths is not None:
            return _index_files(paths, path_of(output), options, watcher, pass_, shard, shards,
                                remove_shards, dry_run)
        if isinstance(source, Mapping):
            return _index_arrays(source, path_of(output), options, watcher)
        return _index_chunks(source, path_of(output), options, watcher)


def _index_options(settings: Mapping[str, Any], group: Any) -> Stats:
    """Named groups as pairs; the cube of another scene, and its origin, as numbers."""
    options = options_of(settings)
    like = options.get("cube")
    if like is not None and (is_path(like) or isinstance(like, Scene)):
        info = _surfeit.scene_info(scene_path(like))
        options["cube"] = list(info["cube"])
        options.setdefault("origin", list(info["origin"]))
    if group is not None:
        if not isinstance(group, Mapping):
            raise TypeError(f"group: found {type(group).__name__}, expected a dict of paths by name")
        options["group"] = [(name, path) for name, source in group.items()
                            for path in listed(source, f"group: {name}")]
    return options


def _index_files(paths: List[str], output: str, options: Stats, watcher: Watcher,
                 pass_: Optional[str], shard: Any, shards: Optional[int], remove_shards: bool,
                 dry_run: bool) -> Stats:
    if pass_ is None:
        if shard is not None or shards is not None or remove_shards:
            raise ValueError("shard, shards and remove_shards are of one pass of an index in shards, "
                             "expected pass_")
        return (_surfeit.forecast_index if dry_run else _surfeit.index_files)(
            paths, output, options, watcher)
    if pass_ not in ("count", "distribute", "build", "places", "sizes", "merge"):
        raise ValueError(f"pass_: found {pass_!r}, expected count, distribute, build, places, sizes or "
                         "merge")
    if dry_run:
        raise ValueError("dry_run estimates a whole index, expected no pass_")
    if pass_ == "merge":
        if shard is not None or not shards:
            raise ValueError('pass_="merge" writes the scene from all shards, expected their number '
                             "(shards) and no shard")
        return _surfeit.merge_index(paths, output, shards, remove_shards, options, watcher)
    if shard is None or shards is not None or remove_shards:
        raise ValueError(f'pass_="{pass_}" is of one shard, expected shard alone')
    return _surfeit.index_shards(paths, output, pass_, shard_of(shard), options, watcher)


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


def convert(inputs: Union[PathLike, Sequence[PathLike]], output: PathLike, *,
            every: Optional[int] = None, spacing: Optional[float] = None,
            units: Optional[str] = None, transform: Any = None,
            up: "Optional[Up]" = None, crop: Any = None, keep: Optional[Sequence[str]] = None,
            drop: Optional[Sequence[str]] = None,
            assignments: Optional[Sequence[str]] = None, like: Optional[PathLike] = None,
            memory: Memory = None, temporary_directory: Optional[PathLike] = None,
            dry_run: bool = False, strict: bool = False, progress: ProgressLike = None,
            **settings: "Unpack[ConvertSettings]") -> Stats:
    """Writes the records of all inputs to one cloud; its name tells the format.

    every: takes every n-th record. spacing: keeps one record per cell of a grid of this edge.
    units: scales from one unit to another, "ft:m"; transform: affine (3, 4) or (4, 4) matrix. up: turns this axis up. crop: corners ((x, y, z),
    (x, y, z)) of a box in the output. keep, drop: channels. assignments: channel arithmetic, such as
    "radiosity *= 0.5 where group == 3". like: a file of the output's format
    with the data that is not in rows. camera, camera_file, pixels, ...: thins for cameras
    (surfeit.settings.CameraSettings). dry_run: writes nothing, and returns an estimate of files and
    time.
    """
    paths = listed(inputs, "inputs")
    options = options_of(with_cameras(settings), every=every, spacing=spacing,
                         transform=scaled(transform, units), up=up,
                         crop=crop, keep=keep, drop=drop, assignments=assignments, like=like,
                         memory=memory, dry_run=dry_run,
                         temporary_directory=temporary_directory)
    with Watcher(progress, strict) as watcher:
        return _surfeit.convert(paths, path_of(output), options, watcher)


def normals(cloud: PathLike, output: PathLike, *, sizes: bool = False, up: "Optional[Up]" = None,
            dry_run: bool = False, progress: ProgressLike = None,
            **settings: "Unpack[NormalsSettings]") -> Stats:
    """Writes the cloud with normals from the neighbours of every point.

    toward: "up" (default), "outward", "consistent", "sensor" with sensor=(x, y, z), "trajectory"
    with trajectory=path. thin: "spheres" or "two-sided", for points on no surface. sizes: writes
    radius and area, too. dry_run: writes nothing, and returns an estimate of files and time.
    """
    with watch(progress, settings) as watcher:
        return _surfeit.normals(path_of(cloud), path_of(output),
                                options_of(settings, sizes=sizes, up=up, dry_run=dry_run),
                                watcher)


def bounce(scene: Union[PathLike, Scene], output: PathLike, bounces: int = 1, *,
           surfels_per_receiver: Optional[int] = None, spare_last: bool = False, groups: Any = None,
           group_gain: Any = None, group_saturation: Any = None, group_tint: Any = None,
           glossy: Any = None, dry_run: bool = False, progress: ProgressLike = None,
           **settings: "Unpack[BounceSettings]") -> Stats:
    """Writes the scene with the radiosity after 1 to 100 bounces of light.

    surfels_per_receiver: all bounces but the last are gathered at one surfel of so many, 1 to 64,
    and interpolated; spare_last: the last one, too.
    groups: object groups that send light and cover, by number or name: "0,2-5", ["lamp", "tree"].
    group_gain, group_saturation, group_tint: of the light that surfels of object groups reflect, by
    number or name: {"walls": .5, "2,5-7": 2}, and for the tint {"curtain": (1, .9, .8)}.
    glossy: the part of it, 0 to 1, that goes into a lobe around the mirror direction, and the
    roughness of the lobe, .05 to 1: {"floor": (.8, .2)}, or {"floor": .8} of roughness .2.
    bounce_gain, bounce_filter, ...: surfeit.settings.LookSettings.
    dry_run: writes nothing, and returns an estimate of memory, files and time.
    """
    if spare_last and surfels_per_receiver is None:
        raise ValueError("spare_last: found without surfels_per_receiver, by which the last bounce is "
                         "spared")
    path = scene_path(scene)
    options = options_of(settings, bounces=bounces, surfels_per_receiver=surfels_per_receiver,
                         spare_last=spare_last, groups=groups, dry_run=dry_run)
    options = with_numbers(options, lambda: names_of_scene(path))
    corrections = group_corrections(path, group_gain=group_gain, group_saturation=group_saturation,
                                    group_tint=group_tint)
    if corrections is not None:
        options["group_corrections"] = corrections
    if glossy is not None:
        options["glossy"] = group_glosses(path, glossy)
    with watch(progress, settings) as watcher:
        return _surfeit.bounce(path, path_of(output), options, watcher)


def lookup(map: PathLike, receivers: PathLike, output: PathLike, *,
           dry_run: bool = False, progress: ProgressLike = None,
           **settings: "Unpack[LookupSettings]") -> Stats:
    """Writes the receivers with the values that the baked cloud or brick map has at their places.

    Only values count whose surface faces as the receiver does. Returns counts, among them
    "missing_receivers", which found none. Settings: surfeit.settings.LookupSettings.
    dry_run: writes nothing, and returns an estimate of memory, files and time.
    """
    with watch(progress, settings) as watcher:
        return _surfeit.lookup(path_of(map), path_of(receivers), path_of(output),
                               options_of(settings, dry_run=dry_run), watcher)


def verify(scene: Union[PathLike, Scene], *, memory: Memory = None, threads: Optional[int] = None,
           progress: ProgressLike = None) -> Stats:
    """Checks every checksum and invariant of a scene.

    Returns "findings", a line for each damage (at most 100), "finding_count", "pages_checked" and
    "bytes_checked". A sound scene has no findings.
    """
    with Watcher(progress) as watcher:
        return _surfeit.verify(scene_path(scene), options_of({}, memory=memory, threads=threads),
                               watcher)


def info(path: Union[PathLike, Scene], *, progress: ProgressLike = None,
         **settings: "Unpack[ReadSettings]") -> Stats:
    """Contents and density of a scene or a cloud; "kind" is "scene" or "cloud".

    A scene has "group_names", the names of its object groups by number.
    """
    with Watcher(progress) as watcher:
        return _surfeit.info(scene_path(path), options_of(settings), watcher)
