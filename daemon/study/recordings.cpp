#include "daemon/study/recordings.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "daemon/record/campaign_file.hpp"
#include "daemon/record/digest.hpp"
#include "daemon/record/replay.hpp"
#include "daemon/record/shaken.hpp"
#include "daemon/results/spectrum_result.hpp"
#include "daemon/study/campaign_record.hpp"
#include "daemon/study/campaigns.hpp"
#include "daemon/study/identified_recording.hpp"
#include "estimator/commissioning/contradiction.hpp"
#include "estimator/filter/parameters.hpp"
#include "estimator/uncertainty/assessment.hpp"
#include "estimator/uncertainty/verdict.hpp"
#include "proto/json_number.hpp"
#include "proto/json_text.hpp"

namespace vibrig::study {

namespace fs = std::filesystem;
namespace uncertainty = estimator::uncertainty;
using Json = nlohmann::ordered_json;

namespace {

constexpr char kRecording = 'R';

// The HDF5 library is one thread's at a time.
std::mutex reading;

std::string serial_of(const std::string& settings, const std::string& path) {
    return configuration::parse(settings, path, false).configuration.paperwork.unit_serial;
}

bool selected(const Selection& select, const std::string& first_file) {
    if (select.serial.empty() && select.since_utc_ns == Selection{}.since_utc_ns) return true;
    try {
        const record::Head head = record::read_part_head(first_file).head;
        return head.utc_ns >= select.since_utc_ns &&
               (select.serial.empty() ||
                serial_of(record::identification_sections(head.configuration), first_file) ==
                    select.serial);
    } catch (const std::exception&) {
        return true;  // its task says why
    }
}

Recording recording_in(const fs::path& folder) {
    Recording out;
    out.folder = folder.string();
    for (const auto& [number, path] : record::part_files(out.folder))
        out.files.push_back({path, record::sha256_of_file(path), fs::file_size(path)});
    return out;
}

/// What is compared of a result: one list each.
struct ResultLists {
    Json value = Json::array(), u = Json::array(), expanded = Json::array();

