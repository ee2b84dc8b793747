# Sourced by line.sh, quantization.sh, sharp.sh and unusual_poses.sh, in the checkout and with
# $folder set: tools.sh, the shipped person's body, the motions, a person's capture.
#
# People walk (four walks and an endless one from CMU 01_03) and jump (01_01), turned through 360
# degrees. What is in $folder already stays.

. scripts/experiments/tools.sh
mkdir -p "$folder/runs"

body=$folder/body.fgn
body_options=(--atlas weighted --weight hands=5.5 --weight head=5.5)
[ -e "$body" ] || {
  step "body"
  train body --makehuman --uv "${uv:-128}" "${body_options[@]}" -o "$body"
}

motions=()
motion() {  # NAME CLIP OPTIONS...
  [ -e "$folder/$1.fgn" ] || train motion "/usr/share/assimp/models/BVH/$2" --body "$body" \
    --name "$1" -o "$folder/$1.fgn" "${@:3}"
  motions+=(--motion "$folder/$1.fgn")
}
step "motions"
motion walk_1 01_03.bvh --start 1 --frames 76
motion walk_straight 01_03.bvh --frames 76 --loop 1 --in-place
motion walk_2 01_03.bvh --start 1473 --frames 50
motion walk_3 01_03.bvh --start 2241 --frames 55
motion walk_4 01_03.bvh --start 3329 --frames 55
motion jump 01_01.bvh --frames 180

capture_person() {  # FOLDER SEED OPTIONS...: leaves the folder of the person's images in $identity
  [ -e "$1/.done" ] || {
    step "capture of person $2"
    train capture --body "$body" --identities 1 --seed "$2" --frames 119 "${motions[@]}" --resume \
      -o "$1" "${@:3}"
    touch "$1/.done"
  }
  identity=$1/$(cd "$1" && ls -d */ | head -n 1 | tr -d /)
}
