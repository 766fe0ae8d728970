#!/usr/bin/env bash
# Builds the tool and does both jobs on the shipped data: a Kalman filter tuned, a vehicle identified.
set -euo pipefail
cd "$(dirname "$0")"
./prepare.sh $(cat packages.txt)
cmake --preset release >build.log 2>&1 && cmake --build build --target identikal >>build.log 2>&1 || {
  tail -n 30 build.log >&2
  echo "run.sh: the build failed; all of it is in build.log" >&2
  exit 1
}
build/identikal tune examples/nile.yaml data/nile.csv -o out/nile --report out/report_noise.html
echo
build/identikal fit examples/severe_lane_change.yaml data/severe_lane_change.csv -o out/severe_lane_change \
  --report out/report_vehicle.html
echo
echo "Results are in out/: report_noise.html and report_vehicle.html to look at, result.json and residuals.csv of each job."
