#include "daemon/study/toml_text.hpp"

#include <cmath>
#include <nlohmann/json.hpp>

#include "daemon/configuration/value.hpp"

namespace vibrig::study {

namespace {

std::string list_text(const toml::array& list) {
    std::string text = "[";
    for (const toml::node& node : list) text += (text.size() > 1 ? ", " : "") + toml_text(node);
    return text + "]";
}

std::string table_text(const toml::table& table) {
    std::string text = "{";
    for (const auto& [key, node] : table) {
        text += text.size() > 1 ? ", " : " ";
        text += configuration::write_text(std::string(key.str())) + " = " + toml_text(node);
    }
    return text + " }";
}

}  // namespace

std::string toml_text(const toml::node& node) {
    if (const auto* list = node.as_array()) return list_text(*list);
    if (const auto* table = node.as_table()) return table_text(*table);
    if (const auto* text = node.as_string()) return configuration::write_text(text->get());
    if (const auto* number = node.as_floating_point())
        return configuration::write_number(number->get());
    if (const auto* number = node.as_integer()) return std::to_string(number->get());
    if (const auto* flag = node.as_boolean()) return flag->get() ? "true" : "false";
    std::ostringstream out;
    if (const auto* date = node.as_date()) out << date->get();
    if (const auto* time = node.as_time()) out << time->get();
    if (const auto* moment = node.as_date_time()) out << moment->get();
    return out.str();
}

std::string json_text(const toml::node& node) {
    if (const auto* list = node.as_array()) {
        std::string text = "[";
        for (const toml::node& one : *list) {
            const std::string element = json_text(one);
            if (element.empty()) return {};
            text += (text.size() > 1 ? "," : "") + element;
        }
        return text + "]";
    }
    if (const auto* text = node.as_string()) return nlohmann::json(text->get()).dump();
    if (const auto* number = node.as_floating_point())
        return std::isfinite(number->get()) ? nlohmann::json(number->get()).dump() : "";
    if (const auto* number = node.as_integer()) return std::to_string(number->get());
    if (const auto* flag = node.as_boolean()) return flag->get() ? "true" : "false";
    return {};
}

}  // namespace vibrig::study
