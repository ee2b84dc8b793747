#!/usr/bin/env bash
# What static values, the network's size, the atlas, the filters, a perceptual loss and a network
# of somebody else are worth: two people, the shipped one and one in pinstripes, each trained for
# ten minutes by today's preset and by the one before it, and a row a change. Writes
# docs/results/stage1.json and docs/sharp.jpg.
#
#   scripts/experiments/sharp.sh [FOLDER]
#
# FOLDER (default out/sharp) keeps every step: run it again and it goes on where it stopped. The
# runs that train for minutes take both cores, one after the other; the rows train for iterations,
# two at a time on one core each, which a busy machine cannot change.
#
# Environment: ITERATIONS (1000) of the rows, MINUTES (10) of the others, SEED (1) of the shipped
# person, STRIPES_SEED (1) of the other, DONOR_SEED (2) of whose network the shipped person borrows
# in some rows, and ROWS (all), a list of names to limit training to. On
# two quiet cores about three hours.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/../environment.sh"
cd "$figurine_checkout"

folder=${1:-out/sharp} iterations=${ITERATIONS:-1000} minutes=${MINUTES:-10}
programs=(figurine)
. scripts/experiments/people.sh

other_body() {  # NAME OPTIONS...: another layout of texels over the same skeleton
  [ -e "$folder/$1.fgn" ] || train body --makehuman -o "$folder/$1.fgn" "${@:2}"
}
step "bodies"
other_body body_mesh_layout --uv 128
other_body body_256 --uv 256 "${body_options[@]}"

wanted() {  # NAME...: one of them
  local name
  for name in "$@"; do case " ${ROWS:-$name} " in *" $name "*) return ;; esac done
  return 1
}
identity=
capture_person "$folder/capture" "${SEED:-1}"
person=$identity
! wanted stripes stripes_before stripes_fine ||
  capture_person "$folder/stripes" "${STRIPES_SEED:-1}" --outfit male_casualsuit03
stripes=$identity
! wanted donor || capture_person "$folder/donor" "${DONOR_SEED:-2}"
donor=$identity

# NAME DATA BODY OPTIONS...: trains and evaluates what is not there yet.
row() {
  local name=$1 data=$2 row_body=$folder/$3.fgn run=$folder/runs/$1
  shift 3
  if [ -e "$run/run.json" ]; then
    train avatar --data "$data" --body "$row_body" --resume --quiet -o "$run"
  else
    train avatar --data "$data" --body "$row_body" --quiet -o "$run" "$@"
  fi
  [ "$run/evaluation.json" -nt "$run/weights.safetensors" ] ||
    train evaluate reconstruction --run "$run" --threads 1 > /dev/null
  step "$name is there"
}

# Trained by the clock, on all cores. The preset before: no static values, a network for all texels
# where the mesh's own layout has them.
before="--static-grids none --network-size 128 --learning-rate 2e-3 --antialiased off"
fast=(--minutes "$minutes" --poses 2 --views-per-pose 2)
timed="
shipped|$person|body|
before|$person|body_mesh_layout|$before
stripes|$stripes|body|
stripes_before|$stripes|body_mesh_layout|$before
fine|$person|body_256|--preset fine
stripes_fine|$stripes|body_256|--preset fine
"
while IFS='|' read -r name data row_body options; do
  # shellcheck disable=SC2086  # options are words
  [ -z "$name" ] || ! wanted "$name" || row "$name" "$data" "$row_body" "${fast[@]}" $options
done <<< "$timed"

# name | body | what is changed of the preset
rows="
chosen|body|
frozen_pose|body|--freeze-pose
learning_rate_2e-3|body|--learning-rate 2e-3
static_none|body|--static-grids none --learning-rate 2e-3
static_none_network_128|body|--static-grids none --network-size 128 --learning-rate 2e-3
static_256|body_256|--preset fine --static-grids all:T
static_colour_256|body_256|--preset fine
static_colour_only|body|--static-grids colour:T
static_half|body|--static-grids all:T/2
static_sum|body|--static-colour sum
static_learning_rate_5e-3|body|--static-learning-rate 5e-3
static_learning_rate_3e-2|body|--static-learning-rate 3e-2
static_penalty_1e-2|body|--static-penalty 1e-2
network_none|body|--network none
network_128|body|--network-size 128
network_32|body|--network-size 32
channels_24|body|--channels 24
channels_16|body|--channels 16
mesh_layout|body_mesh_layout|
smallest_extent|body|--smallest-extent on
not_antialiased|body|--antialiased off
sh_degree_1|body|--sh-degree 1
perceptual|body|--perceptual samples/populations/edge_features.safetensors --perceptual-weight 0.02
"
network_rows="
network_of_another|body|--init $folder/runs/donor --freeze-network
network_rank_8|body|--init $folder/runs/donor --network-rank 8
init_another|body|--init $folder/runs/donor
"
short=(--iterations "$iterations" --views-per-pose 2 --threads 1)
two_at_a_time() {  # ROWS
  local name row_body options
  while IFS='|' read -r name row_body options; do
    [ -n "$name" ] && wanted "$name" || continue
    while [ "$(jobs -rp | wc -l)" -ge 2 ]; do wait -n; done
    # shellcheck disable=SC2086  # options are words
    row "$name" "$person" "$row_body" "${short[@]}" $options &
  done <<< "$1"
  while [ "$(jobs -rp | wc -l)" -gt 0 ]; do wait -n; done
}
two_at_a_time "$rows"
! wanted donor || row donor "$donor" body "${short[@]}"
two_at_a_time "$network_rows"

shipped=$folder/runs/shipped
if [ -e "$shipped/evaluation.json" ]; then
  for run in shipped before; do
    [ ! -e "$folder/runs/$run/evaluation.json" ] ||
      train pack "$folder/runs/$run" --precision f32,q8 --golden -o "$folder/$run.fgn"
  done
  train pack "$shipped" --precision q8 -o "$folder/shipped_q8.fgn"
  train evaluate parity --run "$shipped" --package "$folder/shipped.fgn" \
    --precision q8 -o "$folder/parity_q8.json"
  [ ! -e "$folder/runs/before/evaluation.json" ] ||
    train evaluate reconstruction --run "$shipped" --beside "$folder/runs/before" \
      --sheet docs/sharp.jpg > /dev/null
fi
step "docs/results/stage1.json"
scripts/run python3 scripts/experiments/sharp_report.py "$folder" docs/results/stage1.json \
  "$build/samples/figurine/figurine" "scripts/experiments/sharp.sh"
