#include "studies/figure.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "studies/axis_ticks.h"
#include "studies/contours.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::Vector2d;
using Eigen::VectorXd;

// Page, in points; y goes down.
constexpr double kPanelWidth = 500.0, kPanelHeight = 400.0;
constexpr double kLeft = 70.0, kRight = 20.0, kBarRight = 105.0, kTop = 40.0, kBottom = 55.0;
constexpr double kLetter = 12.0, kLetterWidth = 6.9;
constexpr double kTick = 6.0, kMinorTick = 3.0;
constexpr double kLineWidth = 1.6;
constexpr int kMostTicksX = 8, kMostTicksY = 8;

// Told apart by the colour-blind too (Okabe & Ito).
constexpr std::array kPalette = {"#0072B2", "#D55E00", "#009E73", "#000000", "#CC79A7", "#966E00"};

const char* colour_of(std::size_t at) { return kPalette[at % kPalette.size()]; }

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '&') {
      out += "&amp;";
    } else if (c == '<') {
      out += "&lt;";
    } else if (c == '>') {
      out += "&gt;";
    } else {
      out += c;
    }
  }
  return out;
}

// Letters of UTF-8, whose other bytes begin with the bits 10.
double width_of(const std::string& text) {
  return kLetterWidth * static_cast<double>(std::count_if(
                            text.begin(), text.end(), [](char c) { return (c & 0xC0) != 0x80; }));
}

// An axis on the page: low of the axis is at `from`, high at `to`.
struct Scale {
  bool logarithmic;
  double low, high, from, to;  // low and high of the logarithm where it is logarithmic

  double operator()(double v) const {
    const double scaled = logarithmic ? std::log10(v) : v;
    return from + (scaled - low) / (high - low) * (to - from);
  }
};

Scale scale_of(const Axis& axis, double from, double to) {
  const double low = axis.logarithmic ? std::log10(axis.low) : axis.low;
  const double high = axis.logarithmic ? std::log10(axis.high) : axis.high;
  if (!(low < high) || !std::isfinite(low) || !std::isfinite(high)) {
    throw std::invalid_argument(
        fmt::format("figure: axis '{}' from {} to {}", axis.label, axis.low, axis.high));
  }
  return {axis.logarithmic, low, high, from, to};
}

AxisTicks ticks_of(const Axis& axis, int most) {
  return axis.logarithmic ? logarithmic_ticks(axis.low, axis.high, most)
                          : linear_ticks(axis.low, axis.high, most);
}

// A panel's rectangle on the page, and the SVG that is drawn so far.
struct Plot {
  Plot(const Panel& panel, std::size_t at, std::string& svg)
      : number(at),
        left(kPanelWidth * static_cast<double>(at) + kLeft),
        right(kPanelWidth * static_cast<double>(at + 1) - (panel.map ? kBarRight : kRight)),
        x(scale_of(panel.x, left, right)),
        y(scale_of(panel.y, bottom, top)),
        out(svg) {}

  template <typename... Arguments>
  void add(fmt::format_string<Arguments...> element, Arguments&&... arguments) const {
    fmt::format_to(std::back_inserter(out), element, std::forward<Arguments>(arguments)...);
    out += '\n';
  }
  void line(double x0, double y0, double x1, double y1, double width = 1.0) const {
    add("<line x1='{:.2f}' y1='{:.2f}' x2='{:.2f}' y2='{:.2f}' stroke='#000000' "
        "stroke-width='{:g}'/>",
        x0, y0, x1, y1, width);
  }
  void rect(double x0, double y0, double x1, double y1, const char* fill, double stroke) const {
    add("<rect x='{:.2f}' y='{:.2f}' width='{:.2f}' height='{:.2f}' fill='{}' stroke='#000000' "
        "stroke-width='{:g}'/>",
        x0, y0, x1 - x0, y1 - y0, fill, stroke);
  }
  void text(double x0, double y0, const char* anchor, const std::string& words) const {
    add("<text x='{:.2f}' y='{:.2f}' text-anchor='{}'>{}</text>", x0, y0, anchor, escaped(words));
  }
  void upright_text(double x0, double y0, const std::string& words) const {
    add("<text transform='translate({:.2f} {:.2f}) rotate(-90)' text-anchor='middle'>{}</text>", x0,
        y0, escaped(words));
  }
  bool shows(double x0, double y0) const {
    return x0 >= left - 0.01 && x0 <= right + 0.01 && y0 >= top - 0.01 && y0 <= bottom + 0.01;
  }

