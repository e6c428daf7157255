#pragma once

// Of CLI11 whatever an option needs: App.hpp alone does not link.
#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <algorithm>
#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "proto/durable_file.hpp"

namespace vibrig::proto {

namespace named_files {

/// Options whose values are written; whatever else names a file is read.
[[nodiscard]] inline bool is_written(const CLI::Option& option) {
    constexpr std::array<std::string_view, 8> kNames{
        "output", "plot", "pdf", "csv", "hdf5", "write", "write-truth", "write-mean"};
    return std::ranges::any_of(option.get_lnames(), [&](const std::string& name) {
        return std::ranges::find(kNames, name) != kNames.end();
    });
}

inline void collect(const CLI::App& app, std::vector<std::string>& read,
                    std::vector<std::string>& written) {
    for (const CLI::Option* option : app.get_options()) {
        if (option->get_items_expected_max() == 0) continue;  // a flag
        auto& values = is_written(*option) ? written : read;
        values.insert(values.end(), option->results().begin(), option->results().end());
    }
    for (const CLI::App* command : app.get_subcommands()) collect(*command, read, written);
}

}  // namespace named_files

/// Before a command runs: its outputs are no recordings, and none of the files that it is given to
/// read. What parses `app` throws std::runtime_error naming the one that is.
inline void keep_named_files(CLI::App& app) {
    app.parse_complete_callback([&app] {
        std::vector<std::string> read, written;
        named_files::collect(app, read, written);
        name_inputs(std::move(read));
        for (const std::string& path : written) check_output(path);
        refuse_same(written);
    });
}

}  // namespace vibrig::proto
