#!/usr/bin/env bash
# The shipped person once more, with fewer texels and a smaller network or none: what a renderer
# draws of figures too small for more (--coarse). Leaves a package for each in FOLDER; crowd.py
# measures them.
#
#   scripts/experiments/coarse.sh [FOLDER]
#
# FOLDER (default out/coarse) keeps every step: run it again and it goes on where it stopped. The
# person's captures are taken at the size at which a level is to be seen, because smallest extents
# and details follow from what a camera resolved. Trained for iterations, two rows at a time on one
# core each.
#
# Environment: ITERATIONS (3000), SEED (1) of the person.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/../environment.sh"
cd "$figurine_checkout"

folder=${1:-out/coarse} iterations=${ITERATIONS:-3000}
programs=(figurine)
. scripts/experiments/people.sh

coarse_body=$folder/body_64.fgn
[ -e "$coarse_body" ] || train body --makehuman --uv 64 "${body_options[@]}" -o "$coarse_body"
capture_person "$folder/capture" "${SEED:-1}" --size 128x128 --bust-views 0
person=$identity

row() {  # NAME OPTIONS...
  local run=$folder/runs/$1
  if [ -e "$run/run.json" ]; then
    train avatar --data "$person" --body "$coarse_body" --resume --quiet -o "$run"
  else
    train avatar --data "$person" --body "$coarse_body" --preset edge --uv 64 --threads 1 \
      --iterations "$iterations" --views-per-pose 2 --quiet -o "$run" "${@:2}"
  fi
  [ "$run/evaluation.json" -nt "$run/weights.safetensors" ] ||
    train evaluate reconstruction --run "$run" --threads 1 > /dev/null
  local precision=(--precision q8)
  [ "$1" != none ] || precision=()
  train pack "$run" "${precision[@]}" -o "$folder/$1.fgn"
  step "$1 is there"
}
row network_32 --network-size 32 --channels 16 &
row none --network none &
while [ "$(jobs -rp | wc -l)" -gt 0 ]; do wait -n; done
