"""What the program has, Python has: the same bytes, feature by feature, and no option forgotten."""

import inspect
import os
import re
import subprocess

import numpy as np
import pytest

import surfeit
from surfeit import settings
from conftest import same_bytes

pytestmark = pytest.mark.filterwarnings("ignore::surfeit.DataWarning")

def hdr_sky(path):
    """A lat-long picture of 16 by 8: bright above, dim below."""
    rows = [bytes((200, 180, 160, 130 if row < 4 else 126)) * 16 for row in range(8)]
    path.write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 8 +X 16\n" + b"".join(rows))


def test_settings_of_gathers(room, tmp_path, run_program):
    scene, receivers = room / "room.sft", room / "room.ply"
    hdr_sky(tmp_path / "sky.hdr")
    run_program("gather", scene, receivers, "-o", tmp_path / "p1.ply", "--environment",
                tmp_path / "sky.hdr", "--occlusion-by-brightness", "--outputs", "occlusion")
    surfeit.gather(scene, receivers, tmp_path / "j1.ply", environment=tmp_path / "sky.hdr",
                   occlusion_by_brightness=True, outputs="occlusion")
    assert same_bytes(tmp_path / "p1.ply", tmp_path / "j1.ply")

    run_program("gather", scene, receivers, "-o", tmp_path / "p2.ply", "--max-variation", 1,
                "--max-pixel-dist", 12, "--quality", "draft")
    counts = []
    for distance in (0, 5, 12):
        stats = surfeit.gather(scene, receivers, tmp_path / "j2.ply", max_variation=1.0,
                               max_pixel_dist=distance, quality="draft")
        counts.append(stats["interpolated_receivers"])
    print(f"interpolated: {counts}")
    assert counts[0] > counts[1]
    assert same_bytes(tmp_path / "p2.ply", tmp_path / "j2.ply")


def test_groups_by_name(room, tmp_path, run_program):
    scene, receivers = room / "room.sft", room / "room.ply"
    names = {1: "white", 2: "red", 3: "green", 4: "light"}
    assert surfeit.info(scene)["group_names"] == names
    opened = surfeit.Engine(memory="128M").open(scene)
    assert opened.group_names == names
    run_program("gather", scene, receivers, "-o", tmp_path / "p.ply", "--subset", "red,light",
                "--mode", "bleeding", "--quality", "draft")
    for groups in ("red,light", ["red", 4], "2,4", [2, "light"]):
        surfeit.gather(scene, receivers, tmp_path / "j.ply", groups=groups, mode="bleeding",
                       quality="draft")
        assert same_bytes(tmp_path / "p.ply", tmp_path / "j.ply"), groups
    cloud = surfeit.read(tmp_path / "p.ply")
    found = opened.gather(cloud["position"], cloud["normal"], groups="red,light", mode="bleeding",
                          quality="draft")
    assert np.array_equal(found["irradiance"], cloud["irradiance"])
    surfeit.tune(scene, receivers, groups="red", sample_receivers=500, memory="128M")
    for call in (lambda: opened.gather(cloud["position"], groups="rad"),
                 lambda: surfeit.gather(scene, receivers, tmp_path / "none.ply", groups=["rad"])):
        with pytest.raises(ValueError, match="rad.*white, red, green"):
            call()


def test_shards_resume_and_merge(room, tmp_path, run_program):
    scene, receivers, out = room / "room.sft", room / "room.ply", tmp_path / "out.ply"
    run_program("gather", scene, receivers, "-o", tmp_path / "one.ply", "--quality", "draft")
    with pytest.raises(surfeit.Incomplete, match="shard"):
        surfeit.merge(scene, receivers, out, shards=3)
    stats = surfeit.gather(scene, receivers, out, shard="1/3", quality="draft")
    assert (stats["gathered_shards"], stats["finished_shards"]) == (1, 0)
    surfeit.gather(scene, receivers, out, shard=(3, 3), quality="draft")
    with pytest.raises(surfeit.Incomplete, match="2 of 3"):
        surfeit.merge(scene, receivers, out)
    # The program and Python share a job
    run_program("gather", scene, receivers, "-o", out, "--quality", "draft", "--shard", "2/3")
    again = surfeit.gather(scene, receivers, out, shard="2/3", quality="draft")
    assert again["finished_shards"] == 1 and again["gathered_shards"] == 0
    assert surfeit.merge(scene, receivers, out, remove_shards=True)["shards"] == 3
    assert same_bytes(out, tmp_path / "one.ply")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["one.ply", "out.ply"]
    # Pages of the scene are kept, and read again
    for count, read in (("staged_bytes_kept", 0), ("staged_bytes_read", 1)):
        stats = surfeit.gather(scene, receivers, out, quality="draft", stage=tmp_path, stage_limit="1G")
        assert stats[count] > 0 and stats["staged_bytes_read"] >= read
        assert same_bytes(out, tmp_path / "one.ply")
    assert len(list(tmp_path.glob("surfeit-stage-*"))) == 1

    surfeit.gather(scene, receivers, tmp_path / "r.ply", resume=True, resume_parts=4,
                   quality="draft")
    assert same_bytes(tmp_path / "r.ply", tmp_path / "one.ply")


