#pragma once

#include <chrono>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "daemon/results/progress.hpp"
#include "daemon/study/run.hpp"
#include "daemon/study/status.hpp"

namespace vibrig::tool::studies {

/// What `vibrig study` prints and writes.
[[nodiscard]] std::string result_table(const nlohmann::ordered_json& result);
/// One row for each coefficient of each point.
[[nodiscard]] std::string result_csv(const nlohmann::ordered_json& result);
void write_hdf5(const nlohmann::ordered_json& result, const std::string& path);
/// SVG files, of every kind of study; what is left out, or empty. Where nothing can be drawn there
/// is no folder, either. Throws std::runtime_error.
[[nodiscard]] std::string write_charts(const nlohmann::ordered_json& result,
                                       const std::string& folder);

// The same, of recordings that were identified anew.
[[nodiscard]] std::string recordings_table(const nlohmann::ordered_json& result);
/// One row for each coefficient of each recording.
[[nodiscard]] std::string recordings_csv(const nlohmann::ordered_json& result);
void write_recordings_hdf5(const nlohmann::ordered_json& result, const std::string& path);
// And of the proof of a budget.
[[nodiscard]] std::string propagation_table(const nlohmann::ordered_json& result);
[[nodiscard]] std::string propagation_csv(const nlohmann::ordered_json& result);
void write_propagation_hdf5(const nlohmann::ordered_json& result, const std::string& path);

/// NaN if there is none.
[[nodiscard]] double number_at(const nlohmann::ordered_json& json, const char* pointer);
/// With a comma before it; NaN leaves the field empty.
[[nodiscard]] std::string csv_number(double value);
/// The first line of a table: how much is done of `what`.
[[nodiscard]] std::string done_text(const nlohmann::ordered_json& result, const char* what);
/// A point's place in the grid: "campaign.table_g = [9, 7], ...", or "all runs".
[[nodiscard]] std::string grid_text(const nlohmann::ordered_json& point);

[[nodiscard]] std::string status_text(const study::StudyStatus& status);
[[nodiscard]] nlohmann::ordered_json status_json(const study::StudyStatus& status);

/// Tasks: "0 to 4, 7, 9 to 12 and 3 more"
[[nodiscard]] std::string missing_text(const study::MergeFindings& found);

/// How far a run is: a bar on a terminal, else a line now and then; on standard error.
class RunDisplay {
  public:
    RunDisplay();
    void show(const study::RunProgress& progress);

  private:
    Progress progress_;
    std::chrono::steady_clock::time_point next_;
};

}  // namespace vibrig::tool::studies
