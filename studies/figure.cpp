#include "studies/figure.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <numbers>
#include <stdexcept>

#include <fmt/format.h>
#include <plplot/plplot.h>

#include "lib/base/error.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Page, in points.
constexpr double kPanelWidth = 500.0, kPanelHeight = 400.0;  // of a panel
constexpr double kLeft = 70.0, kRight = 20.0, kBarRight = 105.0, kTop = 40.0, kBottom = 55.0;
constexpr double kLetterHeight = 3.3;  // in PLplot's millimetres: letters of 12 points

// Colours 1 to 6 of PLplot's table 0 here, told apart by the colour-blind too (Okabe & Ito).
constexpr int kWhite = 0, kInk = 15, kColours = 6;
constexpr std::array<std::array<int, 3>, kColours> kPalette = {
    {{0, 114, 178}, {213, 94, 0}, {0, 158, 115}, {0, 0, 0}, {204, 121, 167}, {150, 110, 0}}};

// A panel's rectangle on the page and what it shows.
class Plot {
 public:
  Plot(const Panel& panel, double left, double pages)
      : p_(panel),
        left_(left + kLeft),
        right_(left + kPanelWidth - (panel.map ? kBarRight : kRight)),
        pages_(pages),
        x_(range(panel.x)),
        y_(range(panel.y)) {}

  void draw() const {
    viewport(left_, right_, kBottom, kPanelHeight - kTop);
    plwind(x_.low, x_.high, y_.low, y_.high);
    if (p_.map) shade(*p_.map);
    int colour = 0;
    for (const Bars& bars : p_.bars) draw(bars, 1 + colour++ % kColours);
    for (const Curve& curve : p_.curves) draw(curve, colour++);
    plcol0(kInk);
    plwidth(1.0);
    plbox(p_.x.logarithmic ? "bclnst" : "bcnst", 0.0, 0, p_.y.logarithmic ? "bclnstv" : "bcnstv",
          0.0, 0);
    plmtex("b", 3.0, 0.5, 0.5, text(p_.x.label).c_str());
    plmtex("l", 4.2, 0.5, 0.5, text(p_.y.label).c_str());
    plmtex("t", 1.2, 0.5, 0.5, text(p_.title).c_str());
    legend();
    if (p_.map) colour_bar(*p_.map);
  }

 private:
  struct Range {
    double low, high;
  };
  static double scaled(const Axis& axis, double v) { return axis.logarithmic ? std::log10(v) : v; }
  static Range range(const Axis& axis) {
    const Range out{scaled(axis, axis.low), scaled(axis, axis.high)};
    if (!(out.low < out.high) || !std::isfinite(out.low) || !std::isfinite(out.high)) {
      throw std::invalid_argument(
          fmt::format("figure: axis '{}' from {} to {}", axis.label, axis.low, axis.high));
    }
    return out;
  }
  // PLplot's escape character.
  static std::string text(const std::string& label) {
    std::string out;
    for (const char c : label) out += c == '#' ? std::string("##") : std::string(1, c);
    return out;
  }
  void viewport(double left, double right, double bottom, double top) const {
    plvpor(left / (pages_ * kPanelWidth), right / (pages_ * kPanelWidth), bottom / kPanelHeight,
           top / kPanelHeight);
  }

  // PLplot fills cell by cell, and a viewer lets the page shine through between two that touch.
  static void fill_to_the_rim(int n, const double* x, const double* y) {
    plfill(n, x, y);
    std::vector<double> xs(x, x + n), ys(y, y + n);
    xs.push_back(x[0]), ys.push_back(y[0]);
    plwidth(0.5);
    plline(n + 1, xs.data(), ys.data());
  }

  void shade(const Map& map) const {
    const Index nx = map.x.size(), ny = map.y.size();
    if (nx < 2 || ny < 2 || map.value.rows() != nx || map.value.cols() != ny ||
        map.levels.size() < 2) {
      throw std::invalid_argument("figure: sizes of a map disagree");
    }
    using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    RowMajor value = map.value;
    std::vector<const double*> rows;
    for (Index i = 0; i < nx; ++i) rows.push_back(value.data() + i * ny);
    const double left = scaled(p_.x, map.x[0]), right = scaled(p_.x, map.x[nx - 1]);
    const double bottom = scaled(p_.y, map.y[0]), top = scaled(p_.y, map.y[ny - 1]);
    plshades(rows.data(), static_cast<PLINT>(nx), static_cast<PLINT>(ny), nullptr, left, right,
             bottom, top, map.levels.data(), static_cast<PLINT>(map.levels.size()), 0.0, 0, 0.0,
             fill_to_the_rim, 1, nullptr, nullptr);
    VectorXd xs = VectorXd::LinSpaced(nx, left, right), ys = VectorXd::LinSpaced(ny, bottom, top);
    PLcGrid grid{xs.data(), ys.data(), nullptr, static_cast<PLINT>(nx), static_cast<PLINT>(ny), 0};
    plcol0(kInk);
    plwidth(0.4);
    plcont(rows.data(), static_cast<PLINT>(nx), static_cast<PLINT>(ny), 1, static_cast<PLINT>(nx),
           1, static_cast<PLINT>(ny), map.levels.data(), static_cast<PLINT>(map.levels.size()),
           pltr1, &grid);
  }

