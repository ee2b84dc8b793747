#!/usr/bin/env bash
# A whole population and its figures: makes (or goes on with) the people of a recipe, packs them,
# looks at them, writes docs/results/population.json.
#
#   scripts/experiments/population.sh edge|nano [FOLDER]
#
# FOLDER (default out/population) keeps every step.
# May be stopped and killed at any time; called again it goes on. MINUTES limits how long new people
# are begun. On two quiet cores `edge` takes about two hours and `nano` one, by estimate.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/../environment.sh"
cd "$figurine_checkout"

name=${1:?edge or nano} folder=${2:-out/population}
. scripts/experiments/tools.sh

state=$folder/$name
train population "toolchain/population/$name.json" ${MINUTES:+--stop-after "$MINUTES"} -o "$state"
pictures=(--wall "docs/population_$name.jpg" --bust-wall "docs/population_bust_$name.jpg"
  --interpolation "docs/interpolation_$name.jpg")
# Members are mixed by part where they have maps.
if grep -q '"static_grids"' "toolchain/population/$name.json"; then
  pictures+=(--part-mixtures "docs/population_parts_$name.jpg")
fi
train evaluate members "$state/population.fgn" --body "$state/body.fgn" "${pictures[@]}" \
  -o "$state/report.json"
scripts/run python3 scripts/experiments/population_report.py "$state" "$name" \
  docs/results/population.json "scripts/experiments/population.sh $name"
# The ten worst on held-out poses, worst first: truth left, avatar right in every pair; where a
# member came without its pictures, all of them as avatars alone, from the front and from behind.
while read -r identity; do
  [ -r "$state/members/$identity.jpg" ] || {
    train evaluate members "$state/population.fgn" --body "$state/body.fgn" --quiet \
      --worst-sheet "docs/population_worst_$name.jpg"
    exit
  }
done < "$state/worst.txt"
worst=()
while read -r identity; do worst+=(-i "$state/members/$identity.jpg"); done < "$state/worst.txt"
shape='scale=480:320:force_original_aspect_ratio=decrease,pad=480:320:0:0:0x808080,setsar=1'
filter='' tiles='' layout=''
for k in $(seq 0 9); do
  filter+="[$k]$shape[t$k];" tiles+="[t$k]"
  layout+="${layout:+|}$((k % 2 * 480))_$((k / 2 * 320))"
done
scripts/run ffmpeg -v error -y "${worst[@]}" \
  -filter_complex "$filter${tiles}xstack=inputs=10:layout=$layout" \
  -q:v 4 "docs/population_worst_$name.jpg"
