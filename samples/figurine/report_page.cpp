#include "samples/figurine/report_page.h"

#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "samples/common/html_page.h"
#include "samples/figurine/svg_plot.h"

namespace figurine::samples {

namespace {

using Json = nlohmann::ordered_json;

// Beside the pages' own.
constexpr const char* kStyle = R"css(
.plots { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(430px, 100%), 1fr));
         gap: 18px; }
.words { padding: 18px 8px; align-self: center; }
svg { width: 100%; height: auto; display: block; font-family: inherit; }
svg .grid { stroke: var(--line); stroke-width: 1; }
svg .tick { fill: var(--soft); font-size: 12px; } svg .axis { fill: var(--ink); font-size: 13px; }
svg .curve { fill: none; stroke: var(--blue); stroke-width: 1.6; opacity: 0.55; }
svg .point { fill: var(--blue); }
svg .default { fill: var(--accent); stroke: var(--card); stroke-width: 1.5; }
svg .label { fill: var(--ink); font-size: 12px; }
svg .strong { fill: var(--accent); font-weight: 650; }
svg .theory { stroke: var(--soft); stroke-width: 1.3; stroke-dasharray: 5 4; }
svg .note { fill: var(--soft); font-size: 12px; }
tr.default td { color: var(--accent); font-weight: 600; }
)css";

std::string formatted(const char* pattern, double value) {
  char text[64];
  std::snprintf(text, sizeof(text), pattern, value);
  return text;
}

std::string capitalised(std::string text) {
  if (!text.empty() && text[0] >= 'a' && text[0] <= 'z')
    text[0] = static_cast<char>(text[0] - 'a' + 'A');
  return text;
}

std::string cell(const std::string& text) { return "<td>" + text + "</td>"; }

// A dial of the renderer counts the blends of frames, one of a sampler the evaluations of its
// denoiser.
bool blends_are_counted(const Json& dial) { return dial["settings"][0]["work"].contains("blends"); }

std::string plots_of(const Json& dial) {
  const bool has_order = !dial["theoretical_order"].is_null();
  std::string stages;
  for (const Json& stage : dial["stages"])
    stages += (stages.empty() ? "" : ", ") + stage.get<std::string>();
  Plot time{.x = {"median time of " + stages + ", ms"}, .y = {"PSNR to the reference, dB"}};
  const bool of_frames = blends_are_counted(dial);
  Plot work{.x = {of_frames ? "blends a frame" : "multiply-accumulates", true},
            .y = {"PSNR to the reference, dB"}};
  Plot order{.x = {dial["name"].get<std::string>(), true}, .y = {"rms error", true}};
  for (const Json& setting : dial["settings"]) {
    if (setting["psnr_db"].is_null())
      continue;  // no error at all has no place on a scale of decibels
    const std::string label = setting["label"];
    const bool is_default = setting["default"];
    const double psnr = setting["psnr_db"];
    time.points.push_back({setting["cost_ms"]["median"], psnr, label, is_default});
    work.points.push_back(
        {setting["work"][of_frames ? "blends" : "macs"], psnr, label, is_default});
    order.points.push_back({setting["value"], setting["rmse"], label, is_default});
    if (is_default && has_order && dial["theoretical_order"].get<double>() > 0) {
      const double p = dial["theoretical_order"], v = setting["value"], e = setting["rmse"];
      order.lines.push_back({{v / 8, e / std::pow(8, p), "", false},
                             {v * 8, e * std::pow(8, p), "", false},
                             "order " + formatted("%g", p)});
    }
  }
  const auto figure = [](const Plot& plot, const std::string& caption) {
    return "<figure>" + svg_plot(plot) + "<figcaption>" + escape_html(caption) +
           "</figcaption></figure>\n";
  };
  const std::string theory = escape_html(dial["theory"].get<std::string>());
  // Two settings without an order between them are told by the table.
  if (!has_order && time.points.size() < 2) return "<p class=\"words\">" + theory + "</p>\n";
  const std::string over_time =
      figure(time,
             "Error over the time of the stages that the dial touches: up and to the left is "
             "better. Times move with the machine's mood.");
  if (!has_order)
    return "<div class=\"plots\">\n" + over_time + "<p class=\"words\">" + theory + "</p></div>\n";
  return "<div class=\"plots\">\n" + over_time +
         figure(work, std::string("Error over work: ") + (of_frames ? "blends" : "operations") +
                          " do not depend on the machine.") +
         figure(order,
                "Convergence: the slope is the observed order; dashed, the theoretical one through "
                "the default.") +
         "<div class=\"words\"><p><b>In theory.</b> " + theory + " Order " +
         formatted("%g", dial["theoretical_order"]) + ".</p><p><b>Observed.</b> " +
         (dial["observed_order"].is_null()
              ? "No error to speak of."
              : "Order " + formatted("%.2f", dial["observed_order"]) + ", over " +
                    escape_html(dial["observed_over"].get<std::string>()) + ".") +
         "</p></div>" + "</div>\n";
}

