#!/usr/bin/env bash
# The whole line with figures: body, capture, training rows, packing, parity; writes docs/results/line.json and the contact sheet beside it.
#
#   scripts/experiments/line.sh [FOLDER]        FOLDER (default out/line) keeps every step: run it again and it goes on where it stopped
#
# Environment: LONG_MINUTES (10) of the shipped avatar and of its frozen-pose twin, SHORT_MINUTES (2) of the other rows, SEED (1) of the person,
# IDENTITY (the folder that capture makes of it), ROWS (all) a list of row names to limit training to. On two cores it takes about 40 minutes; keep the
# machine quiet, budgets are in seconds.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/../environment.sh"
cd "$figurine_checkout"

folder=${1:-out/line}
long=${LONG_MINUTES:-10} short=${SHORT_MINUTES:-2} seed=${SEED:-1}
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
data=$folder/capture
[ -e "$data/.done" ] || { step "capture"; train capture --body "$body" --identities 1 --seed "$seed" -o "$data"; touch "$data/.done"; }
identity=${IDENTITY:-$(cd "$data" && ls -d */ | head -n 1 | tr -d /)}

# name | minutes | options
rows="
shaped|$long|
frozen_pose|$long|--freeze-pose
short|$short|
short_mean_template|$short|--template mean
short_learning_rate_1e-4|$short|--learning-rate 1e-4
short_learning_rate_5e-4|$short|--learning-rate 5e-4
short_fourier_off|$short|--fourier off
short_f32|$short|--precision f32
short_warmup_300|$short|--warmup 300
"
while IFS='|' read -r name minutes options; do
  [ -n "$name" ] || continue
  case " ${ROWS:-$name} " in *" $name "*) ;; *) continue ;; esac
  run=$folder/runs/$name
  resume=
  [ ! -e "$run/run.json" ] || resume=--resume
  step "training $name, $minutes min"
  # shellcheck disable=SC2086  # options are words
  train avatar --data "$data/$identity" --body "$body" --preset edge --minutes "$minutes" $options $resume -o "$run"
  if [ ! "$run/evaluation.json" -nt "$run/weights.safetensors" ]; then
    step "evaluating $name"
    sheet=()
    [ "$name" != shaped ] || sheet=(--sheet docs/results/line.png)
    train evaluate reconstruction --run "$run" "${sheet[@]}" -o "$run/report.json"
  fi
done <<< "$rows"

if [ -e "$folder/runs/shaped/evaluation.json" ]; then
  step "packing"
  train pack "$folder/runs/shaped" --golden -o "$folder/avatar.fgn"
  step "parity"
  train evaluate parity --run "$folder/runs/shaped" --package "$folder/avatar.fgn" -o "$folder/parity.json"
fi
step "docs/results/line.json"
scripts/run python3 scripts/experiments/line_report.py "$folder" docs/results/line.json "scripts/experiments/line.sh"
