#!/usr/bin/env bash
# Counts the instructions that a frame of the shipped person takes on emulated ARM cores, by stage,
# by layer of the network and by kind, and what rates they would make.
#
#   scripts/experiments/arm_instructions.sh [OUTPUT]
#
# Writes docs/results/arm_instructions.json, or OUTPUT. Sets up QEMU and a kernel, cross-builds the
# program that draws (tests/bench/arm), and boots a machine that runs nothing else, twice a core;
# about ten minutes after the first time. Counts do not depend on what else the host does.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/../environment.sh"
output=$(realpath "${1:-$figurine_checkout/docs/results/arm_instructions.json}")
cd "$figurine_checkout"

scripts/setup arm_count
say "arm_instructions: building"
for built in aarch64:arm_count light:counting_plugin; do
  preset=${built%:*}
  { scripts/run cmake --preset "$preset" &&
    scripts/run cmake --build --preset "$preset" --target "${built#*:}"; } > build/arm_count.log ||
    { tail -n 30 build/arm_count.log >&2; die "arm_instructions: cannot build ${built#*:}"; }
done

# In the checkout, which the environment shows; the cache it does not.
folder=$(mktemp -d build/arm_count.XXXXXX)
trap 'rm -rf "$folder"' EXIT
cp "$figurine_arm_kernel" "$folder/vmlinuz"
commit=$(git rev-parse HEAD 2> /dev/null || echo unknown)
git diff --quiet HEAD -- 2> /dev/null || commit+=+changes
FIGURINE_COMMIT=$commit FIGURINE_BIND=$(dirname "$output") scripts/run \
  python3 scripts/experiments/arm_instructions.py build/aarch64/tests/bench/arm/arm_count \
  build/light/tests/bench/arm/counting_plugin.so "$folder" "$output"