  // Boxes of the shades, the levels at their edges.
  void colour_bar(const Map& map) const {
    const auto shades = static_cast<int>(map.levels.size()) - 1;
    viewport(right_ + 12.0, right_ + 26.0, kBottom, kPanelHeight - kTop);
    plwind(0.0, 1.0, 0.0, shades);
    for (int s = 0; s < shades; ++s) {
      const std::array<double, 4> x{0.0, 1.0, 1.0, 0.0};
      const std::array<double, 4> y{1.0 * s, 1.0 * s, s + 1.0, s + 1.0};
      plcol1(shades == 1 ? 0.5 : s / (shades - 1.0));
      plfill(4, x.data(), y.data());
    }
    plcol0(kInk);
    plwidth(1.0);
    plbox("bc", 0.0, 0, "bc", 0.0, 0);
    const int every = 1 + shades / 12;
    for (int s = 0; s <= shades; s += every) {
      plmtex("rv", 0.5, s / static_cast<double>(shades), 0.0,
             fmt::format("{:.3g}", map.levels[static_cast<std::size_t>(s)]).c_str());
    }
    plmtex("r", 5.2, 0.5, 0.5, text(map.label).c_str());
  }

  void draw(const Bars& bars, int colour) const {
    if (bars.edges.size() != bars.height.size() + 1) {
      throw std::invalid_argument("figure: n bars need n + 1 edges");
    }
    for (Index i = 0; i < bars.height.size(); ++i) {
      const double a = scaled(p_.x, bars.edges[i]), b = scaled(p_.x, bars.edges[i + 1]);
      const double top = scaled(p_.y, bars.height[i]);
      if (!(top > y_.low) || !std::isfinite(a) || !std::isfinite(b)) continue;
      box(a, b, y_.low, top, colour);
    }
  }

  void box(double left, double right, double bottom, double top, int colour) const {
    const std::array<double, 5> x{left, right, right, left, left};
    const std::array<double, 5> y{bottom, bottom, top, top, bottom};
    plcol0(colour);
    plfill(4, x.data(), y.data());
    plcol0(kInk);
    plwidth(0.6);
    plline(5, x.data(), y.data());
  }

  void draw(const Curve& curve, int at) const {
    if (curve.x.size() != curve.y.size()) {
      throw std::invalid_argument("figure: a curve needs as many x as y");
    }
    std::vector<double> x, y;  // of a piece without gaps
    const auto flush = [&] {
      stroke(x, y, curve.form, at);
      x.clear(), y.clear();
    };
    for (Index i = 0; i < curve.x.size(); ++i) {
      const double a = scaled(p_.x, curve.x[i]), b = scaled(p_.y, curve.y[i]);
      if (std::isfinite(a) && std::isfinite(b)) {
        x.push_back(a), y.push_back(b);
      } else {
        flush();
      }
    }
    flush();
  }

  void stroke(const std::vector<double>& x, const std::vector<double>& y, Curve::Form form,
              int at) const {
    plcol0(1 + at % kColours);
    plwidth(1.6);
    if (form != Curve::Form::points && x.size() > 1) {
      pllsty(form == Curve::Form::dashed ? 2 : 1);
      plline(static_cast<PLINT>(x.size()), x.data(), y.data());
      pllsty(1);
    }
    if (form != Curve::Form::points && form != Curve::Form::marked) return;
    for (std::size_t i = 0; i < x.size(); ++i) {
      if (x[i] < x_.low || x[i] > x_.high || y[i] < y_.low || y[i] > y_.high) continue;
      marker(x[i], y[i], at);
    }
  }

  // Circle, square, diamond, triangle of 7 points, then smaller and filled, so that markers on one
  // another all show; letters of a font would not sit centred.
  void marker(double x, double y, int at) const {
    constexpr std::array<int, 4> kCorners = {16, 4, 4, 3};
    constexpr std::array<double, 4> kTurn = {0.0, 0.25, 0.0, 0.5};  // of pi
    const auto kind = static_cast<std::size_t>(at % 4);
    const bool filled = at % 8 >= 4;
    const double radius = (filled ? 0.5 : 1.0) * (kind == 0 ? 3.4 : 4.2);
    std::vector<double> xs, ys;
    for (int c = 0; c <= kCorners[kind]; ++c) {
      const double angle = (kTurn[kind] + 2.0 * c / kCorners[kind]) * std::numbers::pi;
      xs.push_back(x + radius * std::cos(angle) * (x_.high - x_.low) / (right_ - left_));
      ys.push_back(y +
                   radius * std::sin(angle) * (y_.high - y_.low) / (kPanelHeight - kTop - kBottom));
    }
    plcol0(p_.map ? kWhite : 1 + at % kColours);  // white shows on every shade
    if (filled || p_.map) plfill(static_cast<PLINT>(xs.size()) - 1, xs.data(), ys.data());
    plcol0(1 + at % kColours);
    plwidth(1.2);
    plline(static_cast<PLINT>(xs.size()), xs.data(), ys.data());
    plwidth(1.6);
  }

