#include "daemon/papers/reproduce.hpp"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <exception>
#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>
#include <system_error>

#include "daemon/plot/chart.hpp"
#include "daemon/tool/commands.hpp"
#include "proto/durable_file.hpp"
#include "proto/json_number.hpp"
#include "proto/json_text.hpp"

namespace vibrig::tool {

namespace {

using Json = nlohmann::ordered_json;

constexpr int kDisagrees = 1;

struct Entry {
    const char* name;
    Reproduction (*run)(const ReproduceOptions&);
};
constexpr std::array kEntries{
    Entry{"tang2009", reproduce_tang2009},
    Entry{"allan", reproduce_allan},
    Entry{"dplan", reproduce_dplan},
    Entry{"zha2019", reproduce_zha2019},
    Entry{"accelerometer", reproduce_accelerometer},
};

bool agrees(const Reproduction& reproduction) {
    return std::all_of(reproduction.rows.begin(), reproduction.rows.end(),
                       [](const ReproducedRow& row) { return row.agrees.value_or(true); });
}

/// Lines of at most `width` characters, broken at blanks; a longer word stands alone.
std::vector<std::string> wrapped(const std::string& text, std::size_t width) {
    std::vector<std::string> lines;
    std::istringstream words(text);
    for (std::string word; words >> word;) {
        if (lines.empty() || lines.back().size() + 1 + word.size() > width) {
            lines.push_back(word);
        } else {
            lines.back() += ' ' + word;
        }
    }
    if (lines.empty()) lines.emplace_back();
    return lines;
}

constexpr std::size_t kLineWidth = 120;
constexpr std::size_t kMarkWidth = 6;  // "  pass"
/// Of item, published, theory; the rest is for what is computed.
constexpr std::array<std::size_t, 3> kWidest{46, 22, 18};

class Columns {
  public:
    explicit Columns(const Reproduction& reproduction) {
        widen({"item", "published", "theory"});
        for (const ReproducedRow& row : reproduction.rows)
            widen({row.item, row.published, row.theory});
    }

    [[nodiscard]] std::string line(const std::array<std::string, 4>& cells,
                                   const std::string& mark) const {
        const std::size_t last =
            kLineWidth - kMarkWidth - width_[0] - width_[1] - width_[2] - 3 * kGap;
        std::array<std::vector<std::string>, 4> parts;
        std::size_t lines = 1;
        for (std::size_t k = 0; k < cells.size(); ++k) {
            parts[k] = wrapped(cells[k], k < width_.size() ? width_[k] : last);
            lines = std::max(lines, parts[k].size());
        }
        std::string out;
        for (std::size_t i = 0; i < lines; ++i) {
            std::string text;
            for (std::size_t k = 0; k < cells.size(); ++k) {
                std::string cell = i < parts[k].size() ? parts[k][i] : "";
                if (k < width_.size()) cell.resize(std::max(cell.size(), width_[k] + kGap), ' ');
                text += cell;
            }
            if (i == 0) text += mark;
            text.erase(text.find_last_not_of(' ') + 1);
            out += text + '\n';
        }
        return out;
    }

  private:
    static constexpr std::size_t kGap = 2;
    void widen(const std::array<std::string, 3>& cells) {
        for (std::size_t k = 0; k < cells.size(); ++k)
            width_[k] = std::max(width_[k], std::min(cells[k].size(), kWidest[k]));
    }
    std::array<std::size_t, 3> width_{};
};

std::string table(const Reproduction& reproduction) {
    const Columns columns(reproduction);
    std::string out = reproduction.name + ": " + reproduction.title + "\n\n";
    out += columns.line({"item", "published", "theory", "computed"}, "");
    for (const ReproducedRow& row : reproduction.rows) {
        out += columns.line({row.item, row.published, row.theory, row.computed}, !row.agrees ? ""
                                                                                 : *row.agrees
                                                                                     ? "  pass"
                                                                                     : "  FAIL");
    }
    for (const std::string& note : reproduction.notes) {
        const char* begin = "note: ";
        for (const std::string& line : wrapped(note, kLineWidth - 6)) {
            out += begin + line + '\n';
            begin = "      ";
        }
    }
    return out;
}

/// The numbers of a text by its cell's name: "computed", "computed_2" ...
void add_numbers(const std::string& name, const std::string& text, Json& values) {
    std::size_t count = 0;
    for (std::size_t i = 0; i < text.size();) {
        const auto is_digit = [&](std::size_t k) {
            return k < text.size() && text[k] >= '0' && text[k] <= '9';
        };
        const bool sign = text[i] == '-' && is_digit(i + 1);
        // A digit within a word, as in K3, is none of its own.
        const bool in_word = i > 0 && (std::isalpha(static_cast<unsigned char>(text[i - 1])) != 0 ||
                                       text[i - 1] == '.' || is_digit(i - 1));
        double value = 0;
        if ((is_digit(i) || sign) && !in_word) {
            const auto [end, error] =
                std::from_chars(text.data() + i, text.data() + text.size(), value);
            if (error == std::errc()) {
                ++count;
                values[count == 1 ? name : name + "_" + std::to_string(count)] = value;
                i = static_cast<std::size_t>(end - text.data());
                continue;
            }
        }
        ++i;
    }
}

Json json(const Reproduction& reproduction) {
    Json rows = Json::array();
    for (const ReproducedRow& row : reproduction.rows) {
        Json values = Json::object();
        for (const auto& [key, value] : row.values) {
            values[key] = proto::number_or_null(value);
        }
        if (row.values.empty()) {
            add_numbers("published", row.published, values);
            add_numbers("theory", row.theory, values);
            add_numbers("computed", row.computed, values);
        }
        rows.push_back({{"item", row.item},
                        {"published", row.published},
                        {"theory", row.theory},
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
void check_plot(const std::string& folder) {
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
            for (const auto& [file, chart] : reproduction.charts) {
                const std::string path =
                    options.plot + "/" + reproduction.name + "-" + file + ".svg";
                proto::write_output(path, chart.svg());
            }
            if (as_json) {
                list.push_back(json(reproduction));
            } else {
                std::cout << table(reproduction) << '\n' << std::flush;
            }
        } catch (const std::exception& error) {
            throw std::runtime_error(std::string("reproduce ") + entry.name + ": " + error.what());
        }
    }
    if (as_json) {
        std::cout << proto::json_text(Json{{"reproductions", std::move(list)}}) << '\n';
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
    command->add_option("--plot", options->reproduce.plot, "folder for charts (SVG)")
        ->check(proto::charts(false));
    command->add_flag("--json", options->json, "print the result as JSON");
    command->footer(
        "Example: vibrig reproduce tang2009 --seeds 32 --plot charts\n"
        "Exit codes: 0 everything agrees, 1 something differs (marked), 2 bad usage.");
    command->callback([options, &exit_code] {
        exit_code = guarded(
            [&] {
                if (!options->reproduce.plot.empty()) check_plot(options->reproduce.plot);
                return 0;
            },
            "reproduce: ");
        if (exit_code == 0)
            exit_code =
                guarded([&] { return run(options->name, options->reproduce, options->json); });
    });
}

}  // namespace vibrig::tool
