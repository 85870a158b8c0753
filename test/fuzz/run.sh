#!/bin/sh
# Runs every fuzz target for so many seconds on its corpus:
#   test/fuzz/run.sh SECONDS [BUILD_DIR] [SEED]
# BUILD_DIR (build-asan, that of the asan preset): configured with
# -DPLUMBLINE_BUILD_FUZZERS=ON.
set -eu
seconds=${1:?seconds}
build=${2:-build-asan}
seed=${3:-1}
folder=$(dirname "$0")
for fuzzer in "$build"/bin/*_fuzz; do
  name=$(basename "$fuzzer" _fuzz)
  printf '%s: ' "$name"
  if "$fuzzer" -help=1 2>&1 | grep -q max_total_time; then
    "$fuzzer" -max_total_time="$seconds" -seed="$seed" -timeout=20 \
      -dict="$folder/dictionaries/$name.dict" "$folder/corpus/$name" 2>&1 | tail -n 1
  else
    "$fuzzer" --seconds="$seconds" --seed="$seed" \
      --dictionary="$folder/dictionaries/$name.dict" "$folder/corpus/$name"/*
  fi
done
