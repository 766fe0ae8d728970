#!/usr/bin/env bash
# Fuzzes every target in turn for HOURS in all, on all cores: run.sh [--plain] HOURS [TARGET...]
# Guided by what is reached, under the sanitizers, in build-fuzz/, whose corpus/ keeps what is new; --plain: changes of the kept inputs
# by chance in the release build, twenty times as fast. Inputs that end a target stay there, and this ends with 1.
# Executions are added to tests/fuzz/executions.txt.
set -euo pipefail
cd "$(dirname "$0")/../.."
plain=no
[ "${1-}" != --plain ] || { plain=yes; shift; }
hours=${1:?run.sh [--plain] HOURS [TARGET...]}
shift
targets=("$@")
[ ${#targets[@]} -gt 0 ] || targets=(csv yaml formula model_file result digest manifest store command_line job interface)
counts=$PWD/tests/fuzz/executions.txt
seconds=$(awk "BEGIN { print int($hours * 3600 / ${#targets[@]}) }")
work=$PWD/build-fuzz/corpus
mkdir -p "$work"
[ $plain = yes ] || tests/fuzz/configure.sh

fuzz() { # TARGET CORE
  local dictionary=()
  [ ! -e "tests/fuzz/$1.dict" ] || dictionary=("-dict=tests/fuzz/$1.dict")
  mkdir -p "$work/$1"
  FUZZ_TARGET=$1 build-fuzz/tests/fuzz "$work/$1" "tests/fuzz/corpus/$1" "${dictionary[@]}" -artifact_prefix="$work/$1-" \
    -max_total_time="$seconds" -timeout=10 -rss_limit_mb=2048 -max_len=8000 -print_final_stats=1 2>&1
}

change() { # TARGET CORE
  mkdir -p "$work/plain-$1-$2"
  (cd "$work/plain-$1-$2" && "$OLDPWD/build/tests/fuzz_replay" "$1" "$seconds" "$RANDOM$RANDOM" "$OLDPWD/tests/fuzz/corpus/$1" 2>&1)
}

for target in "${targets[@]}"; do
  for core in $(seq "$(nproc)"); do
    if [ $plain = yes ]; then change "$target" "$core"; else fuzz "$target" "$core"; fi >"$work/$target.$core.log" || true &
  done
  wait
  executed=$(awk '/number_of_executed_units/ { n += $2 } / changes of them/ { n += $4 } END { print n + 0 }' "$work/$target".*.log)
  awk -v target="$target" -v more="$executed" '$1 == target { $2 += more; seen = 1 } $1 != "all" { print; sum += $2 }
    END { if (!seen) { print target, more; sum += more } printf "all %d\n", sum }' "$counts" >"$counts.new"
  mv "$counts.new" "$counts"
  echo "$target: $executed executions"
done
! find "$work" \( -name '*-crash-*' -o -name '*-timeout-*' -o -name '*-oom-*' -o -name 'fuzz-*.input' \) | grep .
