// A small scatter plot as inline SVG, styled by the page's CSS variables.
#pragma once

#include <string>
#include <vector>

namespace figurine::samples {

struct PlotPoint {
  double x = 0, y = 0;
  std::string label;
  bool emphasised = false;  // the default setting
};

struct PlotAxis {
  std::string title;
  bool logarithmic = false;
};

struct PlotLine {  // straight in the plot's own coordinates (a power law on two logarithmic axes)
  PlotPoint from, to;
  std::string label;
};

struct Plot {
  PlotAxis x, y;
  std::vector<PlotPoint> points;  // connected in this order; points that are not finite, or not
                                  // positive on a logarithmic axis, are left out
  std::vector<PlotLine> lines;
};

std::string svg_plot(const Plot& plot);

}  // namespace figurine::samples
