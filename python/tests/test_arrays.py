"""Arrays of any shape and type in and out, without copies where they fit."""

import warnings

import numpy as np
import pytest

import surfeit


def test_strides_types_and_shapes_change_nothing(scene, receivers):
    positions, normals = receivers[0][:600], receivers[1][:600]
    expected = scene.gather(positions, normals, mode="bleeding", quality="draft")
    record = np.zeros(600, [("id", "u1"), ("P", "f4", 3), ("N", "f8", 3)])
    record["P"], record["N"] = positions, normals
    for given in [
        (record["P"], record["N"]),
        (np.asfortranarray(positions), np.asfortranarray(normals)),
        (positions.astype(">f4"), normals.astype(np.longdouble)),
        (positions.tolist(), normals.tolist()),
        (positions.reshape(20, 30, 3), normals.reshape(20, 30, 3)),
    ]:
        found = scene.gather(*given, mode="bleeding", quality="draft")
        for word, array in expected.items():
            assert np.array_equal(found[word].reshape(array.shape), array), word
    picture = scene.gather(positions.reshape(20, 30, 3), normals.reshape(20, 30, 3),
                           outputs="occlusion,bent_normal,radiance_sh", mode="bleeding")
    assert [picture[word].shape for word in sorted(picture)] == [
        (20, 30, 3), (20, 30), (20, 30, 9, 3)]


def test_results_go_into_arrays_of_the_caller(scene, receivers):
    out = {"occlusion": np.zeros(5000, np.float32)}
    found = scene.gather(*receivers, out=out)
    assert np.shares_memory(found["occlusion"], out["occlusion"])
    assert out["occlusion"].any()
    for wrong in (np.zeros(5000), np.zeros(4999, np.float32), np.zeros(10000, np.float32)[::2]):
        with pytest.raises(ValueError, match="occlusion"):
            scene.gather(*receivers, out={"occlusion": wrong})
    with pytest.raises(ValueError, match="irradiance"):
        scene.gather(*receivers, out={"irradiance": np.zeros((5000, 3), np.float32)})


def test_order_of_a_gatherer_is_the_curve_or_the_input(engine, scene, receivers):
    gatherer = engine.gatherer(scene, quality="draft")
    along = gatherer.gather(*receivers)["occlusion"]
    assert np.array_equal(along, scene.gather(*receivers, quality="draft")["occlusion"])
    as_given = gatherer.gather(*receivers, order="input")["occlusion"]
    assert np.abs(along - as_given).max() < 0.02 and np.abs(along - as_given).mean() < 0.002
    one = gatherer.gather(receivers[0][0], receivers[1][0])
    assert one["occlusion"].shape == ()
    assert gatherer.gather(receivers[0][:0])["occlusion"].shape == (0,)


def test_invalid_receivers_get_nan(scene, receivers):
    positions = receivers[0].copy()
    positions[7, 1] = np.nan
    occlusion = scene.gather(positions, receivers[1])["occlusion"]
    assert np.isnan(occlusion[7]) and np.isnan(occlusion).sum() == 1


def test_transforms_and_instances(engine, scene, receivers):
    turn = np.array([[0.0, 0, 2, 10], [0, 2, 0, 20], [-2, 0, 0, 30]])
    positions, normals = receivers
    moved = scene.placed(turn)
    assert np.array_equal(moved.transform, turn)
    there = moved.gather(positions @ turn[:, :3].T + turn[:, 3], normals @ (turn[:, :3].T / 2))
    here = scene.gather(positions, normals)
    assert np.abs(there["occlusion"] - here["occlusion"]).mean() < 0.003
    far = engine.open(scene.path, transform=turn).gather(positions)
    assert far["occlusion"].max() < 0.01

    world = engine.gatherer([scene, scene.placed(np.eye(4)), moved], mode="bleeding")
    both = world.gather(positions[:300], normals[:300])
    assert both["irradiance"].shape == (300, 3)
    assert world.receivers == 300 and world.invalid_receivers == 0
    with pytest.raises(ValueError, match="shear"):
        scene.placed(np.diag([1, 2, 1, 1.0])).gather(positions)


def test_environment_is_an_array(scene, receivers):
    sky = np.ones((8, 16, 3), np.float32)
    found = scene.gather(*receivers, environment=sky, quality="draft")
    assert set(found) == {"occlusion", "environment"}
    # Open directions are as bright as the sky, whose radiance is 1: pi (1 - occlusion)
    open_part = np.pi * (1 - found["occlusion"])
    assert np.abs(found["environment"][:, 0] - open_part).max() < 0.05


def test_clouds_come_back(tmp_path, cloud):
    count = len(cloud["position"])
    arrays = {
        **cloud,
        "place": cloud["position"].astype(np.float64),
        "two_sided": np.arange(count) % 3 == 0,
        "tag": np.arange(count),
        "pair": np.zeros((count, 2), np.float16),
        "color": np.full((count, 3), 17, np.uint8),
    }
    assert surfeit.write(tmp_path / "a.ply", arrays, comments=["made of arrays"], up="z") == count
    whole = surfeit.read(tmp_path / "a.ply")
    for name in ("position", "normal", "radiosity", "color", "place", "tag"):
        assert np.array_equal(whole[name], arrays[name]), name
    assert whole["place"].dtype == np.float64 and whole["tag"].dtype == np.int32
    assert whole["color"].dtype == np.uint8
    chunks = list(surfeit.read_chunks(tmp_path / "a.ply", rows=9000, only=["position", "tag"]))
    assert [len(chunk["tag"]) for chunk in chunks[:2]] == [9000, 9000]
    assert np.array_equal(np.concatenate([chunk["tag"] for chunk in chunks]), arrays["tag"])
    assert surfeit.write(tmp_path / "b.ply", surfeit.read_chunks(tmp_path / "a.ply", 9000)) == count
    assert np.array_equal(surfeit.read(tmp_path / "b.ply")["normal"], cloud["normal"])
    kept = surfeit.read(tmp_path / "a.ply", filter="number < 10", channels="tag=number")
    assert kept["number"].tolist() == list(range(10))


