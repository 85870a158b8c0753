#!/usr/bin/env bash
# Builds with warnings as errors and runs the tests. Arguments go to ctest:
# test/run.sh -R Graph
set -euo pipefail

cd "$(dirname "${BASH_SOURCE[0]}")/.."

apps/install_packages.sh clang-format doxygen dpkg-dev libdxflib-dev
cmake --preset ci >/dev/null
cmake --build --preset ci
ctest --preset ci --parallel "$(nproc)" "$@"
