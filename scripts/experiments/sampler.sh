#!/usr/bin/env bash
# A sampler of new people and its figures: trains (or goes on with) a denoiser on a shipped population, packs it, samples 64 people, measures.
#
#   scripts/experiments/sampler.sh edge [FOLDER]        FOLDER (default out/sampler) keeps every step
#
# May be stopped and killed at any time; called again it goes on. Trains `basis`, which ships (3,000 iterations, 15 minutes of a core), and `layer`,
# the paper's, for the table (MINUTES, default 28, of a core). Writes samples/samplers/edge.fgn, docs/sampler_edge.jpg,
# docs/sampler_trace_edge.jpg, docs/results/sampling.json, docs/results/sampler_loss_edge.csv and, under the population's name,
# docs/results/generation.json.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/../environment.sh"
cd "$figurine_checkout"

name=${1:?edge} folder=${2:-out/sampler} minutes=${MINUTES:-28}
population=samples/populations/$name.fgn body=samples/populations/${name}_body.fgn features=samples/populations/edge_features.safetensors
for file in "$population" "$body" "$features"; do [ -r "$file" ] || die "sampler: $file: no such file"; done
scripts/setup toolchain
scripts/run cmake --preset dev > /dev/null
scripts/run cmake --build --preset dev --target figurine-train figurine > /dev/null
mkdir -p "$folder" docs/results samples/samplers
export FIGURINE_COMMIT=${FIGURINE_COMMIT:-$(git rev-parse HEAD 2> /dev/null || echo unknown)}
export FIGURINE_PATH=samples/populations
train() { scripts/run build/dev/toolchain/cli/figurine-train "$@"; }
device() { scripts/run build/dev/samples/figurine/figurine "$@"; }

# Trains RUN with the options, or goes on with it; a finished one is left alone.
learn() {
  local run=$1
  shift
  if [ -e "$run/run.json" ]; then train sampler --population "$population" --resume -o "$run"; else
    train sampler --population "$population" --size device --blocks 6 --bf16 --threads 1 -o "$run" "$@"
  fi
}

learn "$folder/basis" --variant basis --rank 32 --learning-rate 5e-4 --iterations 3000
learn "$folder/layer" --variant layer --learning-rate 2e-4 --minutes "$minutes"
train evaluate generation --population "$population" --body "$body" --features "$features" --run "basis=$folder/basis" -o "$folder/generation_basis.json"
train pack "$folder/basis" --body "$body" --population-file "$population" --name "$name" --report "$folder/generation_basis.json" -o "$folder/sampler.fgn"
train evaluate generation --population "$population" --body "$body" --features "$features" --run "basis=$folder/basis" --run "layer=$folder/layer" \
  -o "$folder/generation.json"
train evaluate sampling --run "$folder/basis" --population "$population" --sampler "$folder/sampler.fgn" --body "$body" -o "$folder/sampling.json"
install -m 644 "$folder/sampler.fgn" "samples/samplers/$name.fgn"

# 64 seeds, counted up from 0, none left out.
mkdir -p "$folder/people"
for seed in $(seq 0 63); do
  picture=$folder/people/$(printf %02d "$seed")
  device sample "samples/samplers/$name.fgn" --seed "$seed" -o "$picture.fgn" 2> /dev/null
  device render "$picture.fgn" --size 256x256 --background grey -o "$picture.png"
done
scripts/run ffmpeg -v error -y -i "$folder/people/%02d.png" -vf "crop=150:256,tile=16x4" -frames:v 1 -q:v 4 "docs/sampler_$name.jpg"
rm -rf "$folder/trace"
device sample "samples/samplers/$name.fgn" --seed 0 --trace "$folder/trace" -o "$folder/traced.fgn" 2> /dev/null
scripts/run ffmpeg -v error -y -i "$folder/trace/step_%04d.png" -vf "crop=100:240,tile=20x1" -frames:v 1 -q:v 3 "docs/sampler_trace_$name.jpg"
device sample "samples/samplers/$name.fgn" --seed 0 --json -o "$folder/timed.fgn" > "$folder/timed.json"
scripts/run python3 scripts/experiments/sampler_report.py "$folder" "$name" docs/results "scripts/experiments/sampler.sh $name"
