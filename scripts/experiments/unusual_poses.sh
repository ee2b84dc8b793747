#!/usr/bin/env bash
# What keeping a network to the poses that it knows is worth: the shipped person, walking and
# jumping before fewer and smaller cameras, trained for a few minutes of one core; then drawn in
# poses that training never saw, against the person photographed again in each. Writes
# docs/results/unusual_poses.json.
#
#   scripts/experiments/unusual_poses.sh [FOLDER] [OPTIONS of unusual_poses.py...]
#
# FOLDER (default out/unusual_poses) keeps every step: run it again and it goes on where it stopped.
#
# Environment: ITERATIONS (3000), SEED (1) of the person.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/../environment.sh"
cd "$figurine_checkout"

folder=${1:-out/unusual_poses} iterations=${ITERATIONS:-3000}
programs=()
. scripts/experiments/people.sh

capture_person "$folder/capture" "${SEED:-1}" --size 192x192 --views 8 --bust-views 0
run=$folder/runs/walker
if [ -e "$run/run.json" ]; then
  train avatar --data "$identity" --body "$body" --resume --quiet -o "$run"
else
  train avatar --data "$identity" --body "$body" --preset edge --threads 1 --views-per-pose 2 \
    --iterations "$iterations" --quiet -o "$run"
fi
step "the person is trained"
scripts/run python3 scripts/experiments/unusual_poses.py --folder "$folder" \
  --motion samples/packages/dance.fgn --command "scripts/experiments/unusual_poses.sh" \
  "${@:2}" "walker=$run"
cp "$folder/walker.png" docs/unusual_poses.png
step "docs/results/unusual_poses.json"
