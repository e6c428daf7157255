#pragma once

#include <chrono>
#include <filesystem>
#include <optional>
#include <string>

#include "daemon/domain/events.hpp"

namespace vibrig {

/// result.json and result-partial.json in [campaign] results: of the campaign that runs or was the
/// last, never of one before it. Files that cannot be written or moved raise an alarm.
class ResultFiles {
  public:
    /// `folder` empty: nothing is written.
    ResultFiles(std::string folder, EventSink event);

    /// A campaign begins or goes on: what stands there keeps its place in time, as
    /// result-20260301T080000Z.json, by when it was written (UTC). Nothing is written over.
    void begin();
    /// At once or not at all. A partial result never takes the place of a complete one.
    void write(const std::string& text, bool complete);
    /// What a disk did not take: once a second, until it does or the next campaign begins.
    void try_again(std::chrono::steady_clock::time_point now = std::chrono::steady_clock::now());

  private:
    using Steady = std::chrono::steady_clock;
    struct Waiting {
        std::string text;
        bool complete;
        Steady::time_point tried;
    };
    [[nodiscard]] std::string put(const std::string& text, bool complete) const;
    [[nodiscard]] std::filesystem::path path_of(bool complete) const;
    void put_aside(const std::filesystem::path& path);

    std::filesystem::path folder_;
    EventSink event_;
    std::optional<Waiting> waiting_;
};

}  // namespace vibrig
