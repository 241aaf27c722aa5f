"""What a type checker sees: the package is sound, wrong calls are found, the stub names the binding."""

import ast
import os
import subprocess
import sys

import numpy as np
import pytest

import surfeit
from surfeit import _surfeit

PACKAGE = os.path.dirname(surfeit.__file__)
# Unpack of TypedDict, by which options have types, is behind a flag before mypy 1.4
FLAGS = ["--enable-incomplete-feature=Unpack"]


def mypy(directory, *arguments):
    pytest.importorskip("mypy", reason="mypy is missing: scripts/install-deps.sh")
    done = subprocess.run([sys.executable, "-m", "mypy", *FLAGS, "--cache-dir",
                           str(directory / "cache"), *map(str, arguments)],
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                          env={**os.environ, "MYPYPATH": os.path.dirname(PACKAGE)})
    print(done.stdout)
    return done.stdout.splitlines()


def test_the_package_has_no_type_errors(tmp_path):
    assert mypy(tmp_path, PACKAGE)[-1].startswith("Success")


CALLS = """
import numpy as np
import surfeit

engine = surfeit.Engine(memory="512M")
scene = engine.open("scene.sft")
points = np.zeros((3, 3), np.float32)
result = scene.gather(points, points, mode="bleeding", quality="draft", outputs=["occlusion"])
occlusion = result["occlusion"].mean()
surfeit.index("a.ply", "a.sft", memory="1G", full_precision=True)
surfeit.convert(["a.ply", "b.ply"], "c.vdb", every=2)
"""
WRONG_CALLS = [
    'scene.gather(points, points, quality="drafty")',
    "scene.gather(points, points, max_solid_angle='much')",
    "scene.gather(points, points, max_solid_angel=0.1)",
    'surfeit.index("a.ply", 3)',
    'surfeit.convert(["a.ply"], "c.vdb", every="all")',
]


def test_right_calls_pass_and_wrong_ones_are_found(tmp_path):
    (tmp_path / "right.py").write_text(CALLS)
    (tmp_path / "wrong.py").write_text(CALLS + "\n".join(WRONG_CALLS) + "\n")
    assert mypy(tmp_path, tmp_path / "right.py")[-1].startswith("Success")
    found = mypy(tmp_path, tmp_path / "wrong.py")
    first = CALLS.count("\n") + 1
    for line, call in enumerate(WRONG_CALLS, first):
        assert any(f"wrong.py:{line}: error" in text for text in found), call


def test_the_stub_names_what_the_binding_has():
    with open(os.path.join(PACKAGE, "_surfeit.pyi")) as file:
        tree = ast.parse(file.read())
    stub = {node.name: node for node in tree.body
            if isinstance(node, (ast.FunctionDef, ast.ClassDef))}
    optional = {"sample", "photons", "relight", "trace_cube", "view", "composite",
                "write_cube_picture"}
    binding = {name for name in dir(_surfeit) if not name.startswith("_")}
    errors = {name for name in binding if isinstance(getattr(_surfeit, name), type)
              and issubclass(getattr(_surfeit, name), BaseException)}
    assert set(stub) - optional <= binding
    assert binding - errors <= set(stub)
    for name, node in stub.items():
        if isinstance(node, ast.ClassDef) and name in binding:
            written = {each.name for each in node.body if isinstance(each, ast.FunctionDef)}
            there = {each for each in vars(getattr(_surfeit, name)) if not each.startswith("_")}
            assert written - {"__init__"} == there, name


def test_results_are_the_arrays_that_the_stub_says(engine, scene_path, receivers):
    found = engine.open(scene_path).gather(*receivers, quality="draft")
    assert all(isinstance(values, np.ndarray) for values in found.values())
