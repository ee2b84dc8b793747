#!/usr/bin/env bash
# README's first picture, docs/demo.png: the shipped person in the shipped walk, whole and close up.
#
#   scripts/experiments/demo_picture.sh [FOLDER]
#
# FOLDER: out/demo_picture. Needs ffmpeg (`scripts/setup toolchain`) and a build of figurine in
# build/release (`scripts/demo` makes one).
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/../environment.sh"
cd "$figurine_checkout"

folder=${1:-out/demo_picture}
mkdir -p "$folder"
for framing in body bust; do
  scripts/run build/release/samples/figurine/figurine render samples/packages/person.fgn \
    --motion samples/packages/walk.fgn --frames 0:36:6 --framing $framing --size 512x512 \
    --background "#DCE0E6" --tiles 6 --columns 6 --contact-sheet "$folder/$framing.png" \
    -o "$folder/${framing}_%03d.png"
done
scripts/run ffmpeg -v error -y -i "$folder/body.png" -i "$folder/bust.png" \
  -filter_complex "vstack,scale=1536:-1" "$folder/demo.png"
mv "$folder/demo.png" docs/demo.png
