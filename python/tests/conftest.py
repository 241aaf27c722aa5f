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


_ROOM = {  # corners of each wall, by material
    "white": ["0 0 1  1 0 1  1 0 0  0 0 0", "0 1 0  1 1 0  1 1 1  0 1 1", "0 0 0  1 0 0  1 1 0  0 1 0"],
    "red": ["0 0 1  0 0 0  0 1 0  0 1 1"],
    "green": ["1 0 0  1 0 1  1 1 1  1 1 0"],
    "light": [".35 .98 .35  .65 .98 .35  .65 .98 .65  .35 .98 .65"],
}
_MATERIALS = """newmtl white\nKd .7 .7 .7\nnewmtl red\nKd .6 .1 .1\nnewmtl green\nKd .1 .5 .1
newmtl light\nKd .5 .5 .5\nKe 17 15 12\n"""


@pytest.fixture(scope="session")
def room(tmp_path_factory, run_program):
    """room.obj; room.ply, 3,000 surfels with its materials as groups; room.sft. By the program."""
    directory = tmp_path_factory.mktemp("room")
    lines = ["mtllib room.mtl"]
    count = 0
    for material, walls in _ROOM.items():
        lines.append(f"usemtl {material}")
        for wall in walls:
            numbers = wall.split()
            lines += ["v " + " ".join(numbers[i : i + 3]) for i in range(0, 12, 3)]
            lines.append("f " + " ".join(str(count + i) for i in range(1, 5)))
            count += 4
    (directory / "room.obj").write_text("\n".join(lines) + "\n")
    (directory / "room.mtl").write_text(_MATERIALS)
    run_program("sample", directory / "room.obj", "-o", directory / "room.ply", "--count", 3000,
                "--light-samples", 2, "--group-by", "material")
    run_program("index", directory / "room.ply", "-o", directory / "room.sft")
    return directory


def same_bytes(*paths):
    first, *others = (path.read_bytes() for path in paths)
    return len(first) > 0 and all(other == first for other in others)
