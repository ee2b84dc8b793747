#include "samples/figurine/svg_plot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "samples/common/html_page.h"

namespace figurine::samples {

namespace {

constexpr double kWidth = 560, kHeight = 380, kLeft = 66, kRight = 22, kTop = 18, kBottom = 50;

// One axis: data to picture, and its ticks.
class Scale {
 public:
  Scale(const PlotAxis& axis, std::vector<double> values, double from, double to)
      : logarithmic_(axis.logarithmic), from_(from), to_(to) {
    for (double& value : values) value = logarithmic_ ? std::log10(value) : value;
    low_ = values.empty() ? 0 : *std::min_element(values.begin(), values.end());
    high_ = values.empty() ? 1 : *std::max_element(values.begin(), values.end());
    const double room =
        std::max(0.08 * (high_ - low_), logarithmic_ ? 0.1 : 1e-3 * std::max(1.0, std::abs(high_)));
    low_ -= room;
    high_ += room;
  }

  double at(double value) const {
    return from_ +
           ((logarithmic_ ? std::log10(value) : value) - low_) / (high_ - low_) * (to_ - from_);
  }

  // About five round values.
  std::vector<double> ticks() const {
    std::vector<double> result;
    if (logarithmic_) {
      // Decades alone over a wide range, more digits the narrower it is.
      const double range = high_ - low_;
      const std::vector<double> digits = range > 2.5   ? std::vector<double>{1}
                                         : range > 1.2 ? std::vector<double>{1, 2, 5}
                                                       : std::vector<double>{1, 1.5, 2, 3, 4, 6, 8};
      for (double decade = std::floor(low_); decade <= high_; ++decade) {
        for (const double digit : digits) {
          const double value = decade + std::log10(digit);
          if (value >= low_ && value <= high_) result.push_back(std::pow(10, value));
        }
      }
      return result;
    }
    const double rough = (high_ - low_) / 5, power = std::pow(10, std::floor(std::log10(rough)));
    const double lead = rough / power, step = power * (lead < 1.5   ? 1
                                                       : lead < 3.5 ? 2
                                                       : lead < 7.5 ? 5
                                                                    : 10);
    for (double value = std::ceil(low_ / step) * step; value <= high_; value += step)
      result.push_back(std::abs(value) < 1e-9 * step ? 0 : value);
    return result;
  }

 private:
  bool logarithmic_;
  double from_, to_, low_, high_;
};

std::string number(double value) {
  char text[32];
  const double size = std::abs(value);
  if (size >= 1e6) {
    std::snprintf(text, sizeof(text), "%.3gM", value * 1e-6);
  } else if (size >= 1e4) {
    std::snprintf(text, sizeof(text), "%.4gk", value * 1e-3);
  } else if (size != 0 && size < 1e-3) {
    std::snprintf(text, sizeof(text), "%.0e", value);
  } else {
    std::snprintf(text, sizeof(text), "%.4g", value);
  }
  return text;
}

template <class... Values>
std::string format(const char* pattern, Values... values) {
  std::array<char, 512> text;
  std::snprintf(text.data(), text.size(), pattern, values...);
  return text.data();
}

}  // namespace

std::string svg_plot(const Plot& plot) {
  const auto drawable = [](const PlotAxis& axis, double value) {
    return std::isfinite(value) && (!axis.logarithmic || value > 0);
  };
  std::vector<PlotPoint> points;
  std::vector<double> xs, ys;
  for (const PlotPoint& point : plot.points) {
    if (!drawable(plot.x, point.x) || !drawable(plot.y, point.y)) continue;
    points.push_back(point);
    xs.push_back(point.x);
    ys.push_back(point.y);
  }
  const Scale x(plot.x, xs, kLeft, kWidth - kRight), y(plot.y, ys, kHeight - kBottom, kTop);

  std::string svg =
      format("<svg viewBox=\"0 0 %.0f %.0f\" role=\"img\" aria-label=\"", kWidth, kHeight) +
      escape_html(plot.y.title) + " over " + escape_html(plot.x.title) + "\">\n";
  for (const double tick : x.ticks()) {
    svg += format("<line class=\"grid\" x1=\"%.1f\" y1=\"%.1f\" x2=\"%.1f\" y2=\"%.1f\"/>",
                  x.at(tick), kTop, x.at(tick), kHeight - kBottom);
    svg += format("<text class=\"tick\" x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\">%s</text>\n",
                  x.at(tick), kHeight - kBottom + 17, number(tick).c_str());
  }
  for (const double tick : y.ticks()) {
    svg += format("<line class=\"grid\" x1=\"%.1f\" y1=\"%.1f\" x2=\"%.1f\" y2=\"%.1f\"/>", kLeft,
                  y.at(tick), kWidth - kRight, y.at(tick));
    svg += format("<text class=\"tick\" x=\"%.1f\" y=\"%.1f\" text-anchor=\"end\">%s</text>\n",
                  kLeft - 8, y.at(tick) + 4, number(tick).c_str());
  }
  svg += format("<text class=\"axis\" x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\">",
                0.5 * (kLeft + kWidth - kRight), kHeight - 10) +
         escape_html(plot.x.title) + "</text>\n";
  svg += format(
             "<text class=\"axis\" transform=\"translate(16 %.1f) rotate(-90)\" "
             "text-anchor=\"middle\">",
             0.5 * (kTop + kHeight - kBottom)) +
         escape_html(plot.y.title) + "</text>\n";

  for (const PlotLine& line : plot.lines) {
    if (!drawable(plot.x, line.from.x) || !drawable(plot.x, line.to.x) ||
        !drawable(plot.y, line.from.y) || !drawable(plot.y, line.to.y))
      continue;
    svg += format("<line class=\"theory\" x1=\"%.1f\" y1=\"%.1f\" x2=\"%.1f\" y2=\"%.1f\"/>",
                  x.at(line.from.x), y.at(line.from.y), x.at(line.to.x), y.at(line.to.y));
    svg += format("<text class=\"note\" x=\"%.1f\" y=\"%.1f\" text-anchor=\"end\">",
                  x.at(line.to.x) - 6, y.at(line.to.y) - 8) +
           escape_html(line.label) + "</text>\n";
  }
  std::string path;
  for (const PlotPoint& point : points)
    path += format("%s%.1f %.1f", path.empty() ? "M" : "L", x.at(point.x), y.at(point.y));
  if (points.size() > 1) svg += "<path class=\"curve\" d=\"" + path + "\"/>\n";
  for (const PlotPoint& point : points) {
    const double px = x.at(point.x), py = y.at(point.y);
    const bool left = px > kWidth - kRight - 70;  // labels stay inside
    svg += format("<circle class=\"%s\" cx=\"%.1f\" cy=\"%.1f\" r=\"%.1f\"/>",
                  point.emphasised ? "default" : "point", px, py, point.emphasised ? 6.5 : 4.5);
    svg += format("<text class=\"%s\" x=\"%.1f\" y=\"%.1f\" text-anchor=\"%s\">",
                  point.emphasised ? "label strong" : "label", px + (left ? -9 : 9),
                  py + (left ? -8 : 14), left ? "end" : "start") +
           escape_html(point.label) + "</text>\n";
  }
  return svg + "</svg>\n";
}

}  // namespace figurine::samples
