#!/usr/bin/env bash
# The whole line with figures: body, capture, training rows, packing, parity; writes
# docs/results/line.json and the contact sheet beside it.
#
#   scripts/experiments/line.sh [FOLDER]
#
# FOLDER (default out/line) keeps every step: run it again and it goes on where it stopped.
#
# The shipped avatar trains for ten minutes on two quiet cores; all other rows train for iterations,
# which a busy machine cannot change. The pair with and without the body pose takes eleven minutes
# on one core each.
#
# Environment: ITERATIONS (1500) of the rows that name no number of their own, SEED (1) of the
# person and ROWS (all), a list of row names to limit training to. On two quiet cores it takes about
# 50 minutes by estimate.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/../environment.sh"
cd "$figurine_checkout"

folder=${1:-out/line}
iterations=${ITERATIONS:-1500} seed=${SEED:-1}
. scripts/experiments/people.sh

capture_person "$folder/capture" "$seed"

# name | options
rows="
speed|--iterations 1200
shipped|--minutes 10 --poses 2 --views-per-pose 2
one_pose|--iterations 10000 --views-per-pose 2 --threads 1
one_pose_frozen|--iterations 10000 --views-per-pose 2 --threads 1 --freeze-pose
short|--iterations $iterations
short_mean_template|--iterations $iterations --template mean
short_fourier_off|--iterations $iterations --fourier off
short_adamw|--iterations $iterations --optimiser adamw
short_learning_rate_4e-3|--iterations $iterations --learning-rate 4e-3
short_two_views|--iterations $iterations --views-per-pose 2
short_warmup_300|--iterations $iterations --warmup 300
"
while IFS='|' read -r name options; do
  [ -n "$name" ] || continue
  case " ${ROWS:-$name} " in *" $name "*) ;; *) continue ;; esac
  run=$folder/runs/$name
  resume=
  [ ! -e "$run/run.json" ] || resume=--resume
  step "training $name"
  # shellcheck disable=SC2086  # options are words
  train avatar --data "$identity" --body "$body" --preset edge $options $resume -o "$run"
  if [ "$name" != speed ] && [ ! "$run/evaluation.json" -nt "$run/weights.safetensors" ]; then
    step "evaluating $name"
    sheet=()
    [ "$name" != shipped ] || sheet=(--sheet docs/line.png)
    train evaluate reconstruction --run "$run" "${sheet[@]}" -o "$run/report.json"
  fi
done <<< "$rows"

if [ -e "$folder/runs/shipped/evaluation.json" ]; then
  step "packing"
  train pack "$folder/runs/shipped" --precision f32,q8 --golden -o "$folder/avatar.fgn"
  step "parity"
  train evaluate parity --run "$folder/runs/shipped" --package "$folder/avatar.fgn" \
    -o "$folder/parity.json"
fi
step "docs/results/line.json"
scripts/run python3 scripts/experiments/line_report.py "$folder" docs/results/line.json \
  "scripts/experiments/line.sh"
