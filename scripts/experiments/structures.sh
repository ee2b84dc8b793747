#!/usr/bin/env bash
# What a population's members should be made of: one network that LEARNERS people share, and what
# somebody new changes of it. Everybody is trained in each of these ways, all from the shared
# network and the learners' mean static map, but for the first:
#
#   scratch      everything, from the common random weights (edge alone)
#   free         everything
#   map          the static map alone
#   residual_R   and the network's kernels by A B (edge alone)
#   scale_R      and the network's kernels by products with 1 + A B, half of A drawn once for all
#   basis_R      and the network's kernels by A S, whose S is everybody's
#
# At `edge` PEOPLE new people say what each way costs in pictures. At `nano` the learners are
# trained in each way too, so that a way is a population: how much of the new people the learners
# span, how many bytes it has, and what a small sampler makes of it.
#
# Writes its scale's part of docs/results/structures.json.
#
#   scripts/experiments/structures.sh edge|nano [FOLDER]
#
# FOLDER (default out/structures) keeps every step: run it again and it goes on where it stopped.
#
# Environment: LEARNERS (12 at edge, 60 at nano), PEOPLE (6, 15), ITERATIONS of a person (1000,
# 600), SIZE of their pictures (512x512, 128x128), SAMPLER_ITERATIONS (1500); STATE, a population's
# state folder made with --keep-captures: its body, and the first of its training people in its
# pictures, in place of captures of this script's own. On two quiet cores forty minutes each.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/../environment.sh"
cd "$figurine_checkout"

scale=${1:?edge or nano}
folder=${2:-out/structures}/$scale
case $scale in
  edge)
    learners=${LEARNERS:-12} people=${PEOPLE:-6} iterations=${ITERATIONS:-1000}
    pictures=(--frames 50 --views 6 --bust-views 3 --size "${SIZE:-512x512}")
    preset=(--preset edge) uv=128
    ;;
  nano)
    learners=${LEARNERS:-60} people=${PEOPLE:-15} iterations=${ITERATIONS:-600}
    pictures=(--frames 30 --views 6 --bust-views 2 --size "${SIZE:-128x128}")
    preset=(--preset nano --static-grids all:T --network-size 16) uv=32
    ;;
  *) die "structures: '$scale': edge or nano" ;;
esac
programs=()
if [ -n "${STATE:-}" ]; then
  for file in "$STATE/split.json" "$STATE/captures" "$STATE/body.fgn"; do
    [ -r "$file" ] || die "structures: $file: no such file"
  done
  . scripts/experiments/tools.sh
  body=$STATE/body.fgn
else
  . scripts/experiments/people.sh
fi

