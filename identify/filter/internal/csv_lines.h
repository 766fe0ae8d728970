// How are the rows of recordings written as CSV, with the model's states by name? Internal to
// identify/filter.
#pragma once

#include <iosfwd>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "identify/model/model.h"
#include "lib/data/dataset.h"
#include "lib/data/units.h"

namespace identikal {

struct NamedState {
  std::string name, unit;
  Unit si;
};

/// By the names of formulas; else a state that an output shows as it is has that output's name and unit,
/// and the others are x1, x2, ...
std::vector<NamedState> named_states(const Model& model);

/// As recorded [s].
const Eigen::VectorXd& stamps_of(const Dataset& data);

/// Cells of a line, in a buffer that is written out now and then.
class CsvLines {
 public:
  CsvLines(std::ostream& out, bool several);
  ~CsvLines() { flush(); }
  CsvLines(const CsvLines&) = delete;
  CsvLines& operator=(const CsvLines&) = delete;

  void head(const std::string& name, const std::string& unit);
  /// @param number  of the trajectory, in a first column; 0: there is none
  void begin_line(std::size_t recording, double time, int number = 0);
  void cell(double value);  ///< empty where it is not finite
  void end() { text_ += '\n'; }

 private:
  static constexpr std::size_t kBuffer = 1 << 18;
  void flush();
  std::ostream& out_;
  bool several_;
  std::string text_;
};

}  // namespace identikal
