#pragma once

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <initializer_list>
#include <iostream>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

namespace vibrig::proto {

/// What a program's exit status says.
struct Exit {
    int code;
    const char* meaning;
};

namespace command_tree {

using Json = nlohmann::ordered_json;

[[nodiscard]] inline Json option(const CLI::Option& o) {
    Json names = Json::array();
    for (const auto& name : o.get_snames()) names.push_back('-' + name);
    for (const auto& name : o.get_lnames()) names.push_back("--" + name);
    const bool flag = o.get_items_expected_max() == 0;
    return {{"names", names},
            {"positional", o.get_name(true, false)},
            {"text", o.get_description()},
            {"type", flag ? std::string() : o.get_type_name()},
            {"default", o.get_default_str()},
            {"environment", o.get_envname()},
            {"required", o.get_required()},
            {"many", o.get_items_expected_max() > 1}};
}

[[nodiscard]] inline Json command(const CLI::App& app) {
    Json options = Json::array(), commands = Json::array();
    for (const CLI::Option* o : app.get_options()) {
        // No group: not shown in --help either.
        if (!o->get_group().empty()) options.push_back(option(*o));
    }
    for (const CLI::App* c : app.get_subcommands([](const CLI::App*) { return true; }))
        commands.push_back(command(*c));
    return {{"name", app.get_name()},
            {"text", app.get_description()},
            {"footer", app.get_footer()},
            {"options", options},
            {"commands", commands}};
}

}  // namespace command_tree

/// Of a program whose only argument is --command-tree: manual pages, completion and the reference
/// are made from what it prints. Not in --help.
[[nodiscard]] inline bool asks_for_command_tree(int argc, const char* const* argv) {
    return argc == 2 && std::string_view(argv[1]) == "--command-tree";
}

/// Exit status of a program that only prints: nobody may take half of it, or nothing, for all.
[[nodiscard]] inline int print_status(const CLI::App& app) {
    if (std::cout.flush()) return 0;
    std::cerr << app.get_name() << ": standard output: cannot be written\n";
    return 2;
}

/// Options, commands and exit codes as one JSON object, from CLI11's own tree.
[[nodiscard]] inline std::string command_tree_json(const CLI::App& app,
                                                   std::initializer_list<Exit> exits) {
    auto tree = command_tree::command(app);
    for (const Exit& exit : exits)
        tree["exits"].push_back({{"code", exit.code}, {"meaning", exit.meaning}});
    return tree.dump() + '\n';
}

}  // namespace vibrig::proto
