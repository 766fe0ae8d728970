#include "identify/report/internal/bound_text.h"

#include <cmath>

#include <fmt/format.h>

#include "identify/report/internal/text_layout.h"
#include "identify/report/internal/verdict_text.h"

namespace identikal {
namespace {

// There are no estimates, and so no standard errors.
std::string bound_table(const Estimate& estimate, const Bound& bound) {
  const bool wanted = !std::isnan(bound.accuracy);
  std::vector<TableColumn> columns{{"parameter", true}, {"value"}, {"unit", true},
                                   {"bound se"},        {"%"},     {"states measured"}};
  if (wanted) columns.push_back({fmt::format("n for {:.4g} %", 100.0 * bound.accuracy)});
  columns.push_back({"verdict", true});
  std::vector<std::vector<std::string>> rows;
  for (std::size_t i = 0; i < estimate.parameters.size(); ++i) {
    const EstimatedParameter& p = estimate.parameters[i];
    if (p.fixed) continue;
    const double percent = 100.0 * p.crb_se / std::abs(p.value);
    std::vector<std::string> row{p.name,
                                 value_text(p.value),
                                 p.unit.empty() ? "-" : p.unit,
                                 error_text(p.crb_se),
                                 std::isfinite(percent) ? fmt::format("{:.4g}", percent) : "-",
                                 error_text(bound.parameters[i].complete_se)};
    if (wanted) {
      const double samples = bound.parameters[i].samples_needed;
      row.push_back(std::isnan(samples) ? "-" : fmt::format("{:.0f}", samples));
    }
    row.push_back(verdict_text(p));
    rows.push_back(std::move(row));
  }
  return text_table(columns, rows);
}

std::string meaning_of_columns(const Bound& bound) {
  const std::string what = "bound se: the Cramer-Rao bound of the standard error from the outputs";
  if (!bound.simulated) {
    return wrapped(what + "; states measured: the bound if the states were measured as well.", 2);
  }
  const std::string error = std::isnan(bound.simulated->relative_se)
                                ? ""
                                : fmt::format("; Monte Carlo standard error at most {:.2g} %",
                                              100.0 * bound.simulated->relative_se);
  return wrapped(fmt::format("{}, from the mean information of {} recordings simulated with seed "
                             "{}, with the filter's linearisation{}.",
                             what, bound.simulated->recordings, bound.simulated->seed, error),
                 2);
}

// What the uncertainty of the noise means for the filter.
std::string gain_text(const ResultSections& result) {
  const Bound& bound = *result.bound;
  if (bound.gain_se.size() == 0) return "";
  std::string out = "\n" + matrix_text("K", result.noise->K_steady) +
                    matrix_text("standard deviation of K", bound.gain_se);
  for (const Bound::Parameter& p : bound.parameters) {
    if (p.gain_change.size() == 0) continue;
    out += matrix_text("change of K for 1 % more of " + p.name, p.gain_change);
  }
  return out;
}

// The same with the filter's own quantities as the unknowns.
std::string innovation_form_text(const Bound& bound) {
  const Bound::InnovationForm& form = bound.innovation_form;
  if (form.Sigma.size() == 0) return "";
  std::string out = "\nwith K and Sigma themselves as the unknowns\n" +
                    matrix_text("Sigma", form.Sigma) +
                    matrix_text("standard deviation of K", form.K_se) +
                    matrix_text("standard deviation of Sigma", form.Sigma_se);
  if (std::isnan(form.published_K_se)) return out;
  std::string line = fmt::format("(6.45) of Matisko (2013): K {:.4g}, Sigma {:.4g}",
                                 form.published_K_se, form.published_Sigma_se);
  for (const Bound::Parameter& p : bound.parameters) {
    if (std::isnan(p.published_se)) continue;
    line += fmt::format(", {} {:.4g}", p.name, p.published_se);
  }
  return out + wrapped(line +
                           "; it takes the state as measured and counts every innovation twice, "
                           "so that it bounds Sigma only.",
                       2);
}

}  // namespace

std::string bound_text(const ResultSections& result) {
  return bound_table(*result.core, *result.bound) + meaning_of_columns(*result.bound) +
         gain_text(result) + innovation_form_text(*result.bound);
}

}  // namespace identikal
