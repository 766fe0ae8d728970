// What do the units of a fleet have in common, how much do they differ, and which of them do not belong?
#pragma once

#include <array>
#include <map>
#include <string>
#include <vector>

#include "fleet/store.h"

#include "identify/population/random_effects.h"

namespace identikal {

/// One number of every unit that counts: a row of the store, or all rows of a unit together.
struct PopulationUnit {
  std::string name;
  std::string group;                 ///< empty: none, or not the same of all its recordings
  double value = kNone, se = kNone;  ///< on the scale of the analysis
  std::map<std::string, double> covariates;
};

/// How a parameter goes with a covariate: a straight line, fitted with the spread between units.
struct PopulationTrend {
  std::string covariate;
  double slope = kNone, se = kNone, p = kNone;  ///< by one unit of the covariate
};

/// The units of a group; their spread is taken as that of all groups.
struct PopulationGroup {
  std::string name;
  std::size_t units = 0;
  double mean = kNone, se = kNone;
  std::array<double, 2> interval{kNone, kNone};
};

struct PopulationParameter {
  std::string name, unit;
  bool logarithm = false;  ///< of a parameter that cannot be negative the logarithm is analysed
  std::vector<PopulationUnit> units;
  RandomEffects effects;
  double within_sd = 0.0;  ///< of the recordings of a unit, beyond their errors; 0: one of each
  std::vector<PopulationTrend> trends;
  std::vector<PopulationGroup> groups;  ///< by name; empty: there are not two with a group each
  double groups_f = kNone, groups_p = kNone;  ///< F, and its p-value where all groups have one mean
};

struct Population {
  std::int64_t rows = 0, used = 0;  ///< used: with status ok
  std::vector<PopulationParameter> parameters;
  /// Of those that could not be analysed, why.
  std::vector<std::string> remarks;
};

/// The second stage of a two-stage analysis: every unit's estimate with its standard error, from rows
/// with status ok, as one draw of a population (identify/population/random_effects.h). A unit with
/// several recordings counts once, with what its recordings differ by allowed for. Exact where the
/// units' likelihoods are normal in the scale that is analysed; one by one, without correlations
/// between parameters.
///
/// Example:
///
///     FleetStore store("fleet.store", FleetStore::Open::read);
///     std::fputs(population_text(population_of(store)).c_str(), stdout);
///
/// Source: Davidian and Giltinan (1995), "Nonlinear models for repeated measurement data", chapter 5.
Population population_of(FleetStore& store);

std::string population_text(const Population& population);
std::string population_json(const Population& population);

}  // namespace identikal
