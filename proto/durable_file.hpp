#pragma once

#include <string>
#include <string_view>

namespace vibrig::proto {

/// The whole file, on disk before it takes the old one's place, its folder too. An old one's mode
/// and owner are kept, a symbolic link is followed; `mode`: of one that is new. Throws
/// std::runtime_error that names the file.
void write_durably(const std::string& path, std::string_view text, unsigned mode = 0644);

/// A file's name in its folder survives a power cut. Throws std::runtime_error naming the folder.
void sync_folder_of(const std::string& path);

}  // namespace vibrig::proto
