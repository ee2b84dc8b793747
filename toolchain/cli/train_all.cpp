#include "toolchain/cli/train_all.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <vector>

#include "ports/host/files.h"
#include "ports/host/process.h"
#include "toolchain/error.h"
#include "toolchain/train/csv.h"
#include "toolchain/train/progress.h"
#include "toolchain/train/slots.h"

namespace figurine::cli {

namespace {

namespace fs = std::filesystem;

struct Row {
  std::string identity, status = "waiting", reason;
  uint64_t iterations = 0;
  double seconds = 0, psnr_db = 0;
};

std::vector<Row> find_identities(const std::string& data) {
  std::vector<Row> rows;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(data, error)) {
    if (entry.is_directory() && fs::exists(entry.path() / "images_lr"))
      rows.push_back({.identity = entry.path().filename().string()});
  }
  if (error) throw InputError(data + ": " + error.message());
  if (rows.empty()) throw InputError(data + ": holds no identity (a folder with images_lr in it)");
  std::sort(rows.begin(), rows.end(),
            [](const Row& a, const Row& b) { return a.identity < b.identity; });
  return rows;
}

void save_table(const std::string& path, const std::vector<Row>& rows) {
  std::string text = "identity,status,iterations,seconds,psnr_db,reason\n";
  for (const Row& row : rows) {
    char numbers[96];
    std::snprintf(numbers, sizeof(numbers), ",%llu,%.1f,%.2f,",
                  static_cast<unsigned long long>(row.iterations), row.seconds, row.psnr_db);
    text += train::csv_quoted(row.identity) + "," + row.status + numbers +
            (row.reason.empty() ? "" : train::csv_quoted(row.reason)) + "\n";
  }
  throw_if_error(ports::write_file_atomically(
                     path, {reinterpret_cast<const std::byte*>(text.data()), text.size()}),
                 "cannot save");
}

void take_result(const train::JobResult& result, Row& row) {
  row.status = result.done ? "finished" : result.interrupted ? "interrupted" : "failed";
  if (!result.done) {
    row.reason = result.text;
    return;
  }
  const nlohmann::json json = nlohmann::json::parse(result.text);
  row.iterations = json.at("iterations"), row.seconds = json.at("seconds"),
  row.psnr_db = json.at("psnr_db");
}

}  // namespace

void train_all(const TrainAllOptions& options,
               const std::function<train::TrainRequest(const std::string&)>& request_of) {
  std::vector<Row> rows = find_identities(options.data);
  std::error_code error;
  fs::create_directories(options.runs, error);
  if (error) throw InputError(options.runs + ": cannot be created: " + error.message());
  const std::string table = options.runs + "/runs.csv";
  save_table(table, rows);
  train::Progress progress(fs::path(options.data).filename().string(), options.quiet);
  size_t ended = 0, failed = 0;
  const auto job = [&](size_t i) {
    train::TrainRequest request = request_of(rows[i].identity);
    request.quiet = true;
    const train::TrainResult result = train::train_avatar(request);
    // What a finished run was found with is in its run.json; means of the last iterations are not
    // known then.
    const double psnr_db = result.was_finished
                               ? train::read_json(train::RunDirectory{request.run}.run_json())
                                     .at("running")
                                     .at("psnr_db")
                                     .get<double>()
                               : result.psnr_db;
    return nlohmann::json{{"iterations", result.state.iteration},
                          {"seconds", result.state.seconds},
                          {"psnr_db", psnr_db}}
        .dump();
  };
  const auto on_end = [&](size_t i, const train::JobResult& result) {
    take_result(result, rows[i]);
    ++ended;
    failed += rows[i].status == "failed";
    if (rows[i].status == "failed") {
      std::fprintf(stderr, "figurine-train: %s: %s\n", rows[i].identity.c_str(),
                   rows[i].reason.c_str());
    } else if (result.done) {
      progress.say(rows[i].identity + ": training PSNR " +
                   std::to_string(rows[i].psnr_db).substr(0, 5) + " dB after " +
                   train::format_duration(rows[i].seconds));
    }
    try {
      save_table(table, rows);
    } catch (const InputError&) {
      // The disk is full just now. Others may still finish; the last writing below says so if it
      // still is.
    }
  };
  const auto on_wait = [&] {
    progress.show(static_cast<double>(ended) / static_cast<double>(rows.size()),
                  std::to_string(ended) + " of " + std::to_string(rows.size()) + " identities, " +
                      std::to_string(failed) + " failed");
  };
  train::run_in_slots(rows.size(), {.slots = options.slots}, job, on_end, on_wait);
  save_table(table, rows);
  if (!options.quiet)
    ports::sayf("%s: %zu of %zu identities trained, table in %s", options.runs.c_str(),
                rows.size() - failed, rows.size(), table.c_str());
  if (failed > 0)
    throw InputError(options.runs + ": " + std::to_string(failed) + " of " +
                     std::to_string(rows.size()) + " identities failed, see " + table);
}

}  // namespace figurine::cli
