#pragma once

// Of CLI11 whatever an option needs: App.hpp alone does not link.
#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <string>

namespace vibrig::proto {

/// No option takes an empty value: one from a variable that is not set would pass for no option at
/// all, which is another configuration, or another rig. Of a program whose options are all there.
inline void refuse_empty_values(CLI::App& app) {
    const auto takes_values = [](const CLI::Option* o) { return o->get_items_expected_max() > 0; };
    for (CLI::Option* option : app.get_options(takes_values)) {
        option->check(CLI::Validator(
            [meaning = option->get_description()](const std::string& value) {
                return value.empty() ? "found nothing, expected a value: " + meaning
                                     : std::string();
            },
            ""));
    }
    for (CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
        refuse_empty_values(*command);
}

}  // namespace vibrig::proto
