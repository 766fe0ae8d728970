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
./prepare.sh $(cat packages.txt) clang clang-format libclang-rt-dev python3 python3-jsonschema python3-numpy chromium chromium-driver \
  pkg-config dpkg-dev file

git ls-files '*.h' '*.cpp' | xargs clang-format --dry-run --Werror

# Many files in one go: most of the time is spent on the templates that they share. With --slow
# every file is compiled on its own, and so has to include what it uses.
unity=ON
batch=-DCMAKE_UNITY_BUILD_BATCH_SIZE=16
[ "$slow" = yes ] && unity=OFF
cmake --preset release -DIDENTIKAL_WERROR=ON -DCMAKE_UNITY_BUILD=$unity $batch
cmake --build build
[ "$slow" = yes ] && cmake --build build --target benches
labels=(-LE slow)
[ "$slow" = yes ] && labels=()
ctest --test-dir build --output-on-failure -j "$(nproc)" "${labels[@]}"

cmake --preset dev -DCMAKE_UNITY_BUILD=ON $batch
cmake --build build-dev
# Fast in the release build, but up to minutes each here; what they run, shorter tests run too.
slow_here='PathsAgree|GapsSplitTheRecording|CompressedInformationIs|FullCovariancesStay|GridAndMonteCarlo'
slow_here+='|ConstantGainEquals|ConstantNoiseGives|SaysWhatOnlyThePrior|FalseAlarm|BoundsOfFigure15|RaceCar'
slow_here+='|NoiseTrack.DiffuseStart|Shape.FindsThePublishedFilter|Shape.PolesOnTheUnitCircle|Shape.TheOutputsUnit'
slow_here+='|PushedCar|OutliersAndGaps|MistakesPutIntoRealRecordings|TanhTyreComesBack|ErrorsAreHonest|RobustCostShrugs'
slow_here+='|Smoother.IntervalEquals|Smoother.LagEquals|Smoother.DiffuseStart|NonlinearFilter.GradientAndInformation'
slow_here+='|StaysDefiniteOverAMillion|ResetFindsASuddenChange|PortmanteauHasItsExactMean'
slow_here+='|NonlinearSmoother.ItsErrorsAre|NonlinearSmoother.ItIsTheRauch|Smoother.ModelsThatChangeWithTime'
slow_here+='|WithForgettingTheyAreTooLarge|WhiteIsALikelihoodRatio|Simulation.CarriesExactDerivatives'
slow_here+='|IntegrationSteps.AsManyAs|IntegrationSteps.FiltersLook|NonlinearJobs.TheBound|NonlinearJobs.ScoresScatter'
slow_here+='|ParticlesAgree|Shape.StopsWhenTold|RefusesForcesThatAreStates|ExchangedChannelsGive|TableIsTheSame'
slow_here+='|ItsStandardErrorIsTheScatter|OfNoiseAloneEquals'
ctest --test-dir build-dev --output-on-failure -j "$(nproc)" -LE 'slow|release' -E "$slow_here"
