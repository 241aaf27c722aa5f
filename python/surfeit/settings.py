"""Keyword arguments that several functions take. docs/engine.md and `surfeit gather --help` say more.

For annotations alone: at run time they are plain dicts.
"""

from __future__ import annotations

import os
from typing import Any, Literal, Mapping, Sequence, Tuple, TypedDict, Union

Path = Union[str, "os.PathLike[str]"]
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
    max_pixel_dist: int  # with max_variation: most receivers between samples, 4 and more; 0: any
    sides: Literal["front", "both", "back"]  # sides of surfels that cover


class GatherSettings(QualitySettings, total=False):
    """Everything that decides about the result at a receiver, except scene and environment."""

    mode: Literal["occlusion", "bleeding", "glossy"]
    outputs: Union[str, Sequence[str]]  # words of `surfeit.OUTPUTS`; default: by the mode
    # Object groups that send light and cover, by number or name: "0,2-5", "lamp", [0, "tree"]
    groups: Union[str, int, Sequence[Union[int, str]]]
    # Factors of the light that object groups send: {"key": 2, 3: .5}, "key=2,fill=.5"
    gain: Union[str, Mapping[Union[int, str], float]]
    eye: Sequence[float]  # with glossy: viewpoint of receivers without a view
    distribution: Literal["cosine", "uniform"]
    cone_angle: float  # radians, up to pi / 2; 0: the hemisphere
    roughness: float  # with glossy: above 0, up to 1
    falloff: float  # occlusion fades with distance at this rate; 0: not at all
    falloff_mode: Literal["exponential", "polynomial"]
    environment_rotation: float  # radians about the up axis
    environment_intensity: float  # factor, >= 0
    environment_up: Up  # default: the scene's
    occlusion_by_brightness: bool  # covered part of the environment's light, not of the directions


class LookSettings(TypedDict, total=False):
    """The look of bounce light (docs/many_gathers.md): gain * tint * max(0, Y + saturation (E - Y)).

    A filter is a dict or a text of words, "centre=0,1,2 radius=1,3 gain=.5": `centre` (x, y, z) and
    `radius` (inner, outer), where it fades; `direction` (x, y, z) and `angle` (inner, outer) from
    it, in degrees; gain, saturation, tint.
    """

    bounce_gain: float  # factor, 0 to 1e6
    bounce_saturation: float  # 0: grey; 1: as it is
    bounce_tint: Sequence[float]  # factors of red, green and blue
    bounce_filter: Union[str, Mapping[str, Any], Sequence[Union[str, Mapping[str, Any]]]]


class EngineSettings(GatherSettings, LookSettings, total=False):
    environment: Any  # array (height, width, 3) of radiances: lat-long, the top row up


class ReadSettings(TypedDict, total=False):
    """How clouds are read."""

    channels: str  # new names, "FROM=TO,FROM=TO"
    part: str  # grid, layer or element to read
    filter: str  # "classification == 2"
    text: Literal["decimal-comma", "decimal-point"]  # commas in text; default: as the lines tell
    color_range: Literal["auto", "8", "10", "12", "16", "unit"]


class JobSettings(TypedDict, total=False):
    """Resources of a job on files."""

    memory: Union[int, str, None]  # budget: bytes, "512M", or "80%" of what the job may hold
    threads: int  # default: all that the job may use
    strict: bool  # raises DataWarning instead of warning; refuses invalid records
    temporary_directory: Union[str, "os.PathLike[str]"]


class _GatherJobSettings(GatherSettings, ReadSettings, JobSettings, total=False):
    environment: Path  # picture: lat-long, or OpenEXR cube
    order: Literal["curve", "morton", "input"]  # order in which receivers are gathered
    cache_split: float  # part of the cache for nodes, 0 to 1; default: found by measurement
    direct_io: bool  # reads past the page cache of the system
    prefetch: bool  # reads ahead when reading is slow


class GatherJobSettings(_GatherJobSettings, LookSettings, total=False):
    """A gather from file to file; the look is of the output irradiance alone."""

    stage: Union[str, "os.PathLike[str]"]  # directory of this machine for pages of the scene
    stage_limit: Union[int, str]  # most bytes there


class CubeSettings(_GatherJobSettings, total=False):
    show: Union[str, Sequence[str]]  # panels of a PNG: light, coverage, depth, layers, kind
    zoom: int  # edge of a pixel in a PNG
    exposure: float  # stops, of light in a PNG
    up: Up  # in the picture; default: the scene's


class BounceSettings(QualitySettings, LookSettings, JobSettings, total=False):
    cache_split: float  # part of the cache for nodes, 0 to 1; default: found by measurement
    direct_io: bool  # reads past the page cache of the system


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


class NormalsSettings(NormalSettings, ReadSettings, JobSettings, total=False):
    """How normals are found, and how the cloud is read."""


class IndexSettings(ReadSettings, JobSettings, NormalSettings, total=False):
    leaf_capacity: int  # most surfels in a leaf, 1 to 4096
    disk_overlap: float  # disk area over surfel area where one is missing, 1 to 16
    overlap: Literal["keep", "thin"]  # surfels that repeat another
    full_precision: bool  # keeps floats instead of quantized values
    origin: Sequence[float]  # of positions in the scene
    cube: Any  # root cube: least x, y, z and size, as info()["cube"], or another scene with its cube
    up: Up  # default: as the clouds state, else y
    normals: Literal["none", "estimate"]  # for surfels without a normal