  std::size_t number;
  double left, right;
  double top = kTop, bottom = kPanelHeight - kBottom;
  Scale x, y;
  std::string& out;
};

void draw_axes(const Plot& plot, const Panel& panel) {
  plot.rect(plot.left, plot.top, plot.right, plot.bottom, "none", 1.0);
  const auto upright = [&](double v, double length) {
    plot.line(plot.x(v), plot.bottom, plot.x(v), plot.bottom - length);
    plot.line(plot.x(v), plot.top, plot.x(v), plot.top + length);
  };
  const auto level = [&](double v, double length) {
    plot.line(plot.left, plot.y(v), plot.left + length, plot.y(v));
    plot.line(plot.right, plot.y(v), plot.right - length, plot.y(v));
  };
  const AxisTicks x = ticks_of(panel.x, kMostTicksX), y = ticks_of(panel.y, kMostTicksY);
  for (const double v : x.minor) upright(v, kMinorTick);
  for (const double v : y.minor) level(v, kMinorTick);
  for (const auto& [v, label] : x.major) {
    upright(v, kTick);
    plot.text(plot.x(v), plot.bottom + 1.3 * kLetter, "middle", label);
  }
  double widest = 0.0;
  for (const auto& [v, label] : y.major) {
    widest = std::max(widest, width_of(label));
    level(v, kTick);
    plot.text(plot.left - 5.0, plot.y(v) + 0.35 * kLetter, "end", label);
  }
  const double middle = 0.5 * (plot.left + plot.right);
  plot.text(middle, plot.bottom + 3.0 * kLetter, "middle", panel.x.label);
  plot.text(middle, plot.top - kLetter, "middle", panel.title);
  plot.upright_text(plot.left - widest - 1.2 * kLetter, 0.5 * (plot.top + plot.bottom),
                    panel.y.label);
}

// White to dark blue: grows darker all the way, also in print.
std::string shade(double share) {
  constexpr std::array<double, 4> kAt{0.0, 0.35, 0.7, 1.0};
  constexpr std::array<std::array<double, 4>, 3> kColour{
      {{1.0, 0.62, 0.19, 0.03}, {1.0, 0.79, 0.51, 0.19}, {1.0, 0.88, 0.74, 0.42}}};
  std::size_t k = 0;
  while (k < 2 && share > kAt[k + 1]) ++k;
  const double between = (share - kAt[k]) / (kAt[k + 1] - kAt[k]);
  std::string out = "#";
  for (const auto& c : kColour) {
    out += fmt::format("{:02X}", std::lround(255.0 * std::lerp(c[k], c[k + 1], between)));
  }
  return out;
}

std::string shade_of(const Map& map, std::size_t level) {
  const std::size_t shades = map.levels.size() - 1;
  return shade(shades == 1 ? 0.5
                           : static_cast<double>(level) / (static_cast<double>(shades) - 1.0));
}

VectorXd on_page(const Scale& scale, const VectorXd& values) {
  VectorXd out(values.size());
  for (Index i = 0; i < values.size(); ++i) out[i] = scale(values[i]);
  return out;
}

