#pragma once

#include <CLI/App.hpp>
#include <memory>

#include "daemon/tool/recordings/archive_place.hpp"

namespace vibrig::tool {

/// vibrig archive serve: the archive for a browser.
void add_archive_serve(CLI::App& group, const std::shared_ptr<ArchiveOptions>& where,
                       int& exit_code);

}  // namespace vibrig::tool
