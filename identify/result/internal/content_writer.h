// What do described fields hold, to the last digit?
#pragma once

#include <array>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "identify/result/internal/fields.h"

namespace identikal {

/// Visitor of describe(): a text that two structs share if and only if all their fields hold the
/// same. NaN is NaN here, infinity is another thing, and 0 is -0; matrices differ where their
/// shapes do.
class ContentWriter {
 public:
  template <class Struct>
  static std::string content_of(const Struct& s) {
    ContentWriter writer;
    writer.add(s);
    return std::move(writer.out_);
  }

  void is(const char* /*name*/, const char* /*meaning*/) {}
  template <class T>
  void operator()(const char* /*key*/, const T& member, const char* /*meaning*/) {
    add(member);
  }
  template <class Part>
  void group(const char* /*key*/, const char* /*meaning*/, const Part& part) {
    part(*this);
  }

 private:
  void add(double value);
  // With its length in front, so that two texts are not mistaken for one.
  void add(const std::string& text) { out_ += std::to_string(text.size()) + ":" + text; }
  template <class T>
  requires std::is_integral_v<T>
  void add(const T& value) { out_ += std::to_string(value) + ";"; }
  template <class T>
  requires std::is_enum_v<T>
  void add(const T& value) { add(to_string(value)); }
  template <class T>
  void add(const std::vector<T>& items) {
    add(items.size());
    for (const T& item : items) add(item);
  }
  template <std::size_t n>
  void add(const std::array<double, n>& items) {
    for (const double item : items) add(item);
  }
  void add(const Eigen::VectorXd& x) {
    add(x.size());
    for (const double item : x) add(item);
  }
  void add(const Eigen::MatrixXd& M) {
    add(M.rows());
    add(M.cols());
    for (const double item : M.reshaped()) add(item);
  }
  template <class T>
  void add(const std::optional<T>& part) {
    add(part.has_value());
    if (part) add(*part);
  }
  template <class Struct>
  void add(const Struct& s) {
    // As in JsonWriter: a description asks for a struct that may change, and this changes nothing.
    describe(*this, const_cast<Struct&>(s));
  }

  template <class T>
  void add(const Section<T>& section) {
    add(section.held != nullptr);
    if (section.held != nullptr) add(*section.held);
  }
  template <class T>
  void add(const Choice<T>& choice) {
    add(choice.value);
  }
  template <class T>
  void add(const Present<T>& present) {
    add(present.value);
  }
  void add(const ChoiceOrNull& choice) { add(choice.text); }
  void add(const Sha256& sum) { add(sum.text); }
  void add(const Ends& range) { add(range.ends); }
  void add(const CodeOf& code) { add(name_of(code.finding)); }
  void add(const Printed& all) { add(printed(all.findings)); }
  void add(const ByChannel& channels) {
    add(channels.fits.size());
    for (const ChannelFit& fit : channels.fits) {
      add(fit.channel);
      add(fit);
    }
  }

  std::string out_;
};

}  // namespace identikal
