// A fleet on one page: statuses, distributions, which units do not belong, what goes with covariates.
#pragma once

#include <string>

#include "fleet/population.h"
#include "fleet/store.h"

namespace identikal {

/// A page of HTML in one file.
///
/// Example:
///
///     FleetStore store("fleet.store", FleetStore::Open::read);
///     const std::string page = fleet_page(store, population_of(store));
///     std::fputs(page.c_str(), stdout);
std::string fleet_page(FleetStore& store, const Population& population);

}  // namespace identikal
