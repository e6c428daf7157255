#include <array>
#include <nlohmann/json.hpp>
#include <vector>

#include "daemon/record/hdf5.hpp"
#include "daemon/results/text_line.hpp"
#include "daemon/tool/design/study_output.hpp"
#include "daemon/tool/simulated.hpp"

namespace vibrig::tool::studies {

using Json = nlohmann::ordered_json;

namespace {

constexpr std::array kPropagated{"/value",      "/gum/u",      "/gum/low",     "/gum/high",
                                 "/mean",       "/u",          "/symmetric/0", "/symmetric/1",
                                 "/shortest/0", "/shortest/1", "/tolerance",   "/difference"};

}  // namespace

std::string propagation_table(const Json& result) {
    std::string out =
        simulated_line(result.value("simulated", false)) + done_text(result, "blocks");
    for (const auto& [why, count] : result.at("failures").items())
        out += "failed " + std::to_string(count.get<long>()) + " times: " + why + "\n";
    for (const auto& [key, value] : result.at("settings").items())
        out += "with " + key + " = " + value.get<std::string>() + "\n";
    out += line(
        "%ld trials, %ld digits of u: the budget is %s\n"
        "%-6s %-10s %11s %10s %10s  %-23s %-23s %s",
        result.at("trials").get<long>(), result.at("digits").get<long>(),
        result.at("verdict").get<std::string>().c_str(), "", "unit", "value", "u, budget",
        "u, drawn", "interval, budget", "symmetric, drawn", "off/tolerance");
    for (const Json& c : result.at("coefficients")) {
        if (!c.contains("value")) continue;
        out += line(
            "%-6s %-10s %11.6f %10.6f %10.6f  %11.6f %11.6f %11.6f %11.6f %6.2f%s",
            c.at("name").get<std::string>().c_str(), c.at("unit").get<std::string>().c_str(),
            number_at(c, "/value"), number_at(c, "/gum/u"), number_at(c, "/u"),
            number_at(c, "/gum/low"), number_at(c, "/gum/high"), number_at(c, "/symmetric/0"),
            number_at(c, "/symmetric/1"), number_at(c, "/difference") / number_at(c, "/tolerance"),
            c.at("validated").get<bool>() ? "" : "  not validated");
    }
    return out;
}

std::string propagation_csv(const Json& result) {
    std::string out =
        "coefficient,unit,value,u_budget,low_budget,high_budget,mean,u,symmetric_low,"
        "symmetric_high,shortest_low,shortest_high,tolerance,difference\n";
    for (const Json& c : result.at("coefficients")) {
        out += c.at("name").get<std::string>() + "," + c.at("unit").get<std::string>();
        for (const char* pointer : kPropagated) {
            out += csv_number(number_at(c, pointer));
        }
        out += "\n";
    }
    return out;
}

void write_propagation_hdf5(const Json& result, const std::string& path) {
    auto file = record::hdf5::File::create(path);
    std::vector<double> values;
    for (const Json& c : result.at("coefficients")) {
        for (const char* pointer : kPropagated) values.push_back(number_at(c, pointer));
    }
    if (!values.empty())
        file.write_numbers("coefficients", values,
                           {values.size() / kPropagated.size(), kPropagated.size()}, "",
                           "columns as in the CSV");
    file.write_text("result", result.dump(), "the whole result as JSON");
    file.close();
}

}  // namespace vibrig::tool::studies
