#!/usr/bin/env bash
# What a population's members should be made of: one network that LEARNERS people share, and what
# somebody new changes of it. PEOPLE new people are trained in each of these ways, all from the
# shared network and the learners' mean static map, but for the first:
#
#   scratch      everything, from the common random weights
#   free         everything
#   map          the static map alone
#   residual_R   and the network's kernels by A B
#   scale_R      and the network's kernels by products with 1 + A B, half of A drawn once for all
#   basis_R      and the network's kernels by A S, whose S is everybody's
#
# Writes docs/results/structures.json.
#
#   scripts/experiments/structures.sh [FOLDER]
#
# FOLDER (default out/structures) keeps every step: run it again and it goes on where it stopped.
#
# Environment: LEARNERS (12), PEOPLE (6), ITERATIONS (1000) of a new person. On two quiet cores
# forty minutes.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/../environment.sh"
cd "$figurine_checkout"

folder=${1:-out/structures} learners=${LEARNERS:-12} people=${PEOPLE:-6}
iterations=${ITERATIONS:-1000}
programs=()
. scripts/experiments/people.sh

capture_people() {  # NAME COUNT SEED
  [ -e "$folder/$1/.done" ] || {
    step "captures of $2 $1"
    train capture --body "$body" --identities "$2" --seed "$3" --frames 50 --views 6 \
      --bust-views 3 --size 512x512 "${motions[@]}" --resume -o "$folder/$1"
    touch "$folder/$1/.done"
  }
}
capture_people learners "$learners" 2026
capture_people people "$people" 2027

finished() { [ -e "$1/run.json" ] && grep -q '"status": "finished"' "$1/run.json"; }
learn() {  # RUN OPTIONS...: trains what is not there yet
  local run=$1 fresh=("${@:2}")
  finished "$run" && return
  if [ -e "$run/run.json" ]; then
    train avatar --resume --quiet -o "$run"
  else
    train avatar --body "$body" --quiet -o "$run" "${fresh[@]}"
  fi
}
# Two at a time, one core each.
beside() {
  while [ "$(jobs -rp | wc -l)" -ge 2 ]; do wait -n; done
  "$@" &
}
all() { while [ "$(jobs -rp | wc -l)" -gt 0 ]; do wait -n; done; }

shared=$folder/shared
everybody=()
for k in $(seq 0 $((learners - 1))); do
  everybody+=(--data "$folder/learners/$(printf %06d "$k")")
done
step "the shared network"
learn "$shared" "${everybody[@]}" --iterations $((learners * iterations)) --poses 2

step "the directions that learners change it by"
runs=()
for k in $(seq 0 $((learners - 1))); do
  name=$(printf %06d "$k")
  runs+=("$folder/tuned/$name")
  beside learn "$folder/tuned/$name" --data "$folder/learners/$name" \
    --init "$shared/$name" --iterations $((iterations / 3)) --views-per-pose 2 --threads 1
done
all
basis=$folder/basis.safetensors
[ -e "$basis" ] || train basis --shared "$shared" "${runs[@]}" --rank 32 -o "$basis"

ways="
scratch
free|--init $shared
map|--init $shared --freeze-network
residual_4|--init $shared --network-rank 4
scale_4|--init $shared --network-rank 4 --network-adapter scale
basis_8|--init $shared --network-rank 8 --network-adapter basis --network-basis $basis
basis_32|--init $shared --network-rank 32 --network-adapter basis --network-basis $basis
"
one() {  # NAME PERSON OPTIONS...
  local run=$folder/runs/$1/$2
  learn "$run" --data "$folder/people/$2" --iterations "$iterations" --views-per-pose 2 \
    --threads 1 "${@:3}"
  [ "$run/evaluation.json" -nt "$run/weights.safetensors" ] ||
    train evaluate reconstruction --run "$run" --threads 1 > /dev/null
}
while IFS='|' read -r name options; do
  [ -n "$name" ] || continue
  step "$name"
  for k in $(seq 0 $((people - 1))); do
    # shellcheck disable=SC2086  # options are words
    beside one "$name" "$(printf %06d "$k")" $options
  done
done <<< "$ways"
all
step "docs/results/structures.json"
scripts/run python3 scripts/experiments/structures_report.py "$folder" \
  docs/results/structures.json "scripts/experiments/structures.sh"
