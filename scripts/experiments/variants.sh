#!/usr/bin/env bash
# The paper's ablation over what a token is, and ours over the number of people to learn from:
# trains all variants on a shipped population with the same transformer and the same number of
# iterations, and measures them beside the rows that need no training.
#
#   scripts/experiments/variants.sh nano [FOLDER]    FOLDER (default out/variants) keeps every run
#
# May be stopped and killed at any time; called again it goes on. One core trains, for about an hour
# where it is quiet; the evaluation takes all. Writes the population's object in
# docs/results/generation.json, the trainings' losses as docs/results/sampler_loss_NAME.csv,
# docs/sampler_variants_NAME.jpg and docs/sampler_curves.png.
#
# Environment: RUNS ("layer flat latent basis layer_250 ...", all), which of them are trained and
# judged: the others' rows stay as they are, and say from when; ITERATIONS (4000) of each training,
# AUTOENCODER_ITERATIONS (3000) of the one before `latent`; DOCS (docs), where all this is written:
# for a try, name another folder that holds a copy of docs/results.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/../environment.sh"
cd "$figurine_checkout"

name=${1:?nano} folder=${2:-out/variants} iterations=${ITERATIONS:-4000}
autoencoder_iterations=${AUTOENCODER_ITERATIONS:-3000} pictures=${DOCS:-docs}
population=samples/populations/$name.fgn body=samples/populations/${name}_body.fgn
features=samples/populations/edge_features.safetensors
for file in "$population" "$body" "$features"; do
  [ -r "$file" ] || die "variants: $file: no such file"
done
. scripts/experiments/tools.sh

all="layer flat latent basis layer_250 basis_250 layer_100 basis_100 layer_50 basis_50"
read -ra runs <<< "${RUNS:-$all}"
common=(--size small --learning-rate 5e-4 --iterations "$iterations")
for run in "${runs[@]}"; do
  own=(--variant "${run%%_*}")
  case $run in
    flat) own+=(--chunk 512) ;;
    latent) own+=(--autoencoder-iterations "$autoencoder_iterations") ;;
    *_*) own+=(--members "${run#*_}") ;;
  esac
  learn "$folder/$run" "${own[@]}" "${common[@]}"
done
options=()
for run in "${runs[@]}"; do options+=(--run "$run=$folder/$run"); done
step "evaluating"
train evaluate generation --population "$population" --body "$body" --features "$features" \
  --recipe "toolchain/population/$name.json" \
  "${options[@]}" --sheet "$pictures/sampler_variants_$name.jpg" -o "$folder/generation.json"
scripts/run python3 scripts/experiments/variants_report.py "$folder" "$name" "$pictures/results" \
  "scripts/experiments/variants.sh $name" "${runs[@]}"
scripts/setup plots
scripts/run python3 scripts/experiments/generation_plots.py "$pictures/results" \
  "$pictures/sampler_curves.png"
step "done: $pictures"
