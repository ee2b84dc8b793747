#include "samples/figurine/report_page.h"

#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "samples/figurine/svg_plot.h"

namespace figurine::samples {

namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kStyle = R"css(
:root { --paper: #fbfbf9; --ink: #1d2125; --soft: #667079; --line: #dcdfe1; --card: #ffffff;
        --accent: #b5432a; --blue: #2b6a99; }
@media (prefers-color-scheme: dark) {
  :root { --paper: #16181b; --ink: #e8e9ea; --soft: #98a1a9; --line: #33383d; --card: #1d2024;
          --accent: #f08a6b; --blue: #7db9e3; }
}
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 1180px; padding: 40px 28px 64px; background: var(--paper);
       color: var(--ink);
       font: 15px/1.55 system-ui, "Segoe UI", "DejaVu Sans", sans-serif; }
h1 { font-size: 26px; font-weight: 650; margin: 0 0 4px; letter-spacing: -0.01em; }
h2 { font-size: 18px; font-weight: 650; margin: 44px 0 6px; }
p { max-width: 78ch; margin: 6px 0 14px; }
.soft, .facts dt { color: var(--soft); }
.facts { display: grid; grid-template-columns: repeat(auto-fit, minmax(190px, 1fr));
         gap: 14px 28px; margin: 22px 0 8px; padding: 16px 20px;
         background: var(--card); border: 1px solid var(--line); border-radius: 8px; }
.facts dt { font-size: 12.5px; }
.facts dd { margin: 0; overflow-wrap: anywhere; font-variant-numeric: tabular-nums; }
.plots { display: grid; grid-template-columns: repeat(auto-fit, minmax(430px, 1fr)); gap: 18px; }
.words { padding: 18px 8px; align-self: center; }
figure { margin: 0; padding: 14px 14px 8px; background: var(--card);
         border: 1px solid var(--line); border-radius: 8px; }
figcaption { font-size: 13px; color: var(--soft); padding: 4px 4px 6px; }
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
table { border-collapse: collapse; width: 100%; margin: 18px 0;
        font-variant-numeric: tabular-nums; }
th { text-align: right; font-weight: 600; font-size: 13px; color: var(--soft);
     border-bottom: 1.5px solid var(--line); padding: 6px 10px; }
td { text-align: right; border-bottom: 1px solid var(--line); padding: 6px 10px; }
th:first-child, td:first-child { text-align: left; }
tr.default td { color: var(--accent); font-weight: 600; }
.pictures { display: grid; grid-template-columns: repeat(auto-fit, minmax(200px, 1fr)); gap: 18px; }
.pictures img { width: 100%; display: block; border-radius: 4px; }
)css";

std::string formatted(const char* pattern, double value) {
  char text[64];
  std::snprintf(text, sizeof(text), pattern, value);
  return text;
}

std::string base64(const std::vector<std::byte>& bytes) {
  constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (size_t i = 0; i < bytes.size(); i += 3) {
    uint32_t group = 0;
    for (size_t k = 0; k < 3; ++k)
      group = group << 8 | (i + k < bytes.size() ? static_cast<uint32_t>(bytes[i + k]) : 0);
    for (size_t k = 0; k < 4; ++k)
      text +=
          k <= std::min<size_t>(3, bytes.size() - i) ? kDigits[group >> (18 - 6 * k) & 63] : '=';
  }
  return text;
}

std::string fact(const std::string& name, const std::string& value) {
  return "<div><dt>" + escape_html(name) + "</dt><dd>" + escape_html(value) + "</dd></div>\n";
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
  std::string html = "<table><tr><th>" + escape_html(dial["name"].get<std::string>()) +
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
  return html + "</table>\n";
}

}  // namespace

std::string report_html(const Json& report, const std::vector<ReportPicture>& pictures) {
  const Json& machine = report["machine"];
  const bool of_sampler = report.contains("sampler");
  const auto text = [](const Json& value) {
    return value.is_string() ? value.get<std::string>() : value.dump();
  };
  std::string html =
      "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" "
      "content=\"width=device-width\">";
  html += "<title>figurine: error against run time</title><style>" + std::string(kStyle) +
          "</style></head><body>\n";
  html += "<h1>Error against run time</h1>\n<p class=\"soft\">What each dial of the " +
          std::string(of_sampler ? "sampler" : "renderer") +
          " costs in quality and saves in time, for one " + (of_sampler ? "package" : "avatar") +
          ".</p>\n";
  html += "<dl class=\"facts\">\n";
  const std::string size = text(report["size"][0]) + " x " + text(report["size"][1]);
  if (of_sampler) {
    html += fact("Sampler", text(report["sampler"])) +
            fact("People", text(report["seeds"]) + " seeds, pictures of " + size);
  } else {
    html += fact("Avatar", text(report["avatar"]));
    html += fact("Motion",
                 report["motion"].is_null() ? "golden pose, swaying" : text(report["motion"]));
    html += fact("Frames", text(report["frames"]) + " of " + size);
  }
  html += fact("CPU", text(machine["cpu"])) +
          fact("Threads", text(machine["threads"]) + " on " + text(machine["cpus"]) + " CPUs");
  html += fact("Arithmetic", text(machine["precision"]) + ", " + text(machine["isa"]) + " kernels");
  html += fact("Made", text(report["date"])) + fact("By", "figurine " + text(report["version"])) +
          "</dl>\n";
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
      html += "<figure><img alt=\"" + escape_html(picture.caption) +
              "\" src=\"data:image/png;base64," + base64(picture.png) + "\"><figcaption>" +
              escape_html(picture.caption) + "</figcaption></figure>\n";
    }
    html += "</div>\n";
  }
  html += "<h2>How the numbers were made</h2>\n<p><b>Reference:</b> " +
          escape_html(text(report["reference"]["meaning"])) + "</p>\n<p><b>Error:</b> " +
          escape_html(text(report["metric"])) + ".</p>\n<p><b>Time:</b> " +
          escape_html(text(report["timing"])) +
          ".</p>\n<p class=\"soft\">The same figures, and all stages, are in report.json beside "
          "this page.</p>\n</body></html>\n";
  return html;
}

}  // namespace figurine::samples
