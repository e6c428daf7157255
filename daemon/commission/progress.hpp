#pragma once

#include <cstdint>
#include <string>

#include "daemon/commission/procedure.hpp"

namespace vibrig::commission {

/// What a procedure has done, on disk (commission.folder, progress.json).
class Progress {
  public:
    /// `rig`: what it is measured with; another one's progress does not count.
    Progress(const std::string& folder, Json rig);

    /// Throws std::runtime_error that names the file.
    void write(const std::string& by, bool by_hand, const Json& log, std::int64_t utc_ns) const;
    /// 24 h old at most, of the same person, way and rig.
    [[nodiscard]] Kept read(const std::string& by, bool by_hand, std::int64_t utc_ns) const;
    void remove() const;
    /// The keys found, beside it: found.toml. Throws as write().
    void write_found(const std::string& toml) const;

  private:
    std::string path_;
    Json rig_;
};

}  // namespace vibrig::commission
