#!/usr/bin/env bash
# The whole line with figures: body, capture, training rows, packing, parity; writes docs/results/line.json and the contact sheet beside it.
#
#   scripts/experiments/line.sh [FOLDER]        FOLDER (default out/line) keeps every step: run it again and it goes on where it stopped
#
# The person walks (four walks and an endless one from CMU 01_03) and jumps (01_01), turned through 360 degrees. The shipped avatar trains for
# ten minutes on two quiet cores; all other rows train for iterations, which a busy machine cannot change. The pair with and without the body pose
# takes eleven minutes on one core each.
#
# Environment: ITERATIONS (1500) of the rows that name no number of their own, SEED (1) of the person, IDENTITY (the folder that capture makes of
# it), ROWS (all) a list of row names to limit training to. On two quiet cores it takes about 30 minutes by estimate.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/../environment.sh"
cd "$figurine_checkout"

folder=${1:-out/line}
iterations=${ITERATIONS:-1500} seed=${SEED:-1}
build=build/dev
started=$SECONDS
step() { say "line: $((SECONDS - started)) s: $*"; }
train() { scripts/run "$build/toolchain/cli/figurine-train" "$@"; }
export FIGURINE_COMMIT=${FIGURINE_COMMIT:-$(git rev-parse HEAD 2> /dev/null || echo unknown)$(git diff --quiet HEAD -- 2> /dev/null || echo +changes)}

scripts/setup toolchain
step "building"
scripts/run cmake --preset dev > /dev/null
scripts/run cmake --build --preset dev --target figurine-train > /dev/null
mkdir -p "$folder/runs" docs/results

body=$folder/body.fgn
[ -e "$body" ] || { step "body"; train body --makehuman --uv 128 -o "$body"; }

motions=()
motion() {  # NAME CLIP OPTIONS...
  [ -e "$folder/$1.fgn" ] || train motion "/usr/share/assimp/models/BVH/$2" --body "$body" --name "$1" -o "$folder/$1.fgn" "${@:3}"
  motions+=(--motion "$folder/$1.fgn")
}
step "motions"
motion walk_1 01_03.bvh --start 1 --frames 76
motion walk_straight 01_03.bvh --frames 76 --loop 1 --in-place
motion walk_2 01_03.bvh --start 1473 --frames 50
motion walk_3 01_03.bvh --start 2241 --frames 55
motion walk_4 01_03.bvh --start 3329 --frames 55
motion jump 01_01.bvh --frames 180

data=$folder/capture
[ -e "$data/.done" ] || {
  step "capture"
  train capture --body "$body" --identities 1 --seed "$seed" --frames 119 "${motions[@]}" --resume -o "$data"
  touch "$data/.done"
}
identity=${IDENTITY:-$(cd "$data" && ls -d */ | head -n 1 | tr -d /)}

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
  train avatar --data "$data/$identity" --body "$body" --preset edge $options $resume -o "$run"
  if [ "$name" != speed ] && [ ! "$run/evaluation.json" -nt "$run/weights.safetensors" ]; then
    step "evaluating $name"
    sheet=()
    [ "$name" != shipped ] || sheet=(--sheet docs/line.png)
    train evaluate reconstruction --run "$run" "${sheet[@]}" -o "$run/report.json"
  fi
done <<< "$rows"

if [ -e "$folder/runs/shipped/evaluation.json" ]; then
  step "packing"
  train pack "$folder/runs/shipped" --golden -o "$folder/avatar.fgn"
  step "parity"
  train evaluate parity --run "$folder/runs/shipped" --package "$folder/avatar.fgn" -o "$folder/parity.json"
fi
step "docs/results/line.json"
scripts/run python3 scripts/experiments/line_report.py "$folder" docs/results/line.json "scripts/experiments/line.sh"
