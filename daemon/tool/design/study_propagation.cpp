#include <array>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <vector>

#include "daemon/record/hdf5.hpp"
#include "daemon/tool/design/study_recordings.hpp"

namespace vibrig::tool::studies {

using Json = nlohmann::ordered_json;

namespace {

constexpr std::array kPropagated{"/value",      "/gum/u",      "/gum/low",     "/gum/high",
                                 "/mean",       "/u",          "/symmetric/0", "/symmetric/1",
                                 "/shortest/0", "/shortest/1", "/tolerance",   "/difference"};

double propagated(const Json& coefficient, const char* pointer) {
    const Json::json_pointer at(pointer);
    return coefficient.contains(at) && coefficient.at(at).is_number()
               ? coefficient.at(at).get<double>()
               : std::nan("");
}

}  // namespace

std::string propagation_table(const Json& result) {
    std::array<char, 400> text{};
    std::snprintf(text.data(), text.size(), "%s: %ld of %ld blocks, %ld failed%s\n",
                  result.at("study").get<std::string>().c_str(), result.at("done").get<long>(),
                  result.at("tasks").get<long>(), result.at("failed").get<long>(),
                  result.at("partial").get<bool>() ? ", PARTIAL" : "");
    std::string out = text.data();
    for (const auto& [why, count] : result.at("failures").items())
        out += "failed " + std::to_string(count.get<long>()) + " times: " + why + "\n";
    for (const auto& [key, value] : result.at("settings").items())
        out += "with " + key + " = " + value.get<std::string>() + "\n";
    std::snprintf(text.data(), text.size(),
                  "%ld trials, %ld digits of u: the budget is %s\n"
                  "%-6s %-10s %11s %10s %10s  %-23s %-23s %s\n",
                  result.at("trials").get<long>(), result.at("digits").get<long>(),
                  result.at("verdict").get<std::string>().c_str(), "", "unit", "value", "u, budget",
                  "u, drawn", "interval, budget", "symmetric, drawn", "off/tolerance");
    out += text.data();
    for (const Json& c : result.at("coefficients")) {
        if (!c.contains("value")) continue;
        std::snprintf(text.data(), text.size(),
                      "%-6s %-10s %11.6f %10.6f %10.6f  %11.6f %11.6f %11.6f %11.6f %6.2f%s\n",
                      c.at("name").get<std::string>().c_str(),
                      c.at("unit").get<std::string>().c_str(), propagated(c, "/value"),
                      propagated(c, "/gum/u"), propagated(c, "/u"), propagated(c, "/gum/low"),
                      propagated(c, "/gum/high"), propagated(c, "/symmetric/0"),
                      propagated(c, "/symmetric/1"),
                      propagated(c, "/difference") / propagated(c, "/tolerance"),
                      c.at("validated").get<bool>() ? "" : "  not validated");
        out += text.data();
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
            std::array<char, 40> number{};
            const double value = propagated(c, pointer);
            std::snprintf(number.data(), number.size(), ",%.17g", value);
            out += std::isfinite(value) ? number.data() : ",";
        }
        out += "\n";
    }
    return out;
}

void write_propagation_hdf5(const Json& result, const std::string& path) {
    auto file = record::hdf5::File::create(path);
    std::vector<double> values;
    for (const Json& c : result.at("coefficients")) {
        for (const char* pointer : kPropagated) values.push_back(propagated(c, pointer));
    }
    if (!values.empty())
        file.write_numbers("coefficients", values,
                           {values.size() / kPropagated.size(), kPropagated.size()}, "",
                           "columns as in the CSV");
    file.write_text("result", result.dump(), "the whole result as JSON");
    file.close();
}

}  // namespace vibrig::tool::studies
