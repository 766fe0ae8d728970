#include "lib/data/internal/date_time.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>

#include "lib/data/internal/csv_cell.h"

namespace identikal::csv {
namespace {

using std::chrono::sys_days;

constexpr std::int64_t kDay = 86400;      // s
constexpr std::int64_t kMonth = 2629746;  // s, a twelfth of the Gregorian calendar's year
constexpr std::array kMonths{"jan", "feb", "mar", "apr", "may", "jun",
                             "jul", "aug", "sep", "oct", "nov", "dec"};

// Takes parts from the front of a text.
class Scanner {
 public:
  explicit Scanner(std::string_view text) : text_(text) {}

  bool is_done() const { return text_.empty(); }
  bool take(char c) {
    if (text_.empty() || text_.front() != c) return false;
    text_.remove_prefix(1);
    return true;
  }
  bool take_one_of(std::string_view any, char& which) {
    if (text_.empty() || any.find(text_.front()) == std::string_view::npos) return false;
    which = text_.front();
    return take(which);
  }
  bool take_word(std::string_view word) {
    if (!same_ignoring_case(text_.substr(0, word.size()), word)) return false;
    text_.remove_prefix(word.size());
    return true;
  }
  // Of at least `least` and at most `most` digits.
  bool take_number(std::size_t least, std::size_t most, int& value) {
    const std::size_t count = digits();
    if (count < least || count > most) return false;
    std::from_chars(text_.data(), text_.data() + count, value);
    text_.remove_prefix(count);
    return true;
  }
  // Digits behind a decimal mark.
  bool take_fraction(double& value) {
    const std::size_t count = digits();
    if (count == 0 || count > 18) return false;
    std::int64_t whole = 0;
    std::from_chars(text_.data(), text_.data() + count, whole);
    double unit = 1.0;
    for (std::size_t k = 0; k < count; ++k) unit *= 10.0;
    value = static_cast<double>(whole) / unit;
    text_.remove_prefix(count);
    return true;
  }
  std::size_t digits() const {
    const auto end = std::find_if_not(text_.begin(), text_.end(),
                                      [](unsigned char c) { return std::isdigit(c) != 0; });
    return static_cast<std::size_t>(end - text_.begin());
  }

