"""Gathers from file to file, at once or in shards, and what they are told by.

Notes, progress and statistics are as in surfeit.jobs.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Dict, Mapping, Optional, Sequence, Tuple, Union

from . import _surfeit
from ._arguments import PathLike, component, listed, options_of, path_of, shard_of
from ._groups import names_of_scene, with_numbers
from ._lights import crop_of
from ._watch import ProgressLike, Watcher
from .engine import Scene

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from .settings import CubeSettings, GatherJobSettings, JobSettings

Stats = Dict[str, Any]


def scene_path(scene: Union[PathLike, Scene]) -> str:
    return scene.path if isinstance(scene, Scene) else path_of(scene)


def watch(progress: ProgressLike, settings: Mapping[str, Any]) -> Watcher:
    return Watcher(progress, bool(settings.get("strict")))


def _gather_options(scene: str, settings: Mapping[str, Any], crop: Any = None) -> Stats:
    """Groups by name as numbers; a crop as the filter that it stands for."""
    options = with_numbers(options_of(settings), lambda: names_of_scene(scene))
    if crop is not None:
        x0, y0, x1, y1 = crop_of(crop)
        window = (f"pixel_x >= {x0} and pixel_x < {x1} and pixel_y >= {y0} and pixel_y < {y1}")
        kept = options.get("filter")
        options["filter"] = f"({kept}) and {window}" if kept else window
    return options


def gather(scene: Union[PathLike, Scene], receivers: PathLike, output: PathLike, *,
           crop: Any = None, shard: Any = None, resume: bool = False,
           resume_parts: Optional[int] = None, dry_run: bool = False,
           progress: ProgressLike = None, **settings: "Unpack[GatherJobSettings]") -> Stats:
    """Gathers at every record of the cloud `receivers` and writes it with the outputs to `output`.

    For clouds of any size: receivers and results lie in files. For receivers in arrays see
    Engine.open and Scene.gather. Settings: surfeit.settings.GatherJobSettings.

    crop: (x0, y0, x1, y1), only receivers of these pixels of passes.
    shard: (3, 16) or "3/16", gathers the third of 16 parts into a file beside `output`; `merge`
        writes the result. A part that is there is skipped.
    resume: gathers part by part, and goes on where a call with the same arguments was stopped;
        resume_parts: their number.
    dry_run: writes nothing, and returns an estimate of memory, files and time.
    """
    if resume_parts is not None and not resume:
        raise ValueError("resume_parts: found without resume=True, whose parts they are")
    if sum((shard is not None, resume, dry_run)) > 1:
        raise ValueError("expected one of shard, resume and dry_run")
    at = scene_path(scene)
    options = _gather_options(at, settings, crop)
    names = (at, path_of(receivers), path_of(output))
    with watch(progress, settings) as watcher:
        if dry_run:
            return _surfeit.forecast_gather(*names[:2], options, watcher)
        if shard is not None:
            return _surfeit.gather_shards(*names, shard_of(shard), options, watcher)
        if resume:
            return _surfeit.gather_resumable(*names, resume_parts or 0, options, watcher)
        return _surfeit.gather(*names, options, watcher)


def merge(scene: Union[PathLike, Scene], receivers: PathLike, output: PathLike, *,
          shards: Optional[int] = None, remove_shards: bool = False, progress: ProgressLike = None,
          **settings: "Unpack[JobSettings]") -> Stats:
    """Writes the result of a gather from its shards: the bytes of one gather.

    shards: their number; default: as the files beside `output` say. remove_shards: once the result
    is complete. Raises surfeit.Incomplete, which names the shards that are missing.
    """
    options = options_of(settings, shards=shards, remove_shards=remove_shards)
    with watch(progress, settings) as watcher:
        return _surfeit.merge(scene_path(scene), path_of(receivers), path_of(output), options,
                              watcher)


def tune(scene: Union[PathLike, Scene], receivers: PathLike, *, sample_receivers: int = 500_000,
         check: bool = False, crop: Any = None, progress: ProgressLike = None,
         **settings: "Unpack[GatherJobSettings]") -> Stats:
    """Predicts cache misses and time of a gather for budgets of any size, from a sample.

    Returns a dict with "rows" and a denser "curve" of budgets, each with "memory_bytes",
    "cache_bytes" and "predicted": hit rates, bytes read and seconds; and "recommended", the
    smallest budget whose time is within 5 % of the time with the whole scene in memory.
    check: runs the gather in every budget; rows then have "measured".
    """
    at = scene_path(scene)
    options = {**_gather_options(at, settings, crop), "sample_receivers": sample_receivers,
               "check": check}
    with watch(progress, settings) as watcher:
        return _surfeit.tune(at, path_of(receivers), options, watcher)


# Settings of a cube that are not of its gather.
_PICTURE = ("show", "zoom", "exposure", "up")


def cube(scene: Union[PathLike, Scene], at: Optional[Sequence[float]] = None,
         normal: Optional[Sequence[float]] = None, view: Optional[Sequence[float]] = None, *,
         receivers: Optional[PathLike] = None, number: int = 0, picture: Optional[PathLike] = None,
         reference: Any = None, rays: int = 8, progress: ProgressLike = None,
         **settings: "Unpack[CubeSettings]") -> Dict[str, Any]:
    """The raster cube of one receiver: what it sees, pixel by pixel.

    at: position; normal: default: the whole sphere; view: with glossy.
    receivers, number: row of a cloud that is the receiver, from 0, instead of `at`.
    picture: writes the cube, .png or .exr, too, with light in every mode; show: panels of a PNG,
        some of light, coverage, depth, layers, kind; zoom, exposure, up. Needs the component `view`.
    reference: meshes to trace rays on, `rays` along an edge of a pixel; the result has them under
        "reference". Needs the component `sample`.

    Returns arrays (faces, n, n): "coverage" and "pixel_occlusion" (0 to 1), "depth" (inf: open),
    "solid_angle" (steradians), "weight", "layers", "filled", "kind" (surfeit.CUBE_KINDS); arrays
    (faces, n, n, 3): "direction", "light", "pixel_environment"; "faces": forward, u and v of each
    of the six (one for a narrow cone); the results "occlusion", "irradiance", "environment"; and
    the receiver, "at" and "normal".
    """
    if (at is None) == (receivers is None):
        raise ValueError("expected either at or receivers")
    for name in settings:
        if name.startswith("bounce_"):
            raise TypeError(f"{name}: a cube has the light before the look of bounce light")
    path = scene_path(scene)
    given: Mapping[str, Any] = settings
    drawing = {name: given[name] for name in _PICTURE if given.get(name) is not None}
    options = _gather_options(path, {name: value for name, value in given.items()
                                     if name not in _PICTURE})
    if picture is not None:
        options.setdefault("outputs", ["occlusion", "irradiance"])
    with watch(progress, settings) as watcher:
        receiver = _receiver_of(at, normal, view, receivers, number, options, watcher)
        gathered = _surfeit.cube(path, receiver, options, watcher)
        arrays = gathered.arrays()
        traced = None
        if reference is not None:
            tracing = {"rays": rays, **{name: options[name] for name in
                                        ("sides", "max_distance", "threads") if name in options}}
            traced = component("sample", "trace_cube")(gathered, listed(reference, "reference"),
                                                       tracing, watcher)
            arrays["reference"] = traced.arrays()
        if picture is not None:
            _draw(path, path_of(picture), gathered, traced, drawing, options)
        return arrays


def _receiver_of(at: Any, normal: Any, view: Any, receivers: Optional[PathLike], number: int,
                 options: Mapping[str, Any], watcher: Watcher) -> Any:
    def numbers(vector: Any) -> Tuple[float, ...]:
        return tuple(float(value) for value in (vector if vector is not None else (0, 0, 0)))

    if receivers is None:
        return _surfeit.Receiver(numbers(at), numbers(normal), numbers(view))
    reading = {name: options[name] for name in ("channels", "part", "filter") if name in options}
    return _surfeit.read_receiver(path_of(receivers), number, reading, watcher)


def _draw(scene: str, picture: str, gathered: Any, traced: Any, drawing: Mapping[str, Any],
          options: Mapping[str, Any]) -> None:
    """Up is as in the scene, unless it is given."""
    given = {"up": _surfeit.scene_info(scene)["up"], **drawing}
    if isinstance(given.get("show"), str):
        given["show"] = given["show"].split(",")
    if "memory" in options:
        given["memory"] = options["memory"]
    component("view", "write_cube_picture")(picture, gathered, traced, given)