std::string table_of(const Json& dial) {
  const bool of_frames = blends_are_counted(dial);
  std::string html = "<div class=\"wide\"><table><tr><th>" +
                     escape_html(dial["name"].get<std::string>()) +
                     "</th><th>PSNR, dB</th><th>rms error</th><th>largest</th><th>observed "
                     "order</th><th>its stages, ms</th><th>p90, ms</th>" +
                     (of_frames ? "<th>whole frame, ms</th><th>blends</th><th>pairs</th>" : "") +
                     "<th>GMAC</th></tr>\n";
  for (const Json& setting : dial["settings"]) {
    const Json& work = setting["work"];
    html += setting["default"].get<bool>() ? "<tr class=\"default\">" : "<tr>";
    html += cell(escape_html(setting["label"].get<std::string>()) +
                 (setting["default"].get<bool>() ? " (default)" : ""));
    html += cell(setting["psnr_db"].is_null() ? "equal" : formatted("%.2f", setting["psnr_db"]));
    html += cell(formatted("%.2e", setting["rmse"])) + cell(formatted("%.2e", setting["largest"]));
    html += cell(
        setting["observed_order"].is_null() ? "" : formatted("%.2f", setting["observed_order"]));
    const Json& cost = setting["cost_ms"];
    html += cell(formatted("%.2f", cost["median"])) + cell(formatted("%.2f", cost["p90"]));
    if (of_frames) {
      html += cell(formatted("%.2f", setting["stages_ms"]["total"]["median"]));
      html += cell(formatted("%.0f", work["blends"])) + cell(formatted("%.0f", work["pairs"]));
    }
    html += cell(formatted("%.3f", work["macs"].get<double>() * 1e-9));
    html += "</tr>\n";
  }
  return html + "</table></div>\n";
}

}  // namespace

std::string report_html(const Json& report, const std::vector<ReportPicture>& pictures) {
  const Json& machine = report["machine"];
  const bool of_sampler = report.contains("sampler");
  const auto text = [](const Json& value) {
    return value.is_string() ? value.get<std::string>() : value.dump();
  };
  std::string html = "<h1>Error against run time</h1>\n<p class=\"soft\">What each dial of the " +
                     std::string(of_sampler ? "sampler" : "renderer") +
                     " costs in quality and saves in time, for one " +
                     (of_sampler ? "package" : "avatar") + ".</p>\n";
  html += "<dl class=\"facts\">\n";
  const std::string size = text(report["size"][0]) + " x " + text(report["size"][1]);
  if (of_sampler) {
    html += html_fact("Sampler", text(report["sampler"])) +
            html_fact("People", text(report["seeds"]) + " seeds, pictures of " + size);
  } else {
    html += html_fact("Avatar", text(report["avatar"]));
    html += html_fact("Motion",
                      report["motion"].is_null() ? "golden pose, swaying" : text(report["motion"]));
    html += html_fact("Frames", text(report["frames"]) + " of " + size);
  }
  html += html_fact("CPU", text(machine["cpu"])) +
          html_fact("Threads", text(machine["threads"]) + " on " + text(machine["cpus"]) + " CPUs");
  html += html_fact("Arithmetic",
                    text(machine["precision"]) + ", " + text(machine["isa"]) + " kernels");
  html += html_fact("Made", text(report["date"])) +
          html_fact("By", "figurine " + text(report["version"])) + "</dl>\n";
  for (const Json& dial : report["dials"]) {
    html += "<h2>" + escape_html(capitalised(text(dial["name"]))) + "</h2>\n<p>" +
            escape_html(capitalised(text(dial["meaning"]))) + ".</p>\n";
    html += plots_of(dial) + table_of(dial);
  }
  if (!pictures.empty()) {
    html += "<h2>Where the error is</h2>\n<p>" +
            std::string(of_sampler ? "One person, as it becomes one."
                                   : "The middle frame. Differences are shown around mid-grey.") +
            "</p>\n<div class=\"pictures\">\n";
    for (const ReportPicture& picture : pictures) {
      html += html_figure(picture.png, picture.caption);
    }
    html += "</div>\n";
  }
  html += "<h2>How the numbers were made</h2>\n<p><b>Reference:</b> " +
          escape_html(text(report["reference"]["meaning"])) + "</p>\n<p><b>Error:</b> " +
          escape_html(text(report["metric"])) + ".</p>\n<p><b>Time:</b> " +
          escape_html(text(report["timing"])) +
          ".</p>\n<p class=\"soft\">The same figures, and all stages, are in report.json beside "
          "this page.</p>\n";
  return html_page("figurine: error against run time", html, kStyle);
}

}  // namespace figurine::samples
