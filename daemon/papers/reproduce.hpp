#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "daemon/plot/chart.hpp"

namespace vibrig::tool {

struct ReproduceOptions {
    std::size_t seeds = 0;  ///< Monte-Carlo runs; 0: what the table was made with
    std::string plot = {};  ///< folder for charts; empty: none
};

struct ReproducedRow {
    std::string item;
    std::string published;
    std::string computed;
    std::optional<bool> agrees = {};  ///< nothing to compare with: empty
    /// Expected from a derivation of our own, where the paper has no number.
    std::string theory = {};
    /// The numbers of the texts, by name, for machines.
    std::vector<std::pair<std::string, double>> values = {};
};

/// A paper's table: what it published, what theory expects where it did not, and what is computed.
struct Reproduction {
    std::string name;
    std::string title;
    std::vector<ReproducedRow> rows = {};
    std::vector<std::string> notes = {};
    /// Names without extension, if options.plot asks for them.
    std::vector<std::pair<std::string, plot::Chart>> charts = {};

    /// A row with the fields of ReproducedRow.
    void add(std::string item, std::string published, std::string computed,
             std::optional<bool> agrees = {}, std::string theory = {},
             std::vector<std::pair<std::string, double>> values = {}) {
        rows.push_back({std::move(item), std::move(published), std::move(computed), agrees,
                        std::move(theory), std::move(values)});
    }
};

// One function for each name in the table of reproduce.cpp.
[[nodiscard]] Reproduction reproduce_allan(const ReproduceOptions& options);
[[nodiscard]] Reproduction reproduce_tang2009(const ReproduceOptions& options);
[[nodiscard]] Reproduction reproduce_dplan(const ReproduceOptions& options);
[[nodiscard]] Reproduction reproduce_accelerometer(const ReproduceOptions& options);
[[nodiscard]] Reproduction reproduce_zha2019(const ReproduceOptions& options);

}  // namespace vibrig::tool
