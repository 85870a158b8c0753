#!/usr/bin/env bash
# Whole runs of the binaries under the address and undefined-behaviour
# sanitizers: a noisy log with one thread and two (same bytes), the same in two
# logs and with another building, its map and plan used again, every format of
# logs, odometry that is lost. A few minutes; the whole suite under `asan`
# takes an hour.
set -euo pipefail

cd "$(dirname "${BASH_SOURCE[0]}")/../.."

cmake --preset asan >/dev/null
cmake --build --preset asan --target \
  plumbline_simulate plumbline_solve plumbline_evaluate plumbline_inspect
bin=$PWD/build-asan/bin
export LSAN_OPTIONS=suppressions=$PWD/test/sanitizers/leaks.txt:print_suppressions=0
export UBSAN_OPTIONS=print_stacktrace=1
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

passed=0
failed=0
# Runs a command, and tells of it by name.
check() {
  local name=$1
  shift
  if "$@" >"$name.log" 2>&1; then
    passed=$((passed + 1))
    echo "sanitized: $name: passed"
  else
    failed=$((failed + 1))
    echo "sanitized: $name: failed"
    tail -n 60 "$name.log"
  fi
}
simulate() {
  check "$1" "$bin/plumbline_simulate" --quiet "${@:2}"
}
solve() {
  check "solve-$1" "$bin/plumbline_solve" --quiet --output_dir="$1" "${@:2}"
}
# All that two runs wrote but the times of their steps.
same_bytes() {
  local file
  for file in "$1"/*; do
    case ${file##*/} in
      summary.json | report.html | em_trace.csv) ;;
      *) cmp "$file" "$2/${file##*/}" || return 1 ;;
    esac
  done
}

simulate noisy --world=office --size=0.6 --seed=71 --range_noise=0.03 \
  --output=noisy.clf --truth=noisy.json
solve one --input=noisy.clf --num_threads=1
solve two --input=noisy.clf --num_threads=2
check same-bytes same_bytes one two
check evaluate "$bin/plumbline_evaluate" --truth=noisy.json \
  --trajectory=one/trajectory.tum --map=one/map.json \
  --plan=one/floorplan.geojson

# Two parts of a drive, and another building, as three logs.
scans=$(grep -c . noisy.clf)
head -n $((scans * 3 / 5)) noisy.clf >first.clf
tail -n $((scans * 3 / 5)) noisy.clf >second.clf
simulate other --world=symmetric --size=0.3 --seed=72 --range_noise=0.02 \
  --output=other.clf
solve several --input=first.clf,other.clf,second.clf --num_threads=2
solve continued --map=several/map.json --input=second.clf --num_threads=2
solve localized --map=one/map.json --localize --input=first.clf \
  --num_threads=2
solve planned --plan=one/floorplan.dxf --input=first.clf --num_threads=2

simulate carried --world=office --size=0.6 --seed=73 --stress=carried \
  --stress_count=1 --maximum_range=6 --output=carried.clf
check inspect "$bin/plumbline_inspect" carried.clf
solve lost --input=carried.clf --num_threads=2
simulate stale --world=killian_like --size=0.2 --seed=74 --stress=stale \
  --output=stale.clf
solve late --input=stale.clf --num_threads=2 --align=building

for format in ros1 ros2_db3 mcap csv; do
  simulate "bag-$format" --world=office --size=0.3 --seed=75 \
    --format=$format --output="short-$format"
  solve "read-$format" --input="short-$format" --num_threads=2
done

echo "sanitized runs: $passed passed, $failed failed"
[[ $failed == 0 ]]
