#!/usr/bin/env bash
# A sampler of new people and its figures: trains (or goes on with) a denoiser on a shipped
# population, packs it, samples 64 people, measures.
#
#   scripts/experiments/sampler.sh edge [FOLDER]
#
# FOLDER (default out/sampler) keeps every step.
# May be stopped and killed at any time; called again it goes on. Trains `shipped` (basis, people
# mixed by part, as long as scripts/experiments/copies.sh chose; minutes of a core), and for the
# table `alone`, the same from members alone, and `layer`, the paper's tokens. Writes
# samples/samplers/edge.fgn, the pictures docs/sampler_{edge,bust_edge,trace_edge,rows_edge,
# nearest_edge}.jpg, docs/results/sampling.json, docs/results/sampler_loss_edge.csv and, under the
# population's name and under "shipped", docs/results/generation.json.
#
# Environment: ITERATIONS (8000) of `shipped`; MINUTES (60; 0: none) for `layer`;
# UNSEEN (200) people captured for the table; SHIPPED (empty): if set, nothing is trained but
# `alone` and `layer`, the package that ships is judged, and samples/samplers/edge.fgn and
# docs/results/sampling.json stay as they are.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/../environment.sh"
cd "$figurine_checkout"

name=${1:?edge} folder=${2:-out/sampler} minutes=${MINUTES:-60} iterations=${ITERATIONS:-8000}
unseen=${UNSEEN:-200}
population=samples/populations/$name body=samples/populations/$name/body.fgn \
  features=samples/populations/${name}_features.safetensors
for file in "$population/split.json" "$body" "$features"; do
  [ -r "$file" ] || die "sampler: $file: no such file"
done
programs=(figurine)
. scripts/experiments/tools.sh
mkdir -p samples/samplers
export FIGURINE_PATH=samples/populations/$name

package=samples/samplers/$name.fgn
judge() {
  train evaluate generation --population "$population" --body "$body" --features "$features" "$@"
}
basis=(--variant basis --rank 90 --size device --blocks 4 --precision auto --learning-rate 5e-4
  --body "$body")
learn "$folder/alone" "${basis[@]}" --iterations 4000
[ "$minutes" = 0 ] || learn "$folder/layer" --variant layer --size device --blocks 6 \
  --precision auto --learning-rate 2e-4 --minutes "$minutes" --body "$body"
if [ -z "${SHIPPED:-}" ]; then
  learn "$folder/shipped" "${basis[@]}" --iterations "$iterations" --mixed 1
  step "packing"
  judge --run "shipped=$folder/shipped" --no-baselines -o "$folder/generation_shipped.json"
  train pack "$folder/shipped" --body "$body" --population-file "$population" --name "$name" \
    --report "$folder/generation_shipped.json" -o "$folder/sampler.fgn"
  step "error against evaluations"
  train evaluate sampling --run "$folder/shipped" --population "$population" \
    --sampler "$folder/sampler.fgn" --body "$body" -o "$folder/sampling.json"
  install -m 644 "$folder/sampler.fgn" "$package"
fi
step "evaluating"
runs=(--sampler "shipped=$package" --run "alone=$folder/alone")
[ ! -e "$folder/layer/run.json" ] || runs+=(--run "layer=$folder/layer")
judge "${runs[@]}" --recipe "toolchain/population/$name.json" --unseen "$unseen" \
  -o "$folder/generation.json"
train evaluate generation --population "$population" --body "$body" --no-baselines \
  --replicates 10 "${runs[@]}" --sheet "docs/sampler_rows_$name.jpg"

# 64 seeds, counted up from 0, none left out; the first half's heads and shoulders.
step "drawing"
mkdir -p "$folder/people"
for seed in $(seq 0 63); do
  picture=$folder/people/$(printf %02d "$seed")
  device sample "$package" --seed "$seed" -o "$picture.fgn" 2> /dev/null
  device render "$picture.fgn" --size 256x256 --background grey -o "$picture.png"
  [ "$seed" -ge 32 ] || device render "$picture.fgn" --size 256x256 --background grey \
    --framing bust -o "$folder/people/bust_$(printf %02d "$seed").png"
done
tile() {  # FILTER OUT INPUT...
  scripts/run ffmpeg -v error -y "${@:3}" -vf "$1" -frames:v 1 -q:v 4 "$2"
}
tile crop=150:256,tile=16x4 "docs/sampler_$name.jpg" -i "$folder/people/%02d.png"
tile tile=8x4 "docs/sampler_bust_$name.jpg" -i "$folder/people/bust_%02d.png"
# The first 16 above, the training member that looks most like each below, all in one pose.
device pose --from samples/packages/walk.fgn --frame 30 -o "$folder/pose.json"
scripts/run python3 scripts/experiments/nearest.py "$folder/generation.json" shipped \
  > "$folder/nearest.txt"
posed() {  # AVATAR NAME
  device render "$1" --size 256x256 --background grey --pose "$folder/pose.json" \
    -o "$folder/people/$2.png"
}
number=0
while read -r member; do
  seed=$(printf %02d "$number")
  posed "$folder/people/$seed.fgn" "posed_$seed"
  posed "$population#$member" "nearest_$seed"
  number=$((number + 1))
done < "$folder/nearest.txt"
tile crop=90:256,tile=16x1 "$folder/first.png" -i "$folder/people/posed_%02d.png"
tile crop=90:256,tile=16x1 "$folder/nearest.png" -i "$folder/people/nearest_%02d.png"
scripts/run ffmpeg -v error -y -i "$folder/first.png" -i "$folder/nearest.png" \
  -filter_complex vstack -q:v 4 "docs/sampler_nearest_$name.jpg"
rm -rf "$folder/trace"
device sample "$package" --seed 0 --trace "$folder/trace" -o "$folder/traced.fgn" 2> /dev/null
scripts/run ffmpeg -v error -y -i "$folder/trace/step_%04d.png" -vf "crop=100:240,tile=20x1" \
  -frames:v 1 -q:v 3 "docs/sampler_trace_$name.jpg"
device sample "$package" --seed 0 --json -o "$folder/timed.fgn" > "$folder/timed.json"

# The same seed on other CPUs, by QEMU.
step "golden seeds"
scripts/setup arm
golden_programs=(figurine figurine-inspect golden_frame_test)
scripts/run cmake --preset aarch64 > /dev/null
for preset in dev aarch64; do
  scripts/run cmake --build --preset "$preset" --target "${golden_programs[@]}" > /dev/null
done
scripts/run scripts/check_golden > "$folder/golden.txt"
scripts/run python3 scripts/experiments/sampler_report.py "$folder" "$name" docs/results \
  "scripts/experiments/sampler.sh $name"
