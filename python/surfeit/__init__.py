"""Ambient occlusion, color bleeding and reflections from surfel clouds larger than memory.

    import surfeit

    surfeit.index({"position": P, "normal": N}, "scene.sft", memory="1G")
    scene = surfeit.Engine(memory="512M").open("scene.sft")
    occlusion = scene.gather(P, N, quality="draft")["occlusion"]

docs/python.md is an introduction.
"""

from . import settings
from ._errors import DamagedFile, DataWarning, Incomplete
from ._surfeit import __version__, set_read_retries
from .bakes import BrickMap, brick, generate, radiance
from .clouds import read, read_chunks, write
from .engine import Engine, Gatherer, Scene
from .gathers import cube, gather, merge, tune
from .jobs import bounce, convert, index, info, lookup, normals, verify
from .meshes import relight, sample
from .pictures import composite, view

# Words of the outputs of a gather.
OUTPUTS = ("occlusion", "irradiance", "bent_normal", "illumination_direction", "environment",
           "fluence", "radiance_sh")

# Meanings of the numbers in the "kind" of a cube.
CUBE_KINDS = ("nothing", "flat node", "facet", "rough node", "patch", "traced")

__all__ = [
    "BrickMap", "CUBE_KINDS", "DamagedFile", "DataWarning", "Engine", "Gatherer", "Incomplete",
    "OUTPUTS", "Scene", "__version__", "bounce", "brick", "composite", "convert", "cube", "gather",
    "generate", "index", "info", "lookup", "merge", "normals", "radiance", "read", "read_chunks",
    "relight", "sample", "set_read_retries", "settings", "tune", "verify", "view", "write",
]
