"""Ambient occlusion, color bleeding and reflections from surfel clouds larger than memory.

    import surfeit

    surfeit.index({"position": P, "normal": N}, "scene.sft", memory="1G")
    scene = surfeit.Engine(memory="512M").open("scene.sft")
    occlusion = scene.gather(P, N, quality="draft")["occlusion"]

docs/python.md is an introduction.
"""

from . import settings
from ._errors import DamagedFile, DataWarning
from ._surfeit import __version__
from .clouds import read, read_chunks, write
from .engine import Engine, Gatherer, Scene
from .jobs import bounce, convert, cube, gather, index, info, lookup, normals, tune, verify

# Words of the outputs of a gather.
OUTPUTS = ("occlusion", "irradiance", "bent_normal", "illumination_direction", "environment",
           "fluence", "radiance_sh")

# Meanings of the numbers in the "kind" of a cube.
CUBE_KINDS = ("nothing", "flat node", "facet", "rough node", "patch", "traced")

__all__ = [
    "CUBE_KINDS", "DamagedFile", "DataWarning", "Engine", "Gatherer", "OUTPUTS", "Scene",
    "__version__", "bounce", "convert", "cube", "gather", "index", "info", "lookup", "normals",
    "read", "read_chunks", "settings", "tune", "verify", "write",
]
