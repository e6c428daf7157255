// What the live page knows of the table of single values.
#include <nlohmann/json.hpp>

#include "daemon/serve/page.hpp"
#include "daemon/status/values.hpp"

namespace vibrig::serve {
namespace {

std::string values_script() {
    using Json = nlohmann::ordered_json;
    Json rows = Json::array();
    for (const StatusValue& row : status_values()) {
        if (row.line == nullptr || !row.on_page) continue;
        rows.push_back({{"field", row.field},
                        {"line", row.line},
                        {"words", row.words},
                        {"otherwise", row.otherwise == nullptr ? Json() : Json(row.otherwise)},
                        {"unit", row.unit},
                        {"number", is_number(row)},
                        {"decimals", row.decimals},
                        {"duration", row.duration},
                        {"alarming", row.alarming},
                        {"unless", row.silenced_by == nullptr ? Json() : Json(row.silenced_by)}});
    }
    return "'use strict';\nconst kValues = " + rows.dump(1) + ";\n";
}

}  // namespace

const PageFile& page_values() {
    static const std::string kText = values_script();
    static const PageFile kFile{"text/javascript; charset=utf-8", kText};
    return kFile;
}

}  // namespace vibrig::serve
