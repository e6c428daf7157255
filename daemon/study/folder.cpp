#include "daemon/study/folder.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "daemon/record/digest.hpp"
#include "daemon/study/propagation.hpp"
#include "daemon/study/recordings.hpp"
#include "estimator/filter/instruction_set.hpp"
#include "proto/json_file.hpp"
#include "proto/text.hpp"

namespace vibrig::study {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

namespace {

constexpr int kFormat = 1;
constexpr std::size_t kLargestFile = 1 << 20;
constexpr std::size_t kLargestPlan = 256 << 20;
constexpr const char* kStudyFile = "STUDY.toml";
constexpr const char* kPlanFile = "study.json";

std::string read_text(const std::string& path, std::size_t at_most) {
    try {
        return proto::read_whole_file(path, at_most);
    } catch (const std::exception& error) {
        throw StudyError(path + ": " + error.what());
    }
}

[[noreturn]] void cannot(const std::string& path, const char* what) {
    const std::string why = std::strerror(errno);
    throw StudyError(path + ": cannot be " + what + ": " + why);
}

void write_text(const std::string& path, const std::string& text) {
    const std::string temporary = path + ".tmp";
    const int file = ::open(temporary.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
    if (file < 0) cannot(temporary, "written");
    std::string_view rest = text;
    while (!rest.empty()) {
        const auto written = ::write(file, rest.data(), rest.size());
        if (written < 0) cannot(temporary, "written");
        rest.remove_prefix(static_cast<std::size_t>(written));
    }
    if (fsync(file) != 0 || ::close(file) != 0) cannot(temporary, "brought to the disk");
    if (std::rename(temporary.c_str(), path.c_str()) != 0) cannot(path, "written");
}

std::string use_set(const std::string& name) {
    try {
        estimator::use_instruction_set(
            name == "baseline" ? std::string(estimator::instruction_sets().front()) : name);
    } catch (const estimator::SettingsError& error) {
        throw StudyError(error.what());
    }
    return std::string(estimator::instruction_set());
}

Json json_of(const std::vector<Recording>& recordings) {
    Json list = Json::array();
    for (const Recording& recording : recordings) {
        Json files = Json::array();
        for (const Recording::File& file : recording.files)
            files.push_back({{"file", file.path}, {"sha256", file.sha256}, {"bytes", file.bytes}});
        list.push_back({{"folder", recording.folder}, {"files", files}});
    }
    return list;
}

std::vector<Recording> recordings_of(const Json& list) {
    std::vector<Recording> recordings;
    for (const Json& one : list) {
        Recording recording{one.at("folder"), {}};
        for (const Json& file : one.at("files"))
            recording.files.push_back({file.at("file"), file.at("sha256"), file.at("bytes")});
        recordings.push_back(std::move(recording));
    }
    return recordings;
}

/// What of a plan STUDY.toml alone says.
Json stated_by(const Study& study) {
    return {{"name", study.name}, {"kind", study.kind},       {"seed", study.seed},
            {"runs", study.runs}, {"points", study.points()}, {"tasks", study.tasks()}};
}

Json grid_of(const Study& study) {
    Json grid = Json::array();
    for (const Axis& axis : study.grid)
        grid.push_back({{"key", axis.key}, {"values", axis.values}});
    return grid;
}

Json plan_json(const Study& study, const std::string& text, const Sequences& sequences,
               const std::string& instruction_set) {
    Json plan;
    plan["format"] = kFormat;
    plan.update(stated_by(study));
    plan["version"] = VIBRIG_VERSION;
    plan["compiler"] = estimator::compiler();
    plan["instruction_set"] = instruction_set;
    plan["arithmetic"] = arithmetic();
    plan["inputs"] =
        Json::array({{{"file", kStudyFile}, {"sha256", record::sha256_of_text(text)}}});
    if (study.kind != "campaigns") {
        plan["recordings"] = json_of(study.recordings);
        return plan;
    }
    plan["grid"] = grid_of(study);
    plan["sequences"] = sequences;
    for (const auto& [key, value] : configuration_of(study, kStudyFile))
        plan["configuration"][key] = value;
    return plan;
}

constexpr const char* kAsWritten = ", as `vibrig study plan` writes it";

Json read_plan(const std::string& text, const std::string& file) {
    Json plan;
    try {
        plan = proto::parse_json<Json>(text, file,
                                       "not JSON, expected what `vibrig study plan` writes");
    } catch (const std::runtime_error& error) {
        throw StudyError(error.what());
    }
    const Json format = plan.is_object() ? plan.value("format", Json()) : Json();
    if (format != kFormat)
        throw StudyError(file + ": format: found " + format.dump() + ", expected " +
                         std::to_string(kFormat));
    return plan;
}

std::string text_at(const Json& plan, const char* key, const std::string& file) {
    const Json found = plan.value(key, Json());
    if (!found.is_string())
        throw StudyError(file + ": " + key + ": found " + found.dump().substr(0, 40) +
                         ", expected a text" + kAsWritten);
    return found;
}

/// One that was changed or damaged would be another study's, and every part of this a stranger's.
void check_plan(const Json& plan, const Folder& folder, const std::string& file) {
    Json stated = stated_by(folder.study);
    if (folder.study.kind == "campaigns") stated["grid"] = grid_of(folder.study);
    for (const auto& [key, expected] : stated.items()) {
        if (const Json found = plan.value(key, Json()); found != expected)
            throw StudyError(file + ": " + key + ": found " + found.dump().substr(0, 40) +
                             ", expected " + expected.dump().substr(0, 40) + ", as " + kStudyFile +
                             " has it");
    }
}

}  // namespace

Folder plan_study(const std::string& file, const std::string& folder,
                  const std::string& instruction_set) {
    const std::string text = read_text(file, kLargestFile);
    Study study = parse_study(text, file);
    Sequences sequences;
    if (study.kind == "recordings") {
        study.recordings = find_recordings(study, file);
        study.runs = study.recordings.size();
    } else if (study.kind == "uncertainty") {
        study.recordings = {find_recording(study, file)};
    } else {
        sequences = check_campaigns(study, file);
    }
    const std::string set = use_set(instruction_set);
    if (::mkdir(folder.c_str(), 0755) != 0) {
        if (errno == EEXIST)
            throw StudyError(folder + ": is there already" +
                             (fs::exists(folder + "/" + kPlanFile)
                                  ? ""
                                  : std::string(", without ") + kPlanFile) +
                             ", expected a name that is not");
        cannot(folder, "made");
    }
    try {
        if (::mkdir((folder + "/parts").c_str(), 0755) != 0) cannot(folder + "/parts", "made");
        write_text(folder + "/" + kStudyFile, text);
        write_text(folder + "/" + kPlanFile, plan_json(study, text, sequences, set).dump(1) + "\n");
    } catch (const std::exception&) {
        std::error_code ignored;
        fs::remove_all(folder, ignored);
        throw;
    }
    return open_study(folder);
}

bool is_of_plan(const std::string& name) { return name == kPlanFile || name == kStudyFile; }

Folder open_study(const std::string& path) {
    Folder out;
    out.path = path;
    if (!fs::exists(path + "/" + kPlanFile))
        throw StudyError(path + ": no " + kPlanFile +
                         " in it, expected a folder that `vibrig study "
                         "plan STUDY.toml -o " +
                         path + "` made");
    const std::string plan_path = path + "/" + kPlanFile;
    const std::string text = read_text(plan_path, kLargestPlan);
    const Json plan = read_plan(text, plan_path);
    out.version = text_at(plan, "version", plan_path);
    out.compiler = text_at(plan, "compiler", plan_path);
    out.instruction_set = text_at(plan, "instruction_set", plan_path);
    out.arithmetic = text_at(plan, "arithmetic", plan_path);
    const bool campaigns = text_at(plan, "kind", plan_path) == "campaigns";
    std::string digest, key = "inputs";
    std::vector<Recording> recordings;
    try {
        digest = plan.at("inputs").at(0).at("sha256");
        key = campaigns ? "sequences" : "recordings";
        if (campaigns) out.sequences = plan.at(key).get<Sequences>();
        if (!campaigns) recordings = recordings_of(plan.at(key));
        key = "configuration";
        if (campaigns)
            for (const auto& [name, value] : plan.at(key).items())
                out.configuration.emplace_back(name, value);
    } catch (const Json::exception&) {
        throw StudyError(plan_path + ": " + key + ": found " +
                         (plan.contains(key) ? plan[key].dump().substr(0, 40) : "nothing") +
                         ", expected it" + kAsWritten);
    }
    const std::string study_path = path + "/" + kStudyFile;
    const std::string study_text = read_text(study_path, kLargestFile);
    if (const std::string found = record::sha256_of_text(study_text); found != digest)
        throw StudyError(study_path + ": changed since it was planned: SHA-256 " +
                         found.substr(0, 16) + "..., planned " + digest.substr(0, 16) +
                         "...; a changed study is planned anew, in another folder");
    out.study = parse_study(study_text, study_path);
    if (out.study.kind == "recordings") out.study.runs = recordings.size();
    out.study.recordings = std::move(recordings);
    check_plan(plan, out, plan_path);
    out.id_text = record::sha256_of_text(text);
    out.id = id_of(out.id_text);
    return out;
}

namespace {

/// Defaults may have changed under a study, and a plan by a hand.
void check_configuration(const Folder& folder) {
    const Effective here = configuration_of(folder.study, folder.path + "/" + kStudyFile);
    const Effective& planned = folder.configuration;
    const auto [found, expected] =
        std::mismatch(planned.begin(), planned.end(), here.begin(), here.end());
    const auto words = [](auto at, auto end) {
        return at == end ? std::string("nothing") : at->first + " " + at->second;
    };
    if (found != planned.end() || expected != here.end())
        throw StudyError(folder.path + "/" + kPlanFile + ": configuration: found " +
                         words(found, planned.end()) + ", expected " + words(expected, here.end()) +
                         ", as " + kStudyFile + " gives it here: plan it anew");
}

}  // namespace

void prepare_to_run(const Folder& folder) {
    const auto differs = [&](const char* what, const std::string& planned,
                             const std::string& here) {
        if (planned != here)
            throw StudyError(folder.path + ": planned with " + what + " " + planned + ", this is " +
                             here + ": results would differ in their last bits; plan it anew");
    };
    differs("version", folder.version, VIBRIG_VERSION);
    differs("compiler", folder.compiler, std::string(estimator::compiler()));
    use_set(folder.instruction_set);
    differs("arithmetic", folder.arithmetic, arithmetic());
    if (folder.study.kind == "campaigns") check_configuration(folder);
    check_recordings(folder.study);
}

std::unique_ptr<Worker> worker_of(const Folder& folder) {
    if (folder.study.kind == "recordings") return std::make_unique<RecordingWorker>(folder.study);
    if (folder.study.kind == "uncertainty")
        return std::make_unique<PropagationWorker>(folder.study);
    return std::make_unique<CampaignWorker>(folder.study, folder.sequences);
}

}  // namespace vibrig::study
