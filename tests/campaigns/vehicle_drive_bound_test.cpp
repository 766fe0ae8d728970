#include "tests/campaigns/vehicle_drive_bound.h"

#include <string>
#include <utility>

#include <gtest/gtest.h>

namespace identikal {
namespace {

constexpr double kTold = 9.0;

// The first drive without faults whose words begin and hold these.
VehicleDrive drive_of(const std::string& car, const std::string& channels) {
  for (std::uint64_t seed = 1;; ++seed) {
    VehicleDrive out = draw_vehicle_drive(seed, 0);
    if (out.words.starts_with(car) && out.words.find(channels) != std::string::npos) return out;
  }
}

double misfit_with_ratio(const VehicleDrive& drive, double factor) {
  SingleTrack<> car = drive.car;
  car.steering_ratio *= factor;
  return least_misfit(drive, car, drive.speed);
}

TEST(VehicleDriveBound, NothingIsToldOfRightNumbers) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const VehicleDrive drive = draw_vehicle_drive(seed, 0);
    EXPECT_LT(least_misfit(drive, drive.car, drive.speed), 1e-6) << drive.words;
  }
}

// Forces, and so Cf, Cr and Iz, are known up to the mass.
TEST(VehicleDriveBound, NobodyTellsTheMass) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const VehicleDrive drive = draw_vehicle_drive(seed, 0);
    SingleTrack<> car = drive.car;
    car.m *= 1.3;
    EXPECT_LT(least_misfit(drive, car, drive.speed), 0.01) << drive.words;
  }
}

TEST(VehicleDriveBound, SideslipTellsAxlesThatAreExchanged) {
  for (const std::string name : {"sedan", "lorry", "race car"}) {
    const VehicleDrive drive = drive_of(name, "r ay vy");
    SingleTrack<> car = drive.car;
    std::swap(car.a, car.b);
    EXPECT_GT(least_misfit(drive, car, drive.speed), 3.0 * kTold) << drive.words;
    VehicleDrive faulty = drive;
    faulty.faults.kinds = {DriveFault::swapped_axles};
    EXPECT_EQ(least_misfit(faulty), least_misfit(drive, car, drive.speed));
  }
}

TEST(VehicleDriveBound, IsAQuadraticOfSmallErrors) {
  const VehicleDrive drive = drive_of("sedan", "r ay vy");
  EXPECT_NEAR(misfit_with_ratio(drive, 1.01) / misfit_with_ratio(drive, 1.005), 4.0, 0.2);
  EXPECT_NEAR(misfit_with_ratio(drive, 1.005) / misfit_with_ratio(drive, 0.995), 1.0, 0.1);
}

TEST(VehicleDriveBound, DoesNotDependOnTheStart) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const VehicleDrive drive = draw_vehicle_drive(seed, 0);
    SingleTrack<> car = drive.car;
    car.steering_ratio *= 1.1;
    const double least = least_misfit(drive, car, drive.speed);
    car.front.stiffness *= 1.5;
    car.Iz *= 0.7;
    EXPECT_NEAR(least_misfit(drive, car, drive.speed), least, 0.02 + 0.02 * least) << drive.words;
  }
}

TEST(VehicleDriveBound, OtherFaultsCountAsKnowable) {
  VehicleDrive drive = draw_vehicle_drive(1, 0);
  drive.faults.kinds = {DriveFault::ratio};
  drive.faults.ratio = 1.05;
  EXPECT_EQ(least_misfit(drive), misfit_with_ratio(drive, 1.05));
  drive.faults.kinds.push_back(DriveFault::low_pass);
  EXPECT_EQ(least_misfit(drive), kInfinity);
}

}  // namespace
}  // namespace identikal
