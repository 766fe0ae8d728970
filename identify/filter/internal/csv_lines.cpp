#include "identify/filter/internal/csv_lines.h"

#include <cmath>
#include <iterator>
#include <ostream>

#include <fmt/format.h>

#include "identify/result/csv.h"
#include "lib/model/linear_model.h"

namespace identikal {

using Eigen::Index;

std::vector<NamedState> named_states(const Model& model) {
  const StateSpace system = instantiate(noise_model(model), model.parameters);
  std::vector<NamedState> out;
  for (Index i = 0; i < system.states(); ++i) {
    NamedState state{fmt::format("x{}", i + 1), "", Unit{}};
    if (!model.states.empty()) {
      const StateName& named = model.states[i];
      out.push_back({named.name, named.unit, unit_or_dimensionless(named.unit)});
      continue;
    }
    for (Index j = 0; j < system.outputs(); ++j) {
      const bool shown = system.C(j, i) == 1.0 && (system.C.row(j).array() != 0.0).count() == 1 &&
                         system.D.row(j).isZero(0.0);
      if (!shown) continue;
      const ChannelSource& output = model.outputs[j];
      state = {output.name, output.unit, unit_or_dimensionless(output.unit)};
      break;
    }
    out.push_back(std::move(state));
  }
  return out;
}

const Eigen::VectorXd& stamps_of(const Dataset& data) {
  return data.stamps.size() > 0 ? data.stamps : data.time;
}

CsvLines::CsvLines(std::ostream& out, bool several) : out_(out), several_(several) {
  text_ = several ? "recording,time [s]" : "time [s]";
}

void CsvLines::head(const std::string& name, const std::string& unit) {
  text_ += "," + csv_heading(name, unit);
}

void CsvLines::begin_line(std::size_t recording, double time, int number) {
  text_ += '\n';
  if (text_.size() > kBuffer) flush();
  if (number > 0) fmt::format_to(std::back_inserter(text_), "{},", number);
  if (several_) fmt::format_to(std::back_inserter(text_), "{},", recording + 1);
  fmt::format_to(std::back_inserter(text_), "{:.15g}", time);
}

void CsvLines::cell(double value) {
  text_ += ',';
  // As few digits as read back to the same number.
  if (std::isfinite(value)) fmt::format_to(std::back_inserter(text_), "{}", value);
}

void CsvLines::flush() {
  out_.write(text_.data(), static_cast<std::streamsize>(text_.size()));
  text_.clear();
}

}  // namespace identikal