def test_a_stopped_gather_goes_on(room, tmp_path):
    scene, receivers = room / "room.sft", room / "room.ply"
    calls = []

    def stop(phase, done, total, unit):
        calls.append(done)
        if list(tmp_path.glob("*.shard-*")):
            raise LookupError("enough")

    options = {"resume": True, "resume_parts": 12, "max_solid_angle": 0.005, "threads": 1}
    try:
        surfeit.gather(scene, receivers, tmp_path / "out.ply", progress=stop, **options)
    except LookupError:
        finished = len(list(tmp_path.glob("out.ply.shard-*")))
        assert finished >= 1 and not (tmp_path / "out.ply").exists()
        stats = surfeit.gather(scene, receivers, tmp_path / "out.ply", **options)
        assert stats["finished_shards"] == finished
    surfeit.gather(scene, receivers, tmp_path / "one.ply", max_solid_angle=0.005)
    assert same_bytes(tmp_path / "out.ply", tmp_path / "one.ply")


def test_crops_of_passes(room, tmp_path, run_program):
    camera = {"eye": (0.5, 0.5, 2.4), "look_at": (0.5, 0.5, 0), "fov": 60, "size": (32, 32)}
    words = ["--eye", ".5 .5 2.4", "--look-at", ".5 .5 0", "--fov", 60, "--size", "32x32"]
    run_program("view", room / "room.sft", "--passes", tmp_path / "p.exr", *words)
    stats = surfeit.view(room / "room.sft", passes=tmp_path / "passes.exr", **camera)
    assert stats["pass_pixels"] > 300 and same_bytes(tmp_path / "p.exr", tmp_path / "passes.exr")
    run_program("gather", room / "room.sft", tmp_path / "passes.exr", "-o", tmp_path / "p.ply",
                "--crop", "10,12,20,17", "--filter", "pixel_x != 11")
    surfeit.gather(room / "room.sft", tmp_path / "passes.exr", tmp_path / "j.ply",
                   crop=(10, 12, 20, 17), filter="pixel_x != 11")
    assert same_bytes(tmp_path / "p.ply", tmp_path / "j.ply")
    assert len(surfeit.read(tmp_path / "j.ply")["occlusion"]) == 45
    with pytest.raises(ValueError, match="x0, y0, x1, y1"):
        surfeit.gather(room / "room.sft", tmp_path / "passes.exr", tmp_path / "n.ply",
                       crop=(10, 12, 5, 17))


