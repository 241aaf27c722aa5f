"""A wheel and a Debian package are built without network, and work by themselves."""

import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import surfeit

SOURCES = Path(__file__).resolve().parents[1]


# Uses the package that lies below EXPECTED.
CODE = """
import os, numpy, surfeit
assert surfeit.__file__.startswith(os.environ["EXPECTED"]), surfeit.__file__
assert os.path.exists(os.path.join(os.path.dirname(surfeit.__file__), "py.typed"))
points = numpy.random.default_rng(1).random((1000, 3), numpy.float32)
surfeit.index({"position": points, "area": numpy.full(1000, 1e-3)}, os.environ["SCENE"])
print(surfeit.Engine(memory="128M").open(os.environ["SCENE"]).gather(points)["occlusion"].shape)
"""


def run(*command, **environment):
    clean = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(list(map(str, command)), env={**clean, **environment}, text=True,
                          capture_output=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_wheel_installs_into_a_clean_environment(tmp_path):
    for module in ("pip", "setuptools", "wheel", "ensurepip"):
        if importlib.util.find_spec(module) is None:
            pytest.skip(f"{module} is missing: scripts/install-deps.sh")
    build_dir = Path(surfeit.__file__).resolve().parents[2]
    sources = tmp_path / "source" / "python"
    shutil.copytree(SOURCES, sources, ignore=shutil.ignore_patterns("tests", "__pycache__"))
    shutil.copy(SOURCES.parent / "CMakeLists.txt", sources.parent)
    run(sys.executable, "-m", "pip", "wheel", "--no-build-isolation", "--no-index", "--no-deps",
        "--wheel-dir", tmp_path, sources, SURFEIT_BUILD_DIR=str(build_dir))
    (wheel,) = tmp_path.glob("surfeit-*.whl")
    assert surfeit.__version__ in wheel.name and "none-any" not in wheel.name

    # numpy comes from the system
    run(sys.executable, "-m", "venv", "--system-site-packages", tmp_path / "venv")
    python = tmp_path / "venv" / "bin" / "python"
    run(python, "-m", "pip", "install", "--no-index", "--no-deps", wheel)
    said = run(python, "-W", "ignore", "-c", CODE, EXPECTED=str(tmp_path / "venv"),
               SCENE=str(tmp_path / "a.sft"))
    assert said.strip() == "(1000,)"


def test_debian_package_works_where_it_is_unpacked(tmp_path):
    for program in ("cpack", "dpkg-deb", "dpkg-shlibdeps"):
        if shutil.which(program) is None:
            pytest.skip(f"{program} is missing")
    build_dir = Path(surfeit.__file__).resolve().parents[2]
    config = build_dir / "CPackConfig.cmake"
    run("cpack", "-G", "DEB", "--config", config, "-B", tmp_path / "cpack")
    (package,) = (tmp_path / "cpack").glob("python3-surfeit_*.deb")
    control = run("dpkg-deb", "--field", package)
    assert "Package: python3-surfeit" in control and f"Version: {surfeit.__version__}" in control
    assert "python3-numpy" in control and "libtbb" in control
    run("dpkg-deb", "--extract", package, tmp_path / "root")
    unpacked = tmp_path / "root" / "usr" / "lib" / "python3" / "dist-packages"
    said = run(sys.executable, "-W", "ignore", "-c", CODE, EXPECTED=str(unpacked),
               SCENE=str(tmp_path / "a.sft"), PYTHONPATH=str(unpacked))
    assert said.strip() == "(1000,)"
