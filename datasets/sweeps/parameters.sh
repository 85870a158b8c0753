#!/usr/bin/env bash
# The sweeps behind the advice on parameters (README.md): every flag varied
# with the others at their defaults. Started again, it does what is missing.
#
#   bash datasets/sweeps/parameters.sh BIN OUT [JOBS]
#
# BIN is the folder of the binaries, OUT gets a folder a sweep. The logs need
# PLUMBLINE_DATASETS. Says after each sweep how long it took.
set -euo pipefail

bin=$(realpath "$1")
out=$2
jobs=${3:-1}
datasets=${PLUMBLINE_DATASETS:-}

sweep() { # NAME FLAGS... -- COMMAND...
  local start=$SECONDS
  "$bin/plumbline_sweep" --one_at_a_time --jobs="$jobs" --notimes \
    --output_dir="$out/$1" "${@:2}"
  echo "$1: $((SECONDS - start)) s, $SECONDS s in all"
}

# Points: seeds from 1 on. The first value of each is the default.
thresholds='delta_threshold=0.3,0.01,0.05,0.1,0.2,0.5,0.7,0.9'
d=detector_parameters
points="$thresholds;\
$d:line_ransac.sigma=0.02,0.005,0.01,0.05,0.1;\
$d:line_ransac.gate=0.1,0.03,0.05,0.2,0.4;\
$d:line_ransac.tolerance=0.3,0.1,0.2,0.5;\
$d:circle_ransac.sigma=0.02,0.005,0.01,0.05,0.1;\
$d:circle_ransac.gate=0.1,0.03,0.05,0.2,0.4;\
$d:center_cluster.sigma=0.05,0.01,0.02,0.1,0.2;\
$d:center_cluster.gate=0.4,0.1,0.2,0.8;\
$d:orientation_mixture.sigma_deg=0.1,0.02,0.05,0.5,1,3;\
$d:orientation_relation.sigma_deg=0.02,0.1,0.5,2;\
$d:orientation_relation.gate_deg=0.7,1,3,6"
experiment() { # ID TRIALS GRID FIGURE
  sweep "$1" --grid="$3" --trials="$2" --figures="$4" -- \
    plumbline_experiments --experiment="$1" --trials=1 --num_threads=1
}
experiment S1 5 "$points" S1.means.S1.error_structure
experiment S3 5 "$thresholds" 'S3.means.distance noise 0.10 m.error_structure'
experiment S5 5 "$thresholds" 'S5.means.removed by delta.error_structure'
experiment S6 5 "$thresholds" \
  'S6.claims.method 4 isolates the outlier and keeps the others together.value'
experiment S2 2 'delta_threshold=0.3,0.05,0.7' \
  'S2.means.noise 0.30 m.error_structure'
experiment S4 3 "$points" 'S4.means.20 outliers.error_structure'

# Logs: one run of each setting.
walls="delta_threshold=0.3,0.05,0.1,0.5,0.7;\
structure_sigma_segment_orientation=0.1,0.02,0.5,2;\
structure_sigma_orientation_orientation=0.02,0.1,0.5;\
structure_sigma_same_wall=0.05,0.02,0.15;\
structure_sigma_same_wall_angle=0.3,0.1,1;\
link_radius=10,4,25;\
association_depth=3,1,5;\
$d:orientation_mixture.gate_deg=8,4;\
$d:same_wall.min_evidence=3,1.5"
# What matters most, for the logs that take longer.
few_walls="delta_threshold=0.3,0.1,0.7;\
structure_sigma_segment_orientation=0.1,0.02,2;\
link_radius=10,4,25"
no_closures="delta_threshold=0.3,0.05,0.1,0.5,0.7;\
structure_sigma_segment_orientation=0.1,0.02,0.5,2;\
structure_sigma_orientation_orientation=0.02,0.1,0.5;\
link_radius=10,4,25;\
association_depth=3,1,5;\
$d:orientation_mixture.gate_deg=8,4"
solve() { # NAME LOG FIGURE GRID FLAGS...
  if [[ -z $datasets ]]; then
    echo "PLUMBLINE_DATASETS is not set: $1 is skipped" >&2
    return
  fi
  sweep "$1" --grid="$4" --figures="$3" \
    --evaluate="plumbline_evaluate --relations='$datasets/$2.relations'" -- \
    plumbline_solve --input="$datasets/$2.clf.bz2" --num_threads=1 \
    --outputs=trajectory.tum "${@:5}"
}
error=evaluation.relations.translation_m.mean
# The error hardly moves there.
solve fr079 fr079 orthogonality_deg "$walls"
solve intel intel $error "$few_walls"
solve mit-killian mit-killian $error "$few_walls"
# Structure alone, with nothing behind it that makes up for it.
alone=(--global_association=false --refine=map)
solve intel-structure intel $error "$no_closures" "${alone[@]}"
solve mit-killian-structure mit-killian $error "$few_walls" "${alone[@]}"