// Every level's region lies on that of the one before; above the last one it is white again. A
// viewer shows no seams inside one path.
void draw_map(const Plot& plot, const Map& map) {
  if (map.levels.size() < 2) throw std::invalid_argument("figure: a map needs two levels");
  const VectorXd x = on_page(plot.x, map.x), y = on_page(plot.y, map.y);
  std::string lines;
  for (std::size_t k = 0; k < map.levels.size(); ++k) {
    const Contour level = contour(x, y, map.value, map.levels[k]);
    std::string path;
    for (const std::vector<Vector2d>& polygon : level.above) {
      const char* command = "M";
      for (const Vector2d& p : polygon) {
        path += fmt::format("{}{:.2f} {:.2f}", command, p.x(), p.y());
        command = "L";
      }
      path += "Z";
    }
    const bool last = k + 1 == map.levels.size();
    if (!path.empty()) {
      plot.add("<path fill='{}' d='{}'/>", last ? "#FFFFFF" : shade_of(map, k), path);
    }
    for (const auto& [a, b] : level.line) {
      lines += fmt::format("M{:.2f} {:.2f}L{:.2f} {:.2f}", a.x(), a.y(), b.x(), b.y());
    }
  }
  plot.add("<path fill='none' stroke='#000000' stroke-width='0.4' stroke-linecap='round' d='{}'/>",
           lines);
}

// Boxes of the shades, the levels at their edges.
void draw_colour_bar(const Plot& plot, const Map& map) {
  const std::size_t shades = map.levels.size() - 1, every = 1 + shades / 12;
  const double from = plot.right + 12.0, to = plot.right + 26.0;
  const auto edge = [&](std::size_t level) {
    return std::lerp(plot.bottom, plot.top,
                     static_cast<double>(level) / static_cast<double>(shades));
  };
  for (std::size_t k = 0; k < shades; ++k) {
    plot.rect(from, edge(k + 1), to, edge(k), shade_of(map, k).c_str(), 0.5);
  }
  for (std::size_t k = 0; k <= shades; k += every) {
    plot.text(to + 5.0, edge(k) + 0.35 * kLetter, "start", fmt::format("{:.3g}", map.levels[k]));
  }
  plot.upright_text(plot.right + kBarRight - kLetter, 0.5 * (plot.top + plot.bottom), map.label);
}

void draw_bars(const Plot& plot, const Bars& bars, std::size_t at) {
  if (bars.edges.size() != bars.height.size() + 1) {
    throw std::invalid_argument("figure: n bars need n + 1 edges");
  }
  for (Index i = 0; i < bars.height.size(); ++i) {
    const double from = plot.x(bars.edges[i]), to = plot.x(bars.edges[i + 1]);
    const double top = plot.y(bars.height[i]);
    if (!(top < plot.bottom) || !std::isfinite(from) || !std::isfinite(to)) continue;
    plot.rect(from, std::max(top, plot.top - 1.0), to, plot.bottom, colour_of(at), 0.6);
  }
}

// Circle, square, diamond, triangle of 7 points, then smaller and filled, so that markers on one
// another all show.
void draw_marker(const Plot& plot, double x, double y, std::size_t at, bool on_map) {
  constexpr std::array<int, 4> kCorners = {0, 4, 4, 3};
  constexpr std::array<double, 4> kTurn = {0.0, 0.25, 0.0, 0.5};  // of pi
  const std::size_t kind = at % 4;
  const bool filled = at % 8 >= 4;
  const double radius = (filled ? 0.5 : 1.0) * (kind == 0 ? 3.4 : 4.2);
  const char* colour = colour_of(at);
  // White shows on every shade.
  const char* fill = on_map ? "#FFFFFF" : filled ? colour : "none";
  if (kind == 0) {
    plot.add("<circle cx='{:.2f}' cy='{:.2f}' r='{:g}' fill='{}' stroke='{}' stroke-width='1.2'/>",
             x, y, radius, fill, colour);
    return;
  }
  std::string corners;
  for (int c = 0; c < kCorners[kind]; ++c) {
    const double angle = (kTurn[kind] + 2.0 * c / kCorners[kind]) * std::numbers::pi;
    corners += fmt::format("{}{:.2f},{:.2f}", c == 0 ? "" : " ", x + radius * std::cos(angle),
                           y - radius * std::sin(angle));
  }
  plot.add("<polygon points='{}' fill='{}' stroke='{}' stroke-width='1.2'/>", corners, fill,
           colour);
}

