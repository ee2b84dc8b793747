#!/usr/bin/env bash
# Fixed point measured on three people: trains and fine-tunes what is missing, packs all in int8, writes docs/results/quantization.json.
#
#   scripts/experiments/quantization.sh [FOLDER [RUN...]]        FOLDER (default out/quantization) keeps every step: run it again and it goes on where it stopped
#
# With RUNs, these are measured and nothing is trained but their fine-tunes. Otherwise people and motions are as in line.sh. Environment: SEEDS ("1 6 23") of
# the people; ITERATIONS (3000), VIEWS (2) a pose of the trainings; QAT_ITERATIONS (400) of the fine-tunes; THREADS (1). On one quiet core it takes about three
# quarters of an hour by estimate, with three RUNs a quarter.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/../environment.sh"
cd "$figurine_checkout"

folder=${1:-out/quantization}
runs=("${@:2}")
seeds=${SEEDS:-1 6 23} iterations=${ITERATIONS:-3000} views=${VIEWS:-2} threads=${THREADS:-1} qat_iterations=${QAT_ITERATIONS:-400}
build=build/dev
started=$SECONDS
step() { say "quantization: $((SECONDS - started)) s: $*"; }
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

train_person() {  # SEED
  local data=$folder/capture_$1 run=$folder/runs/$1 identity
  [ -e "$data/.done" ] || {
    step "capture of person $1"
    train capture --body "$body" --identities 1 --seed "$1" --frames 119 "${motions[@]}" --resume -o "$data"
    touch "$data/.done"
  }
  identity=$(cd "$data" && ls -d */ | head -n 1 | tr -d /)
  local resume=()
  [ ! -e "$run/run.json" ] || resume=(--resume)
  step "training person $1"
  train avatar --data "$data/$identity" --body "$body" --preset edge --iterations "$iterations" --views-per-pose "$views" --threads "$threads" "${resume[@]}" -o "$run"
  runs+=("$run")
}
[ ${#runs[@]} -gt 0 ] || for seed in $seeds; do train_person "$seed"; done

measured=()
for run in "${runs[@]}"; do
  package=$folder/$(basename "$run").fgn
  [ "$package" -nt "$run/weights.safetensors" ] || { step "packing $run"; train pack "$run" --precision q8 --threads "$threads" -o "$package"; }
  measured+=(--run "$run" --package "$package")
done

step "docs/results/quantization.json"
train evaluate quantization "${measured[@]}" --motion "$folder/walk_straight.fgn" --qat-iterations "$qat_iterations" --threads "$threads" -o docs/results/quantization.json
