// Do curves, bars and maps lie where the axes say, and is a figure always the same?
#include "studies/figure.h"

#include <cmath>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::Vector2d;
using Eigen::VectorXd;

struct Line {
  std::string colour;
  bool dashed = false;
  std::vector<double> x, y;
};

std::string attribute(const std::string& element, const std::string& name) {
  const std::size_t at = element.find(" " + name + "='");
  if (at == std::string::npos) return "";
  const std::size_t from = at + name.size() + 3;
  return element.substr(from, element.find('\'', from) - from);
}

// Every element of that name, without what stands inside.
std::vector<std::string> elements(const std::string& text, const std::string& name) {
  std::vector<std::string> out;
  for (std::size_t at = 0; (at = text.find("<" + name + " ", at)) != std::string::npos; ++at) {
    out.push_back(text.substr(at, text.find('>', at) - at));
  }
  return out;
}

double number(const std::string& element, const std::string& name) {
  return std::stod(attribute(element, name));
}

// The words of every <text>, and where they stand.
struct Words {
  std::string text;
  double x, y;
};
std::vector<Words> words(const std::string& svg_text) {
  std::vector<Words> out;
  for (std::size_t at = 0; (at = svg_text.find("<text x=", at)) != std::string::npos; ++at) {
    const std::size_t begin = svg_text.find('>', at), end = svg_text.find('<', begin);
    const std::string element = svg_text.substr(at, begin - at);
    out.push_back(
        {svg_text.substr(begin + 1, end - begin - 1), number(element, "x"), number(element, "y")});
  }
  return out;
}

std::vector<Line> polylines(const std::string& text) {
  std::vector<Line> out;
  for (const std::string& element : elements(text, "polyline")) {
    Line line;
    line.colour = attribute(element, "stroke");
    line.dashed = !attribute(element, "stroke-dasharray").empty();
    std::string points = attribute(element, "points");
    for (char& c : points) c = c == ',' ? ' ' : c;
    std::istringstream in(points);
    for (double x, y; in >> x >> y;) line.x.push_back(x), line.y.push_back(y);
    out.push_back(line);
  }
  return out;
}

std::vector<Line> of_colour(const std::string& text, const std::string& colour) {
  std::vector<Line> out;
  for (const Line& line : polylines(text)) {
    if (line.colour == colour) out.push_back(line);
  }
  return out;
}

Panel empty_panel() {
  Panel panel;
  panel.title = "title";
  panel.x = {"x", 1.0, 1000.0, true};
  panel.y = {"y", 0.0, 4.0, false};
  return panel;
}

const char* const kFirst = "#0072B2";

TEST(Figure, CurvesLieWhereTheAxesSay) {
  Panel panel = empty_panel();
  const double gap = std::nan("");
  panel.curves = {{"", (VectorXd(5) << 1.0, 10.0, 100.0, gap, 500.0).finished(),
                   (VectorXd(5) << 0.0, 1.0, 4.0, 1.0, 2.0).finished(), Curve::Form::solid}};
  const std::string text = svg({{panel}});
  const std::vector<Line> lines = of_colour(text, kFirst);
  ASSERT_EQ(lines.size(), 1U);  // a point alone is no line
  ASSERT_EQ(lines[0].x.size(), 3U);
  // The panel is 500 x 400 points, its axes 70 from the left, 20 from the right, 55 from below, 40
  // from above.
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(lines[0].x[i], 70.0 + 410.0 * static_cast<double>(i) / 3.0, 0.1);
  }
  EXPECT_NEAR(lines[0].y[0], 345.0, 0.1);
  EXPECT_NEAR(lines[0].y[1], 345.0 - 305.0 / 4.0, 0.1);
  EXPECT_NEAR(lines[0].y[2], 40.0, 0.1);
}