def test_indexes_with_groups_cubes_and_shards(room, tmp_path, run_program):
    cloud = surfeit.read(room / "room.ply", filter="group != 4")
    cloud.pop("group")
    surfeit.write(tmp_path / "walls.ply", cloud)
    surfeit.convert(room / "room.ply", tmp_path / "lamp.ply", filter="group == 4", drop=["group"])
    surfeit.index(tmp_path / "walls.ply", tmp_path / "like.sft", cube=(-1, -1, -1, 4))
    run_program("index", tmp_path / "walls.ply", "--group", f"lamp={tmp_path / 'lamp.ply'}", "-o",
                tmp_path / "p.sft", "--cube", tmp_path / "like.sft")
    inputs = {"group": {"lamp": tmp_path / "lamp.ply"}, "cube": tmp_path / "like.sft"}
    surfeit.index(tmp_path / "walls.ply", tmp_path / "j.sft", **inputs)
    assert same_bytes(tmp_path / "p.sft", tmp_path / "j.sft")
    assert surfeit.info(tmp_path / "j.sft")["cube"] == (-1, -1, -1, 4)
    surfeit.index([], tmp_path / "lamp.sft", group={"lamp": [tmp_path / "lamp.ply"]})
    assert surfeit.info(tmp_path / "lamp.sft")["group_names"] == {1: "lamp"}

    for pass_ in ("count", "distribute", "build"):
        for shard in (1, 2):
            stats = surfeit.index(tmp_path / "walls.ply", tmp_path / "s.sft", pass_=pass_,
                                  shard=(shard, 2), **inputs)
            assert stats["done_shards"] == 1
            assert stats["surfels"] > 0 or pass_ == "build"  # one slab is all of so few
        if pass_ == "count":
            with pytest.raises(surfeit.Incomplete, match="distribute"):
                surfeit.index(tmp_path / "walls.ply", tmp_path / "s.sft", pass_="build",
                              shard="1/2", **inputs)
    surfeit.index(tmp_path / "walls.ply", tmp_path / "s.sft", pass_="merge", shards=2,
                  remove_shards=True, **inputs)
    assert same_bytes(tmp_path / "s.sft", tmp_path / "p.sft")
    assert not list(tmp_path.glob("s.sft.*"))

    # Sizes and normals from neighbours
    surfeit.convert(room / "room.ply", tmp_path / "bare.ply", keep=["position"])
    surfeit.index(tmp_path / "bare.ply", tmp_path / "one.sft", normals="estimate")
    for pass_ in ("count", "distribute", "build", "places", "sizes"):
        for shard in (1, 2):
            surfeit.index(tmp_path / "bare.ply", tmp_path / "s.sft", pass_=pass_, shard=(shard, 2),
                          normals="estimate")
    surfeit.index(tmp_path / "bare.ply", tmp_path / "s.sft", pass_="merge", shards=2,
                  remove_shards=True, normals="estimate")
    assert same_bytes(tmp_path / "s.sft", tmp_path / "one.sft")
    for wrong, message in [({"pass_": "sort"}, "count, distribute"), ({"shard": "1/2"}, "pass_"),
                           ({"pass_": "merge"}, "shards"), ({"pass_": "build"}, "shard"),
                           ({"pass_": "build", "shard": "3/2"}, "I/N")]:
        with pytest.raises(ValueError, match=message):
            surfeit.index(tmp_path / "walls.ply", tmp_path / "none.sft", **wrong)
    with pytest.raises(ValueError, match="surfeit.write"):
        surfeit.index(cloud, tmp_path / "none.sft", group={"lamp": tmp_path / "lamp.ply"})


