#pragma once

#include <string>

namespace vibrig::record {

/// [record] of the configuration.
struct Settings {
    bool enabled = true;
    std::string folder;  ///< a folder for each campaign goes here; empty: campaign.results
    bool raw = true;     ///< frames too, as candump logs
    double segment_s = 600;
    int segment_mb = 64;
    bool zstd = true;  ///< closed segments are compressed
    double flush_s = 1;
    int keep_free_mb = 64;  ///< with less on the disk nothing is written
};

}  // namespace vibrig::record
