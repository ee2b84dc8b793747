#!/usr/bin/env bash
# Fixed point measured on three people: trains and fine-tunes what is missing, packs all in int8,
# writes docs/results/quantization.json.
#
#   scripts/experiments/quantization.sh [FOLDER [RUN...]]
#
# FOLDER (default out/quantization) keeps every step: run it again and it goes on where it stopped.
#
# With RUNs, these are measured and nothing is trained but their fine-tunes. Environment: SEEDS ("1
# 6 23") of the people; ITERATIONS (3000), VIEWS (2) a pose of the trainings; QAT_ITERATIONS (400)
# of the fine-tunes; THREADS (1). On one quiet core it takes about three quarters of an hour by
# estimate, with three RUNs a quarter.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/../environment.sh"
cd "$figurine_checkout"

folder=${1:-out/quantization}
runs=("${@:2}")
seeds=${SEEDS:-1 6 23} iterations=${ITERATIONS:-3000} views=${VIEWS:-2} threads=${THREADS:-1}
qat_iterations=${QAT_ITERATIONS:-400}
. scripts/experiments/people.sh

train_person() {  # SEED
  local run=$folder/runs/$1 identity
  capture_person "$folder/capture_$1" "$1"
  local resume=()
  [ ! -e "$run/run.json" ] || resume=(--resume)
  step "training person $1"
  train avatar --data "$identity" --body "$body" --preset edge --iterations "$iterations" \
    --views-per-pose "$views" --threads "$threads" "${resume[@]}" -o "$run"
  runs+=("$run")
}
[ ${#runs[@]} -gt 0 ] || for seed in $seeds; do train_person "$seed"; done

measured=()
for run in "${runs[@]}"; do
  package=$folder/$(basename "$run").fgn
  [ "$package" -nt "$run/weights.safetensors" ] ||
    { step "packing $run"; train pack "$run" --precision q8 --threads "$threads" -o "$package"; }
  measured+=(--run "$run" --package "$package")
done

step "docs/results/quantization.json"
train evaluate quantization "${measured[@]}" --motion "$folder/walk_straight.fgn" \
  --qat-iterations "$qat_iterations" --threads "$threads" -o docs/results/quantization.json