class CameraSettings(TypedDict, total=False):
    """Cameras that decide how densely surfels lie (docs/surfels.md, "Surfels for cameras")."""

    # (ex, ey, ez, lx, ly, lz), eye and look-at, or with the field of view behind; one or several
    camera: Union[str, Sequence[Any]]
    camera_file: Union[Path, Sequence[Path]]  # texts with such a camera a line
    pixels: float  # edge of a surfel in view
    max_solid_angle: float  # largest surfel out of view, steradians
    stereo: float  # distance of two eyes for each camera
    fov: float  # vertical field of view of cameras without their own, degrees
    size: Union[str, Tuple[int, int]]  # pixels of the pictures: (1280, 960), "1280x960"


class ConvertSettings(ReadSettings, CameraSettings, total=False):
    """How clouds are read, and thinned for cameras."""


class LightSettings(TypedDict, total=False):
    """Lights, one or several, as runs of numbers or texts of them; in a dict they have names."""

    light_point: Any  # (x, y, z, r, g, b): position, intensity
    light_directional: Any  # (dx, dy, dz, r, g, b): direction it travels in, irradiance facing it
    light_area: Any  # (cx, cy, cz, ux, uy, uz, vx, vy, vz, r, g, b): centre, half edges, radiance
    light_samples: int  # shadow rays per rectangle light, and for all emissive triangles
    falloff: float  # of points and rectangles: 1 / distance^falloff, 0 to 8
    falloff_distance: float  # where all falloffs give the same light
    ground_plane: bool  # a square below the meshes
    ground_size: float  # its edge over the diagonal of the scene
    ground_albedo: Sequence[float]
    up: Up  # from the ground; default: y
    threads: int
    strict: bool  # raises DataWarning instead of warning


class RelightSettings(LightSettings, total=False):
    shadow_bias: float  # least distance above a surfel where shadow rays start


class SampleSettings(LightSettings, CameraSettings, total=False):
    count: int  # surfels; default: a million
    spacing: float  # distance between surfels, instead of a count
    crop: Sequence[int]  # (x0, y0, x1, y1): pixels of the cameras that are in view
    group_by: Literal["file", "object", "material"]  # object groups with names
    two_sided: bool  # both sides send and block light
    emission: bool  # surfels of emissive surfaces carry the emission, too
    albedo: Sequence[float]  # of meshes without colors and materials
    curve_width: float  # diameter of hair and of lines of OBJ files
    strands: int  # at most so many strands of each file
    seed: int  # of photons
    caustic_photons: Path  # cloud of the photons that come over mirrors or through glass


class BrickSettings(JobSettings, total=False):
    channel: Union[str, Sequence[str]]  # channels to keep; default: the outputs of a gather
    max_error: float  # divides a voxel where a value differs by more; 0: keeps the finest ones
    voxel_size: float  # edge of the finest voxels; default: twice the spacing of the points
    filter: str  # "classification == 2"
    color_range: Literal["auto", "8", "10", "12", "16", "unit"]


class RadianceSettings(ReadSettings, JobSettings, total=False):
    photons_per_estimate: int  # 1 to 10000
    max_radius: float  # photons farther away do not count; default: 16 times the median
    albedo: Sequence[float]  # of photons without one
    disk_overlap: float  # disk area over surfel area, 1 to 16


class GenerateSettings(TypedDict, total=False):
    kind: Literal["terrain", "city", "volume"]
    seed: int
    order: Literal["scan", "shuffled"]
    outlier: float  # metres from the middle to one more surfel
    duplicates: float  # percentage of records that repeat an earlier one
    threads: int


class PictureSettings(TypedDict, total=False):
    channel: str  # to show; default: the most telling one
    exposure: float  # stops, of light in a PNG
    background: Sequence[float]  # of a PNG, display values, 0 to 1
    range: Sequence[float]  # values shown black and white
    memory: Union[int, str, None]
    strict: bool  # raises DataWarning instead of warning


class CompositeSettings(PictureSettings, total=False):
    reduce: int  # pixels along an edge that become one, 1 to 16


class ViewSettings(PictureSettings, ReadSettings, total=False):
    mode: Literal["discs", "points", "normals"]
    eye: Sequence[float]  # default: so that the bounds fill the picture
    look_at: Sequence[float]  # default: the middle of the bounds
    up: Union[Up, Sequence[float]]  # axis or direction; default: the cloud's
    fov: float  # vertical field of view, degrees
    size: Union[str, Tuple[int, int]]  # pixels: (1280, 960), "1280x960"
    samples: int  # along each edge of a pixel, 1 to 8
    point_size: float  # of points, pixels
    radius: float  # of every surfel
    radius_scale: float  # times the cloud's
    cull_back: bool  # leaves out disks that are seen from behind
    brick: Path  # brick map whose values the surfels show
    filter_width: float  # over which it averages; default: the diameter of the surfel
    threads: int