def test_meshes_and_lights(room, tmp_path, run_program):
    mesh = room / "room.obj"
    key, fill = (0.5, 0.8, 0.5, 1, 1, 1), (-1, -2, -1, 3, 3, 3)
    lamps = ["--light-point", "key=.5 .8 .5 1 1 1", "--light-directional", "fill=-1 -2 -1 3 3 3",
             "--falloff", 1, "--falloff-distance", 0.4]
    lights = {"light_point": {"key": key}, "light_directional": "fill=-1 -2 -1 3 3 3",
              "falloff": 1, "falloff_distance": 0.4}
    run_program("relight", room / "room.sft", "-o", tmp_path / "p.sft", "--mesh", mesh, *lamps,
                "--gain", "key=2,fill=.3", "--add", "--no-mesh-light")
    stats = surfeit.relight(room / "room.sft", tmp_path / "j.sft", mesh=mesh, add=True,
                            gain={"key": 2, "fill": 0.3}, mesh_light=False, **lights)
    assert 0 < stats["lit_surfels"] <= stats["surfels"]
    assert same_bytes(tmp_path / "p.sft", tmp_path / "j.sft")
    run_program("relight", room / "room.sft", "-o", tmp_path / "p1.sft", "--mesh", mesh, *lamps,
                "--gain", ".3")
    surfeit.relight(room / "room.sft", tmp_path / "j1.sft", mesh=[mesh], gain=0.3, **lights)
    assert same_bytes(tmp_path / "p1.sft", tmp_path / "j1.sft")
    with pytest.raises(ValueError, match='"kay": found fill, key'):
        surfeit.relight(room / "room.sft", tmp_path / "n.sft", gain="kay=2", **lights)
    with pytest.raises(ValueError, match="expected 6 numbers"):
        surfeit.relight(room / "room.sft", tmp_path / "n.sft", light_point=(1, 2, 3))

    area = "0.5 0.9 0.5  .1 0 0  0 0 .1  5 5 5"
    run_program("sample", mesh, "-o", tmp_path / "p.ply", "--camera", ".5 .5 2  .5 .5 0", "--size",
                "64x48", "--crop", "0,0,32,48", "--pixels", 2, "--group-by", "material",
                "--light-area", area, "--light-samples", 3, "--ground-plane", "--albedo", ".2 .3 .4")
    surfeit.sample(mesh, tmp_path / "j.ply", camera=(0.5, 0.5, 2, 0.5, 0.5, 0), size=(64, 48),
                   crop=(0, 0, 32, 48), pixels=2, group_by="material", light_area=area,
                   light_samples=3, ground_plane=True, albedo=(0.2, 0.3, 0.4))
    assert same_bytes(tmp_path / "p.ply", tmp_path / "j.ply")
    with pytest.raises(ValueError, match="no camera"):
        surfeit.sample(mesh, tmp_path / "n.ply", pixels=2)

    run_program("sample", mesh, "-o", tmp_path / "pp.ply", "--photons", 3000, "--seed", 5)
    sent = surfeit.sample(mesh, tmp_path / "jp.ply", photons=3000, seed=5)
    assert sent["emitted"] == 3000 and same_bytes(tmp_path / "pp.ply", tmp_path / "jp.ply")
    with pytest.raises(ValueError, match="count"):
        surfeit.sample(mesh, tmp_path / "n.ply", photons=3000, count=10)
    run_program("radiance", tmp_path / "pp.ply", "-o", tmp_path / "pr.ply",
                "--photons-per-estimate", 30, "--albedo", ".4 .4 .4")
    estimated = surfeit.radiance(tmp_path / "jp.ply", tmp_path / "jr.ply", photons_per_estimate=30,
                                 albedo=(0.4, 0.4, 0.4))
    assert same_bytes(tmp_path / "pr.ply", tmp_path / "jr.ply")
    forecast = surfeit.radiance(tmp_path / "jp.ply", tmp_path / "no.ply", photons_per_estimate=30,
                                dry_run=True)
    assert forecast["records"] == estimated["photons"] + estimated["skipped_photons"]
    assert not (tmp_path / "no.ply").exists()
    assert forecast["output_bytes"] == pytest.approx((tmp_path / "jr.ply").stat().st_size, rel=0.1)


def test_conversions(room, tmp_path, run_program):
    run_program("convert", room / "room.ply", "-o", tmp_path / "p.ply", "--camera",
                ".5 .5 2  .5 .5 0  50", "--pixels", 40, "--units", "ft:m")
    surfeit.convert(room / "room.ply", tmp_path / "j.ply", camera=[(0.5, 0.5, 2, 0.5, 0.5, 0, 50)],
                    pixels=40, units="ft:m")
    assert same_bytes(tmp_path / "p.ply", tmp_path / "j.ply")
    assert 0 < len(surfeit.read(tmp_path / "j.ply")["position"]) < 3000
    (tmp_path / "a.csv").write_text("x;y;z\n" + "1,5;2,5;3,5\n" * 3)
    places = surfeit.read(tmp_path / "a.csv", text="decimal-comma")["position"]
    assert places.tolist() == [[1.5, 2.5, 3.5]] * 3


