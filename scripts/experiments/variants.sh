#!/usr/bin/env bash
# The paper's ablation over what a token is, and ours over the number of people to learn from: trains all variants on a shipped population with
# the same transformer and the same number of iterations, and measures them beside the rows that need no training.
#
#   scripts/experiments/variants.sh nano [FOLDER]        FOLDER (default out/variants) keeps every run
#
# May be stopped and killed at any time; called again it goes on. ITERATIONS (default 4000) is each training's budget. Writes the population's
# object in docs/results/generation.json, the trainings' losses as docs/results/sampler_loss_NAME.csv, docs/sampler_variants_NAME.jpg and
# docs/sampler_curves.png.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/../environment.sh"
cd "$figurine_checkout"

name=${1:?nano} folder=${2:-out/variants} iterations=${ITERATIONS:-4000}
population=samples/populations/$name.fgn body=samples/populations/${name}_body.fgn features=samples/populations/edge_features.safetensors
for file in "$population" "$body" "$features"; do [ -r "$file" ] || die "variants: $file: no such file"; done
scripts/setup toolchain
scripts/run cmake --preset dev > /dev/null
scripts/run cmake --build --preset dev --target figurine-train > /dev/null
mkdir -p "$folder" docs/results
export FIGURINE_COMMIT=${FIGURINE_COMMIT:-$(git rev-parse HEAD 2> /dev/null || echo unknown)}
train() { scripts/run build/dev/toolchain/cli/figurine-train "$@"; }

# Trains FOLDER/RUN with the options, or goes on with it; a finished one is left alone.
learn() {
  local run=$folder/$1
  shift
  if [ -e "$run/run.json" ]; then train sampler --population "$population" --resume -o "$run"; else
    train sampler --population "$population" --size small --learning-rate 5e-4 --threads 1 --iterations "$iterations" -o "$run" "$@"
  fi
}

runs=(layer flat latent basis)
learn layer --variant layer
learn flat --variant flat --chunk 512
learn latent --variant latent --autoencoder-iterations 3000
learn basis --variant basis
for members in 250 100 50; do
  for variant in layer basis; do
    runs+=("${variant}_$members")
    learn "${variant}_$members" --variant "$variant" --members "$members"
  done
done
options=()
for run in "${runs[@]}"; do options+=(--run "$run=$folder/$run"); done
train evaluate generation --population "$population" --body "$body" --features "$features" "${options[@]}" --sheet "docs/sampler_variants_$name.jpg" \
  -o "$folder/generation.json"
scripts/run python3 scripts/experiments/variants_report.py "$folder" "$name" docs/results "scripts/experiments/variants.sh $name" "${runs[@]}"
scripts/setup plots
scripts/run python3 scripts/experiments/generation_plots.py docs/results docs/sampler_curves.png
