#include "daemon/report/sections.hpp"

#include <spdlog/fmt/fmt.h>

#include <nlohmann/json.hpp>

namespace vibrig::report {

using nlohmann::json;

void add_type(Page& page, const record::Campaign& campaign) {
    const json root = json::parse(campaign.result_json, nullptr, false);
    if (!root.is_object() || !root.contains("type_prior")) return;
    try {
        const json& type = root.at("type_prior");
        page.section("type", "With the unit's type");
        page.paragraph(fmt::format(
            "The campaign chose its dwells starting from {} other units of type {} in the archive "
            "({} campaigns). The result does not contain them; beside it, here it is with them.",
            type.at("units").get<int>(), type.at("type").get<std::string>(),
            type.at("campaigns").get<int>()));
        if (type.at("parameters").is_null()) {
            page.paragraph("Not all coefficients are determined: there is nothing to join.");
            return;
        }
        const json& distance = type.at("distance");
        const bool passes = distance.at("passes");
        page.paragraph(fmt::format(
            "{}Mahalanobis' distance from the type: {:.1f} (squared), p = {:.2g}: the unit {}.",
            passes ? "" : "Warning: ", distance.at("squared").get<double>(),
            distance.at("p").get<double>(),
            passes ? "passes for one of its type"
                   : "does not pass for one of its type at 1 %, which took no part in the choice "
                     "once that was seen"));
        Rows rows{{"coefficient", "without", "u", "with the type", "u", "type's mean", "scatter",
                   "unit"}};
        for (std::size_t i = 0; i < type.at("parameters").size(); ++i) {
            const json& with = type.at("parameters")[i];
            const json& without = root.at("parameters").at(i);
            const auto number = [](const json& of, const char* key) {
                return of.at(key).is_number() ? fmt::format("{:.5f}", of.at(key).get<double>())
                                              : std::string("-");
            };
            rows.push_back({with.at("name"), number(without, "value"), number(without, "u"),
                            number(with, "value"), number(with, "u"), number(with, "type_mean"),
                            number(with, "type_sigma"), with.at("unit")});
        }
        page.table(rows);
    } catch (const json::exception& error) {
        page.paragraph(std::string("The recorded result cannot be read: ") + error.what());
    }
}

}  // namespace vibrig::report