 private:
  std::string_view text_;
};

std::optional<sys_days> day_of(int year, int month, int day) {
  const std::chrono::year_month_day date{std::chrono::year(year),
                                         std::chrono::month(static_cast<unsigned>(month)),
                                         std::chrono::day(static_cast<unsigned>(day))};
  return date.ok() ? std::optional<sys_days>(date) : std::nullopt;
}

bool take_month_name(Scanner& text, int& month) {
  for (std::size_t k = 0; k < kMonths.size(); ++k) {
    if (!text.take_word(kMonths[k])) continue;
    month = static_cast<int>(k) + 1;
    return true;
  }
  return false;
}

bool take_year_first(Scanner& text, WrittenTime& out) {
  int year = 0, month = 0, day = 1;
  char mark = '\0';
  if (!text.take_number(4, 4, year) || !text.take_one_of("-/", mark)) return false;
  if (!text.take_number(1, 2, month)) return false;
  if (text.take(mark) && !text.take_number(1, 2, day)) return false;
  out.month_first = out.day_first = day_of(year, month, day);
  return true;
}

bool take_year_last(Scanner& text, WrittenTime& out) {
  int first = 0, second = 0, year = 0;
  char mark = '\0';
  if (!text.take_number(1, 2, first) || !text.take_one_of(".-/", mark)) return false;
  const bool named = take_month_name(text, second);
  if (!named && !text.take_number(1, 2, second)) return false;
  if (!text.take(mark) || !text.take_number(4, 4, year)) return false;
  out.day_first = day_of(year, second, first);
  out.month_first = named || mark == '.' ? out.day_first : day_of(year, first, second);
  return true;
}

bool take_date(Scanner& text, WrittenTime& out) {
  const bool taken = text.digits() == 4 ? take_year_first(text, out) : take_year_last(text, out);
  return taken && (out.month_first || out.day_first);
}

bool take_half_of_day(Scanner& text, int& hour) {
  Scanner behind = text;
  behind.take(' ');
  const bool after_noon = behind.take_word("pm");
  if (!after_noon && !behind.take_word("am")) return true;
  if (hour < 1 || hour > 12) return false;
  hour = hour % 12 + (after_noon ? 12 : 0);
  text = behind;
  return true;
}

// Z, UTC or an offset from it.
bool take_zone(Scanner& text, std::int64_t& second) {
  Scanner behind = text;
  behind.take(' ');
  char sign = '\0';
  if (behind.take_word("z") || behind.take_word("utc") || behind.take_word("gmt")) {
    text = behind;
  } else if (behind.take_one_of("+-", sign)) {
    int hours = 0, minutes = 0;
    if (!behind.take_number(2, 4, hours)) return false;
    if (hours > 99) {
      minutes = hours % 100;
      hours /= 100;
    } else if (behind.take(':') && !behind.take_number(2, 2, minutes)) {
      return false;
    }
    if (hours > 14 || minutes > 59) return false;
    second += (sign == '+' ? -60 : 60) * (60 * hours + minutes);
    text = behind;
  }
  return true;
}

// @param with_seconds  they have to be there
bool take_time_of_day(Scanner& text, bool with_seconds, WrittenTime& out) {
  int hour = 0, minute = 0, second = 0;
  char mark = '\0';
  if (!text.take_number(1, 2, hour) || !text.take(':') || !text.take_number(2, 2, minute))
    return false;
  const bool has_seconds = text.take(':');
  if (has_seconds && !text.take_number(2, 2, second)) return false;
  if (has_seconds && text.take_one_of(".,", mark) && !text.take_fraction(out.fraction))
    return false;
  if (!take_half_of_day(text, hour)) return false;
  constexpr int kLeapSecond = 60;
  const bool beyond_midnight = hour > 24 || (hour == 24 && (minute > 0 || second > 0));
  if (beyond_midnight || minute > 59 || second > kLeapSecond) return false;
  out.second = 3600 * hour + 60 * minute + second;
  return has_seconds || !with_seconds;
}

// Seconds and what a double lacks of them.
struct Seconds {
  double value, remainder;
};
Seconds seconds_of(std::int64_t whole, double fraction) {
  const double value = static_cast<double>(whole) + fraction;
  return {value, fraction - (value - static_cast<double>(whole))};
}

using Order = std::optional<sys_days> WrittenTime::*;

std::optional<std::vector<std::int64_t>> in_order(const std::vector<WrittenTime>& times,
                                                  Order order) {
  std::vector<std::int64_t> out;
  for (const WrittenTime& each : times) {
    if (!(each.*order)) return std::nullopt;
    out.push_back(kDay * (each.*order)->time_since_epoch().count() + each.second);
  }
  return out;
}

bool are_equally_apart(const std::vector<std::int64_t>& a, const std::vector<std::int64_t>& b) {
  return std::equal(a.begin(), a.end(), b.begin(),
                    [shift = a.front() - b.front()](auto x, auto y) { return x - y == shift; });
}

// Behind midnight the next day begins.
std::vector<std::int64_t> times_of_day(const std::vector<WrittenTime>& times) {
  std::vector<std::int64_t> out;
  std::int64_t days = 0;
  for (const WrittenTime& each : times) {
    if (!out.empty() && each.second + days + kDay / 2 < out.back()) days += kDay;
    out.push_back(each.second + days);
  }
  return out;
}

// The months from date to date, where all are the same day of their months, or the last one, at one time of day; else 0.
int months_apart(const std::vector<WrittenTime>& times, Order order) {
  using std::chrono::year_month_day;
  int step = 0, before = 0;
  bool same = true, last = true;
  const year_month_day first(*(times.front().*order));
  for (std::size_t k = 0; k < times.size(); ++k) {
    const year_month_day date(*(times[k].*order));
    const int month = 12 * static_cast<int>(date.year()) + static_cast<int>(unsigned(date.month()));
    same = same && date.day() == first.day();
    last = last && date == year_month_day(date.year() / date.month() / std::chrono::last);
    if (times[k].second != times[0].second || times[k].fraction != times[0].fraction) return 0;
    if (k == 1) step = month - before;
    if (k > 1 && month - before != step) return 0;
    before = month;
  }
  return times.size() > 2 && (same || last) && step > 0 ? step : 0;
}

}  // namespace

std::optional<WrittenTime> written_time(std::string_view text) {
  WrittenTime out;
  Scanner rest(text);
  char between = '\0';
  Scanner of_date = rest;
  out.has_day = take_date(of_date, out);
  if (out.has_day) rest = of_date;
  const bool ends = out.has_day && rest.is_done();
  const bool goes_on = !out.has_day || ends || rest.take_one_of(" Tt_", between);
  if (!goes_on || (!ends && !take_time_of_day(rest, !out.has_day, out))) return std::nullopt;
  if (!take_zone(rest, out.second) || !rest.is_done()) return std::nullopt;
  return out;
}

void DateColumn::take(std::size_t row, std::string_view text) {
  if (!all_are_times_) return;
  const std::optional<WrittenTime> time = written_time(text);
  all_are_times_ = time && (times_.empty() || time->has_day == times_.front().has_day);
  if (!all_are_times_) return;
  rows_.push_back(row);
  times_.push_back(*time);
}

void DateColumn::settle(Column& column) const {
  const std::size_t others = column.values.size() - column.missing;
  if (!all_are_times_ || times_.empty() || others > 0) return;
  std::vector<std::int64_t> whole;
  Order order = &WrittenTime::month_first;
  if (!times_.front().has_day) {
    whole = times_of_day(times_);
  } else {
    const auto month_first = in_order(times_, order);
    const auto day_first = in_order(times_, &WrittenTime::day_first);
    if (!month_first && !day_first) return;
    if (month_first && day_first && !are_equally_apart(*month_first, *day_first)) {
      column.dates = Dates::ambiguous;
      return;
    }
    if (!month_first) order = &WrittenTime::day_first;
    whole = month_first ? *month_first : *day_first;
    column.months = months_apart(times_, order);
  }
  column.remainder.assign(column.values.size(), 0.0);
  for (std::size_t k = 0; k < times_.size(); ++k) {
    const auto place = static_cast<std::int64_t>(k);
    if (column.months > 0) whole[k] = whole[0] + place * column.months * kMonth;
    const Seconds at = seconds_of(whole[k], times_[k].fraction);
    column.values[rows_[k]] = at.value;
    column.remainder[rows_[k]] = at.remainder;
  }
  column.missing -= times_.size();
  column.text_cells = 0;
  column.dates = times_.front().has_day ? Dates::instants : Dates::times_of_day;
  column.unit = "s";
}

}  // namespace identikal::csv
