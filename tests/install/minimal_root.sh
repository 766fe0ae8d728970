#!/usr/bin/env bash
# Does run.sh work on a machine that has nothing? Makes a minimal Debian 12 in a folder, clones the repository into it and
# runs run.sh there. Needs root, debootstrap, a Debian mirror and some minutes; not part of test.sh for that reason.
set -euo pipefail
repository=$(cd "$(dirname "$0")/../.." && pwd)
root=$(mktemp -d)
trap 'umount "$root/proc" 2>/dev/null || true; rm -rf "$root"' EXIT
debootstrap --variant=minbase bookworm "$root" "${1:-http://deb.debian.org/debian}" >"$root.log" 2>&1 ||
  { tail "$root.log"; exit 1; }
cp /etc/resolv.conf /etc/hosts "$root/etc/"
mount -t proc proc "$root/proc"
git clone -q "$repository" "$root/root/identikal"
chroot "$root" /bin/bash -c 'cd /root/identikal && ./run.sh' | tee "$root.out"
grep -q 'log-likelihood -632.545625' "$root.out"
grep -q '^Cf ' "$root.out"
test -s "$root/root/identikal/out/nile/result.json"
test -s "$root/root/identikal/out/severe_lane_change/result.json"
echo "minimal root: both tables are there"
