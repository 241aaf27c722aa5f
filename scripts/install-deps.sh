#!/usr/bin/env bash
# Installs the Debian 12 packages that building and testing Surfeit needs. Does nothing when all of
# them are there.
set -euo pipefail

packages=(
  # Tools
  g++ cmake ninja-build ccache pkg-config
  # Library
  libglm-dev libfmt-dev libtbb-dev libzstd-dev zlib1g-dev libblosc-dev libxxhash-dev libhwy-dev nlohmann-json3-dev
  libopenexr-dev
  # Program: rays and meshes of `surfeit sample`, pictures of `surfeit view`
  libcli11-dev libembree-dev libtinyobjloader-dev libstb-dev libpng-dev
  # Python package, its tests and examples, and pictures of docs/gallery.md
  python3 python3-dev python3-numpy pybind11-dev python3-pytest python3-matplotlib mypy
  # Its wheel
  python3-setuptools python3-wheel python3-pip python3-venv
  # Tests; GNU parallel runs one of the jobs of `surfeit plan`
  libgtest-dev libgmock-dev parallel make
  # OpenVDB itself, against which our reader and writer of .vdb are tested
  libopenvdb-dev libboost-iostreams-dev
)

if ! command -v dpkg-query > /dev/null || ! command -v apt-get > /dev/null; then
  echo "Not a Debian system: please see to it that these are installed: ${packages[*]}"
  exit 0
fi

missing=()
for package in "${packages[@]}"; do
  state=$(dpkg-query --show --showformat='${db:Status-Status}' "$package" 2> /dev/null || true)
  [[ $state == installed ]] || missing+=("$package")
done
if ((${#missing[@]} == 0)); then
  echo "All packages are installed."
  exit 0
fi

as_root=()
if ((EUID != 0)); then as_root=(sudo); fi
echo "Installing: ${missing[*]}"
"${as_root[@]}" apt-get update --quiet
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
  apt-get install --yes --quiet --no-install-recommends "${missing[@]}"
