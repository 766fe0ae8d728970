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
  std::vector<double> x, y;
};

std::string attribute(const std::string& element, const std::string& name) {
  const std::size_t at = element.find(" " + name + "=\"");
  if (at == std::string::npos) return "";
  const std::size_t from = at + name.size() + 3;
  return element.substr(from, element.find('"', from) - from);
}

// Every <polyline> of the figure; y upwards.
std::vector<Line> polylines(const std::string& text) {
  std::vector<Line> out;
  for (std::size_t at = 0; (at = text.find("<polyline", at)) != std::string::npos; ++at) {
    const std::string element = text.substr(at, text.find("/>", at) - at);
    Line line;
    line.colour = attribute(element, "stroke");
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
  EXPECT_NEAR(lines[0].y[0], 55.0, 0.1);
  EXPECT_NEAR(lines[0].y[1], 55.0 + 305.0 / 4.0, 0.1);
  EXPECT_NEAR(lines[0].y[2], 360.0, 0.1);
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
  EXPECT_NE(text.find("width=\"1000pt\""), std::string::npos);
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
