"""The same bytes as the program's, for whole clouds."""

import numpy as np
import pytest

import surfeit

pytestmark = pytest.mark.filterwarnings("ignore::surfeit.DataWarning")


@pytest.fixture()
def files(tmp_path, cloud, receivers):
    """The cloud and the receivers as files."""
    surfeit.write(tmp_path / "cloud.ply", cloud)
    positions, normals = receivers
    surfeit.write(tmp_path / "receivers.ply", {"position": positions, "normal": normals})
    return tmp_path


def test_scene_of_arrays_has_the_bytes_of_the_programs(files, cloud, run_program):
    run_program("index", files / "cloud.ply", "-o", files / "program.sft")
    surfeit.index(cloud, files / "arrays.sft")
    surfeit.index(files / "cloud.ply", files / "file.sft", memory="128M", threads=1)
    chunks = ({name: array[i : i + 7000] for name, array in cloud.items()}
              for i in range(0, len(cloud["position"]), 7000))
    surfeit.index(chunks, files / "chunks.sft")
    expected = (files / "program.sft").read_bytes()
    for name in ("arrays", "file", "chunks"):
        assert (files / f"{name}.sft").read_bytes() == expected, name
    left = sorted(path.name for path in files.iterdir())
    assert left == ["arrays.sft", "chunks.sft", "cloud.ply", "file.sft", "program.sft",
                    "receivers.ply"]


@pytest.mark.parametrize("settings", [
    {},
    {"mode": "bleeding", "quality": "draft"},
    {"mode": "bleeding", "outputs": ["occlusion", "bent_normal", "fluence"]},
    {"mode": "glossy", "eye": (0, 3, 5), "roughness": 0.3},
    {"max_distance": 1.0, "falloff": 1.0, "falloff_mode": "polynomial", "cone_angle": 1.0},
], ids=["occlusion", "bleeding", "outputs", "glossy", "weights"])
def test_gather_in_memory_has_the_bytes_of_the_programs(files, scene, receivers, run_program,
                                                        settings):
    options = []
    for name, value in settings.items():
        option = {"eye": "camera", "max_distance": "max-dist"}.get(name, name.replace("_", "-"))
        text = value if isinstance(value, str) else ",".join(map(str, np.atleast_1d(value)))
        options += [f"--{option}", text]
    run_program("gather", scene.path, files / "receivers.ply", "-o", files / "out.ply", *options)
    surfeit.gather(scene, files / "receivers.ply", files / "job.ply", memory="128M", **settings)
    assert (files / "job.ply").read_bytes() == (files / "out.ply").read_bytes()

    found = scene.gather(*receivers, **settings)
    expected = surfeit.read(files / "out.ply")
    for word, array in found.items():
        name = "reflection" if settings.get("mode") == "glossy" and word == "irradiance" else word
        assert array.dtype == np.float32
        assert np.array_equal(array, expected[name]), word


def test_jobs_have_the_bytes_of_the_programs(files, scene, run_program):
    run_program("bounce", scene.path, "--bounces", 1, "--quality", "draft", "-o", files / "p.sft")
    stats = surfeit.bounce(scene, files / "b.sft", 1, quality="draft", memory="256M")
    assert len(stats["passes"]) == 1
    assert (files / "b.sft").read_bytes() == (files / "p.sft").read_bytes()

    run_program("normals", files / "cloud.ply", "-o", files / "p.ply", "--orient", "outward")
    surfeit.normals(files / "cloud.ply", files / "n.ply", toward="outward")
    assert (files / "n.ply").read_bytes() == (files / "p.ply").read_bytes()

    run_program("convert", files / "cloud.ply", "-o", files / "p.ptc", "--every", 3)
    surfeit.convert(files / "cloud.ply", files / "c.ptc", every=3)
    assert (files / "c.ptc").read_bytes() == (files / "p.ptc").read_bytes()


def test_lookups_have_the_bytes_of_the_program(files, run_program):
    moved = [[0, -1, 0, 3.0], [1, 0, 0, 0.0], [0, 0, 1, -2.0], [0, 0, 0, 1.0]]
    text = " ".join(str(number) for row in moved for number in row)
    surfeit.convert(files / "receivers.ply", files / "moved.ply", transform=moved)
    run_program("lookup", files / "cloud.ply", files / "moved.ply", "-o", files / "p.ply",
                "--channel", "radiosity", "--from-space", text, "--interpolation", "nearest",
                "--missing", "0")
    stats = surfeit.lookup(files / "cloud.ply", files / "moved.ply", files / "l.ply",
                           values=["radiosity"], from_space=moved, interpolation="nearest",
                           missing=0.0)
    assert stats["points"] > 0 and not stats["is_brick_map"]
    assert stats["missing_receivers"] < stats["receivers"]
    assert (files / "l.ply").read_bytes() == (files / "p.ply").read_bytes()
    with pytest.raises(ValueError, match="from_space"):
        surfeit.lookup(files / "cloud.ply", files / "moved.ply", files / "l.ply",
                       from_space=[1, 2, 3])


def test_scenes_share_a_cube(files, tmp_path):
    surfeit.index(files / "cloud.ply", tmp_path / "a.sft", cube=(-8, -8, -8, 32))
    assert surfeit.info(tmp_path / "a.sft")["cube"] == (-8, -8, -8, 32)


def test_tune_verify_info_and_cube_answer(files, scene, receivers):
    report = surfeit.tune(scene, files / "receivers.ply", memory="128M", sample_receivers=1000)
    assert report["recommended"]["memory_bytes"] >= report["rows"][0]["memory_bytes"]
    assert all(0 <= row["predicted"]["node_cache"]["hit_rate"] <= 1 for row in report["curve"])
    assert surfeit.verify(scene)["findings"] == []
    info = surfeit.info(scene)
    assert info["kind"] == "scene" and info["surfels"] == scene.info["surfels"]
    assert surfeit.info(files / "cloud.ply")["surfels"]["count"] == info["surfels"]

    position, normal = receivers[0][0], receivers[1][0]
    cube = surfeit.cube(scene, position, normal, mode="bleeding")
    weight = (cube["weight"] * cube["solid_angle"]).astype(np.float64)
    occlusion = (weight * cube["pixel_occlusion"]).sum() / weight.sum()
    assert cube["coverage"].shape == (6, 16, 16) and cube["light"].shape == (6, 16, 16, 3)
    assert occlusion == pytest.approx(cube["occlusion"], abs=1e-4)
    assert cube["solid_angle"].sum() == pytest.approx(4 * np.pi, rel=1e-4)
    gathered = scene.gather(position[None], normal[None])["occlusion"][0]
    assert gathered == pytest.approx(cube["occlusion"], abs=0.02)