void draw_line(const Plot& plot, const std::vector<Vector2d>& points, bool dashed, std::size_t at) {
  if (points.size() < 2) return;
  std::string list;
  for (const Vector2d& p : points) {
    list += fmt::format("{}{:.2f},{:.2f}", list.empty() ? "" : " ", p.x(), p.y());
  }
  plot.add(
      "<polyline fill='none' stroke='{}' stroke-width='{:g}' stroke-linejoin='round'{} "
      "points='{}'/>",
      colour_of(at), kLineWidth, dashed ? " stroke-dasharray='6 4'" : "", list);
}

bool has_line(const Curve& curve) { return curve.form != Curve::Form::points; }
bool has_markers(const Curve& curve) {
  return curve.form == Curve::Form::points || curve.form == Curve::Form::marked;
}

// Where the points of a curve lie, a piece for every run of them without gaps.
std::vector<std::vector<Vector2d>> pieces_of(const Plot& plot, const Curve& curve) {
  if (curve.x.size() != curve.y.size()) {
    throw std::invalid_argument("figure: a curve needs as many x as y");
  }
  // Numbers far outside the page are nobody's: some viewers fail at them.
  constexpr double kFar = 1e5;
  std::vector<std::vector<Vector2d>> out(1);
  for (Index i = 0; i < curve.x.size(); ++i) {
    const Vector2d p(plot.x(curve.x[i]), plot.y(curve.y[i]));
    if (p.allFinite()) {
      out.back().push_back(p.cwiseMax(-kFar).cwiseMin(kFar));
    } else if (!out.back().empty()) {
      out.emplace_back();
    }
  }
  return out;
}

void draw_curve(const Plot& plot, const Curve& curve, std::size_t at, bool on_map) {
  for (const std::vector<Vector2d>& piece : pieces_of(plot, curve)) {
    if (has_line(curve)) draw_line(plot, piece, curve.form == Curve::Form::dashed, at);
    if (!has_markers(curve)) continue;
    for (const Vector2d& p : piece) {
      if (plot.shows(p.x(), p.y())) draw_marker(plot, p.x(), p.y(), at, on_map);
    }
  }
}

// One line of the legend.
struct Entry {
  std::string name;
  std::size_t at;      // in the order of colours
  const Curve* curve;  // nullptr: bars
};

std::vector<Entry> entries_of(const Panel& panel) {
  std::vector<Entry> out;
  std::size_t at = 0;
  for (const Bars& bars : panel.bars) out.push_back({bars.name, at++, nullptr});
  for (const Curve& curve : panel.curves) out.push_back({curve.name, at++, &curve});
  std::erase_if(out, [](const Entry& e) { return e.name.empty(); });
  return out;
}

struct Box {
  double left, top, right, bottom;
};

// The corner that hides the fewest points; of those the top right one first.
Box free_corner(const Plot& plot, const Panel& panel, double width, double height) {
  constexpr double kMargin = 8.0;
  const double right = plot.right - kMargin - width, left = plot.left + kMargin;
  const double top = plot.top + kMargin, bottom = plot.bottom - kMargin - height;
  std::vector<Vector2d> points;
  for (const Curve& curve : panel.curves) {
    for (const std::vector<Vector2d>& piece : pieces_of(plot, curve)) {
      points.insert(points.end(), piece.begin(), piece.end());
    }
  }
  for (const Bars& bars : panel.bars) {
    for (Index i = 0; i < bars.height.size(); ++i) {
      const double middle = 0.5 * (plot.x(bars.edges[i]) + plot.x(bars.edges[i + 1]));
      points.emplace_back(middle, plot.y(bars.height[i]));
    }
  }
  Box best{};
  auto fewest = std::numeric_limits<std::ptrdiff_t>::max();
  for (const auto& [x, y] : {std::pair{right, top}, {left, top}, {right, bottom}, {left, bottom}}) {
    const Box box{x, y, x + width, y + height};
    const auto hidden = std::count_if(points.begin(), points.end(), [&](const Vector2d& p) {
      return p.x() > box.left && p.x() < box.right && p.y() > box.top && p.y() < box.bottom;
    });
    if (hidden < fewest) {
      fewest = hidden;
      best = box;
    }
  }
  return best;
}

