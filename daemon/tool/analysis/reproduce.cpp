#include "daemon/papers/reproduce.hpp"

#include <unistd.h>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <CLI/Validators.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <filesystem>
#include <iomanip>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>

#include "daemon/plot/chart.hpp"
#include "daemon/tool/commands.hpp"

namespace vibrig::tool {

namespace {

using Json = nlohmann::ordered_json;

constexpr int kDisagrees = 1;

struct Entry {
    const char* name;
    Reproduction (*run)(const ReproduceOptions&);
    bool has_charts = false;
};
constexpr std::array kEntries{
    Entry{"tang2009", reproduce_tang2009, true},
    Entry{"allan", reproduce_allan},
    Entry{"dplan", reproduce_dplan},
    Entry{"zha2019", reproduce_zha2019},
    Entry{"accelerometer", reproduce_accelerometer},
};

bool agrees(const Reproduction& reproduction) {
    return std::all_of(reproduction.rows.begin(), reproduction.rows.end(),
                       [](const ReproducedRow& row) { return row.agrees.value_or(true); });
}

std::string table(const Reproduction& reproduction) {
    std::size_t item = 4;
    std::size_t published = 9;
    for (const ReproducedRow& row : reproduction.rows) {
        item = std::max(item, row.item.size());
        published = std::max(published, row.published.size());
    }
    std::ostringstream out;
    const auto line = [&](const std::string& a, const std::string& b, const std::string& c,
                          const char* mark) {
        out << std::left << std::setw(static_cast<int>(item) + 2) << a
            << std::setw(static_cast<int>(published) + 2) << b << c << mark << '\n';
    };
    out << reproduction.name << ": " << reproduction.title << "\n\n";
    line("item", "published", "computed", "");
    for (const ReproducedRow& row : reproduction.rows) {
        line(row.item, row.published, row.computed,
             !row.agrees   ? ""
             : *row.agrees ? "  pass"
                           : "  FAIL");
    }
    for (const std::string& note : reproduction.notes) {
        out << "note: " << note << '\n';
    }
    return out.str();
}

Json json(const Reproduction& reproduction) {
    Json rows = Json::array();
    for (const ReproducedRow& row : reproduction.rows) {
        Json values = Json::object();
        for (const auto& [key, value] : row.values) {
            values[key] = std::isfinite(value) ? Json(value) : Json(nullptr);
        }
        rows.push_back({{"item", row.item},
                        {"published", row.published},
                        {"computed", row.computed},
                        {"agrees", row.agrees ? Json(*row.agrees) : Json(nullptr)},
                        {"values", std::move(values)}});
    }
    return {{"name", reproduction.name},
            {"title", reproduction.title},
            {"agrees", agrees(reproduction)},
            {"rows", std::move(rows)},
            {"notes", reproduction.notes}};
}

/// Throws what is wrong with the folder before a study of minutes has run.
void check_plot(const std::string& name, const std::string& folder) {
    if (folder.empty())
        throw std::runtime_error("--plot: found \"\", expected a folder for charts");
    for (const Entry& entry : kEntries) {
        if (name == entry.name && !entry.has_charts) {
            throw std::runtime_error("--plot: found " + folder + ", but " + name +
                                     " has no charts");
        }
    }
    if (std::filesystem::exists(folder) && !std::filesystem::is_directory(folder)) {
        throw std::runtime_error("--plot: found " + folder + ", expected a folder for charts");
    }
    plot::make_folder(folder);
    if (access(folder.c_str(), W_OK) != 0) {
        throw std::runtime_error("--plot: found " + folder + ", which cannot be written to");
    }
}

int run(const std::string& name, const ReproduceOptions& options, bool as_json) {
    bool all_agree = true;
    Json list = Json::array();
    for (const Entry& entry : kEntries) {
        if (name != "all" && name != entry.name) {
            continue;
        }
        try {
            const Reproduction reproduction = entry.run(options);
            all_agree = all_agree && agrees(reproduction);
            if (as_json) {
                list.push_back(json(reproduction));
            } else {
                std::cout << table(reproduction) << '\n' << std::flush;
            }
        } catch (const std::exception& error) {
            std::cerr << "reproduce " << entry.name << ": " << error.what() << '\n';
            return kBadInput;
        }
    }
    if (as_json) {
        std::cout << Json{{"reproductions", std::move(list)}}.dump() << '\n' << std::flush;
    }
    if (!std::cout) {
        std::cerr << "standard output: cannot be written\n";
        return kBadInput;
    }
    return all_agree ? 0 : kDisagrees;
}

}  // namespace

void add_reproduce(CLI::App& app, int& exit_code) {
    struct Options {
        std::string name;
        ReproduceOptions reproduce;
        bool json = false;
    };
    auto options = std::make_shared<Options>();
    CLI::App* command =
        app.add_subcommand("reproduce", "A paper's tables, published next to computed");
    std::vector<std::string> names{"all"};
    std::string list;
    for (const Entry& entry : kEntries) {
        names.emplace_back(entry.name);
        list += std::string(entry.name) + ", ";
    }
    command->add_option("NAME", options->name, list + "all")
        ->required()
        ->check(CLI::IsMember(names));
    command->add_option("--seeds", options->reproduce.seeds, "Monte-Carlo runs of each study")
        ->check(CLI::Range(std::size_t{2}, std::size_t{100000}));
    const CLI::Option* plot = command->add_option("--plot", options->reproduce.plot,
                                                  "folder for charts of tang2009 (SVG)");
    command->add_flag("--json", options->json, "print the result as JSON");
    command->footer(
        "Example: vibrig reproduce tang2009 --seeds 32 --plot charts\n"
        "Exit codes: 0 everything agrees, 1 something differs (marked), 2 bad usage.");
    command->callback([options, plot, &exit_code] {
        if (plot->count() > 0) {
            try {
                check_plot(options->name, options->reproduce.plot);
            } catch (const std::exception& error) {
                std::cerr << "reproduce: " << error.what() << '\n';
                exit_code = kBadInput;
                return;
            }
        }
        exit_code = run(options->name, options->reproduce, options->json);
    });
}

}  // namespace vibrig::tool
