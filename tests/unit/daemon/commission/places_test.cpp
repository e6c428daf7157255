#include "daemon/commission/places.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "tests/plant/random.hpp"

namespace vibrig::commission {
namespace {

using proto::Register;
using proto::RegisterTable;
using proto::RegisterType;
using proto::WordOrder;

/// A controller with a map of its own, full of other values.
struct Foreign {
    std::vector<RegisterBlock> blocks;
    Register place;

    explicit Foreign(std::uint64_t seed, std::size_t registers) {
        plant::Random random(seed, 3);
        blocks = {{RegisterTable::holding, {}}, {RegisterTable::input, {}}};
        for (auto& block : blocks)
            for (std::size_t i = 0; i < registers / 2; ++i)
                block.words.push_back(static_cast<std::uint16_t>(
                    random.uniform() < 0.5 ? 0 : std::pow(65535.0, random.uniform())));
        constexpr std::array kTypes{RegisterType::u16, RegisterType::u32, RegisterType::f32};
        place.type = kTypes[static_cast<std::size_t>(3 * random.uniform())];
        place.order =
            place.words() == 2 && random.uniform() < 0.5 ? WordOrder::little : WordOrder::big;
        place.scale = place.type == RegisterType::f32 ? 1 : place.words() == 2 ? 1e-4 : 1e-2;
        place.address = static_cast<std::uint16_t>(random.uniform() * (double(registers) / 2 - 2));
    }
    void set(double value) {
        std::array<std::uint16_t, 2> words{};
        ASSERT_TRUE(proto::encode(place, value, {words.data(), place.words()}));
        for (std::size_t i = 0; i < place.words(); ++i)
            blocks[0].words[place.address + i] = words[i];
    }
    [[nodiscard]] bool among(const std::vector<Register>& places) const {
        return std::ranges::any_of(places, [this](const Register& p) {
            return p.address == place.address && p.type == place.type && p.order == place.order &&
                   p.table == RegisterTable::holding && std::abs(p.scale / place.scale - 1) < 1e-9;
        });
    }
};

TEST(Places, OfAHundredAndFiftyMapsAtMostThreeAreLeftAfterThreeValues) {
    std::size_t most = 0, one = 0;
    constexpr std::uint64_t kMaps = 150;
    for (std::uint64_t seed = 1; seed <= kMaps; ++seed) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        Foreign device(seed, 512);
        std::vector<Register> places;
        for (const char* text : {"15.00", "17.50", "21.25"}) {
            const auto shown = *shown_value(text);
            device.set(shown.value);
            places = places.empty() ? places_of(shown, device.blocks)
                                    : still_places(places, shown, device.blocks);
            ASSERT_TRUE(device.among(places)) << text;
        }
        most = std::max(most, places.size());
        if (places.size() == 1) ++one;
        // What is left beside it is the low word of a long number, or the same number scaled.
        for (const auto& place : places)
            EXPECT_LE(std::abs(place.address - device.place.address), 1);
    }
    std::printf("# %zu of %d maps to one place, at most %zu\n", one, int(kMaps), most);
    EXPECT_LE(most, 3U);  // a short number between zeros is a long one of either order, too
}

TEST(Places, WhatCannotBeReadIsNoPlace) {
    const std::vector<RegisterBlock> blocks{{RegisterTable::holding, {std::nullopt, 1500}},
                                            {RegisterTable::input, {}}};
    const auto places = places_of(*shown_value("15.00"), blocks);
    ASSERT_EQ(places.size(), 1U);
    EXPECT_EQ(toml_line("frequency", places[0]),
              R"(frequency = { address = 1, type = "u16", table = "holding", scale = 0.01 })");
    EXPECT_TRUE(still_places(places, *shown_value("17.50"), blocks).empty());
}

TEST(Places, WhatADisplayShowsIsAPositiveNumber) {
    for (const char* text : {"", "0", "-3", "1e3", "nan", "15 Hz", "1,5", "0x10", "inf"})
        EXPECT_FALSE(shown_value(text)) << text;
    EXPECT_DOUBLE_EQ(shown_value("15.00")->half_digit, 0.005);
    EXPECT_DOUBLE_EQ(shown_value("15")->half_digit, 0.5);
}

}  // namespace
}  // namespace vibrig::commission
