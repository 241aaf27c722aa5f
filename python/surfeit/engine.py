"""Scenes that stay open in one memory budget, and gathers at receivers in arrays."""

from __future__ import annotations

import threading
import uuid
import weakref
from typing import TYPE_CHECKING, Any, Dict, Iterable, List, Mapping, Optional, Tuple, Union

import numpy as np

from . import _surfeit
from ._arguments import (Memory, PathLike, flat, leading_shape, matrix_of, memory_bytes, options_of,
                         path_of)
from ._groups import names_of_scene, names_of_scenes, with_numbers
from ._looks import LOOK_SETTINGS
from ._watch import ProgressLike, Watcher

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from .settings import EngineSettings

# Worlds of one scene and some settings that a scene keeps gatherers of.
_KEPT_WORLDS = 4

# Engines of this process by their tokens, so that scenes that are unpickled share one.
_engines: "weakref.WeakValueDictionary[str, Engine]" = weakref.WeakValueDictionary()
_engines_lock = threading.Lock()


def _engine_of(token: str, *arguments: Any) -> "Engine":
    with _engines_lock:
        engine = _engines.get(token)
        if engine is None:
            engine = Engine(*arguments)
            engine._token = token
            _engines[token] = engine
        return engine


def _scene_of(engine: "Engine", path: str, matrix: Tuple[float, ...]) -> "Scene":
    with engine._lock:
        opened = engine._opened.get(path)
    return Scene(engine, opened or engine._open(path), matrix)


def _gather_into(gatherer: Any, positions: Any, normals: Any, views: Any, out: Any, order: str,
                 threads: int, look: Dict[str, Any], watcher: Watcher) -> Dict[str, np.ndarray]:
    if order not in ("curve", "input"):
        raise ValueError(f'order: found "{order}", expected curve or input')
    places, shape = leading_shape(positions)
    filled = None
    if out is not None:
        filled = {}
        for word, array in out.items():
            if not isinstance(array, np.ndarray) or array.shape[: len(shape)] != shape:
                raise ValueError(f"out[{word!r}]: found {np.shape(array)}, expected an array of "
                                 f"shape {shape} and, for vectors, 3")
            if not array.flags.c_contiguous:
                raise ValueError(f"out[{word!r}]: expected a contiguous array")
            filled[word] = array.reshape((len(places), *array.shape[len(shape):]))
    results = gatherer.gather(places, flat(normals), flat(views), filled, order == "input", threads, look,
                              watcher)
    if out is not None and set(out) - set(results):
        raise ValueError(f"out: {', '.join(sorted(set(out) - set(results)))}: no such output")
    return {word: array.reshape(shape + array.shape[1:]) for word, array in results.items()}


