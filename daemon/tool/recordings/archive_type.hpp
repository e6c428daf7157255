#pragma once

#include <memory>

#include "daemon/tool/recordings/archive_place.hpp"

namespace vibrig::tool {

/// `vibrig archive type`.
void add_archive_type(CLI::App& group, const std::shared_ptr<ArchiveOptions>& where,
                      int& exit_code);

}  // namespace vibrig::tool
