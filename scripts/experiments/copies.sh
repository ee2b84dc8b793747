#!/usr/bin/env bash
# Copies are a matter of time: samplers of 25, 50 and 100 people, learnt from alone and mixed by
# part, each for several budgets; how many of their people are near copies, and how sharp and how
# varied they are. Says which budget is shipped, by a rule that no test person has a part in.
#
#   scripts/experiments/copies.sh edge [FOLDER]
#
# FOLDER (default out/copies) keeps every run.
# May be stopped and killed at any time; called again it goes on. Two cores train two runs at a
# time: 73,000 iterations, at 16 a second (AVX2) 75 minutes; the evaluation takes half an hour by
# estimate. Writes docs/results/copies.json and docs/sampler_copies.png.
#
# Environment: RUNS, which of them are trained and judged (all; a name is MEMBERS_alone_ITERATIONS,
# MEMBERS_mixed_ITERATIONS or one of those below). Remedies beside mixing, of 100 people alone:
# decay (of weights), dropout, small (blocks of an eighth). Other ways to mix: half of a batch,
# pieces (smaller tokens).
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/../environment.sh"
cd "$figurine_checkout"

name=${1:?edge} folder=${2:-out/copies}
population=samples/populations/$name body=samples/populations/$name/body.fgn \
  features=samples/populations/${name}_features.safetensors
for file in "$population/split.json" "$body" "$features"; do
  [ -r "$file" ] || die "copies: $file: no such file"
done
. scripts/experiments/tools.sh

if [ -z "${RUNS:-}" ]; then
  RUNS=100_mixed_8000
  for iterations in 4000 2000 1000 500; do
    for members in 100 50 25; do
      RUNS+=" ${members}_mixed_$iterations ${members}_alone_$iterations"
    done
  done
  RUNS+=' decay dropout small pieces half'
fi
read -ra runs <<< "$RUNS"

options_of() {
  local run=$1 iterations=4000 members=100 mixed=1
  own=(--variant basis --rank 90 --size device --blocks 4 --precision auto --learning-rate 5e-4)
  case $run in
    decay) mixed=0 own+=(--weight-decay 0.3) ;;
    dropout) mixed=0 own+=(--dropout 0.1) ;;
    small) mixed=0 own+=(--size small --blocks 2) ;;
    pieces) own+=(--pieces 12) ;;
    half) mixed=0.5 ;;
    *)
      members=${run%%_*} iterations=${run##*_}
      case $run in *alone*) mixed=0 ;; esac
      ;;
  esac
  own+=(--iterations "$iterations" --members "$members" --mixed "$mixed" --body "$body" --quiet)
}

learn_all

judged=()
for run in "${runs[@]}"; do judged+=(--run "$run=$folder/$run"); done
step "evaluating"
train evaluate generation --population "$population" --body "$body" --features "$features" \
  --no-baselines --replicates 100 "${judged[@]}" -o "$folder/generation.json"
scripts/setup plots
scripts/run python3 scripts/experiments/copies_report.py "$folder" docs/results/copies.json \
  docs/sampler_copies.png "scripts/experiments/copies.sh $name"
step "done: docs/results/copies.json"