class Engine:
    """One memory budget and two caches for any number of scenes. Safe from any thread.

    memory: budget for pages of all scenes, directories and gatherers: bytes, "512M", or "80%" of
        what the job may hold. Arrays, Python and libraries are not counted. Default: three quarters
        of what the job may hold.
    threads: threads of a gather at many receivers. Default: the processors that the job may use.
    direct_io: reads scenes past the page cache of the system.
    lobes: room for the lobes of scenes of `bounce(glossy=...)`, which are refused without it.

    Raises MemoryError, which names the least budget that works.
    """

    def __init__(self, memory: Memory = None, threads: Optional[int] = None,
                 direct_io: bool = False, lobes: bool = False):
        self._arguments = (memory_bytes(memory), threads or 0, bool(direct_io),
                           bool(lobes))
        self._engine = _surfeit.Engine(*self._arguments)
        self._token: Optional[str] = None
        self._lock = threading.Lock()
        self._opened: "weakref.WeakValueDictionary[str, Any]" = weakref.WeakValueDictionary()

    def _open(self, path: str) -> Any:
        opened = self._engine.open(path)
        with self._lock:
            self._opened[path] = opened
        return opened

    def open(self, path: PathLike, transform: Any = None) -> "Scene":
        """Opens a scene (.sft). Reads its directory, no page.

        transform: (3, 4) or (4, 4) matrix that moves the scene into the world: a rotation, one
            scale and a shift. Default: the world has the coordinates of the cloud.
        """
        return Scene(self, self._open(path_of(path)), matrix_of(transform))

    def open_bytes(self, data: bytes, name: str = "scene", transform: Any = None) -> "Scene":
        """Opens the bytes of a scene file. They are copied and count as part of the budget."""
        return Scene(self, self._engine.open_bytes(data, name), matrix_of(transform))

    def gatherer(self, scenes: Union["Scene", Iterable["Scene"]],
                 **settings: "Unpack[EngineSettings]") -> "Gatherer":
        """A gatherer of one scene, or of several that see each other in one world.

        The same scene may stand in it many times: `[tree.placed(matrix) for matrix in places]`.
        For settings see surfeit.settings.EngineSettings.
        """
        placed = [scenes] if isinstance(scenes, Scene) else list(scenes)
        world, look = _split(settings)
        made = self._engine.gatherer([(scene._scene, scene._matrix) for scene in placed],
                                     _settings_of(world, placed))
        return Gatherer(self, made, look)

    @property
    def stats(self) -> Dict[str, Any]:
        """Counts since the engine was created; times in seconds, sizes in bytes (docs/stats.md)."""
        return self._engine.statistics()

    @property
    def windows(self) -> List[Dict[str, Any]]:
        """Statistics of both caches over time, in order."""
        return self._engine.windows()

    def __repr__(self) -> str:
        stats = self.stats
        return (f"surfeit.Engine(memory={stats['memory_bytes']}, threads={self._arguments[1]}): "
                f"{stats['scenes']} scenes, {stats['gatherers']} gatherers")

    def __reduce__(self):
        # In another process it becomes an engine with a budget of its own; in one, always the same
        with _engines_lock:
            if self._token is None:
                self._token = uuid.uuid4().hex
                _engines[self._token] = self
        return _engine_of, (self._token, *self._arguments)


class Scene:
    """An open scene and its place in the world. Immutable; safe from any thread.

    Pickles as a handle: the engine's options, the path and the transform.
    """

    def __init__(self, engine: Engine, scene: Any, matrix: Tuple[float, ...]):
        self._engine = engine
        self._scene = scene
        self._matrix = matrix
        self._worlds: Dict[Any, Any] = {}  # settings: (gatherer, idle ones), the oldest first
        self._lock = threading.Lock()

    @property
    def engine(self) -> Engine:
        return self._engine

    @property
    def path(self) -> str:
        return self._scene.path

    @property
    def transform(self) -> np.ndarray:
        """The (3, 4) matrix from the cloud's coordinates to the world's."""
        return np.array(self._matrix).reshape(3, 4)

    @property
    def info(self) -> Dict[str, Any]:
        """Contents of the file: counts, bytes, bounds in the cloud's coordinates."""
        return self._scene.info

    @property
    def group_names(self) -> Dict[int, str]:
        """Names of object groups by number. Reads the file again: not of a scene from bytes."""
        return dict(names_of_scene(self.path))

    def placed(self, transform: Any) -> "Scene":
        """The same open scene in another place. Takes no memory."""
        return Scene(self._engine, self._scene, matrix_of(transform))

    def gather(self, positions: Any, normals: Any = None, *, views: Any = None,
               out: Optional[Mapping[str, np.ndarray]] = None, threads: Optional[int] = None,
               progress: ProgressLike = None,
               **settings: "Unpack[EngineSettings]") -> Dict[str, np.ndarray]:
        """Gathers at receivers.

        positions: (..., 3), in units of the world; float32 or float64 with any strides are not
            copied. Positions and the others may have the shape of a picture.
        normals: (..., 3), of any length, used as float32; zero, or None for all: the whole sphere.
        views: (..., 3), with glossy: directions from the viewer to the receivers.
        out: dict of contiguous float32 arrays to fill, by output.
        threads: default: the engine's. Results do not depend on it.
        progress: True for a bar of tqdm, or a function of phase, done, total and unit.
        settings: mode, quality, outputs, ...: surfeit.settings.EngineSettings.

        Returns a dict of float32 arrays: "occlusion" (...), the covered part, 0 to 1; "irradiance",
        "environment", "fluence" (..., 3), in units of radiosity (with glossy, irradiance is the
        reflection); "bent_normal", "illumination_direction" (..., 3), of length 1 or 0;
        "radiance_sh" (..., 9, 3). A receiver that is not valid gets NaN.

        Results have the bits of `surfeit gather` for the same receivers with float32 normals, unless
        the scene has a transform or results are interpolated. Other companions change a result by
        less than .004.
        """
        world, look = _split(settings)
        key = _key_of(world)
        gatherer = self._take(key, world)
        try:
            with Watcher(progress) as watcher:
                return _gather_into(gatherer, positions, normals, views, out, "curve", threads or 0,
                                    look, watcher)
        finally:
            self._give(key, gatherer)

    def _take(self, key: Any, settings: Mapping[str, Any]) -> Any:
        """An idle gatherer of these settings, or a new one."""
        with self._lock:
            first, idle = self._worlds.get(key, (None, []))
            if idle:
                return idle.pop()
        try:
            return self._make(key, first, settings)
        except MemoryError:
            self._forget()
            return self._make(key, None, settings)

    def _make(self, key: Any, first: Any, settings: Mapping[str, Any]) -> Any:
        if first is not None:
            return first.another()
        made = self._engine._engine.gatherer([(self._scene, self._matrix)],
                                             _settings_of(settings, [self]))
        if key is not None:
            with self._lock:
                self._worlds[key] = (made, [])
                while len(self._worlds) > _KEPT_WORLDS:
                    del self._worlds[next(iter(self._worlds))]
        return made

    def _give(self, key: Any, gatherer: Any) -> None:
        gatherer.pause()
        with self._lock:
            if key in self._worlds:
                self._worlds[key][1].append(gatherer)

    def _forget(self) -> None:
        with self._lock:
            self._worlds.clear()

    def __repr__(self) -> str:
        return f"<surfeit.Scene {self.path}: {self.info['surfels']} surfels>"

    def __reduce__(self):
        return _scene_of, (self._engine, self.path, self._matrix)


