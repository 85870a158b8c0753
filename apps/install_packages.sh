#!/usr/bin/env bash
# Installs the Debian packages that the build needs, as far as they are missing.
# Arguments are names of further packages.
set -euo pipefail

packages=(
  cmake ninja-build ccache g++ pkg-config
  libceres-dev libeigen3-dev libsuitesparse-dev libgoogle-glog-dev libgflags-dev
  libgtest-dev libgmock-dev libbenchmark-dev
  libarchive-dev libsqlite3-dev liblz4-dev libzstd-dev nettle-dev
  libcairo2-dev libgeos-dev libbz2-dev zlib1g-dev nlohmann-json3-dev libnanoflann-dev
  "$@"
)

if ! command -v dpkg-query >/dev/null; then
  echo "no dpkg here: install the equivalents of ${packages[*]} yourself" >&2
  exit 0
fi

missing=()
for package in "${packages[@]}"; do
  status=$(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null || true)
  # The status of a package on several architectures is repeated.
  [[ $status == installed* ]] || missing+=("$package")
done
((${#missing[@]} == 0)) && exit 0

echo "installing ${missing[*]}" >&2
as_root=()
if ((EUID != 0)); then as_root=(sudo); fi
install() {
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
    apt-get install -y -q --no-install-recommends "${missing[@]}" >&2
}
# The package lists may be there and fresh already; fetch them only when not.
install || { "${as_root[@]}" apt-get update -q >&2 && install; }
