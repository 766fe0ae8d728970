// A fleet's results as a table of text: a row for each recording, or part of one, in the order of the manifest.
#pragma once

#include <functional>
#include <string>

#include "fleet/store.h"

namespace identikal {

/// Writes a header and a row for each row of the store, as CSV (RFC 4180, '.' as decimal mark, numbers
/// with all their digits): recording, unit, group, then where there are some options, where, covariates and the
/// part, status, exit_code, rows, log_likelihood, every parameter with _se, _low and _high (its 95 %
/// interval), fit_percent_CHANNEL, TEST_p, findings, message. Nothing in it depends on who did the
/// work, when, or in which order.
///
/// Example:
///
///     FleetStore store("fleet.store", FleetStore::Open::read);
///     write_table(store, [](const std::string& text) { std::fputs(text.c_str(), stdout); });
void write_table(FleetStore& store, const std::function<void(const std::string& text)>& write);

}  // namespace identikal