def test_brick_maps(room, tmp_path, run_program):
    surfeit.gather(room / "room.sft", room / "room.ply", tmp_path / "baked.ply", quality="draft",
                   mode="bleeding")
    run_program("brick", tmp_path / "baked.ply", "-o", tmp_path / "p.vdb", "--max-error", 0.05,
                "--channel", "occlusion,irradiance")
    stats = surfeit.brick(tmp_path / "baked.ply", tmp_path / "j.vdb", max_error=0.05,
                          channel="occlusion,irradiance")
    assert stats["points"] == 3000 and same_bytes(tmp_path / "p.vdb", tmp_path / "j.vdb")

    brick_map = surfeit.BrickMap(tmp_path / "j.vdb")
    assert [name for name, _ in brick_map.channels] == ["occlusion", "irradiance"]
    assert brick_map.voxel_sizes[0] == pytest.approx(stats["voxel_size"])
    cloud = surfeit.read(room / "room.ply")
    found = brick_map.lookup(cloud["position"], cloud["normal"])
    surfeit.lookup(tmp_path / "j.vdb", room / "room.ply", tmp_path / "looked.ply")
    expected = surfeit.read(tmp_path / "looked.ply")
    for name in ("occlusion", "irradiance"):
        assert np.array_equal(found[name], expected[name], equal_nan=True), name
    nothing = brick_map.lookup(np.full((2, 5, 3), 1e6), missing=7)
    assert nothing["irradiance"].shape == (2, 5, 3) and (nothing["occlusion"] == 7).all()
    with pytest.raises(ValueError, match="normals"):
        brick_map.lookup(cloud["position"], cloud["normal"][:5])
    with pytest.raises(surfeit.DamagedFile):
        surfeit.BrickMap(room / "room.ply")


def test_generated_scenes(tmp_path, run_program):
    run_program("generate", "-o", tmp_path / "p.ply", "--surfels", "5k", "--kind", "terrain",
                "--part", "2/3", "--order", "shuffled", "--duplicates", 2)
    stats = surfeit.generate(tmp_path / "j.ply", surfels="5k", kind="terrain", part=(2, 3),
                             order="shuffled", duplicates=2)
    assert stats["surfels"] > 1000 and same_bytes(tmp_path / "p.ply", tmp_path / "j.ply")
    surfeit.generate(tmp_path / "a.recipe", surfels=5000, recipe=True)
    assert surfeit.index(tmp_path / "a.recipe", tmp_path / "a.sft")["surfels"] == 5000


def test_pictures(room, tmp_path, run_program):
    words = ["--eye", ".5 .5 2.4", "--look-at", ".5 .5 0", "--size", "40x30"]
    camera = {"eye": (0.5, 0.5, 2.4), "look_at": (0.5, 0.5, 0), "size": "40x30"}
    run_program("view", room / "room.sft", "-o", tmp_path / "p.png", *words, "--exposure", 1)
    stats = surfeit.view(room / "room.sft", tmp_path / "j.png", exposure=1, **camera)
    assert stats["channel"] == "radiosity" and same_bytes(tmp_path / "p.png", tmp_path / "j.png")

    surfeit.view(room / "room.sft", passes=tmp_path / "passes.exr", **camera)
    surfeit.gather(room / "room.sft", tmp_path / "passes.exr", tmp_path / "light.exr",
                   mode="bleeding", quality="draft")
    layers = [tmp_path / "passes.exr", tmp_path / "light.exr"]
    run_program("composite", *layers, "-o", tmp_path / "pc.png", "--channel", "lit", "--reduce", 2)
    made = surfeit.composite(layers, tmp_path / "jc.png", channel="lit", reduce=2)
    assert (made["width"], made["height"]) == (20, 15)
    assert same_bytes(tmp_path / "pc.png", tmp_path / "jc.png")

    run_program("cube", room / "room.sft", "--at", ".5,.1,.5", "--normal", "0,1,0", "-o",
                tmp_path / "pq.png", "--reference", room / "room.obj", "--rays", 2, "--show",
                "coverage,kind")
    arrays = surfeit.cube(room / "room.sft", (0.5, 0.1, 0.5), (0, 1, 0), picture=tmp_path / "jq.png",
                          reference=room / "room.obj", rays=2, show="coverage,kind")
    assert same_bytes(tmp_path / "pq.png", tmp_path / "jq.png")
    assert arrays["light"].any() and arrays["reference"]["coverage"].shape == (6, 16, 16)
    assert arrays["reference"]["occlusion"] == pytest.approx(arrays["occlusion"], abs=0.1)
    cloud = surfeit.read(room / "room.ply")
    row = surfeit.cube(room / "room.sft", receivers=room / "room.ply", number=17)
    assert row["at"] == pytest.approx(cloud["position"][17])
    with pytest.raises(ValueError, match="at or receivers"):
        surfeit.cube(room / "room.sft")


