#pragma once

#include <memory>
#include <string>

#include "daemon/study/campaigns.hpp"
#include "daemon/study/parts.hpp"
#include "daemon/study/study.hpp"
#include "daemon/study/worker.hpp"

namespace vibrig::study {

/// A planned study: a folder with study.json, the study's file and parts.
struct Folder {
    std::string path;
    Study study;
    Sequences sequences;
    Effective configuration;  ///< of a study of campaigns, as planned
    StudyId id{};
    std::string id_text;  ///< hexadecimal
    std::string version, compiler, instruction_set, arithmetic;

    [[nodiscard]] std::string parts() const { return path + "/parts"; }
    [[nodiscard]] std::uint64_t tasks() const { return study.tasks(); }
};

/// Makes the folder. `instruction_set`: "baseline", "auto" or a name. Throws StudyError.
Folder plan_study(const std::string& file, const std::string& folder,
                  const std::string& instruction_set);

/// Whether a file of this name in a study's folder is what was planned.
[[nodiscard]] bool is_of_plan(const std::string& name);

/// Throws StudyError when it is none, or its files are not those that were planned.
[[nodiscard]] Folder open_study(const std::string& folder);

/// Takes the planned instruction set into use. Throws StudyError when this program or machine would
/// not compute what the plan's would, to the last bit.
void prepare_to_run(const Folder& folder);

/// Who does its tasks; one thread each.
[[nodiscard]] std::unique_ptr<Worker> worker_of(const Folder& folder);

}  // namespace vibrig::study
