"""Triangle meshes to surfels and photons, and other light for scenes. Needs the component `sample`.

Meshes are PLY files, OBJ files with their MTL, or hair (.hair); they are held in memory, some 100
bytes a triangle. Light is scene-linear rgb: intensities in W/sr, irradiance in W/m2, radiance in
W/(m2 sr). Notes, progress and statistics are as in surfeit.jobs.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Dict, Optional, Sequence, Union

from ._arguments import PathLike, component, listed, options_of, path_of
from ._lights import with_cameras, with_lights
from ._watch import ProgressLike
from .engine import Scene
from .gathers import scene_path, watch

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from .settings import RelightSettings, SampleSettings

Stats = Dict[str, Any]

# Settings that are of surfels or of photons alone.
_OF_SURFELS = ("count", "spacing", "group_by", "two_sided", "camera", "camera_file", "crop")
_OF_PHOTONS = ("seed", "caustic_photons")


def sample(meshes: Union[PathLike, Sequence[PathLike]], output: PathLike, *,
           photons: Optional[int] = None, dry_run: bool = False, progress: ProgressLike = None,
           **settings: "Unpack[SampleSettings]") -> Stats:
    """Writes a cloud of surfels of triangle meshes with direct light, or a photon map.

    photons: number of photons to send from the lights; the output is where they arrive, for
        surfeit.radiance, instead of surfels.
    dry_run: writes nothing, and returns an estimate of memory, files and time.
    settings: count or spacing or camera, light_point, ...: surfeit.settings.SampleSettings.
    """
    wrong = _OF_PHOTONS if photons is None else _OF_SURFELS
    for name in wrong:
        if settings.get(name) is not None:
            raise ValueError(f"{name}: found with{'out' if photons is None else ''} photons, expected "
                             f"it with{'' if photons is None else 'out'} them")
    chosen = [name for name in ("count", "spacing", "camera", "camera_file")
              if settings.get(name) is not None]
    if len(chosen) > 1 and chosen != ["camera", "camera_file"]:
        raise ValueError(f"{' and '.join(chosen)}: expected one of them")
    taken: Dict[str, Any] = dict(settings)
    strict = {"strict": taken.pop("strict", False)}
    if "crop" in taken:
        taken["camera_crop"] = taken.pop("crop")
    options = options_of(with_cameras(with_lights(taken)), photons=photons, dry_run=dry_run)
    function = "sample" if photons is None else "photons"
    with watch(progress, strict) as watcher:
        return component("sample", function)(listed(meshes, "meshes"), path_of(output), options,
                                             watcher)


def relight(scene: Union[PathLike, Scene], output: PathLike, *, mesh: Any = None, gain: Any = None,
            add: bool = False, mesh_light: bool = True, dry_run: bool = False,
            progress: ProgressLike = None,
            **settings: "Unpack[RelightSettings]") -> Stats:
    """Writes the scene with other direct light at its surfels, or with one light more.

    mesh: triangle meshes that cast shadows; default: none, so that light passes through everything.
        Those with emission give light, too, unless mesh_light=False.
    gain: factor of the new light, or of lights by name: {"key": 2, "fill": .5} with
        light_point={"key": (x, y, z, r, g, b)}.
    add: adds to the light of the scene instead of taking its place: lights in layers.
    dry_run: writes nothing, and returns an estimate of memory, files and time.
    settings: light_point, light_directional, ...: surfeit.settings.RelightSettings.
    """
    taken: Dict[str, Any] = dict(settings)
    strict = {"strict": taken.pop("strict", False)}
    options = options_of(with_lights(taken, gain), add=add, mesh_light=mesh_light, dry_run=dry_run,
                         mesh=None if mesh is None else listed(mesh, "mesh"))
    with watch(progress, strict) as watcher:
        return component("sample", "relight")(scene_path(scene), path_of(output), options, watcher)
