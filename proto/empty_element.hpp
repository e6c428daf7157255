#pragma once

// Of CLI11 whatever an option needs: App.hpp alone does not link.
#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <algorithm>
#include <string>
#include <string_view>
#include <vector>

#include "proto/text.hpp"

namespace vibrig::proto {

[[nodiscard]] inline bool has_empty_element(std::string_view list) {
    return list.starts_with(',') || list.ends_with(',') ||
           list.find(",,") != std::string_view::npos;
}

/// Throws where a list has an empty element, as 0,,6 of a variable that is not set: CLI11 leaves it
/// out, and what follows takes its place. Before it parses these arguments, without the program's
/// name.
inline void refuse_empty_elements(const CLI::App& app, const std::vector<std::string>& arguments) {
    const CLI::App* command = &app;
    const CLI::Option* list = nullptr;
    std::ptrdiff_t left = 0;  // elements that the list may still take
    for (std::string_view text : arguments) {
        const auto named = command->get_subcommands(
            [text](const CLI::App* one) { return one->check_name(std::string(text)); });
        if (!named.empty()) command = named.front();
        if (text.starts_with("--") || !named.empty()) {
            const auto equals = std::min(text.find('='), text.size());
            list = command->get_option_no_throw(std::string(text.substr(0, equals)));
            left = list != nullptr && list->get_delimiter() == ',' ? list->get_items_expected_max()
                                                                   : 0;
            text.remove_prefix(std::min(equals + 1, text.size()));
        }
        // That nothing at all is given is said by refuse_empty_values().
        if (left <= 0 || text.empty()) continue;
        left -= 1 + std::ranges::count(text, ',');
        if (text.starts_with('[') && text.ends_with(']')) text = text.substr(1, text.size() - 2);
        if (has_empty_element(text))
            throw CLI::ValidationError(list->get_name(), "found '" + printable(text) +
                                                             "', expected something between "
                                                             "commas");
    }
}

}  // namespace vibrig::proto
