#!/usr/bin/env bash
# A sampler of new people and its figures: trains (or goes on with) a denoiser on a shipped
# population, packs it, samples 64 people, measures.
#
#   scripts/experiments/sampler.sh edge [FOLDER]    FOLDER (default out/sampler) keeps every step
#
# May be stopped and killed at any time; called again it goes on. Trains `basis`, which ships (3,000
# iterations, 15 minutes of a core), and `layer`, the paper's, for the table. Writes
# samples/samplers/edge.fgn, the pictures docs/sampler_{edge,trace_edge,rows_edge}.jpg,
# docs/results/sampling.json, docs/results/sampler_loss_edge.csv and, under the population's name,
# docs/results/generation.json.
#
# Environment: MINUTES (60) of a core for `layer`; SHIPPED (empty): if set, `basis` is not trained
# anew, the package that ships is judged, and samples/samplers/edge.fgn and
# docs/results/sampling.json stay as they are.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/../environment.sh"
cd "$figurine_checkout"

name=${1:?edge} folder=${2:-out/sampler} minutes=${MINUTES:-60}
population=samples/populations/$name.fgn body=samples/populations/${name}_body.fgn
features=samples/populations/edge_features.safetensors
for file in "$population" "$body" "$features"; do
  [ -r "$file" ] || die "sampler: $file: no such file"
done
programs=(figurine)
. scripts/experiments/tools.sh
mkdir -p samples/samplers
export FIGURINE_PATH=samples/populations

common=(--size device --blocks 6 --bf16)
package=samples/samplers/$name.fgn
judge() {
  train evaluate generation --population "$population" --body "$body" --features "$features" \
    --recipe "toolchain/population/$name.json" "$@"
}
learn "$folder/layer" --variant layer --learning-rate 2e-4 --minutes "$minutes" "${common[@]}"
if [ -z "${SHIPPED:-}" ]; then
  learn "$folder/basis" --variant basis --rank 32 --learning-rate 5e-4 \
    --iterations 3000 "${common[@]}"
  step "packing"
  judge --run "basis=$folder/basis" -o "$folder/generation_basis.json"
  train pack "$folder/basis" --body "$body" --population-file "$population" --name "$name" \
    --report "$folder/generation_basis.json" -o "$folder/sampler.fgn"
  step "error against evaluations"
  train evaluate sampling --run "$folder/basis" --population "$population" \
    --sampler "$folder/sampler.fgn" --body "$body" -o "$folder/sampling.json"
  install -m 644 "$folder/sampler.fgn" "$package"
fi
step "evaluating"
judge --sampler "basis=$package" --run "layer=$folder/layer" -o "$folder/generation.json"
train evaluate generation --population "$population" --body "$body" --no-baselines --replicates 10 \
  --sampler "basis=$package" --run "layer=$folder/layer" \
  --sheet "docs/sampler_rows_$name.jpg"

# 64 seeds, counted up from 0, none left out.
mkdir -p "$folder/people"
for seed in $(seq 0 63); do
  picture=$folder/people/$(printf %02d "$seed")
  device sample "$package" --seed "$seed" -o "$picture.fgn" 2> /dev/null
  device render "$picture.fgn" --size 256x256 --background grey -o "$picture.png"
done
scripts/run ffmpeg -v error -y -i "$folder/people/%02d.png" -vf "crop=150:256,tile=16x4" \
  -frames:v 1 -q:v 4 "docs/sampler_$name.jpg"
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
