// Which instants do the cells of a column name, where they are dates and times of day? Internal to lib: for
// the readers of tables.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "lib/data/csv.h"

namespace identikal::csv {

/// A date with or without a time of day, or a time of day alone.
struct WrittenTime {
  bool has_day = false;
  /// The same but for 3/4/2024, which may be March 4 and April 3; none where there is no such month.
  std::optional<std::chrono::sys_days> month_first, day_first;
  std::int64_t second = 0;  ///< of that day, in UTC where an offset from it is written
  double fraction = 0.0;    ///< of a second, [0, 1)
};

/// 2024-01-31, 2024/01/31, 31.01.2024, 31-Jan-2024 and 1/31/2024, a time behind it after a blank or a T: 12:30, 12:30:05,
/// 12:30:05.25 or 12:30:05,25, am or pm, and Z, UTC or +02:00; or hours, minutes and seconds alone.
/// @return nothing for any other text
std::optional<WrittenTime> written_time(std::string_view text);

/// The cells of one column that are no numbers, for as long as all of them are times.
class DateColumn {
 public:
  /// @param row  of the table, from 0, each above the one before; @param text  no number and not missing
  void take(std::size_t row, std::string_view text);
  /// Makes a column whose every cell is a time or empty one of seconds: since 1970-01-01 in UTC, or since midnight, the
  /// days behind it counted. Dates that are the same days of months, equally many apart, are made equally far apart:
  /// a month has 30.436875 days. Where it stays open which number is the day nothing is changed but `Column::dates`.
  void settle(Column& column) const;

 private:
  std::vector<std::size_t> rows_;
  std::vector<WrittenTime> times_;
  bool all_are_times_ = true;
};

}  // namespace identikal::csv