link_people() {  # NAME COUNT: the state's people under numbers from 0
  local number=0 person
  mkdir -p "$folder/$1"
  for person in $(scripts/run python3 -c 'import json, sys
first = int(sys.argv[3]) if sys.argv[2] == "people" else 0
print(*json.load(open(sys.argv[1]))["train"][first:first + int(sys.argv[4])])' \
    "$STATE/split.json" "$1" "$learners" "$2"); do
    [ -e "$folder/$1/$(printf %06d "$number")" ] ||
      cp -al "$STATE/captures/$person" "$folder/$1/$(printf %06d "$number")"
    number=$((number + 1))
  done
  [ "$number" = "$2" ] || die "structures: $STATE: has $number $1, $2 were asked for"
}
capture_people() {  # NAME COUNT SEED
  [ -z "${STATE:-}" ] || {
    link_people "$@"
    return
  }
  [ -e "$folder/$1/.done" ] || {
    step "captures of $2 $1"
    train capture --body "$body" --identities "$2" --seed "$3" "${pictures[@]}" "${motions[@]}" \
      --resume -o "$folder/$1"
    touch "$folder/$1/.done"
  }
}
capture_people learners "$learners" 2026
capture_people people "$people" 2027

names() { seq -f %06.0f 0 $(($1 - 1)); }
finished() { [ -e "$1/run.json" ] && grep -q '"status": "finished"' "$1/run.json"; }
learn() {  # RUN OPTIONS...: trains what is not there yet
  local run=$1 fresh=("${@:2}")
  finished "$run" && return
  if [ -e "$run/run.json" ]; then
    train avatar --resume --quiet -o "$run"
  else
    train avatar --body "$body" --quiet -o "$run" "${preset[@]}" "${fresh[@]}"
  fi
}

shared=$folder/shared
everybody=()
for name in $(names "$learners"); do everybody+=(--data "$folder/learners/$name"); done
step "the shared network"
learn "$shared" "${everybody[@]}" --iterations $((learners * iterations)) --poses 2

# WAY GROUP PERSON OPTIONS...: one person's run, measured.
one() {
  local run=$folder/runs/$1/$2_$3
  learn "$run" --data "$folder/$2/$3" --iterations "$iterations" --views-per-pose 2 --threads 1 \
    --init "$shared" "${@:4}"
  [ "$run/evaluation.json" -nt "$run/weights.safetensors" ] ||
    train evaluate reconstruction --run "$run" --threads 1 > /dev/null
}
way() {  # WAY OPTIONS...
  local name
  step "$1"
  for name in $(names "$people"); do beside one "$1" people "$name" "${@:2}"; done
  [ "$scale" = edge ] ||
    for name in $(names "$learners"); do beside one "$1" learners "$name" "${@:2}"; done
}

step "the directions that learners change it by"
runs=()
for name in $(names "$learners"); do
  runs+=("$folder/tuned/$name")
  beside learn "$folder/tuned/$name" --data "$folder/learners/$name" \
    --init "$shared/$name" --iterations $((iterations / 3)) --views-per-pose 2 --threads 1
done
wait_all
basis=$folder/basis.safetensors
[ -e "$basis" ] || train basis --shared "$shared" "${runs[@]}" --rank 32 -o "$basis"

on_basis=(--network-adapter basis --network-basis "$basis")
if [ "$scale" = edge ]; then
  step "scratch"
  for name in $(names "$people"); do
    run=$folder/runs/scratch/people_$name
    beside learn "$run" --data "$folder/people/$name" --iterations "$iterations" \
      --views-per-pose 2 --threads 1
  done
  wait_all
  for name in $(names "$people"); do
    run=$folder/runs/scratch/people_$name
    [ "$run/evaluation.json" -nt "$run/weights.safetensors" ] ||
      train evaluate reconstruction --run "$run" > /dev/null
  done
  way residual_4 --network-rank 4
  way basis_32 --network-rank 32 "${on_basis[@]}"
fi
way free
way map --freeze-network
way scale_4 --network-rank 4 --network-adapter scale
way basis_8 --network-rank 8 "${on_basis[@]}"
wait_all

if [ "$scale" = nano ]; then
  split=$folder/split.json
  list() { names "$2" | sed "s/.*/\"$1_&\"/" | paste -sd,; }
  printf '{"train": [%s], "validation": [], "test": [%s]}\n' "$(list learners "$learners")" \
    "$(list people "$people")" > "$split"
  [ -e "$folder/shared.fgn" ] ||
    train pack "$shared/000000" --body "$body" -o "$folder/shared.fgn" > /dev/null
  pack_one() {  # RUN PACKAGE OPTIONS...
    [ -e "$2" ] ||
      train pack "$1" --name "$(basename "$1")" --threads 1 "${@:3}" -o "$2" > /dev/null
  }
  for ways in free map scale_4 basis_8; do
    step "$ways: a population"
    members=$folder/members/$ways
    mkdir -p "$members"
    own=() together=(--init "$shared")
    [ $ways != map ] || own=(--no-network) together=(--shared "$folder/shared.fgn")
    for run in "$folder/runs/$ways"/*; do
      beside pack_one "$run" "$members/$(basename "$run").fgn" "${own[@]}"
    done
    wait_all
    population=$folder/$ways.fgn
    [ -e "$population" ] ||
      train pack --population "$members" "${together[@]}" --split "$split" --name "$ways" \
        -o "$population"
    [ -e "$folder/$ways.json" ] ||
      train evaluate members "$population" --body "$body" --wall "$folder/$ways.jpg" \
        -o "$folder/$ways.json" > /dev/null
    learn_sampler() {
      finished "$folder/samplers/$ways" ||
        train sampler --population "$population" --body "$body" --variant basis --rank 32 \
          --size small --iterations "${SAMPLER_ITERATIONS:-1500}" --learning-rate 5e-4 --threads 1 \
          -o "$folder/samplers/$ways"
    }
    learn_sampler
    [ -e "$folder/generation_$ways.json" ] ||
      train evaluate generation --population "$population" --body "$body" --no-baselines \
        --run "basis=$folder/samplers/$ways" --replicates 100 \
        --sheet "$folder/generation_$ways.jpg" -o "$folder/generation_$ways.json" > /dev/null
  done
fi
step "docs/results/structures.json"
scripts/run python3 scripts/experiments/structures_report.py "$folder" \
  docs/results/structures.json "scripts/experiments/structures.sh $scale"
