#!/usr/bin/env bash
# Every test: format, layers, the release build's tests, the fast ones again under the sanitizers.
# --slow adds the long Monte Carlo studies.
set -euo pipefail
cd "$(dirname "$0")"
slow=no
case "${1-}" in
  "") ;;
  --slow) slow=yes ;;
  *) echo "test.sh: unknown option '$1'; expected nothing or --slow" >&2; exit 2 ;;
esac
./prepare.sh $(cat packages.txt) libgtest-dev libgmock-dev libbenchmark-dev clang-format \
  python3 python3-numpy python3-dev pybind11-dev pkg-config
# What tests and sanitizers alone take comes while the compiler works.
./prepare.sh clang libclang-rt-dev lld python3-jsonschema python3-pytest python3-pandas python3-matplotlib python3-setuptools python3-wheel python3-pip \
  chromium chromium-driver &
of_tests=$!

find lib solvers identify studies jobs fleet interface command python tests examples \( -name '*.h' -o -name '*.cpp' \) -print0 |
  xargs -0 clang-format --dry-run --Werror

# Many files in one go: half of the time is spent on the templates that they share. With --slow every file is compiled by itself and
# without the precompiled header, and so has to include what it uses.
# g++ collects its garbage later, too: some 6 % of its time, for 200 MB more.
alone=(-DCMAKE_DISABLE_PRECOMPILE_HEADERS=OFF -DCMAKE_UNITY_BUILD_BATCH_SIZE=64 -DIDENTIKAL_BUILD_SLOW_TESTS=OFF
  -DCMAKE_CXX_FLAGS=--param=ggc-min-heapsize=800000)
# Checks of every access for null and alignment make a third of the sanitizer build; a null that is used ends the program anyway.
pointers=$slow
[ "$slow" = yes ] && alone=(-DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON -DCMAKE_UNITY_BUILD=OFF -DIDENTIKAL_BUILD_SLOW_TESTS=ON)
: >build.log
generator=$(packaging/generator.sh)
build() { packaging/with_progress.sh build.log "$@"; }
build "Configuring" cmake --preset release -G "$generator" -DIDENTIKAL_WERROR=ON "${alone[@]}"
build "Building" cmake --build build -j "$(nproc)"
[ "$slow" = yes ] && build "Building the benches" cmake --build build -j "$(nproc)" --target benches
labels=(-LE slow)
[ "$slow" = yes ] && labels=()
wait "$of_tests"
ctest --test-dir build --output-on-failure -j "$(nproc)" "${labels[@]}"

# Programs of half a gigabyte each take the usual linker as long as compiling them.
optimised="-O0 -g1"
[ "$slow" = yes ] && optimised="-O1 -g1"
build "Configuring with sanitizers" cmake --preset dev -DCMAKE_CXX_FLAGS_DEBUG="$optimised" -G "$generator" -DCMAKE_UNITY_BUILD=ON -DCMAKE_UNITY_BUILD_BATCH_SIZE=64 \
  -DCMAKE_EXE_LINKER_FLAGS=-fuse-ld=lld -DCMAKE_SHARED_LINKER_FLAGS=-fuse-ld=lld -DIDENTIKAL_SANITIZE_POINTERS="$pointers" -DIDENTIKAL_BUILD_SLOW_TESTS="$slow"
build "Building with sanitizers" cmake --build build-dev -j "$(nproc)"
# Here a test takes about a hundred times as long: those that took little more [s] than starting a program does, which is what
# the fastest quarter took; at night, ten times as long: all.
costs=$(awk '$1 == "---" { exit } NF == 3 && $1 ~ /^[A-Za-z0-9_\/]+[.][A-Za-z0-9_\/]+$/ && $3 > 0 { print $3, $1 }' \
  build/Testing/Temporary/CTestCostData.txt | sort -n)
longest=$(awk '{ cost[NR] = $1 } END { print cost[int(NR / 4) + 1] + 0.01 }' <<<"$costs")
[ "$slow" = yes ] && longest=1e9
slow_here=$(awk -v longest="$longest" '$1 > longest { printf "%s%s", n++ ? "|" : "", $2 }' <<<"$costs")
ctest --test-dir build-dev --output-on-failure -j "$(nproc)" -LE 'slow|release' -E "^($slow_here)\$"
