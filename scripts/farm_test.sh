#!/usr/bin/env bash
# Runs the tests of farms with a Slurm cluster of two nodes on this machine: installs Debian's
# slurm-wlm and munge where they are missing, starts them as the superuser in a directory and with
# ports of their own, without systemd, and ends them.
#
#   scripts/farm_test.sh [PRESET]
#
# In a container that has never run them, this is all that a farm needs. Services that the packages
# bring are not started.
set -euo pipefail
cd "$(dirname "$0")/.."
preset=${1:-dev}

if ((EUID != 0)); then
  echo "the cluster needs the superuser: sudo scripts/farm_test.sh $preset" >&2
  exit 1
fi
missing=()
for package in slurm-wlm munge parallel; do
  state=$(dpkg-query --show --showformat='${db:Status-Status}' "$package" 2> /dev/null || true)
  [[ $state == installed ]] || missing+=("$package")
done
if ((${#missing[@]} > 0)); then
  apt-get update --quiet
  # Packages start their services where systemd or a policy lets them; this says no
  policy=/usr/sbin/policy-rc.d
  if [[ ! -e $policy ]]; then
    trap 'rm -f "$policy"' EXIT
    printf '#!/bin/sh\nexit 101\n' > "$policy"
    chmod +x "$policy"
  fi
  env DEBIAN_FRONTEND=noninteractive apt-get install --yes --quiet --no-install-recommends \
    "${missing[@]}"
fi

cmake --preset "$preset"
cmake --build --preset "$preset" --target surfeit_program cornell_scene
ctest --preset "$preset" -L farm
