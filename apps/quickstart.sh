#!/usr/bin/env bash
# Builds the binaries and makes a map of the bundled log. Run it from anywhere.
set -euo pipefail

top=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
cd "$top"

apps/install_packages.sh
cmake --preset release -DPLUMBLINE_BUILD_TESTS=OFF \
  -DCMAKE_CXX_COMPILER_LAUNCHER=ccache >/dev/null
cmake --build --preset release

build/bin/plumbline_solve --input=datasets/office.clf.gz --output_dir=out/office
echo "The map: $top/out/office/map.png"