    [[nodiscard]] Json json(const Json& verdict) const {
        return {{"verdict", verdict}, {"value", value}, {"u", u}, {"expanded", expanded}};
    }
};

Json new_result(const estimator::Result& result, const uncertainty::Assessment& assessed) {
    ResultLists lists;
    for (std::size_t i = 0; i < estimator::kParameters; ++i) {
        const auto& c = assessed.coefficients[i];
        const bool known = assessed.done && result.observable[i];
        lists.value.push_back(known ? proto::number_or_null(c.value) : Json());
        lists.u.push_back(known ? proto::number_or_null(c.u) : Json());
        lists.expanded.push_back(known ? proto::number_or_null(c.expanded) : Json());
    }
    return lists.json(uncertainty::word_of(assessed.verdict.level));
}

/// Of the recording; null: it has none.
Json old_result(const std::string& text) {
    const Json result = Json::parse(text, nullptr, false);
    if (!result.is_object() || !result.contains("parameters")) return nullptr;
    std::map<std::string, Json> by_name;
    for (const Json& one : result["parameters"]) {
        if (one.is_object() && one.contains("name") && one["name"].is_string())
            by_name[one["name"].get<std::string>()] = one;
    }
    ResultLists lists;
    for (const std::string_view name : estimator::parameter_names()) {
        const Json& one = by_name[std::string(name)];
        const auto entry = [&](const char* key) {
            return one.is_object() && one.contains(key) && one[key].is_number() ? one[key] : Json();
        };
        lists.value.push_back(entry("value"));
        lists.u.push_back(entry("u"));
        lists.expanded.push_back(entry("expanded"));
    }
    return lists.json(result.value("/verdict/word"_json_pointer, Json()));
}

void check_unchanged(const Recording& recording) {
    for (const Recording::File& file : recording.files) {
        if (record::sha256_of_file(file.path) != file.sha256)
            throw StudyError(file.path +
                             ": changed since it was planned; a study of what it is now is "
                             "planned anew, in another folder");
    }
}

std::string identified(const Recording& recording, const std::vector<Setting>& settings) {
    const IdentifiedRecording found = identify_recording(recording, settings);
    const Json out{{"name", found.name},
                   {"serial", found.serial},
                   {"state", found.state},
                   {"simulated", found.simulated},
                   {"samples", found.replayed.samples},
                   {"old", old_result(found.old_result)},
                   {"new", new_result(found.replayed.result, found.assessed)}};
    return kRecording + proto::json_text(out);
}

}  // namespace

std::vector<Recording> find_recordings(const Study& study, const std::string& file) {
    static_cast<void>(load_settings(study.configuration, file));
    std::set<fs::path> found;
    for (const std::string& name : study.folders) {
        std::error_code error;
        const fs::path top = fs::canonical(fs::path(file).parent_path() / name, error);
        if (error || !fs::is_directory(top))
            throw StudyError(file + ": study.folders: found " + name + ": " +
                             (error ? error.message() : "no folder") + ", expected a folder");
        const auto look = [&](const fs::path& path) {
            if (path.filename() == record::part_name(1)) found.insert(path.parent_path());
        };
        fs::recursive_directory_iterator at(top, error), end;
        for (; !error && at != end; at.increment(error)) look(at->path());
        if (error) throw StudyError(top.string() + ": cannot be searched: " + error.message());
    }
    std::vector<Recording> out;
    for (const fs::path& folder : found) {
        if (!selected(study.select, (folder / record::part_name(1)).string())) continue;
        try {
            out.push_back(recording_in(folder));
        } catch (const std::exception& error) {
            throw StudyError(folder.string() + ": " + error.what());
        }
    }
    if (out.empty())
        throw StudyError(file + ": study.folders: found " + std::to_string(found.size()) +
                         " recorded campaigns, none of them selected, expected one at least");
    return out;
}

Recording find_recording(const Study& study, const std::string& file) {
    static_cast<void>(load_settings(study.configuration, file));
    const fs::path at = fs::path(file).parent_path() / study.recording;
    try {
        return recording_in(fs::canonical(record::folder_of(record::campaign_path(at.string()))));
    } catch (const std::exception& error) {
        throw StudyError(file + ": study.recording: " + error.what());
    }
}

IdentifiedRecording identify_recording(const Recording& recording,
                                       const std::vector<Setting>& settings) {
    check_unchanged(recording);
    record::Campaign campaign;
    {
        const std::scoped_lock lock(reading);
        campaign = record::read_campaign(recording.folder);
    }
    const std::string text = settings_of_recording(campaign.head.configuration, settings);
    const auto loaded = configuration::parse(text, recording.folder, false).configuration;
    if (!settings.empty()) record::forget_noise(campaign);
    campaign.estimates.clear();  // nobody asks whether it is as recorded
    IdentifiedRecording out{campaign.head.campaign,
                            loaded.paperwork.unit_serial,
                            campaign.state,
                            campaign.result_json,
                            loaded.estimator,
                            record::replay(campaign, loaded.estimator, {}),
                            {},
                            campaign.head.simulated};
    out.assessed = tool::assess(out.settings, out.replayed.found, out.replayed.result,
                                out.replayed.rows, record::shaken_of(campaign, loaded))
                       .assessed;
    // As whoever else looks at it says: replay, identify, report, compensate and certificate.
    uncertainty::contradict(out.assessed.verdict,
                            estimator::commissioning::first_contradiction(
                                out.settings, out.replayed.result.dwells, out.replayed.means));
    out.settings = dwells::Anew::settings_of(out.settings, out.replayed.found);
    return out;
}

void check_recordings(const Study& study) {
    std::size_t missing = 0;
    std::string first;
    for (const Recording& recording : study.recordings) {
        for (const Recording::File& file : recording.files) {
            std::error_code error;
            const auto bytes = fs::file_size(file.path, error);
            if (!error && bytes == file.bytes) continue;
            if (missing++ == 0)
                first = file.path + ": " +
                        (error ? error.message() + ": has it moved?"
                               : "found " + std::to_string(bytes) + " bytes, expected " +
                                     std::to_string(file.bytes) + " as planned");
        }
    }
    if (missing > 0)
        throw StudyError(first + (missing > 1 ? " (and " + std::to_string(missing - 1) +
                                                    " more files are not as planned)"
                                              : ""));
}

std::string settings_of_recording(const std::string& configuration,
                                  const std::vector<Setting>& settings) {
    std::istringstream lines(record::identification_sections(configuration));
    std::string kept;
    for (std::string line; std::getline(lines, line);) {
        const std::string key = line.substr(0, line.find_first_of(" ="));
        const auto same = [&](const Setting& one) { return one.key == key; };
        if (std::ranges::none_of(settings, same)) kept += line + "\n";
    }
    return kept + configuration_text(settings);
}

std::string RecordingWorker::run(std::uint64_t index) {
    const Recording& recording = study_.recordings.at(index);
    return record_of([&] { return identified(recording, study_.configuration); });
}

struct RecordingSums::One {
    double rank = 0;  ///< the largest E_n; of what has failed the largest of all
    Json json;
};

RecordingSums::RecordingSums() = default;
RecordingSums::~RecordingSums() = default;

void RecordingSums::add(const Recording& recording, const std::string& bytes) {
    One one;
    one.json = {{"recording", recording.folder}};
    if (bytes.empty() || bytes[0] != kRecording) {
        one.rank = std::numeric_limits<double>::infinity();
        one.json["failed"] = decode(bytes).failed;
        all_.push_back(std::move(one));
        return;
    }
    const Json record = Json::parse(bytes.substr(1));
    const Json &before = record["old"], &now = record["new"];
    Json in_sigma = Json::array(), e_n = Json::array();
    std::size_t worst = estimator::kParameters;
    for (std::size_t i = 0; i < estimator::kParameters; ++i) {
        const auto entry = [&](const Json& of, const char* key) {
            return of.is_object() ? proto::number_or_nan(of[key][i]) : std::nan("");
        };
        const double difference = entry(now, "value") - entry(before, "value");
        const double e = difference / std::hypot(entry(now, "expanded"), entry(before, "expanded"));
        in_sigma.push_back(proto::number_or_null(difference / entry(before, "u")));
        e_n.push_back(proto::number_or_null(e));
        if (std::isfinite(e) && (worst == estimator::kParameters || std::abs(e) > one.rank)) {
            one.rank = std::abs(e);
            worst = i;
        }
    }
    const bool compared = worst < estimator::kParameters;
    one.json.update(record);
    one.json["difference_sigma"] = in_sigma;
    one.json["e_n"] = e_n;
    one.json["largest_e_n"] = compared ? Json(one.rank) : Json();
    one.json["coefficient"] = compared ? Json(estimator::parameter_names()[worst]) : Json();
    all_.push_back(std::move(one));
}

Json RecordingSums::take() {
    std::ranges::stable_sort(all_, std::ranges::greater(), &One::rank);
    Json list = Json::array();
    for (One& one : all_) list.push_back(std::move(one.json));
    all_.clear();
    return list;
}

}  // namespace vibrig::study
