"""A scene of two spheres and a floor, made once, and where the program is."""

import os
import subprocess

import numpy as np
import pytest

import surfeit


def points_on_sphere(count, centre, seed):
    """Even points of radius 1 about `centre`, and their normals: float32."""
    i = np.arange(count) + 0.5
    polar = np.arccos(1 - 2 * i / count)
    angle = np.pi * (1 + 5**0.5) * i + seed
    normals = np.stack(
        [np.cos(angle) * np.sin(polar), np.cos(polar), np.sin(angle) * np.sin(polar)], axis=1
    )
    return (normals + centre).astype(np.float32), normals.astype(np.float32)


def floor_points(side):
    x, z = np.meshgrid(np.linspace(-3, 3, side), np.linspace(-3, 3, side))
    points = np.stack([x.ravel(), np.full(side * side, -1.0), z.ravel()], axis=1)
    return points.astype(np.float32), np.tile(np.float32([0, 1, 0]), (side * side, 1))


def cloud_of(count):
    """About `count` surfels with all that a scene may have."""
    parts = [
        points_on_sphere(count // 3, (0, 0, 0), 0),
        points_on_sphere(count // 3, (1.2, 1.5, 0.3), 1),
        floor_points(int((count / 3) ** 0.5)),
    ]
    position = np.concatenate([part[0] for part in parts])
    normal = np.concatenate([part[1] for part in parts])
    return {
        "position": position,
        "normal": normal,
        "area": np.full(len(position), 36 / (count / 3), np.float32),
        "radiosity": np.abs(normal) * np.float32(0.8),
        "albedo": np.full((len(position), 3), 0.5, np.float32),
    }


@pytest.fixture(scope="session")
def cloud():
    return cloud_of(60_000)


@pytest.fixture(scope="session")
def scene_path(cloud, tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "scene.sft"
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        surfeit.index(cloud, path, memory="256M")
    return path


@pytest.fixture(scope="session")
def engine():
    return surfeit.Engine(memory="256M", threads=2)


@pytest.fixture(scope="session")
def scene(engine, scene_path):
    return engine.open(scene_path)


@pytest.fixture(scope="session")
def receivers(cloud):
    """5,000 positions and normals from all over the cloud."""
    step = len(cloud["position"]) // 5000
    return (
        np.ascontiguousarray(cloud["position"][::step][:5000]),
        np.ascontiguousarray(cloud["normal"][::step][:5000]),
    )


@pytest.fixture(scope="session")
def run_program():
    """Runs the program, which must succeed."""
    program = os.environ.get("SURFEIT_PROGRAM")
    if not program or not os.path.exists(program):
        pytest.skip("SURFEIT_PROGRAM names no program to compare with")

    def run(*arguments):
        command = [program, *map(str, arguments), "--quiet"]
        subprocess.run(command, check=True, capture_output=True, text=True)

    return run
