#!/usr/bin/env bash
# Builds what tests/fuzz/run.sh runs, in build-fuzz/.
set -euo pipefail
cd "$(dirname "$0")/../.."
cmake -B build-fuzz -G Ninja -DCMAKE_CXX_COMPILER=clang++ -DCMAKE_BUILD_TYPE=Debug -DCMAKE_CXX_FLAGS_DEBUG="-O1 -g1" \
  -DIDENTIKAL_FUZZ=ON -DIDENTIKAL_SANITIZE_POINTERS=OFF -DCMAKE_UNITY_BUILD=ON -DCMAKE_UNITY_BUILD_BATCH_SIZE=16 \
  -DCMAKE_EXE_LINKER_FLAGS=-fuse-ld=lld -DCMAKE_SHARED_LINKER_FLAGS=-fuse-ld=lld
cmake --build build-fuzz -j "$(nproc)" --target fuzz