@pytest.mark.parametrize("name", ["a.ply", "a.bgeo", "a.vdb", "a.prt", "a.pdb", "a.xyz"])
def test_formats_of_all_kinds_come_back(tmp_path, name, cloud):
    arrays = {"position": cloud["position"][:1000], "normal": cloud["normal"][:1000]}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", surfeit.DataWarning)
        surfeit.write(tmp_path / name, arrays)
    found = surfeit.read(tmp_path / name)
    order = np.lexsort(found["position"].T)
    expected = np.lexsort(arrays["position"].T)
    assert np.allclose(found["position"][order], arrays["position"][expected], atol=1e-5)


def test_a_scene_reads_as_a_cloud(scene_path, cloud):
    surfels = surfeit.read(scene_path)
    assert surfels["position"].shape == cloud["position"].shape
    assert {"normal", "radius", "area", "radiosity", "albedo"} <= set(surfels)


def test_a_scene_opens_from_bytes(engine, scene, scene_path, receivers):
    held = engine.open_bytes(scene_path.read_bytes(), "held")
    assert np.array_equal(held.gather(*receivers)["occlusion"],
                          scene.gather(*receivers)["occlusion"])


def test_stats_and_windows_tell_of_the_caches(engine, scene, receivers):
    scene.gather(*receivers)
    stats = engine.stats
    assert stats["scenes"] >= 1 and stats["memory_bytes"] == 256 << 20
    assert stats["node_cache"]["requests"] >= stats["node_cache"]["hits"] > 0
    assert engine.windows[-1]["receivers"] >= 0
    assert "surfels" in repr(scene) and "256" not in str(surfeit.__version__)


def test_channels_of_other_shapes_are_read_or_refused(tmp_path):
    """What numpy users have: RGBA, columns (n, 1); what has no meaning is refused."""
    places = np.random.default_rng(3).random((20, 3))
    rgba = np.tile(np.uint8([117, 73, 49, 255]), (20, 1))
    surfeit.write(tmp_path / "a.ply", {"position": places, "color": rgba,
                                       "radius": np.full((20, 1), 0.1)})
    read = surfeit.read(tmp_path / "a.ply")
    assert np.array_equal(read["color"][:, :3], rgba[:, :3])
    assert np.allclose(read["radius"], 0.1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        surfeit.index({"position": places, "color": rgba, "radius": np.full((20, 1), 0.1)},
                      tmp_path / "a.sft")
    scene = surfeit.read(tmp_path / "a.sft")
    assert scene["radiosity"].min() > 0.02 and np.allclose(scene["radius"], 0.1, rtol=0.01)
    for name, array, expected in [
        ("position", places.T, r"\(n, 3\)"), ("position", np.zeros((20, 4)), r"\(n, 3\)"),
        ("position", np.zeros(60), r"\(n, 3\)"), ("normal", np.zeros((20, 2)), r"\(n, 3\)"),
        ("color", np.zeros((20, 5)), r"\(n, 3\) or \(n, 4\)"),
        ("radius", np.zeros((20, 2)), r"\(n,\)"), ("group", np.zeros((20, 3), int), r"\(n,\)"),
    ]:
        with pytest.raises(ValueError, match=f"{name}: found shape .*expected {expected}"):
            surfeit.index({"position": places, name: array}, tmp_path / "b.sft")
        with pytest.raises(ValueError, match=f"{name}: found shape"):
            surfeit.write(tmp_path / "b.ply", {"position": places, name: array})


def test_names_that_are_nearly_ours_are_told(tmp_path):
    places = np.random.default_rng(3).random((20, 3))
    for name, array, channel in [("colors", places, "color"), ("RGB", places, "color"),
                                 ("normals", places, "normal"), ("radii", places[:, 0], "radius")]:
        with pytest.warns(surfeit.DataWarning, match=f"{name}: not read as {channel}"):
            surfeit.index({"position": places, name: array}, tmp_path / "a.sft")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        surfeit.write(tmp_path / "a.ply", {"position": places, "color": places, "n": places[:, 0]})


def test_integers_that_lose_digits_are_told(tmp_path):
    places = np.zeros((2, 3))
    with pytest.warns(surfeit.DataWarning, match="id: integers of 64 bits"):
        surfeit.write(tmp_path / "a.ply", {"position": places, "id": np.array([1, 2**53 + 1])})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        surfeit.write(tmp_path / "a.ply", {"position": places, "id": np.array([1, 2**53])})


def test_masked_values_are_refused(tmp_path, scene, receivers):
    points = np.ma.array(receivers[0][:4], mask=[[0, 0, 0]] * 3 + [[0, 0, 1]])
    area = np.full(4, 0.5)
    for call in (lambda: surfeit.index({"position": points, "area": area}, tmp_path / "a.sft"),
                 lambda: surfeit.index({"position": points.data, "area": np.ma.masked_less(area, 1)},
                                       tmp_path / "a.sft"),
                 lambda: surfeit.write(tmp_path / "a.ply", {"position": points}),
                 lambda: scene.gather(points), lambda: scene.gather(points.data, points)):
        with pytest.raises(ValueError, match="found [14] masked values"):
            call()
    whole = np.ma.array(receivers[0][:4], mask=np.zeros((4, 3)))
    assert scene.gather(whole)["occlusion"].shape == (4,)
