#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <vector>

#include "daemon/record/hdf5.hpp"
#include "daemon/results/text_line.hpp"
#include "daemon/tool/design/study_output.hpp"
#include "estimator/filter/parameters.hpp"
#include "proto/json_number.hpp"

namespace vibrig::tool::studies {

using Json = nlohmann::ordered_json;

namespace {

constexpr std::size_t kMostShown = 30;

std::string word_of(const Json& result) {
    return result.is_object() && result["verdict"].is_string()
               ? result["verdict"].get<std::string>()
               : "none";
}

std::string name_of(const Json& one) {
    return std::filesystem::path(one.at("recording").get<std::string>()).filename().string();
}

/// Of the coefficient at `i` in `one`'s old or new result.
double entry(const Json& one, const char* which, const char* key, std::size_t i) {
    const Json& result = one.at(which);
    return result.is_object() ? proto::number_or_nan(result.at(key).at(i)) : std::nan("");
}

std::size_t place_of(const std::string& coefficient) {
    for (std::size_t i = 0; i < estimator::kParameters; ++i) {
        if (estimator::parameter_names()[i] == coefficient) return i;
    }
    return 0;
}

std::string mark_of(const Json& one) { return one.value("simulated", false) ? "  SIMULATED" : ""; }

std::string row(const Json& one) {
    const std::string words = word_of(one.at("old")) + " -> " + word_of(one.at("new"));
    if (!one.at("coefficient").is_string()) {
        return line(
            "%-28s %-10s %-22s %s%s", name_of(one).c_str(),
            one.at("serial").get<std::string>().c_str(), words.c_str(),
            one.at("old").is_object() ? "no coefficient in both" : "the recording has no result",
            mark_of(one).c_str());
    }
    const std::string coefficient = one.at("coefficient");
    const std::size_t i = place_of(coefficient);
    return line("%-28s %-10s %-22s %-6s %12.6f %12.6f %10.3g %8.3f%s", name_of(one).c_str(),
                one.at("serial").get<std::string>().c_str(), words.c_str(), coefficient.c_str(),
                entry(one, "old", "value", i), entry(one, "new", "value", i),
                proto::number_or_nan(one.at("difference_sigma").at(i)),
                proto::number_or_nan(one.at("e_n").at(i)), mark_of(one).c_str());
}

std::string csv_text(const std::string& text) {
    std::string out = "\"";
    for (const char c : text) out += c == '"' ? std::string("\"\"") : std::string(1, c);
    return out + "\"";
}

}  // namespace

std::string recordings_table(const Json& result) {
    std::string out = done_text(result, "recordings");
    for (const auto& [key, value] : result.at("settings").items())
        out += "with " + key + " = " + value.get<std::string>() + "\n";
    out += line("%-28s %-10s %-22s %-6s %12s %12s %10s %8s", "recording", "serial",
                "verdict, old -> new", "worst", "old", "new", "in old u", "E_n");
    const Json& all = result.at("recordings");
    for (std::size_t i = 0; i < std::min(all.size(), kMostShown); ++i) {
        const Json& one = all[i];
        out += one.contains("failed")
                   ? name_of(one) + ": failed: " + one.at("failed").get<std::string>() + "\n"
                   : row(one);
    }
    if (all.size() > kMostShown)
        out += std::to_string(all.size() - kMostShown) + " more, which differ less\n";
    return out;
}

std::string recordings_csv(const Json& result) {
    std::string out =
        "recording,serial,verdict_old,verdict_new,coefficient,unit,old,u_old,new,u_new,"
        "difference_in_u_old,e_n\n";
    for (const Json& one : result.at("recordings")) {
        if (one.contains("failed")) continue;
        for (std::size_t i = 0; i < estimator::kParameters; ++i) {
            out += csv_text(one.at("recording")) + "," + csv_text(one.at("serial")) + "," +
                   word_of(one.at("old")) + "," + word_of(one.at("new")) + "," +
                   std::string(estimator::parameter_names()[i]) + "," +
                   std::string(estimator::parameter_unit(i));
            for (const double value : {entry(one, "old", "value", i), entry(one, "old", "u", i),
                                       entry(one, "new", "value", i), entry(one, "new", "u", i),
                                       proto::number_or_nan(one.at("difference_sigma").at(i)),
                                       proto::number_or_nan(one.at("e_n").at(i))})
                out += csv_number(value);
            out += "\n";
        }
    }
    return out;
}

void write_recordings_hdf5(const Json& result, const std::string& path) {
    auto file = record::hdf5::File::create(path);
    const auto put = [&](const char* name, const char* which, const char* key, const char* what) {
        std::vector<double> values;
        std::size_t rows = 0;
        for (const Json& one : result.at("recordings")) {
            if (one.contains("failed")) continue;
            for (std::size_t i = 0; i < estimator::kParameters; ++i)
                values.push_back(which == nullptr ? proto::number_or_nan(one.at(key).at(i))
                                                  : entry(one, which, key, i));
            ++rows;
        }
        if (rows > 0) file.write_numbers(name, values, {rows, estimator::kParameters}, "", what);
    };
    put("old", "old", "value", "recordings x coefficients, in the coefficients' units");
    put("u_old", "old", "u", "standard uncertainty");
    put("new", "new", "value", "recordings x coefficients");
    put("u_new", "new", "u", "standard uncertainty");
    put("e_n", nullptr, "e_n", "difference over the root of both expanded uncertainties squared");
    file.write_text("result", result.dump(), "the whole result as JSON");
    file.close();
}

}  // namespace vibrig::tool::studies
