#!/usr/bin/env bash
# Fuzzes every target in turn for HOURS in all, on all cores: run.sh HOURS [TARGET...]
# What is new stays in build-fuzz/corpus; what ends a target is left there as crash-*, timeout-* or oom-*, and this ends with 1.
# Executions are added to tests/fuzz/executions.txt.
set -euo pipefail
cd "$(dirname "$0")/../.."
hours=${1:?run.sh HOURS [TARGET...]}
shift
targets=("$@")
[ ${#targets[@]} -gt 0 ] || targets=(csv yaml formula model_file result command_line job interface)
[ -n "${FUZZ_PROGRAM-}" ] || tests/fuzz/configure.sh
program=${FUZZ_PROGRAM-build-fuzz/tests/fuzz}
counts=$PWD/tests/fuzz/executions.txt
seconds=$(awk "BEGIN { print int($hours * 3600 / ${#targets[@]}) }")
for target in "${targets[@]}"; do
  folder=build-fuzz/corpus/$target
  mkdir -p "$folder"
  dictionary=()
  [ ! -e "tests/fuzz/$target.dict" ] || dictionary=("-dict=tests/fuzz/$target.dict")
  for core in $(seq "$(nproc)"); do
    FUZZ_TARGET=$target "$program" "$folder" "tests/fuzz/corpus/$target" "${dictionary[@]}" -artifact_prefix="$folder/../$target-" \
      -max_total_time="$seconds" -timeout=10 -rss_limit_mb=2048 -max_len=8000 -print_final_stats=1 \
      >"$folder/../$target.$core.log" 2>&1 || grep -m1 -E 'ERROR|not one line' "$folder/../$target.$core.log" &
  done
  wait
  executed=$(awk '/number_of_executed_units/ { n += $2 } END { print n + 0 }' "$folder"/../"$target".*.log)
  awk -v target="$target" -v more="$executed" '$1 == target { $2 += more; seen = 1 } $1 != "all" { print; sum += $2 }
    END { if (!seen) { print target, more; sum += more } printf "all %d\n", sum }' "$counts" >"$counts.new"
  mv "$counts.new" "$counts"
  echo "$target: $executed executions"
done
! ls build-fuzz/corpus/*-{crash,timeout,oom}-* 2>/dev/null
