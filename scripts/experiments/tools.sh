# Sourced by the scripts of this folder, in the checkout and with $folder, which keeps every step:
# the toolchain built (and the programs in the array $programs) unless FIGURINE_BUILT is set,
# `train` and `device` to call it, the commit that reports name.

build=build/dev
started=$SECONDS
step() { say "$(basename "$0" .sh): $((SECONDS - started)) s: $*"; }
train() { scripts/run "$build/toolchain/cli/figurine-train" "$@"; }
device() { scripts/run "$build/samples/figurine/figurine" "$@"; }
commit_here() {
  git rev-parse HEAD 2> /dev/null || echo unknown
  git diff --quiet HEAD -- 2> /dev/null || echo +changes
}
export FIGURINE_COMMIT=${FIGURINE_COMMIT:-$(commit_here | tr -d '\n')}

[ -n "${FIGURINE_BUILT:-}" ] || {
  scripts/setup toolchain
  step "building"
  scripts/run cmake --preset dev > /dev/null
  scripts/run cmake --build --preset dev --target figurine-train "${programs[@]}" > /dev/null
}
mkdir -p "$folder" docs/results

# Trains the sampler RUN by the options, or goes on with it; a finished one is left alone. Needs
# $population.
learn() {
  local run=$1
  shift
  step "training $run"
  if [ -e "$run/run.json" ]; then train sampler --population "$population" --resume -o "$run"; else
    train sampler --population "$population" --threads 1 -o "$run" "$@"
  fi
}

# Two at a time, one core each.
beside() {
  while [ "$(jobs -rp | wc -l)" -ge 2 ]; do wait -n; done
  "$@" &
}
wait_all() { while [ "$(jobs -rp | wc -l)" -gt 0 ]; do wait -n; done; }

# All of the array $runs; options_of RUN sets the array $own.
learn_all() {
  local run
  for run in "${runs[@]}"; do
    options_of "$run"
    beside learn "$folder/$run" "${own[@]}"
  done
  wait_all
}
