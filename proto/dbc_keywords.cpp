#include "proto/dbc_keywords.hpp"

#include <algorithm>
#include <array>

namespace vibrig::proto {

namespace {

constexpr std::array<std::string_view, 12> kRead = {
    "VERSION", "NS_",        "BS_",          "BU_",         "BO_", "SG_",
    "VAL_",    "VAL_TABLE_", "SIG_VALTYPE_", "SG_MUL_VAL_", "BA_", "BA_DEF_DEF_"};

constexpr std::array<std::string_view, 25> kPassedOver = {
    "CM_",          "BA_DEF_",         "EV_",
    "BO_TX_BU_",    "SIG_GROUP_",      "CAT_",
    "CAT_DEF_",     "FILTER",          "NS_DESC_",
    "ENVVAR_DATA_", "EV_DATA_",        "SGTYPE_",
    "SGTYPE_VAL_",  "SIG_TYPE_REF_",   "SIGTYPE_VALTYPE_",
    "BA_SGTYPE_",   "BA_DEF_SGTYPE_",  "BA_REL_",
    "BA_DEF_REL_",  "BA_DEF_DEF_REL_", "BA_SGTYPE_REL_",
    "BU_SG_REL_",   "BU_EV_REL_",      "BA_DEF_SGTYPE_REL_",
    "BU_BO_REL_"};

template <std::size_t N>
bool contains(const std::array<std::string_view, N>& list, const Token& token) noexcept {
    return token.kind == Token::Kind::word &&
           std::find(list.begin(), list.end(), token.text) != list.end();
}

}  // namespace

bool is_passed_over(const Token& token) noexcept { return contains(kPassedOver, token); }

bool is_keyword(const Token& token) noexcept {
    return contains(kRead, token) || contains(kPassedOver, token);
}

}  // namespace vibrig::proto
