"""Errors are Python's own, with the library's messages."""

import errno

import numpy as np
import pytest

import surfeit


def test_missing_files_are_file_not_found(engine, tmp_path):
    for call in (engine.open, surfeit.read, surfeit.verify, surfeit.info):
        with pytest.raises(FileNotFoundError) as caught:
            call(tmp_path / "none.sft")
        assert caught.value.errno == errno.ENOENT
        assert caught.value.filename == str(tmp_path / "none.sft")
    with pytest.raises(OSError):
        surfeit.write(tmp_path / "none" / "a.ply", {"position": np.zeros((1, 3))})


def test_damaged_files_say_where(engine, scene_path, tmp_path, receivers):
    bytes_ = bytearray(scene_path.read_bytes())
    damaged = tmp_path / "damaged.sft"
    damaged.write_bytes(bytes_[: len(bytes_) // 2])
    with pytest.raises(surfeit.DamagedFile, match="damaged.sft") as caught:
        engine.open(damaged)
    assert isinstance(caught.value, OSError)
    for place in range(20_000, len(bytes_) * 3 // 4, 16_384):  # pages, not the directory
        bytes_[place] ^= 0x55
    damaged.write_bytes(bytes_)
    assert surfeit.verify(damaged)["finding_count"] > 0
    with pytest.raises(surfeit.DamagedFile, match="page .* checksum"):
        engine.open(damaged).gather(*receivers)


def test_budgets_name_the_least_that_works(scene_path, tmp_path):
    with pytest.raises(MemoryError, match="MiB is the least that works"):
        surfeit.Engine(memory="1M")
    with pytest.raises(MemoryError, match="least"):
        surfeit.index(scene_path, tmp_path / "a.sft", memory="2M")
    assert not (tmp_path / "a.sft").exists()


def test_budgets_have_units():
    from surfeit._arguments import memory_bytes

    assert memory_bytes("512M") == memory_bytes("512MiB") == memory_bytes(512 << 20) == 512 << 20
    assert memory_bytes("1.5G") == 3 << 29
    assert 0 < memory_bytes("10%") < memory_bytes("80%")
    for wrong in ("", "M", "12X", "0", "200%", "%", "-1M", 0, -5):
        with pytest.raises(ValueError, match="memory"):
            memory_bytes(wrong)


def test_wrong_settings_are_value_or_type_errors(scene, receivers):
    for settings, message in [
        ({"mode": "shiny"}, "expected one of occlusion, bleeding, glossy"),
        ({"quality": "best"}, "draft, standard, final"),
        ({"outputs": ["colour"]}, "colour"),
        ({"raster_resolution": 15}, "raster"),
        ({"max_solid_angle": -1.0}, "solid angle"),
        ({"groups": "99"}, "99"),
        ({"environment": np.zeros((4, 4))}, "environment"),
    ]:
        with pytest.raises(ValueError, match=message):
            scene.gather(*receivers, **settings)
    with pytest.raises(TypeError, match="unknown options: qualty"):
        scene.gather(*receivers, qualty="draft")
    with pytest.raises(TypeError, match="bias"):
        scene.gather(*receivers, bias="much")


def test_wrong_arrays_are_value_errors(scene, receivers, tmp_path):
    positions, normals = receivers
    for given in [(positions[:, :2],), (positions, normals[:10]), (positions, normals[:, :2]),
                  (np.array(["a", "b", "c"]),), (positions.astype(complex),)]:
        with pytest.raises(ValueError):
            scene.gather(*given)
    for arrays in [{"normal": normals}, {"position": positions, "radius": np.ones(3)}, {},
                   {"position": np.zeros((4, 3, 2))}, {"position": positions, "a b": normals[:, 0]},
                   {"position": positions, "tag": normals[:, 0].astype(complex)}]:
        with pytest.raises(ValueError):
            surfeit.index(arrays, tmp_path / "a.sft")
    with pytest.raises(ValueError, match="expected one or more"):
        surfeit.index(iter([]), tmp_path / "a.sft")
    chunks = [{"position": positions}, {"position": positions.astype(np.float64)}]
    with pytest.raises(ValueError, match="chunk"):
        surfeit.write(tmp_path / "a.ply", chunks)
    with pytest.raises(ValueError):
        surfeit.write(tmp_path / "a.unknown", {"position": positions})
    with pytest.raises(ValueError, match="expected one of position"):
        surfeit.read(scene.path, only=["colour"])
    assert list(tmp_path.iterdir()) == []


def test_what_a_chunk_raises_reaches_the_caller(receivers, tmp_path):
    def chunks():
        yield {"position": receivers[0]}
        raise LookupError("the next chunk")

    with pytest.raises(LookupError, match="the next chunk"):
        surfeit.index(chunks(), tmp_path / "a.sft")
    assert list(tmp_path.iterdir()) == []


def test_guesses_are_warnings_or_with_strict_errors(receivers, tmp_path):
    arrays = {"position": receivers[0]}
    with pytest.warns(surfeit.DataWarning, match="neither radius nor area") as caught:
        surfeit.index(arrays, tmp_path / "a.sft")
    assert all(warning.filename == __file__ for warning in caught)
    with pytest.raises(surfeit.DataWarning):
        surfeit.index(arrays, tmp_path / "b.sft", strict=True)
    assert not (tmp_path / "b.sft").exists()
