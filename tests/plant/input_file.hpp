#pragma once

#include <cstddef>
#include <stdexcept>
#include <string>

#include "proto/text.hpp"
#include "tests/plant/truth.hpp"

namespace vibrig::plant {

/// The text of a file that a person named. Throws PlantError with the cause: a folder, too, can be
/// opened, and seems to be an empty file then.
[[nodiscard]] inline std::string read_input(const std::string& path, const std::string& expected) {
    constexpr std::size_t kLargest = std::size_t{1} << 30;
    try {
        return proto::read_whole_file(path, kLargest);
    } catch (const std::runtime_error& error) {
        throw PlantError(path + ": " + error.what() + ", expected " + expected);
    }
}

}  // namespace vibrig::plant
