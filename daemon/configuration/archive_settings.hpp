#pragma once

#include <string>

namespace vibrig::configuration {

/// [archive]: where campaigns go when they are over.
struct ArchiveSettings {
    std::string folder;        ///< a mounted file system; empty: nothing is archived
    std::string index;         ///< "postgresql://..."; empty: SQLite in the folder
    std::string rig;           ///< this rig's name there; empty: the machine's
    double retry_max_s = 600;  ///< longest wait before a delivery is tried again
    int keep_mb = 0;           ///< delivered recordings beyond it are removed here; 0: none is
};

}  // namespace vibrig::configuration
