"""A build without the components sample and view: the rest works, and errors name what is missing."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import surfeit

CODE = """
import numpy, surfeit
points = numpy.random.default_rng(1).random((1000, 3), numpy.float32)
surfeit.index({"position": points, "area": numpy.full(1000, 1e-3)}, "a.sft")
assert surfeit.Engine(memory="128M").open("a.sft").gather(points)["occlusion"].shape == (1000,)
for component, call in (
        ("sample", lambda: surfeit.sample("a.obj", "a.ply", count=10)),
        ("sample", lambda: surfeit.relight("a.sft", "b.sft", light_point=(0, 0, 0, 1, 1, 1))),
        ("sample", lambda: surfeit.cube("a.sft", at=(0, 0, 0), reference="a.obj")),
        ("view", lambda: surfeit.view("a.sft", "a.png")),
        ("view", lambda: surfeit.composite("a.exr", "a.png")),
        ("view", lambda: surfeit.cube("a.sft", at=(0, 0, 0), picture="a.png"))):
    try:
        call()
    except NotImplementedError as error:
        assert f"lacks the component {component}:" in str(error), error
        assert f"SURFEIT_BUILD_{component.upper()}=ON" in str(error), error
        print(error)
    else:
        raise AssertionError(component)
"""


def test_without_sample_and_view(tmp_path):
    package = tmp_path / "surfeit"
    package.mkdir()
    for source in Path(surfeit.__file__).parent.glob("*.py"):
        shutil.copy(source, package)
    (module,) = Path(os.environ["SURFEIT_BARE_MODULE"]).glob("_surfeit*.so")
    shutil.copy(module, package)
    done = subprocess.run([sys.executable, "-W", "ignore", "-c", CODE], cwd=tmp_path, text=True,
                          capture_output=True, env={**os.environ, "PYTHONPATH": str(tmp_path)})
    assert done.returncode == 0, done.stdout + done.stderr
    assert len(done.stdout.splitlines()) == 6
