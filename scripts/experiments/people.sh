# Sourced by line.sh and quantization.sh, in the checkout and with $folder set: the program, the body, the motions, a person's capture.
#
# People walk (four walks and an endless one from CMU 01_03) and jump (01_01), turned through 360 degrees. What is in $folder already stays.

build=build/dev
started=$SECONDS
step() { say "$(basename "$0" .sh): $((SECONDS - started)) s: $*"; }
train() { scripts/run "$build/toolchain/cli/figurine-train" "$@"; }
export FIGURINE_COMMIT=${FIGURINE_COMMIT:-$(git rev-parse HEAD 2> /dev/null || echo unknown)$(git diff --quiet HEAD -- 2> /dev/null || echo +changes)}

scripts/setup toolchain
step "building"
scripts/run cmake --preset dev > /dev/null
scripts/run cmake --build --preset dev --target figurine-train > /dev/null
mkdir -p "$folder/runs" docs/results

body=$folder/body.fgn
[ -e "$body" ] || { step "body"; train body --makehuman --uv 128 -o "$body"; }

motions=()
motion() {  # NAME CLIP OPTIONS...
  [ -e "$folder/$1.fgn" ] || train motion "/usr/share/assimp/models/BVH/$2" --body "$body" --name "$1" -o "$folder/$1.fgn" "${@:3}"
  motions+=(--motion "$folder/$1.fgn")
}
step "motions"
motion walk_1 01_03.bvh --start 1 --frames 76
motion walk_straight 01_03.bvh --frames 76 --loop 1 --in-place
motion walk_2 01_03.bvh --start 1473 --frames 50
motion walk_3 01_03.bvh --start 2241 --frames 55
motion walk_4 01_03.bvh --start 3329 --frames 55
motion jump 01_01.bvh --frames 180

capture_person() {  # FOLDER SEED: leaves the folder of the person's images in $identity
  [ -e "$1/.done" ] || {
    step "capture of person $2"
    train capture --body "$body" --identities 1 --seed "$2" --frames 119 "${motions[@]}" --resume -o "$1"
    touch "$1/.done"
  }
  identity=$1/$(cd "$1" && ls -d */ | head -n 1 | tr -d /)
}