  // Top right, on white.
  void legend() const {
    constexpr double kLine = 16.0, kSample = 30.0, kLetter = 6.6, kMargin = 8.0;  // points
    std::size_t longest = 0, lines = 0;
    const auto count = [&](const std::string& name) {
      if (name.empty()) return;
      ++lines;
      longest = std::max(longest, name.size());
    };
    for (const Bars& b : p_.bars) count(b.name);
    for (const Curve& c : p_.curves) count(c.name);
    if (lines == 0) return;
    const double per_x = (x_.high - x_.low) / (right_ - left_);
    const double per_y = (y_.high - y_.low) / (kPanelHeight - kTop - kBottom);
    const double width = kSample + 3.0 * kMargin + kLetter * static_cast<double>(longest);
    const double right = x_.high - kMargin * per_x, left = right - width * per_x;
    const double top = y_.high - kMargin * per_y;
    box(left, right, top - (static_cast<double>(lines) * kLine + kMargin) * per_y, top, kWhite);
    double y = top - 0.5 * (kLine + kMargin) * per_y;
    const double from = left + kMargin * per_x, to = from + kSample * per_x;
    const auto name = [&](const std::string& what) {
      plcol0(kInk);
      plptex(to + kMargin * per_x, y, 1.0, 0.0, 0.0, text(what).c_str());
      y -= kLine * per_y;
    };
    int at = 0;
    for (const Bars& b : p_.bars) {
      const int colour = 1 + at++ % kColours;
      if (b.name.empty()) continue;
      box(from, to, y - 4.0 * per_y, y + 4.0 * per_y, colour);
      name(b.name);
    }
    for (const Curve& c : p_.curves) {
      const int own = at++;
      if (c.name.empty()) continue;
      if (c.form != Curve::Form::points) {
        stroke({from, to}, {y, y}, c.form == Curve::Form::dashed ? c.form : Curve::Form::solid,
               own);
      }
      if (c.form == Curve::Form::marked || c.form == Curve::Form::points) {
        marker(0.5 * (from + to), y, own);
      }
      name(c.name);
    }
  }

  const Panel& p_;
  double left_, right_, pages_;
  Range x_, y_;
};

// Asks before PLplot does, which would ask the terminal.
void check_driver() {
  std::array<const char*, 256> menu{}, names{};  // PLplot fills in
  const char** menu_at = menu.data();
  const char** names_at = names.data();
  int count = static_cast<int>(names.size());  // room, then devices
  plgDevs(&menu_at, &names_at, &count);
  for (int i = 0; i < count; ++i) {
    if (std::strcmp(names[static_cast<std::size_t>(i)], "svg") == 0) return;
  }
  throw OutputError(
      "PLplot has no svg driver here (PLPLOT_DRV_DIR is unset, or names its folder): cannot draw "
      "the figure");
}

}  // namespace

std::string svg(const Figure& figure) {
  if (figure.panels.empty()) throw std::invalid_argument("figure: no panel");
  const auto pages = static_cast<double>(figure.panels.size());
  std::vector<Plot> plots;
  for (const Panel& panel : figure.panels) {
    plots.emplace_back(panel, kPanelWidth * static_cast<double>(plots.size()), pages);
  }
  // PLplot draws on one page of the whole process.
  static std::mutex one_at_a_time;
  const std::lock_guard<std::mutex> lock(one_at_a_time);
  check_driver();
  struct Buffer {
    char* bytes = nullptr;
    std::size_t size = 0;
    ~Buffer() { std::free(bytes); }
  } buffer;
  std::FILE* file = open_memstream(&buffer.bytes, &buffer.size);
  if (file == nullptr) throw OutputError("no memory for a figure");
  // PLplot closes the file, which is when bytes and size are set.
  plsdev("svg");
  plsfile(file);
  plspage(0.0, 0.0, static_cast<PLINT>(pages * kPanelWidth), static_cast<PLINT>(kPanelHeight), 0,
          0);
  plscolbg(255, 255, 255);
  for (int i = 0; i < kColours; ++i) {
    const auto& c = kPalette[static_cast<std::size_t>(i)];
    plscol0(1 + i, c[0], c[1], c[2]);
  }
  plscol0(kInk, 0, 0, 0);
  // White to dark blue: grows darker all the way, also in print.
  const std::array<double, 4> at{0.0, 0.35, 0.7, 1.0}, red{1.0, 0.62, 0.19, 0.03},
      green{1.0, 0.79, 0.51, 0.19}, blue{1.0, 0.88, 0.74, 0.42};
  plscmap1n(256);
  plscmap1l(1, 4, at.data(), red.data(), green.data(), blue.data(), nullptr);
  {
    struct End {
      ~End() { plend(); }
    } end;  // also where a panel throws
    plinit();
    pladv(0);
    plschr(kLetterHeight, 1.0);
    for (const Plot& plot : plots) plot.draw();
  }
  if (buffer.bytes == nullptr || buffer.size == 0) throw OutputError("PLplot wrote no figure");
  return {buffer.bytes, buffer.size};
}

}  // namespace identikal