def test_dry_runs_write_nothing(room, tmp_path):
    forecast = surfeit.gather(room / "room.sft", room / "room.ply", tmp_path / "a.ply", dry_run=True)
    assert forecast["receivers"] == 3000 and forecast["recommended_memory_bytes"] > 0
    forecast = surfeit.index(room / "room.ply", tmp_path / "a.sft", dry_run=True)
    assert forecast["records"] == 3000 and forecast["file_bytes"] > 0
    forecast = surfeit.convert(room / "room.ply", tmp_path / "a.ply", every=3, dry_run=True)
    assert forecast["records"] == forecast["sampled_records"] == 3000
    third = surfeit.convert(room / "room.ply", tmp_path / "third.ply", every=3)
    assert forecast["output_bytes"] == third["output_bytes"]
    (tmp_path / "third.ply").unlink()
    forecast = surfeit.normals(room / "room.ply", tmp_path / "a.ply", dry_run=True)
    assert forecast["records"] == 3000 and forecast["output_bytes"] > 0
    with pytest.raises(surfeit.DamagedFile, match="room.ply: .*power of every photon"):
        surfeit.radiance(room / "room.ply", tmp_path / "a.ply", dry_run=True)
    forecast = surfeit.bounce(room / "room.sft", tmp_path / "a.sft", quality="draft", dry_run=True)
    assert forecast["records"] == 3000 and forecast["output_bytes"] > 0
    for forecast in (surfeit.sample(room / "room.obj", tmp_path / "a.ply", count=3000, dry_run=True),
                     surfeit.sample(room / "room.obj", tmp_path / "a.ply", photons=3000, dry_run=True,
                                    light_point=(0.5, 0.9, 0.5, 2, 2, 1)),
                     surfeit.relight(room / "room.sft", tmp_path / "a.sft", dry_run=True,
                                     light_point=(0.5, 0.9, 0.5, 2, 2, 1))):
        assert forecast["records"] == 3000 and forecast["output_bytes"] > 0
    forecast = surfeit.brick(room / "room.ply", tmp_path / "a.vdb", channel="radiosity", dry_run=True)
    assert forecast["records"] == 3000 and forecast["memory_bytes"] > 0
    forecast = surfeit.lookup(room / "room.ply", room / "room.ply", tmp_path / "a.ply",
                              values=["radiosity"], dry_run=True)
    assert forecast["records"] == 3000 and forecast["output_bytes"] > 0
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("wrong, message", [
    ({"bounce_filter": "gain=2"}, "bounce_gain"),
    ({"bounce_filter": "centre=1,1,1 gain=2"}, "centre and radius need each other"),
    ({"bounce_filter": {"center": (1, 1, 1)}}, "center is none of centre, radius"),
    ({"bounce_filter": "centre=1,1,1 radius=2,1 gain=2"}, "outer one not smaller"),
    ({"bounce_filter": "direction=0,0,0 angle=10 gain=2"}, "direction is zero"),
    ({"bounce_filter": "direction=0,0,1 angle=10"}, "changes nothing"),
    ({"bounce_tint": (1, 2)}, "expected 3 numbers"),
    ({"bounce_gain": -1.0}, "expected 0 to 1e"),
    ({"mode": "occlusion", "bounce_gain": 2.0}, "bleeding"),
    ({"shard": "4/3"}, "I/N"),
    ({"resume_parts": 3}, "resume=True"),
    ({"max_pixel_dist": 2}, "4 and more"),
    ({"occlusion_by_brightness": True}, "environment"),
], ids=str)
def test_wrong_values_are_refused(room, tmp_path, wrong, message):
    options = {"mode": "bleeding", **wrong}
    with pytest.raises(ValueError, match=message):
        surfeit.gather(room / "room.sft", room / "room.ply", tmp_path / "a.ply", **options)
    if not {"shard", "resume_parts"} & set(wrong):
        scene = surfeit.Engine(memory="64M").open(room / "room.sft")
        with pytest.raises(ValueError, match=message):
            scene.gather(np.zeros((4, 3)), **options)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("wrong, message", [
    ({"group_gain": {"rad": 1}}, "white, red, green"),
    ({"group_gain": "red"}, "groups: value"),
    ({"group_gain": {"red": -1}}, "0 to 1e"),
    ({"group_gain": {"red": 1, "2": 1}}, "another value has"),
    ({"group_tint": {"red": 1}}, "3 numbers"),
    ({"spare_last": True}, "surfels_per_receiver"),
], ids=str)
def test_wrong_bounces_are_refused(room, tmp_path, wrong, message):
    with pytest.raises(ValueError, match=message):
        surfeit.bounce(room / "room.sft", tmp_path / "a.sft", **wrong)
    assert list(tmp_path.iterdir()) == []


