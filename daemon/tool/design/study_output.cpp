#include "daemon/tool/design/study_output.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "daemon/record/hdf5.hpp"
#include "daemon/results/text_line.hpp"
#include "daemon/serve/render.hpp"

namespace vibrig::tool::studies {

using Json = nlohmann::ordered_json;

namespace {

std::string left_text(double seconds) {
    return seconds < 0 ? "not known" : serve::render_duration(seconds);
}

constexpr std::chrono::seconds kLines{60};
constexpr int kBar = 30;
constexpr std::size_t kMostRanges = 20;

std::string point_text(const Json& point) {
    const auto runs = point.at("runs").get<double>() - point.at("failed").get<double>();
    const Json& v = point.at("verdicts");
    const auto share = [&](const char* key) { return 100 * v.at(key).get<double>() / runs; };
    std::string text = grid_text(point) + "\n";
    text += printed(
        "  %.0f campaigns of %.2f h: valid %.1f %%, doubtful %.1f %%, not valid %.1f %%\n", runs,
        number_at(point, "/campaign_h"), share("valid"), share("doubtful"), share("not_valid"));
    for (const char* claim : {"noise", "all"}) {
        const Json& nees = point.at("nees").at(claim);
        if (nees.at("n") == 0) continue;
        text += printed("  NEES, %-15s %6.2f of %.0f (%.2f to %.2f expected, p %.2g)\n",
                        std::string(claim) == "noise" ? "noise alone:" : "all inputs:",
                        number_at(nees, "/mean"), number_at(nees, "/expected"),
                        number_at(nees, "/low"), number_at(nees, "/high"), number_at(nees, "/p"));
    }
    for (const auto& [why, count] : point.at("failures").items())
        text += printed("  failed %ld times: ", count.get<long>()) + why + "\n";
    for (const auto& [code, count] : point.at("reasons").items())
        text += printed("  %ld times: ", count.get<long>()) + code + "\n";
    return text;
}

std::string coefficients_text(const Json& point) {
    std::string text =
        "  coefficient unit        mean error  rms error  claimed u  rms z (95 %)           "
        "within 68/95/99 %\n";
    for (const Json& c : point.at("coefficients")) {
        if (!c.contains("all")) continue;
        text += printed(
            "  %-11s %-10s %11.6f %10.6f %10.6f  %5.3f (%5.3f to %5.3f) %5.1f %5.1f %5.1f\n",
            c.at("name").get<std::string>().c_str(), c.at("unit").get<std::string>().c_str(),
            number_at(c, "/mean_error"), number_at(c, "/rms_error"), number_at(c, "/all/sigma"),
            number_at(c, "/all/rms_z/value"), number_at(c, "/all/rms_z/low"),
            number_at(c, "/all/rms_z/high"), 100 * number_at(c, "/all/coverage/68/value"),
            100 * number_at(c, "/all/coverage/95/value"),
            100 * number_at(c, "/all/coverage/99/value"));
    }
    return text;
}

/// A number of every coefficient at one point, NaN where there is none.
std::vector<double> row_of(const Json& point, const char* pointer) {
    std::vector<double> row;
    for (const Json& c : point.at("coefficients")) row.push_back(number_at(c, pointer));
    return row;
}

}  // namespace

double number_at(const Json& json, const char* pointer) {
    const Json::json_pointer at(pointer);
    return json.contains(at) && json.at(at).is_number() ? json.at(at).get<double>() : std::nan("");
}

std::string csv_number(double value) {
    return std::isfinite(value) ? printed(",%.17g", value) : ",";
}

std::string done_text(const Json& result, const char* what) {
    return line("%s: %ld of %ld %s, %ld failed%s", result.at("study").get<std::string>().c_str(),
                result.at("done").get<long>(), result.at("tasks").get<long>(), what,
                result.at("failed").get<long>(),
                result.at("partial").get<bool>() ? ", PARTIAL" : "");
}

std::string grid_text(const Json& point) {
    std::string text;
    for (const auto& [key, value] : point.at("grid").items())
        text += (text.empty() ? "" : ", ") + key + " = " + value.get<std::string>();
    return text.empty() ? "all runs" : text;
}

std::string result_table(const Json& result) {
    if (result.contains("recordings")) return recordings_table(result);
    if (result.at("kind") == "uncertainty") return propagation_table(result);
    std::string text = done_text(result, "tasks");
    const Json& points = result.at("points");
    for (const Json& point : points) {
        text += point_text(point);
        if (points.size() == 1) text += coefficients_text(point);
    }
    return text;
}

std::string result_csv(const Json& result) {
    if (result.contains("recordings")) return recordings_csv(result);
    if (result.at("kind") == "uncertainty") return propagation_csv(result);
    std::string text =
        "point,grid,runs,failed,coefficient,unit,n,mean_error,rms_error,u,rms_z,rms_z_low,"
        "rms_z_high,within_68,within_95,within_99,u_noise,rms_z_noise,rms_z_noise_low,"
        "rms_z_noise_high,within_68_noise,within_95_noise,within_99_noise\n";
    for (const Json& point : result.at("points")) {
        std::string grid = grid_text(point);
        std::ranges::replace(grid, '"', '\'');
        for (const Json& c : point.at("coefficients")) {
            text += printed("%ld,", point.at("point").get<long>()) + "\"" + grid + "\"," +
                    printed("%ld,%ld,%s,%s,%ld", point.at("runs").get<long>(),
                            point.at("failed").get<long>(), c.at("name").get<std::string>().c_str(),
                            c.at("unit").get<std::string>().c_str(), c.at("n").get<long>());
            for (const char* pointer :
                 {"/mean_error", "/rms_error", "/all/sigma", "/all/rms_z/value", "/all/rms_z/low",
                  "/all/rms_z/high", "/all/coverage/68/value", "/all/coverage/95/value",
                  "/all/coverage/99/value", "/noise/sigma", "/noise/rms_z/value",
                  "/noise/rms_z/low", "/noise/rms_z/high", "/noise/coverage/68/value",
                  "/noise/coverage/95/value", "/noise/coverage/99/value"})
                text += csv_number(number_at(c, pointer));
            text += "\n";
        }
    }
    return text;
}

void write_hdf5(const Json& result, const std::string& path) {
    if (result.contains("recordings")) return write_recordings_hdf5(result, path);
    if (result.at("kind") == "uncertainty") return write_propagation_hdf5(result, path);
    auto file = record::hdf5::File::create(path);
    const auto put = [&](const char* name, const char* pointer, const char* what) {
        std::vector<double> values;
        std::size_t points = 0;
        for (const Json& point : result.at("points")) {
            const auto row = row_of(point, pointer);
            values.insert(values.end(), row.begin(), row.end());
            ++points;
        }
        if (points > 0)
            file.write_numbers(name, values, {points, values.size() / points}, "", what);
    };
    put("mean_error", "/mean_error", "points x coefficients, in the coefficients' units");
    put("rms_error", "/rms_error", "points x coefficients");
    put("u", "/all/sigma", "claimed standard uncertainty, root of the mean square");
    put("u_noise", "/noise/sigma", "the same, of noise alone");
    put("rms_z", "/all/rms_z/value", "rms of error over u");
    put("rms_z_noise", "/noise/rms_z/value", "rms of error over u of noise alone");
    put("within_95", "/all/coverage/95/value", "share of errors within 1.96 u");
    file.write_text("result", result.dump(), "the whole result as JSON");
    file.close();
}

std::string missing_text(const study::MergeFindings& found) {
    std::string text;
    std::uint64_t listed = 0;
    for (std::size_t i = 0; i < std::min(found.missing.size(), kMostRanges); ++i) {
        const auto& [first, last] = found.missing[i];
        text += (text.empty() ? "" : ", ") + std::to_string(first) +
                (last > first ? " to " + std::to_string(last) : "");
        listed += last - first + 1;
    }
    const std::uint64_t more = found.missing_count - listed;
    return more > 0 ? text + " and " + std::to_string(more) + " more" : text;
}

std::string status_text(const study::StudyStatus& s) {
    std::string text =
        printed("%lu of %lu tasks done, %lu failed; %lu parts", s.done, s.tasks, s.failed, s.parts);
    if (s.found.duplicates > 0) text += printed(", %lu tasks done twice", s.found.duplicates);
    text += s.found.missing_count == 0 ? "\n" : "; left: " + left_text(s.left_s) + "\n";
    for (const auto& part : s.running)
        text +=
            printed("running: shard %lu of %lu on %s, process %ld: %lu tasks, written %.0f s ago\n",
                    part.shard.number, part.shard.of, part.host.c_str(), part.pid, part.records,
                    part.age_s);
    for (const auto& line : s.found.damaged) text += "damaged: " + line + "\n";
    for (const auto& line : s.found.foreign) text += "foreign: " + line + "\n";
    for (const auto& line : s.found.contradictions) text += "contradictory: " + line + "\n";
    if (s.found.missing_count > 0 && s.running.empty())
        text += "missing: tasks " + missing_text(s.found) + "\n";
    return text;
}

Json status_json(const study::StudyStatus& s) {
    Json running = Json::array();
    for (const auto& part : s.running)
        running.push_back({{"file", part.file},
                           {"shard", part.shard.number},
                           {"of", part.shard.of},
                           {"host", part.host},
                           {"pid", part.pid},
                           {"tasks", part.records},
                           {"age_s", part.age_s}});
    return {{"tasks", s.tasks},
            {"done", s.done},
            {"failed", s.failed},
            {"missing", s.found.missing_count},
            {"duplicates", s.found.duplicates},
            {"parts", s.parts},
            {"running", running},
            {"damaged", s.found.damaged},
            {"foreign", s.found.foreign},
            {"contradictory", s.found.contradictions},
            {"left_s", s.left_s < 0 ? Json(nullptr) : Json(s.left_s)}};
}

RunDisplay::RunDisplay() : next_(std::chrono::steady_clock::now() + kLines) {}

void RunDisplay::show(const study::RunProgress& p) {
    if (p.all == 0) return;
    const auto share = static_cast<double>(p.done) / static_cast<double>(p.all);
    const std::string words =
        printed("%lu of %lu  %.1f %%  %.3g tasks/s  left: ", p.done, p.all, 100 * share, p.per_s) +
        left_text(p.left_s);
    const auto filled = static_cast<std::size_t>(share * kBar);
    progress_.show("[" + std::string(filled, '#') + std::string(kBar - filled, '.') + "] " + words);
    const auto now = std::chrono::steady_clock::now();
    if (progress_.on_terminal() || now < next_) return;
    next_ = now + kLines;
    std::fprintf(stderr, "%s\n", words.c_str());
}

}  // namespace vibrig::tool::studies
