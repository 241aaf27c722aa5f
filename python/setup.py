"""The wheel: CMake builds the module, setuptools packs it. Needs no network.

    pip install ./python                                  # builds the library, which takes minutes
    SURFEIT_BUILD_DIR=build/release pip install ./python  # takes the module that is built there

SURFEIT_WITHOUT=sample,view leaves out components of the library and what they need: Embree, libpng.

Add --no-build-isolation --no-index where setuptools and numpy are Debian's.
"""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent


def version() -> str:
    text = (ROOT / "CMakeLists.txt").read_text()
    return re.search(r"project\(surfeit VERSION ([0-9.]+)", text)[1]


def build_with_cmake(build_dir: Path) -> None:
    without = os.environ.get("SURFEIT_WITHOUT", "").split(",")
    options = {
        "CMAKE_BUILD_TYPE": "Release",
        "SURFEIT_BUILD_TOOLS": "OFF",
        "SURFEIT_BUILD_TESTS": "OFF",
        "SURFEIT_BUILD_BENCH": "OFF",
        "SURFEIT_BUILD_SAMPLE": "OFF" if "sample" in without else "ON",
        "SURFEIT_BUILD_VIEW": "OFF" if "view" in without else "ON",
        "SURFEIT_PYTHON": "ON",
        "Python3_EXECUTABLE": sys.executable,
    }
    definitions = [f"-D{name}={value}" for name, value in options.items()]
    subprocess.run(["cmake", "-S", ROOT, "-B", build_dir, *definitions], check=True)
    jobs = str(os.cpu_count() or 1)
    build = ["cmake", "--build", build_dir, "--target", "surfeit_python", "--parallel", jobs]
    subprocess.run(build, check=True)


class CMakeModule(build_ext):
    def build_extension(self, ext: Extension) -> None:
        target = Path(self.get_ext_fullpath(ext.name)).resolve()
        given = os.environ.get("SURFEIT_BUILD_DIR")
        build_dir = Path(given).resolve() if given else Path(self.build_temp).resolve() / "cmake"
        if not given:
            build_with_cmake(build_dir)
        module = build_dir / "python" / "surfeit" / target.name
        if not module.exists():
            raise SystemExit(f"{module} is missing: build the target surfeit_python")
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(module, target)


setup(
    version=version(),
    ext_modules=[Extension("surfeit._surfeit", sources=[])],
    cmdclass={"build_ext": CMakeModule},
)
