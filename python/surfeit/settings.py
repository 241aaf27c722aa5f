"""Keyword arguments that several functions take. docs/engine.md and `surfeit gather --help` say more.

For annotations alone: at run time they are plain dicts.
"""

from __future__ import annotations

import os
from typing import Any, Literal, Sequence, TypedDict, Union

Up = Literal["x", "y", "z"]


class QualitySettings(TypedDict, total=False):
    """Accuracy of a gather. Lengths are in the units of the cloud."""

    quality: Literal["draft", "standard", "final"]  # sets what follows where it is not given
    max_solid_angle: float  # steradians, >= 0: larger nodes are opened
    raster_resolution: int  # pixels along a cube face, even, 2 to 64
    near_field_radii: float  # surfels closer than so many radii are ray traced
    bias: float  # start of rays above the receiver, in surfel radii
    max_distance: float  # surfels farther away do not count
    max_variation: float  # interpolates where results vary less; 0: never
    sides: Literal["front", "both", "back"]  # sides of surfels that cover


class GatherSettings(QualitySettings, total=False):
    """Everything that decides about the result at a receiver, except scene and environment."""

    mode: Literal["occlusion", "bleeding", "glossy"]
    outputs: Union[str, Sequence[str]]  # words of `surfeit.OUTPUTS`; default: by the mode
    groups: Union[str, Sequence[int]]  # object groups that send light and cover: "0,2-5"
    eye: Sequence[float]  # with glossy: viewpoint of receivers without a view
    distribution: Literal["cosine", "uniform"]
    cone_angle: float  # radians, up to pi / 2; 0: the hemisphere
    roughness: float  # with glossy: above 0, up to 1
    falloff: float  # occlusion fades with distance at this rate; 0: not at all
    falloff_mode: Literal["exponential", "polynomial"]
    environment_rotation: float  # radians about the up axis
    environment_intensity: float  # factor, >= 0
    environment_up: Up  # default: the scene's


class EngineSettings(GatherSettings, total=False):
    environment: Any  # array (height, width, 3) of radiances: lat-long, the top row up


class ReadSettings(TypedDict, total=False):
    """How clouds are read."""

    channels: str  # new names, "FROM=TO,FROM=TO"
    part: str  # grid, layer or element to read
    filter: str  # "classification == 2"
    color_range: Literal["auto", "8", "16", "unit"]


class JobSettings(TypedDict, total=False):
    """Resources of a job on files."""

    memory: Union[int, str, None]  # budget: bytes, "512M", or "80%" of what the job may hold
    threads: int  # default: all that the job may use
    strict: bool  # raises DataWarning instead of warning; refuses invalid records
    temporary_directory: Union[str, "os.PathLike[str]"]


class GatherJobSettings(GatherSettings, ReadSettings, JobSettings, total=False):
    environment: Union[str, "os.PathLike[str]"]  # picture: lat-long, or OpenEXR cube
    order: Literal["curve", "morton", "input"]  # order in which receivers are gathered
    cache_split: float  # part of the cache for nodes, 0 to 1; default: found by measurement
    direct_io: bool  # reads past the page cache of the system
    prefetch: bool  # reads ahead when reading is slow


class LookupSettings(ReadSettings, JobSettings, total=False):
    """How baked values are looked up; ReadSettings are for the receivers."""

    values: Sequence[str]  # channels of the map; default: its gathered ones
    interpolation: Literal["smooth", "nearest"]  # of a cloud
    max_distance: float  # of a cloud; default: 8 times the spacing of its points
    filter_width: float  # of a brick map; default: its finest voxels
    missing: float  # for receivers without a value nearby; default: NaN
    from_space: Any  # matrix (3, 4) or (4, 4) from the object's space to the receivers'
    to_space: Any  # and to that of the map
    pref: str  # channel of reference positions to look up at
    nref: str  # and of normals there
    map_channels: str  # new names for channels of a cloud
    map_filter: str  # condition for points of a cloud


class NormalSettings(TypedDict, total=False):
    """Which way normals point that are found from the neighbours."""

    toward: Literal["up", "sensor", "outward", "consistent", "trajectory"]
    sensor: Sequence[float]  # place that all points were seen from
    trajectory: Union[str, "os.PathLike[str]"]  # cloud of the sensor's places; only `normals`
    thin: Literal["spheres", "two-sided"]  # points on no surface


class IndexSettings(ReadSettings, JobSettings, NormalSettings, total=False):
    leaf_capacity: int  # most surfels in a leaf, 1 to 4096
    disk_overlap: float  # disk area over surfel area where one is missing, 1 to 16
    overlap: Literal["keep", "thin"]  # surfels that repeat another
    full_precision: bool  # keeps floats instead of quantized values
    origin: Sequence[float]  # of positions in the scene
    cube: Sequence[float]  # root cube: least x, y, z and size, as info()["cube"]
    up: Up  # default: as the clouds state, else y
    normals: Literal["none", "estimate"]  # for surfels without a normal
