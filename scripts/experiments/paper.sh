#!/usr/bin/env bash
# The preset `paper` beside `edge`: the same person at the paper's size, the same time for each on
# one core, side by side. Writes docs/results/paper.json and docs/paper.jpg.
#
#   scripts/experiments/paper.sh [FOLDER]
#
# FOLDER (default out/paper) keeps every step: run it again and it goes on where it stopped.
#
# Environment: MINUTES (60) of each training, FRAMES (60) of the capture, SEED (1) of the person. On
# two quiet cores an hour and a quarter by estimate.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/../environment.sh"
cd "$figurine_checkout"

folder=${1:-out/paper} minutes=${MINUTES:-60}
programs=(figurine)
. scripts/experiments/people.sh

paper_body=$folder/body_paper.fgn
[ -e "$paper_body" ] || train body --makehuman --uv 256 -o "$paper_body"
[ -e "$folder/capture/.done" ] || {
  step "capture of person ${SEED:-1}"
  train capture --body "$body" --identities 1 --seed "${SEED:-1}" --frames "${FRAMES:-60}" \
    --size 750x1024 "${motions[@]}" --resume -o "$folder/capture"
  touch "$folder/capture/.done"
}
person=$folder/capture/000000

one() {  # PRESET BODY
  local run=$folder/runs/$1 resume=()
  [ ! -e "$run/run.json" ] || resume=(--resume)
  train avatar --data "$person" --body "$2" --preset "$1" --minutes "$minutes" --threads 1 --quiet \
    "${resume[@]}" -o "$run"
  [ "$run/evaluation.json" -nt "$run/weights.safetensors" ] ||
    train evaluate reconstruction --run "$run" --threads 1 > /dev/null
  train pack "$run" --precision f32 -o "$folder/$1.fgn"
  train pack "$run" --precision q8 -o "$folder/$1_q8.fgn"
}
step "training paper and edge for $minutes minutes each"
one paper "$paper_body" &
one edge "$body" &
while [ "$(jobs -rp | wc -l)" -gt 0 ]; do wait -n; done
train evaluate reconstruction --run "$folder/runs/edge" --beside "$folder/runs/paper" \
  --sheet docs/paper.jpg > /dev/null
step "docs/results/paper.json"
scripts/run python3 scripts/experiments/paper_report.py "$folder" docs/results/paper.json \
  "$build/samples/figurine/figurine" "scripts/experiments/paper.sh"