TEST(Figure, LabelsStandAtTheirValues) {
  Panel panel = empty_panel();
  panel.title = "1 < 2 & \"so\"";
  std::vector<std::string> at_x, at_y;
  for (const Words& label : words(svg({{panel}}))) {
    if (label.text.rfind("10", 0) == 0) {
      EXPECT_NEAR(label.x, 70.0 + 410.0 * static_cast<double>(at_x.size()) / 3.0, 0.1);
      EXPECT_GT(label.y, 345.0);
      at_x.push_back(label.text);
    } else if (label.text.size() == 3 && label.text[1] == '.') {
      EXPECT_NEAR(label.y, 345.0 - 305.0 * std::stod(label.text) / 4.0 + 4.0, 1.0);
      EXPECT_LT(label.x, 70.0);
      at_y.push_back(label.text);
    }
  }
  EXPECT_EQ(at_x, (std::vector<std::string>{"10⁰", "10¹", "10²", "10³"}));
  EXPECT_EQ(at_y.size(), 9U);
  EXPECT_NE(svg({{panel}}).find(">1 &lt; 2 &amp; \"so\"</text>"), std::string::npos);
}

TEST(Figure, BarsReachFromEdgeToEdge) {
  Panel panel = empty_panel();
  panel.bars = {{"", Eigen::Vector3d(1.0, 10.0, 100.0), Vector2d(3.0, -1.0)}};
  std::vector<std::string> bars;
  for (const std::string& rect : elements(svg({{panel}}), "rect")) {
    if (attribute(rect, "fill") == kFirst) bars.push_back(rect);
  }
  ASSERT_EQ(bars.size(), 1U);  // nothing stands below the axis
  EXPECT_NEAR(number(bars[0], "x"), 70.0, 0.1);
  EXPECT_NEAR(number(bars[0], "width"), 410.0 / 3.0, 0.1);
  EXPECT_NEAR(number(bars[0], "y"), 345.0 - 305.0 * 0.75, 0.1);
  EXPECT_NEAR(number(bars[0], "height"), 305.0 * 0.75, 0.1);
}

TEST(Figure, MarkersAreDrawnInsideTheAxesAlone) {
  Panel panel = empty_panel();
  const VectorXd x = (VectorXd(4) << 0.5, 10.0, 100.0, 2000.0).finished();
  panel.curves = {{"", x, VectorXd::Constant(4, 2.0), Curve::Form::marked},
                  {"", x, VectorXd::Constant(4, 1.0), Curve::Form::points},
                  {"", x, VectorXd::Constant(4, 3.0), Curve::Form::dashed}};
  const std::string text = svg({{panel}});
  const std::vector<std::string> circles = elements(text, "circle");
  ASSERT_EQ(circles.size(), 2U);
  EXPECT_NEAR(number(circles[0], "cx"), 70.0 + 410.0 / 3.0, 0.1);
  EXPECT_NEAR(number(circles[0], "cy"), 345.0 - 305.0 * 0.5, 0.1);
  EXPECT_EQ(elements(text, "polygon").size(), 2U);
  const std::vector<Line> lines = polylines(text);
  ASSERT_EQ(lines.size(), 2U);  // points are not joined
  EXPECT_FALSE(lines[0].dashed);
  EXPECT_TRUE(lines[1].dashed);
}

TEST(Figure, TheLegendHidesFewPoints) {
  Panel panel = empty_panel();
  panel.curves = {{"falls", Vector2d(1.0, 1000.0), Vector2d(4.0, 0.0), Curve::Form::solid}};
  const auto legend_of = [&] {
    for (const Words& label : words(svg({{panel}}))) {
      if (label.text == "falls") return label;
    }
    return Words{"", 0.0, 0.0};
  };
  EXPECT_GT(legend_of().x, 300.0);
  EXPECT_LT(legend_of().y, 100.0);
  // Points at the top right and, fewer, at the top left.
  panel.curves.push_back(
      {"", VectorXd::Constant(9, 800.0), VectorXd::Constant(9, 3.8), Curve::Form::points});
  panel.curves.push_back({"", Vector2d(1.5, 2.0), Vector2d(3.8, 3.8), Curve::Form::points});
  EXPECT_GT(legend_of().x, 300.0);
  EXPECT_GT(legend_of().y, 300.0);
}

