#pragma once

#include <CLI/App.hpp>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "daemon/archive/deliver.hpp"
#include "daemon/archive/index.hpp"

namespace vibrig::tool {

/// Which archive is meant.
struct ArchiveOptions {
    std::string archive, index, config, rig;
};

/// --archive, --index and --config.
void add_archive_options(CLI::App& command, ArchiveOptions& options);
/// --at-hz: of which vibration quadratic coefficients are compared.
void add_at_hz(CLI::App& command, std::optional<double>& at_hz);

struct Whereabouts {
    archive::Place place;
    std::string rig;         ///< of --rig or the configuration; else this machine's name
    std::string recordings;  ///< of the configuration; empty: not known
    bool named = false;      ///< somebody said which: not just what is here
};
/// Throws std::runtime_error with what was found and expected.
[[nodiscard]] Whereabouts whereabouts_of(const ArchiveOptions& options);
/// Index for whoever asks. What a rig's recorder noted in a folder of recordings, and nobody read
/// the result of so far, is read first.
[[nodiscard]] std::unique_ptr<archive::Index> open_index(const ArchiveOptions& options);

/// Time of "2026-03-01" or "2026-03-01T08:00:00Z", UTC. Throws std::runtime_error.
[[nodiscard]] std::int64_t utc_of(const std::string& option, const std::string& text);
/// "2026-03-01 08:00"
[[nodiscard]] std::string minute_text(std::int64_t utc_ns);

}  // namespace vibrig::tool