def _split(settings: Mapping[str, Any]) -> Tuple[Dict[str, Any], Dict[str, Any]]:
    """Settings of the gather, and those of the look of its light, for the binding."""
    world = {name: value for name, value in settings.items() if name not in LOOK_SETTINGS}
    look = {name: value for name, value in settings.items() if name in LOOK_SETTINGS}
    return world, options_of(look)


def _settings_of(settings: Mapping[str, Any], scenes: Iterable["Scene"]) -> Dict[str, Any]:
    """Settings for the binding; groups by name have the numbers that the scenes have for them."""
    paths = {scene.path: None for scene in scenes}
    return with_numbers(options_of(settings), lambda: names_of_scenes(paths))


def _key_of(settings: Mapping[str, Any]) -> Any:
    """Something that is equal for equal settings; None where that is not known."""
    try:
        key = tuple(sorted((name, _plain(value)) for name, value in settings.items()
                           if value is not None))
        hash(key)
        return key
    except TypeError:
        return None


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return tuple(value.items())
    return tuple(value) if isinstance(value, (list, np.ndarray)) else value


class Gatherer:
    """Gathers for one thread at a time, thousands of times; the caches stay warm between calls.

    Two calls at once on one gatherer raise ValueError: `another()` makes one for another thread.
    """

    def __init__(self, engine: Engine, gatherer: Any, look: Optional[Dict[str, Any]] = None):
        self._engine = engine
        self._gatherer = gatherer
        self._look = look or {}

    def gather(self, positions: Any, normals: Any = None, *, views: Any = None,
               out: Optional[Mapping[str, np.ndarray]] = None, order: str = "curve",
               threads: int = 1, progress: ProgressLike = None) -> Dict[str, np.ndarray]:
        """As Scene.gather.

        order: "curve" sorts the receivers, as Scene.gather does; "input" takes 256 consecutive
            receivers at a time as they come, on this thread alone.
        threads: as many with "curve"; 0: the engine's.
        """
        with Watcher(progress) as watcher:
            return _gather_into(self._gatherer, positions, normals, views, out, order, threads,
                                self._look, watcher)

    def another(self) -> "Gatherer":
        """A gatherer of the same world and settings for another thread."""
        return Gatherer(self._engine, self._gatherer.another(), self._look)

    def pause(self) -> None:
        """Releases pages in front of the caches, for a thread that does something else for long."""
        self._gatherer.pause()

    @property
    def receivers(self) -> int:
        """Receivers of all calls so far."""
        return self._gatherer.receivers

    @property
    def invalid_receivers(self) -> int:
        """Receivers without a result."""
        return self._gatherer.invalid_receivers
