// Which registers of a foreign controller keep what its display shows.
#include "daemon/commission/places.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <iterator>

namespace vibrig::commission {

using proto::Register;
using proto::RegisterTable;
using proto::RegisterType;
using proto::WordOrder;

namespace {

constexpr int kLeastExponent = -6, kMostExponent = 3;

bool keeps(const Register& place, const Shown& shown, const std::vector<RegisterBlock>& blocks) {
    const auto block = std::ranges::find(blocks, place.table, &RegisterBlock::table);
    if (block == blocks.end()) return false;
    std::array<std::uint16_t, 2> words{};
    for (std::size_t i = 0; i < place.words(); ++i) {
        const std::size_t at = place.address + i;
        if (at >= block->words.size() || !block->words[at]) return false;
        words[i] = *block->words[at];
    }
    const double value = proto::decode(place, {words.data(), place.words()});
    // Beyond what rounding of the decimal scale costs.
    return std::abs(value - shown.value) <= shown.half_digit + 1e-9 * shown.value;
}

}  // namespace

std::optional<Shown> shown_number(const std::string& text) {
    double value = 0;
    std::size_t used = 0;
    try {
        value = std::stod(text, &used);
    } catch (const std::exception&) {
        return std::nullopt;
    }
    if (used != text.size() || !std::isfinite(value) ||
        text.find_first_not_of("0123456789.") != std::string::npos)
        return std::nullopt;
    const auto point = text.find('.');
    const auto digits = point == std::string::npos ? 0 : text.size() - point - 1;
    return Shown{value, 0.5 * std::pow(10.0, -static_cast<double>(digits))};
}

std::optional<Shown> shown_value(const std::string& text) {
    const auto shown = shown_number(text);
    return shown && shown->value > 0 ? shown : std::nullopt;
}

std::vector<Register> places_of(const Shown& shown, const std::vector<RegisterBlock>& blocks) {
    std::vector<Register> all;
    for (const auto& block : blocks) {
        for (std::size_t at = 0; at < block.words.size(); ++at) {
            for (const auto type : {RegisterType::u16, RegisterType::i16, RegisterType::u32,
                                    RegisterType::i32, RegisterType::f32}) {
                for (const auto order : {WordOrder::big, WordOrder::little}) {
                    for (int e = kLeastExponent; e <= kMostExponent; ++e) {
                        Register place;
                        place.address = static_cast<std::uint16_t>(at);
                        place.type = type;
                        place.order = order;
                        place.table = block.table;
                        place.scale = std::pow(10.0, e);
                        if (place.words() == 1 && order == WordOrder::little) continue;
                        if (keeps(place, shown, blocks)) all.push_back(place);
                    }
                }
            }
        }
    }
    // A number with its sign bit clear is the same with and without one: the unsigned one is named.
    const auto twin = [&all](const Register& p) {
        const bool small = p.type == RegisterType::i16, wide = p.type == RegisterType::i32;
        return (small || wide) && std::ranges::any_of(all, [&](const Register& q) {
                   return q.type == (small ? RegisterType::u16 : RegisterType::u32) &&
                          q.address == p.address && q.order == p.order && q.table == p.table &&
                          q.scale == p.scale;
               });
    };
    std::vector<Register> kept;
    std::ranges::copy_if(all, std::back_inserter(kept),
                         [&twin](const Register& p) { return !twin(p); });
    return kept;
}

std::vector<Register> still_places(const std::vector<Register>& places, const Shown& shown,
                                   const std::vector<RegisterBlock>& blocks) {
    std::vector<Register> kept;
    std::ranges::copy_if(places, std::back_inserter(kept),
                         [&](const Register& p) { return keeps(p, shown, blocks); });
    return kept;
}

std::string toml_line(const std::string& role, const Register& place) {
    constexpr std::array kTypes{"u16", "i16", "u32", "i32", "f32", "bits"};
    std::string line = fmt::format("{} = {{ address = {}, type = \"{}\"", role, place.address,
                                   kTypes[static_cast<std::size_t>(place.type)]);
    if (place.words() > 1)
        line +=
            fmt::format(", word_order = \"{}\"", place.order == WordOrder::big ? "big" : "little");
    return line + fmt::format(", table = \"{}\", scale = {:g} }}",
                              place.table == RegisterTable::holding ? "holding" : "input",
                              place.scale);
}

}  // namespace vibrig::commission
