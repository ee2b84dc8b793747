#!/usr/bin/env bash
# A row after E3Gen (Zhang et al., 2024): diffusion over static texel maps of Gaussians, skinned,
# without any network. The same people from the same pictures as the population of the name, the
# same transformer, the same judge (scripts/experiments/variants.sh).
#
#   scripts/experiments/texel_maps.sh nano [FOLDER]
#
# FOLDER (default out/texel_maps) keeps every step: run it again and it goes on where it stopped.
# SOURCE (default out/population/NAME) is the state folder of the population, made with
# --keep-captures. Writes FOLDER/NAME/population.fgn and docs/results/generation_NAME_texels.json.
# 45 minutes of two cores at `nano`, half of them the evaluation.
#
# The network that all members share is one of zeros: what is drawn is what `--network none` draws.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/../environment.sh"
cd "$figurine_checkout"

name=${1:?nano} folder=${2:-out/texel_maps}
source=${SOURCE:-out/population/$name} recipe=toolchain/population/$name.json
for file in "$source"/{body.fgn,initial/weights.safetensors,captures} "$recipe"; do
  [ -r "$file" ] || die "texel_maps: $file: no such file"
done
. scripts/experiments/tools.sh

state=$folder/$name
mkdir -p "$state/initial"
[ -e "$state/captures" ] || cp -al "$source/captures" "$state/captures"
[ -e "$state/body.fgn" ] || cp "$source/body.fgn" "$state/body.fgn"
learners=$(scripts/run python3 - "$recipe" "$source" "$folder/$name" << 'END'
"""Writes FOLDER.json, the recipe under another name, and FOLDER/zeros.safetensors, the shared
network without weights; prints the captures of those who learn together."""
import json
import pathlib
import struct
import sys

recipe, source, folder = sys.argv[1], pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[3])
text = json.loads(pathlib.Path(recipe).read_text())
text["name"] += "_texels"
text["training"]["iterations"] = 500  # without a network a map has less to find
pathlib.Path(f"{folder}.json").write_text(json.dumps(text, indent=1))
tensors = (source / "initial/weights.safetensors").read_bytes()
(length,) = struct.unpack("<Q", tensors[:8])
header = json.loads(tensors[8:8 + length])
header.pop("__metadata__", None)
named = json.dumps(header).encode()
(folder / "zeros.safetensors").write_bytes(
    struct.pack("<Q", len(named)) + named + bytes(len(tensors) - 8 - length))
first = next(group for group in text["groups"] if group["split"] == "train")["first"]
for number in range(first, first + text["shared_network"]["identities"]):
    print(folder / "captures" / f"{number:06}")
END
)
training() { scripts/run python3 -c "import json, sys
print(json.load(open(sys.argv[1]))['training'][sys.argv[2]])" "$recipe" "$1"; }
[ -e "$state/initial/weights.safetensors" ] || {
  together=$folder/together
  own=()
  for person in $learners; do own+=(--data "$person"); done
  step "the mean map"
  if [ -e "$together/run.json" ]; then
    train avatar --resume -o "$together"
  else
    train avatar "${own[@]}" --body "$state/body.fgn" --preset "$name" \
      --static-grids "$(training static_grids)" --network-size "$(training network_size)" \
      --init "$state/zeros.safetensors" --freeze-network --iterations 4800 --poses 2 -o "$together"
  fi
  first=$(basename "$(head -n 1 <<< "$learners")")
  train pack "$together/$first" --body "$state/body.fgn" -o "$state/initial/shared.fgn"
  cp "$together/weights.safetensors" "$state/initial/weights.safetensors.new"
  mv "$state/initial/weights.safetensors.new" "$state/initial/weights.safetensors"
}
step "members"
train population "$folder/$name.json" -o "$state"
POPULATION=$state/population.fgn BODY=$state/body.fgn RECIPE=$folder/$name.json RUNS="layer basis" \
  scripts/experiments/variants.sh "${name}_texels" "$folder/samplers"
