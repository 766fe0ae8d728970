#!/usr/bin/env bash
# Builds the tool and does both jobs on the shipped data: a Kalman filter tuned, a vehicle identified. What is built is
# what `cmake --install build` installs; tests and benches are left to test.sh.
set -euo pipefail
cd "$(dirname "$0")"
./prepare.sh $(cat packages.txt)
: >build.log
[ -f build/build.ninja ] || [ -f build/Makefile ] ||
  packaging/with_progress.sh build.log "Configuring" \
    cmake --preset release -G "$(packaging/generator.sh)" -DIDENTIKAL_BUILD_TESTS=OFF -DIDENTIKAL_BUILD_BENCH=OFF
packaging/with_progress.sh build.log "Building" cmake --build build -j "$(nproc)" --target identikal identikal_c command_reference
build/identikal tune examples/nile.yaml data/nile.csv -o out/nile --report out/report_noise.html
echo
build/identikal fit examples/severe_lane_change.yaml data/severe_lane_change.csv -o out/severe_lane_change \
  --report out/report_vehicle.html
echo
echo "Results are in out/: report_noise.html and report_vehicle.html to look at, result.json and residuals.csv of each job."
