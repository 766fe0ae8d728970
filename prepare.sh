#!/usr/bin/env bash
# Installs the Debian packages named on the command line that are missing. Asks dpkg first, so that a prepared machine
# needs neither root nor network.
set -euo pipefail
command -v dpkg-query >/dev/null || {
  echo "prepare.sh: no Debian here; CMake will name what it misses of: $*"
  exit 0
}
installed=$(dpkg-query -W -f='${db:Status-Status} ${Package}\n' "$@" 2>/dev/null || true)
missing=()
for package in "$@"; do
  grep -qxF "installed $package" <<<"$installed" || missing+=("$package")
done
[ ${#missing[@]} -eq 0 ] && exit 0
install="apt-get install -y --no-install-recommends ${missing[*]}"
as_root=()
if [ "$(id -u)" -ne 0 ]; then
  command -v sudo >/dev/null || {
    printf '%s\n' "prepare.sh: ${#missing[@]} packages are missing, and only root can install them:" \
      "    apt-get update && $install" >&2
    exit 1
  }
  as_root=(sudo)
fi
echo "Installing: ${missing[*]}"
export DEBIAN_FRONTEND=noninteractive
{ "${as_root[@]}" apt-get update -q && "${as_root[@]}" $install -q; } || {
  printf '%s\n' "prepare.sh: that failed; by hand:" "    sudo apt-get update && sudo $install" >&2
  exit 1
}