TEST(Figure, MapsAreShadedDarkerLevelByLevel) {
  Panel panel = empty_panel();
  panel.x = {"x", 0.0, 1.0, false};
  panel.y = {"y", 0.0, 1.0, false};
  // The value is x: its levels are upright.
  panel.map = Map{"level", Vector2d(0.0, 1.0), Vector2d(0.0, 1.0), {}, {0.0, 0.25, 0.75}};
  panel.map->value = (Eigen::MatrixXd(2, 2) << 0.0, 0.0, 1.0, 1.0).finished();
  std::vector<std::string> fills, paths;
  for (const std::string& path : elements(svg({{panel}}), "path")) {
    fills.push_back(attribute(path, "fill"));
    paths.push_back(attribute(path, "d"));
  }
  // White, dark, above the last level white again; then the lines.
  EXPECT_EQ(fills, (std::vector<std::string>{"#FFFFFF", "#08306B", "#FFFFFF", "none"}));
  // 0.25 and 0.75 of the 325 points between 70 and 395.
  EXPECT_NE(paths[3].find("M151.25 "), std::string::npos) << paths[3];
  EXPECT_NE(paths[3].find("L313.75 "), std::string::npos) << paths[3];
}

TEST(Figure, BarsMapsAndSeveralPanelsAreTheSameEveryTime) {
  Panel bars = empty_panel();
  bars.bars = {{"count", Eigen::Vector3d(1.0, 10.0, 100.0), Vector2d(3.0, 2.0)}};
  bars.curves = {{"of # samples", Vector2d(1.0, 100.0), Vector2d(1.0, 2.0), Curve::Form::marked},
                 {"none", Vector2d(-1.0, 0.0), Vector2d(1.0, 2.0), Curve::Form::points}};
  Panel map = empty_panel();
  map.y.low = 1.0;
  Map shaded{"level", Eigen::Vector3d(1.0, 31.62, 1000.0), Vector2d(1.0, 4.0), {}, {0.0, 1.0, 2.0}};
  shaded.value = (Eigen::MatrixXd(3, 2) << 0.0, 0.5, 1.0, 1.5, 1.8, 1.9).finished();
  map.map = shaded;
  const Figure figure{{bars, map}};
  const std::string text = svg(figure);
  EXPECT_EQ(text, svg(figure));
  EXPECT_EQ(text.rfind("<?xml", 0), 0U);
  EXPECT_NE(text.find("width='1000pt'"), std::string::npos);
  EXPECT_EQ(text.find("nan"), std::string::npos);
  EXPECT_NE(text.find("</svg>"), std::string::npos);
}

TEST(Figure, SizesThatDisagree) {
  EXPECT_THROW(svg({}), std::invalid_argument);
  Panel panel = empty_panel();
  panel.curves = {{"", Vector2d(1.0, 2.0), VectorXd::Ones(3), Curve::Form::solid}};
  EXPECT_THROW(svg({{panel}}), std::invalid_argument);
  panel = empty_panel();
  panel.bars = {{"", Vector2d(1.0, 2.0), Vector2d(1.0, 2.0)}};
  EXPECT_THROW(svg({{panel}}), std::invalid_argument);
  panel = empty_panel();
  panel.x.low = 0.0;  // logarithmic
  EXPECT_THROW(svg({{panel}}), std::invalid_argument);
  panel = empty_panel();
  panel.map = Map{"", Vector2d(1, 2), Vector2d(1, 2), Eigen::MatrixXd::Zero(2, 3), {0, 1}};
  EXPECT_THROW(svg({{panel}}), std::invalid_argument);
  // Nothing is left behind by a figure that failed.
  EXPECT_NE(svg({{empty_panel()}}).find("</svg>"), std::string::npos);
}

}  // namespace
}  // namespace identikal
