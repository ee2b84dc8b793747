#!/usr/bin/env bash
# The paper's ablation over what a token is, and ours over how a sampler learns and from how many
# people: trains all on a shipped population with the same transformer and the same number of
# iterations, and measures them beside the rows that need no training.
#
#   scripts/experiments/variants.sh nano [FOLDER]
#
# FOLDER (default out/variants) keeps every run.
# May be stopped and killed at any time; called again it goes on. Two trainings at a time, a core
# each; the evaluation takes all, two minutes a row of 500 samples. Writes
# docs/results/generation_NAME.json, the trainings' losses as docs/results/sampler_loss_NAME.csv,
# docs/sampler_variants_NAME.jpg and docs/sampler_curves_NAME.png.
#
# layer, flat, latent, basis: what a token is. The others are basis with one thing changed: mixed
# (people mixed by part), velocity (flow matching), dropout, decay (weight decay), basis_N (the
# first N people).
#
# Environment: RUNS (of these names, all), which of them are trained and judged: the others' rows
# stay as they are, and say from when; ITERATIONS (4000) of each training, AUTOENCODER_ITERATIONS
# (3000) of the one before `latent`; POPULATION, BODY and RECIPE for people that are not shipped
# (scripts/experiments/texel_maps.sh); DOCS (docs), where all this is written: for a try, name
# another folder that holds a copy of docs/results.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/../environment.sh"
cd "$figurine_checkout"

name=${1:?nano} folder=${2:-out/variants} iterations=${ITERATIONS:-4000}
autoencoder_iterations=${AUTOENCODER_ITERATIONS:-3000} pictures=${DOCS:-docs}
population=${POPULATION:-samples/populations/$name.fgn} \
  body=${BODY:-samples/populations/${name}_body.fgn} \
  features=samples/populations/edge_features.safetensors
recipe=${RECIPE:-toolchain/population/$name.json}
for file in "$population" "$body" "$features" "$recipe"; do
  [ -r "$file" ] || die "variants: $file: no such file"
done
. scripts/experiments/tools.sh

all='layer flat latent basis mixed velocity dropout decay basis_250 basis_100 basis_50'
read -ra runs <<< "${RUNS:-$all}"
options_of() {
  local run=$1 variant=basis
  own=(--body "$body" --size small --learning-rate 5e-4 --iterations "$iterations" --quiet)
  case $run in
    layer | basis) variant=$run ;;
    flat) variant=flat own+=(--chunk 512) ;;
    latent) variant=latent own+=(--autoencoder-iterations "$autoencoder_iterations") ;;
    mixed) own+=(--mixed 1) ;;
    velocity) own+=(--prediction velocity) ;;
    dropout) own+=(--dropout 0.1) ;;
    decay) own+=(--weight-decay 0.3) ;;
    basis_*) own+=(--members "${run#*_}") ;;
    *) die "variants: RUNS: $run: no such run" ;;
  esac
  own+=(--variant "$variant")
}
learn_all
options=()
for run in "${runs[@]}"; do options+=(--run "$run=$folder/$run"); done
step "evaluating"
train evaluate generation --population "$population" --body "$body" --features "$features" \
  --recipe "$recipe" \
  "${options[@]}" --sheet "$pictures/sampler_variants_$name.jpg" -o "$folder/generation.json"
scripts/run python3 scripts/experiments/variants_report.py "$folder" "$name" "$pictures/results" \
  "scripts/experiments/variants.sh $name" "${runs[@]}"
scripts/setup plots
scripts/run python3 scripts/experiments/generation_plots.py "$pictures/results" "$name" \
  "$pictures/sampler_curves_$name.png"
step "done: $pictures"
