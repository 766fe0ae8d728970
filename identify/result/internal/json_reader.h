// How do described fields get the values that a file holds?
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include "identify/result/internal/fields.h"
#include "identify/result/internal/json_field.h"
#include "lib/base/constants.h"

namespace identikal {

/// Visitor of describe(): takes every field from one JSON object, in the order of the description.
/// @throws InputError at the first one that is missing or of another kind
class JsonReader {
 public:
  explicit JsonReader(const JsonField& from) : from_(from) {}

  void is(const char* /*name*/, const char* /*meaning*/) {}
  template <class T>
  void operator()(const char* key, T&& member, const char* /*meaning*/) {
    read(from_[key], member);
  }
  template <class Part>
  void group(const char* key, const char* /*meaning*/, const Part& part) {
    JsonReader inner(from_[key]);
    part(inner);
  }

 private:
  static void read(const JsonField& from, double& to) { to = from.number(); }
  static void read(const JsonField& from, bool& to) { to = from.yes(); }
  static void read(const JsonField& from, std::string& to) { to = from.text(); }
  template <class T>
  requires std::is_integral_v<T>
  static void read(const JsonField& from, T& to) { to = from.whole_number<T>(); }
  template <class T>
  requires std::is_enum_v<T>
  static void read(const JsonField& from, T& to) { to = from.word(values_of(to)); }
  template <class T>
  static void read(const JsonField& from, std::vector<T>& to) {
    to.clear();
    for (const JsonField& item : from.items()) read(item, to.emplace_back());
  }
  template <std::size_t n>
  static void read(const JsonField& from, std::array<double, n>& to) {
    const std::vector<JsonField> items = from.items();
    if (items.size() != n) {
      from.refuse(n == 2 ? "is no interval" : "is no list of " + std::to_string(n) + " numbers");
    }
    for (std::size_t i = 0; i < n; ++i) to[i] = items[i].number();
  }
  static void read(const JsonField& from, Eigen::VectorXd& to) {
    std::vector<double> items;
    read(from, items);
    to = Eigen::Map<const Eigen::VectorXd>(items.data(), static_cast<Eigen::Index>(items.size()));
  }
  static void read(const JsonField& from, Eigen::MatrixXd& to) {
    to.resize(0, 0);
    if (from.absent()) return;
    std::vector<std::vector<double>> rows;
    read(from, rows);
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const auto columns = static_cast<Eigen::Index>(rows[i].size());
      if (i == 0) to.resize(static_cast<Eigen::Index>(rows.size()), columns);
      if (columns != to.cols()) from.refuse("has rows of different lengths");
      to.row(static_cast<Eigen::Index>(i)) =
          Eigen::Map<const Eigen::RowVectorXd>(rows[i].data(), columns);
    }
  }
  template <class T>
  static void read(const JsonField& from, std::optional<T>& to) {
    to.reset();
    if (!from.absent()) read(from, to.emplace());
  }
  template <class Struct>
  static void read(const JsonField& from, Struct& to) {
    JsonReader reader(from);
    describe(reader, to);
  }

  template <class T>
  static void read(const JsonField& from, Section<T>& to) {
    read(from, *to.read);
  }
  template <class T>
  static void read(const JsonField& from, Choice<T>& to) {
    read(from, to.value);
  }
  template <class T>
  static void read(const JsonField& from, Present<T>& to) {
    read(from, to.value);
  }
  static void read(const JsonField& from, ChoiceOrNull& to) {
    to.text = from.absent() ? "" : from.text();
    const bool known = std::find(to.known.begin(), to.known.end(), to.text) != to.known.end();
    if (!from.absent() && !known) from.refuse("is no word that stands here");
  }
  static void read(const JsonField& from, Sha256& to) { to.text = from.text(); }
  static void read(const JsonField& from, Ends& to) {
    read(from, to.ends);
    if (std::isnan(to.ends[0])) to.ends[0] = -kInfinity;
    if (std::isnan(to.ends[1])) to.ends[1] = kInfinity;
  }
  static void read(const JsonField& from, CodeOf& to) { set_code(to.finding, from.text()); }
  static void read(const JsonField& from, Printed& to) { read(from, to.findings); }
  static void read(const JsonField& from, ByChannel& to) {
    to.fits.clear();
    for (const auto& [channel, fit] : from.members()) {
      read(fit, to.fits.emplace_back());
      to.fits.back().channel = channel;
    }
  }

  JsonField from_;
};

}  // namespace identikal
