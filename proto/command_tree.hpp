#pragma once

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <array>
#include <cstdio>
#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

namespace vibrig::proto {

/// What a program's exit status says.
struct Exit {
    int code;
    const char* meaning;
};

namespace command_tree {

[[nodiscard]] inline std::string json_text(std::string_view text) {
    std::string out = "\"";
    for (const char c : text) {
        if (c == '"' || c == '\\') {
            out += '\\';
            out += c;
        } else if (static_cast<unsigned char>(c) < 0x20) {
            std::array<char, 8> code{};
            std::snprintf(code.data(), code.size(), "\\u%04x", static_cast<unsigned>(c));
            out += code.data();
        } else {
            out += c;
        }
    }
    return out + '"';
}

[[nodiscard]] inline std::string list(const std::vector<std::string>& words) {
    std::string out;
    for (const auto& word : words) out += (out.empty() ? "" : ",") + json_text(word);
    return '[' + out + ']';
}

[[nodiscard]] inline std::string option(const CLI::Option& o) {
    std::vector<std::string> names;
    for (const auto& name : o.get_snames()) names.push_back('-' + name);
    for (const auto& name : o.get_lnames()) names.push_back("--" + name);
    const bool flag = o.get_items_expected_max() == 0;
    return "{\"names\":" + list(names) + ",\"positional\":" + json_text(o.get_name(true, false)) +
           ",\"text\":" + json_text(o.get_description()) +
           ",\"type\":" + json_text(flag ? "" : o.get_type_name()) +
           ",\"default\":" + json_text(o.get_default_str()) +
           ",\"environment\":" + json_text(o.get_envname()) +
           ",\"required\":" + (o.get_required() ? "true" : "false") +
           ",\"many\":" + (o.get_items_expected_max() > 1 ? "true" : "false") + '}';
}

/// Without the closing bracket: the program's own has more to say.
[[nodiscard]] inline std::string command(const CLI::App& app) {
    std::string options, commands;
    for (const CLI::Option* o : app.get_options()) {
        // No group: not shown in --help either.
        if (!o->get_group().empty()) options += (options.empty() ? "" : ",") + option(*o);
    }
    for (const CLI::App* c : app.get_subcommands([](const CLI::App*) { return true; }))
        commands += (commands.empty() ? "" : ",") + command(*c) + '}';
    return "{\"name\":" + json_text(app.get_name()) +
           ",\"text\":" + json_text(app.get_description()) +
           ",\"footer\":" + json_text(app.get_footer()) + ",\"options\":[" + options +
           "],\"commands\":[" + commands + "]";
}

}  // namespace command_tree

/// Of a program whose only argument is --command-tree: manual pages, completion and the reference
/// are made from what it prints. Not in --help.
[[nodiscard]] inline bool asks_for_command_tree(int argc, const char* const* argv) {
    return argc == 2 && std::string_view(argv[1]) == "--command-tree";
}

/// Options, commands and exit codes as one JSON object, from CLI11's own tree.
[[nodiscard]] inline std::string command_tree_json(const CLI::App& app,
                                                   std::initializer_list<Exit> exits) {
    std::string codes;
    for (const Exit& exit : exits)
        codes += (codes.empty() ? "" : ",") + std::string("{\"code\":") +
                 std::to_string(exit.code) +
                 ",\"meaning\":" + command_tree::json_text(exit.meaning) + '}';
    return command_tree::command(app) + ",\"exits\":[" + codes + "]}\n";
}

}  // namespace vibrig::proto
