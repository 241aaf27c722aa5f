"""Pictures of clouds and of render passes. Needs the component `view`.

Notes, progress and statistics are as in surfeit.jobs.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Dict, Optional, Sequence, Union

from ._arguments import PathLike, component, listed, options_of, path_of
from ._lights import size_of
from ._looks import numbers_of
from ._watch import ProgressLike
from .engine import Scene
from .gathers import scene_path, watch

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from .settings import CompositeSettings, ViewSettings

Stats = Dict[str, Any]


def _picture_options(settings: Any, **more: Any) -> Dict[str, Any]:
    taken: Dict[str, Any] = {**settings, **more}
    taken.pop("strict", None)
    for name, count in (("eye", 3), ("look_at", 3), ("background", 3), ("range", 2)):
        if taken.get(name) is not None:
            taken[name] = list(numbers_of(taken[name], (count,), name))
    if taken.get("up") is not None and taken["up"] not in ("x", "y", "z"):
        taken["up_direction"] = list(numbers_of(taken.pop("up"), (3,), "up"))
    if taken.get("size") is not None:
        taken["size"] = size_of(taken["size"])
    return options_of(taken)


def view(source: Union[PathLike, Scene], picture: Optional[PathLike] = None, *,
         passes: Optional[PathLike] = None, progress: ProgressLike = None,
         **settings: "Unpack[ViewSettings]") -> Stats:
    """Draws a cloud or a scene into `picture`, .png or .exr.

    passes: writes what every pixel sees as OpenEXR, receivers for a gather, with or without picture.
    settings: eye, look_at, size, channel, ...: surfeit.settings.ViewSettings.

    Returns statistics, among them the camera that was used: "eye" and "look_at".
    """
    if picture is None and passes is None:
        raise ValueError("expected picture or passes, or both")
    options = _picture_options(settings, passes=passes)
    with watch(progress, settings) as watcher:
        return component("view", "view")(scene_path(source), "" if picture is None else path_of(picture),
                                         options, watcher)


def composite(inputs: Union[PathLike, Sequence[PathLike]], picture: PathLike, *,
              progress: ProgressLike = None, **settings: "Unpack[CompositeSettings]") -> Stats:
    """Makes a picture, .png or .exr, of render passes and the light that was gathered at them.

    inputs: OpenEXR pictures; the first decides the pixels, and the others add the channels that it
    lacks. Settings: surfeit.settings.CompositeSettings.
    """
    with watch(progress, settings) as watcher:
        return component("view", "composite")(listed(inputs, "inputs"), path_of(picture),
                                              _picture_options(settings), watcher)
