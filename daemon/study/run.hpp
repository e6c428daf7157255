#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "daemon/study/folder.hpp"
#include "daemon/study/worker.hpp"

namespace vibrig::study {

/// How far a run is; of its shard.
struct RunProgress {
    std::uint64_t done = 0, all = 0;  ///< with those of earlier runs
    double per_s = 0;                 ///< since the run began
    double left_s = 0;                ///< at that rate; negative: not known yet
};

struct RunOptions {
    unsigned threads = 1;
    Shard shard;
    double chunk_s = 10;  ///< between two writes
    std::function<void(const RunProgress&)> progress = {};
    std::function<void(const std::string&)> tell = {};     ///< what a person should know
    const std::atomic<bool>* stop = nullptr;               ///< set: what is done is stored, and out
    std::function<std::unique_ptr<Worker>()> worker = {};  ///< in place of the study's own
};

struct RunReport {
    std::uint64_t all = 0, before = 0, now = 0, failed = 0;
    std::string first_failure;
    [[nodiscard]] bool complete() const { return before + now == all; }
};

/// Does what is not done of a shard. Throws StudyError when results cannot be stored, or memory or
/// threads do not suffice; what was done before is stored.
RunReport run_study(const Folder& folder, const RunOptions& options);

/// From now on SIGINT and SIGTERM set it, for RunOptions::stop; a file that may not grow is a disk
/// that is full.
[[nodiscard]] const std::atomic<bool>& stop_on_signals();

}  // namespace vibrig::study