void draw_legend(const Plot& plot, const Panel& panel) {
  constexpr double kLine = 16.0, kSample = 30.0, kMargin = 8.0;
  const std::vector<Entry> entries = entries_of(panel);
  if (entries.empty()) return;
  double longest = 0.0;
  for (const Entry& entry : entries) longest = std::max(longest, width_of(entry.name));
  const Box box = free_corner(plot, panel, kSample + 3.0 * kMargin + longest,
                              kLine * static_cast<double>(entries.size()) + kMargin);
  plot.rect(box.left, box.top, box.right, box.bottom, "#FFFFFF", 0.6);
  const double from = box.left + kMargin, to = from + kSample;
  double y = box.top + 0.5 * (kLine + kMargin);
  for (const auto& [name, at, curve] : entries) {
    if (curve == nullptr) {
      plot.rect(from, y - 4.0, to, y + 4.0, colour_of(at), 0.6);
    } else {
      if (has_line(*curve)) {
        draw_line(plot, {{from, y}, {to, y}}, curve->form == Curve::Form::dashed, at);
      }
      if (has_markers(*curve)) {
        draw_marker(plot, 0.5 * (from + to), y, at, panel.map.has_value());
      }
    }
    plot.text(to + kMargin, y + 0.35 * kLetter, "start", name);
    y += kLine;
  }
}

void draw_panel(const Plot& plot, const Panel& panel) {
  plot.add(
      "<clipPath id='panel{}'><rect x='{:g}' y='{:g}' width='{:g}' height='{:g}'/></clipPath>\n"
      "<g clip-path='url(#panel{})'>",
      plot.number, plot.left, plot.top, plot.right - plot.left, plot.bottom - plot.top,
      plot.number);
  if (panel.map) draw_map(plot, *panel.map);
  std::size_t at = 0;
  for (const Bars& bars : panel.bars) draw_bars(plot, bars, at++);
  for (const Curve& curve : panel.curves) {
    draw_curve(plot, curve, at++, panel.map.has_value());
  }
  plot.add("</g>");
  draw_axes(plot, panel);
  draw_legend(plot, panel);
  if (panel.map) draw_colour_bar(plot, *panel.map);
}

}  // namespace

std::string svg(const Figure& figure) {
  if (figure.panels.empty()) throw std::invalid_argument("figure: no panel");
  const double width = kPanelWidth * static_cast<double>(figure.panels.size());
  std::string out = fmt::format(
      "<?xml version='1.0' encoding='UTF-8'?>\n"
      "<svg xmlns='http://www.w3.org/2000/svg' version='1.1' width='{0:g}pt' height='{1:g}pt' "
      "viewBox='0 0 {0:g} {1:g}' font-family='DejaVu Sans, Helvetica, Arial, sans-serif' "
      "font-size='{2:g}'>\n"
      "<rect width='{0:g}' height='{1:g}' fill='#FFFFFF'/>\n"
      "",
      width, kPanelHeight, kLetter);
  for (std::size_t k = 0; k < figure.panels.size(); ++k) {
    draw_panel(Plot(figure.panels[k], k, out), figure.panels[k]);
  }
  return out + "</svg>\n";
}

}  // namespace identikal