# Settings of each command; what is not among them are arguments of the function
COMMANDS = {
    "bounce": (surfeit.bounce, settings.BounceSettings),
    "brick": (surfeit.brick, settings.BrickSettings),
    "composite": (surfeit.composite, settings.CompositeSettings),
    "convert": (surfeit.convert, settings.ConvertSettings),
    "cube": (surfeit.cube, settings.CubeSettings),
    "gather": (surfeit.gather, settings.GatherJobSettings),
    "generate": (surfeit.generate, settings.GenerateSettings),
    "index": (surfeit.index, settings.IndexSettings),
    "info": (surfeit.info, settings.ReadSettings),
    "lookup": (surfeit.lookup, settings.LookupSettings),
    "merge": (surfeit.merge, settings.JobSettings),
    "normals": (surfeit.normals, settings.NormalsSettings),
    "radiance": (surfeit.radiance, settings.RadianceSettings),
    "relight": (surfeit.relight, settings.RelightSettings),
    "sample": (surfeit.sample, settings.SampleSettings),
    "tune": (surfeit.tune, settings.GatherJobSettings),
    "verify": (surfeit.verify, settings.JobSettings),
    "view": (surfeit.view, settings.ViewSettings),
}
# Options under another name here
RENAMED = {
    "temp": "temporary_directory", "subset": "groups", "max-dist": "max_distance",
    "near-field": "near_field_radii", "orient": "toward", "precision": "full_precision",
    "leaf": "leaf_capacity", "set": "assignments", "pass": "pass_", "sample": "sample_receivers",
    ("gather", "camera"): "eye", ("tune", "camera"): "eye", ("cube", "camera"): "eye",
    ("lookup", "channel"): "values", ("gather", "up"): "environment_up",
    ("tune", "up"): "environment_up",
    "no-mesh-light": "mesh_light", "no-prefetch": "prefetch",
}
# And those without a place in Python
ELSEWHERE = {
    "help", "help-all", "output",  # the output is an argument
    "stats", "json", "cache-series",  # what is returned
    "progress", "quiet", "verbose",  # progress=, warnings and logging
    "read-retries",  # set_read_retries
    "frames", "newer",  # a loop
    "plot",  # matplotlib
    "clamp",  # has no effect
    # limits of the process, which is Python's: meshes and small files are held whole
    ("sample", "memory"), ("relight", "memory"), ("generate", "memory"), ("convert", "threads"),
    ("generate", "strict"), ("verify", "strict"), ("info", "strict"),
}


def options_of(command):
    """The first name of each option that the program's help lists."""
    text = subprocess.run([os.environ["SURFEIT_PROGRAM"], command, "--help"], check=True,
                          capture_output=True, text=True).stdout
    return re.findall(r"^ +(?:-\w,)?--([\w-]+)", text, re.M)


@pytest.mark.parametrize("command", COMMANDS)
def test_every_option_of_the_program_is_there(command, run_program):
    function, of_settings = COMMANDS[command]
    known = {name for name, parameter in inspect.signature(function).parameters.items()
             if parameter.kind is not inspect.Parameter.VAR_KEYWORD}
    known |= set(of_settings.__annotations__)
    options = options_of(command)
    assert len(options) > 5
    missing = []
    for option in options:
        name = RENAMED.get((command, option)) or RENAMED.get(option) or option.replace("-", "_")
        if name not in known and option not in ELSEWHERE and (command, option) not in ELSEWHERE:
            missing.append(option)
    print(f"{command}: {len(options)} options, {len(missing)} missing")
    assert missing == []


def test_every_command_has_a_function(run_program):
    text = subprocess.run([os.environ["SURFEIT_PROGRAM"], "--help"], check=True,
                          capture_output=True, text=True).stdout
    listed = re.findall(r"^  (\w+)  ", text[text.index("Subcommands:"):], re.M)
    # Scripts for farms, and command lines of RenderMan, stand for others
    assert set(listed) - set(COMMANDS) - {"plan", "ptfilter", "brickmake"} == set()
