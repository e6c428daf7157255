#include "daemon/tool/analysis/allan_live.hpp"

#include <chrono>
#include <cmath>
#include <iostream>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

#include "daemon/allan/analysis.hpp"
#include "daemon/allan/column_file.hpp"
#include "daemon/results/text_line.hpp"
#include "proto/durable_file.hpp"
#include "proto/open_end.hpp"
#include "proto/text.hpp"

namespace vibrig::tool {

namespace {

constexpr std::size_t kLongestNumber = 4096;

constexpr std::size_t kLargestWindow = 10'000'000;  // samples; takes 0.3 GB

/// Lines as read_columns() takes those of a file with one column.
class LiveLines {
  public:
    /// Nothing for a comment, a name above the numbers, and blank lines before the first of them.
    std::optional<double> sample(std::string_view line) {
        ++lines_;
        const std::string_view text = proto::trimmed(lines_ == 1 ? without_mark(line) : line);
        if (is_comment(text) || (text.empty() && samples_ == 0)) return {};
        const bool first = !std::exchange(begun_, true);
        if (first && is_name(text) && text.find_first_of(",; \t") == std::string_view::npos)
            return {};
        double value = 0;
        if (text.size() > kLongestNumber || !read_sample(text, value) ||
            std::abs(value) > kLargestValue) {
            throw std::runtime_error("standard input:" + std::to_string(lines_) + ": found '" +
                                     proto::printable(text.substr(0, 60)) +
                                     "', expected a number up to 1e60");
        }
        ++samples_;
        return value;
    }

    [[nodiscard]] std::size_t lines() const { return lines_; }
    [[nodiscard]] std::size_t samples() const { return samples_; }

  private:
    std::size_t lines_ = 0;
    std::size_t samples_ = 0;
    bool begun_ = false;
};

std::string live_text(const allan::WindowRow& row, const std::vector<allan::Alarm>& alarms) {
    std::string out = printed("%12.6g s  mean ", row.centre_s) +
                      (std::isnan(row.mean) ? printed("%13s", "-") : printed("%13.6g", row.mean)) +
                      " deg/h";
    if (row.refused) return out + "  refused: samples are missing, or nothing varies";
    for (std::size_t j = 0; j < allan::kTerms; ++j) {
        const allan::FittedTerm& term = row.fit.terms[j];
        if (term.detected) out += printed("  %s %.3g", allan::kTermNames[j], term.value);
    }
    if (row.fit.slow.found && !row.fit.slow.determined) out += "  " + row.fit.verdict();
    for (const allan::Alarm& alarm : alarms) {
        out += "\n" + alarm_text(alarm);
    }
    return out;
}

constexpr std::size_t kShownWindows = 400;
constexpr std::chrono::seconds kPagePeriod{2};

/// What a browser shows while the windows come; complete at any moment it is read.
void write_page(const std::string& path, const AllanAnalysis& shown) {
    proto::write_output(path,
                        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\">"
                        "<meta http-equiv=\"refresh\" content=\"2\"><title>Allan, live</title>" +
                            surface_chart(shown).svg() + traces_chart(shown).svg() + "</html>\n");
}

void check_live(const AllanRequest& request, const std::string& page) {
    if (!page.empty() && !page.ends_with(".html")) {
        throw std::runtime_error("--plot: found " + page +
                                 ", expected with --live a name that ends in .html");
    }
    if (!(request.tau0 > 0) || !(request.window_s > 0) || request.phase || request.file != "-" ||
        !request.column.empty() || !request.time.empty()) {
        throw std::runtime_error(
            "--live: expected rates, one a line, on standard input (FILE -), with --tau0 and "
            "--dynamic");
    }
    // A file has as many samples as it has; here a window that never ends would wait for ever.
    if (request.window_s / request.tau0 > static_cast<double>(kLargestWindow)) {
        throw std::runtime_error(printed(
            "--dynamic: found %g s, %.3g samples of --tau0 %g s; expected at most %zu "
            "samples with --live",
            request.window_s, request.window_s / request.tau0, request.tau0, kLargestWindow));
    }
}

}  // namespace

bool allan_live(const AllanRequest& request, bool json, const std::string& page) {
    check_live(request, page);
    const allan::DynamicSettings settings = dynamic_settings(request);
    allan::DynamicAllan dynamic(settings);
    allan::StationarityMonitor monitor({request.alpha, 5}, dynamic);
    if (request.reference) monitor.set_reference(*request.reference);
    const double to_deg_h = to_deg_per_hour(request.unit, false);
    AllanAnalysis shown;
    shown.request = request;
    shown.request.file = "standard input";
    shown.to_deg_h = to_deg_h;
    shown.factors = dynamic.factors();
    // A place that cannot be written is found now, not when the first window is full.
    if (!page.empty()) proto::OutputFile{page};
    bool alarmed = false, written = true;
    auto next_page = std::chrono::steady_clock::now();
    LiveLines read;
    for (std::string line; std::getline(std::cin, line);) {
        const auto sample = read.sample(line);
        if (!sample) continue;
        if (std::cin.eof()) proto::tell_open_end("-:" + std::to_string(read.lines()), line);
        if (!dynamic.add(*sample * to_deg_h)) continue;
        const allan::WindowRow row = dynamic.row();
        const auto alarms = monitor.check(row);
        alarmed = alarmed || row.refused || !alarms.empty();
        std::cout << (json ? allan_window_json(row, alarms, dynamic, to_deg_h)
                           : live_text(row, alarms))
                  << std::endl;
        if (!std::cout) throw std::runtime_error("standard output: cannot be written");
        if (page.empty()) continue;
        if (shown.windows.size() == kShownWindows) shown.windows.erase(shown.windows.begin());
        shown.windows.push_back({row, alarms});
        written = false;
        // As often as the browser looks: a stream from a file is faster than that.
        if (std::chrono::steady_clock::now() < next_page) continue;
        write_page(page, shown);
        written = true;
        next_page = std::chrono::steady_clock::now() + kPagePeriod;
    }
    if (!written) write_page(page, shown);
    if (read.samples() < settings.window) {
        throw std::runtime_error("--live: " + std::to_string(read.samples()) +
                                 " samples came, a window of --dynamic needs " +
                                 std::to_string(settings.window));
    }
    return alarmed;
}

}  // namespace vibrig::tool
