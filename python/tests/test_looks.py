"""The look of bounce light, glossy bounces and gains of groups: the bytes of the program."""

import numpy as np
import pytest

import surfeit
from conftest import same_bytes

pytestmark = pytest.mark.filterwarnings("ignore::surfeit.DataWarning")

FILTER = "centre=.5,.5,.5 radius=.2,.6 gain=.5 direction=0,1,0 angle=20,100 saturation=0"
LOOK = {
    "bounce_gain": 1.7,
    "bounce_saturation": 1.3,
    "bounce_tint": (1, 0.9, 0.8),
    "bounce_filter": [
        {"centre": (0.5, 0.5, 0.5), "radius": (0.2, 0.6), "gain": 0.5, "direction": (0, 1, 0),
         "angle": (20, 100), "saturation": 0},
        "direction=0,0,1 angle=45 tint=1,.5,.5",
    ],
}
LOOK_OPTIONS = ["--bounce-gain", 1.7, "--bounce-saturation", 1.3, "--bounce-tint", "1,.9,.8",
                "--bounce-filter", FILTER, "--bounce-filter", "direction=0,0,1 angle=45 tint=1,.5,.5"]


def test_looks_of_gathers(room, tmp_path, run_program):
    scene, receivers = room / "room.sft", room / "room.ply"
    run_program("gather", scene, receivers, "-o", tmp_path / "program.ply", "--mode", "bleeding",
                "--quality", "draft", *LOOK_OPTIONS)
    surfeit.gather(scene, receivers, tmp_path / "job.ply", mode="bleeding", quality="draft", **LOOK)
    assert same_bytes(tmp_path / "program.ply", tmp_path / "job.ply")

    cloud = surfeit.read(tmp_path / "program.ply")
    opened = surfeit.Engine(memory="128M").open(scene)
    at = cloud["position"], cloud["normal"]
    found = opened.gather(*at, mode="bleeding", quality="draft", **LOOK)
    assert np.array_equal(found["irradiance"], cloud["irradiance"])
    plain = opened.gather(*at, mode="bleeding", quality="draft")
    assert not np.array_equal(plain["irradiance"], found["irradiance"])
    gatherer = opened.engine.gatherer(opened, mode="bleeding", bounce_gain=2)
    doubled = gatherer.another().gather(*at)["irradiance"]
    assert np.array_equal(doubled, 2 * opened.gather(*at, mode="bleeding")["irradiance"])
    far = opened.placed(np.array([[1, 0, 0, 1e4], [0, 1, 0, 0], [0, 0, 1, 0.0]]))
    moved = {**LOOK, "bounce_filter": {"centre": (1e4, 0.5, 0.5), "radius": 0.3, "gain": 0}}
    dark = far.gather(at[0] + np.array([1e4, 0, 0]), at[1], mode="bleeding", **moved)["irradiance"]
    inside = np.linalg.norm(at[0] - (0, 0.5, 0.5), axis=1) < 0.29
    assert inside.any() and not dark[inside].any() and dark[~inside].any()


def test_bounces(room, tmp_path, run_program):
    run_program("bounce", room / "room.sft", "-o", tmp_path / "program.sft", "--bounces", 2,
                "--quality", "draft", "--surfels-per-receiver", 4, "--spare-last", *LOOK_OPTIONS,
                "--group-gain", "red,3=.3", "--group-saturation", "red=.5", "--group-tint",
                "green=1,.5,.25", "--subset", "white,2-4")
    surfeit.bounce(room / "room.sft", tmp_path / "python.sft", 2, quality="draft",
                   surfels_per_receiver=4, spare_last=True, group_gain={"red,3": 0.3},
                   group_saturation="red=.5", group_tint={3: (1, 0.5, 0.25)},
                   groups=["white", 2, 3, 4], **LOOK)
    assert same_bytes(tmp_path / "program.sft", tmp_path / "python.sft")
    surfeit.bounce(room / "room.sft", tmp_path / "plain.sft", 2, quality="draft",
                   surfels_per_receiver=4)
    assert not same_bytes(tmp_path / "plain.sft", tmp_path / "python.sft")


def test_glossy_bounces(room, tmp_path, run_program):
    scene, shiny = room / "room.sft", tmp_path / "python.sft"
    run_program("bounce", scene, "-o", tmp_path / "program.sft", "--quality", "draft",
                "--glossy", "red,3=.5,.3", "--glossy", "white=.8")
    surfeit.bounce(scene, shiny, quality="draft", glossy={"red,3": (0.5, 0.3), "white": 0.8})
    assert same_bytes(tmp_path / "program.sft", shiny)
    assert surfeit.info(shiny)["has_lobes"] and not surfeit.info(scene)["has_lobes"]
    surfeit.gather(shiny, room / "room.ply", tmp_path / "job.ply", mode="bleeding", quality="draft")
    cloud = surfeit.read(tmp_path / "job.ply")
    with pytest.raises(ValueError, match="lobes"):
        surfeit.Engine(memory="128M").open(shiny)
    opened = surfeit.Engine(memory="128M", lobes=True).open(shiny)
    found = opened.gather(cloud["position"], cloud["normal"], mode="bleeding", quality="draft")
    assert np.array_equal(found["irradiance"], cloud["irradiance"])
    for wrong in ({"red": (1, 2, 3)}, {"red": 0.5, 2: 0.5}, {"rad": 0.5}, {"red": 2.0}):
        with pytest.raises(ValueError, match="glossy|rad|share"):
            surfeit.bounce(scene, shiny, glossy=wrong)


def test_gains_of_groups(room, tmp_path, run_program):
    scene, receivers = room / "room.sft", room / "room.ply"
    run_program("gather", scene, receivers, "-o", tmp_path / "p.ply", "--mode", "bleeding",
                "--quality", "draft", "--gain", "red,3=2,white=.5")
    for gain in ({"red,3": 2, "white": 0.5}, "red,3=2,white=.5", {2: 2, 3: 2, 1: 0.5}):
        surfeit.gather(scene, receivers, tmp_path / "j.ply", mode="bleeding", quality="draft",
                       gain=gain)
        assert same_bytes(tmp_path / "p.ply", tmp_path / "j.ply"), gain
    cloud = surfeit.read(tmp_path / "p.ply")
    opened = surfeit.Engine(memory="128M").open(scene)
    found = opened.gather(cloud["position"], cloud["normal"], mode="bleeding", quality="draft",
                          gain={"red,3": 2, "white": 0.5})
    assert np.array_equal(found["irradiance"], cloud["irradiance"])
    with pytest.raises(ValueError, match="expected 1 number"):
        opened.gather(cloud["position"], mode="bleeding", gain={"red": "much"})
