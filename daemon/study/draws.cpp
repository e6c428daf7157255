#include "daemon/study/draws.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace vibrig::study {

namespace {

constexpr int kRounds = 10;
constexpr int kMostTries = 10'000;

std::uint32_t low_word(std::uint64_t x) noexcept { return static_cast<std::uint32_t>(x); }
std::uint32_t high_word(std::uint64_t x) noexcept { return static_cast<std::uint32_t>(x >> 32); }

}  // namespace

std::array<std::uint32_t, 4> philox(std::array<std::uint32_t, 4> c,
                                    std::array<std::uint32_t, 2> k) noexcept {
    for (int round = 0; round < kRounds; ++round) {
        const std::uint64_t a = std::uint64_t{0xD2511F53} * c[0];
        const std::uint64_t b = std::uint64_t{0xCD9E8D57} * c[2];
        c = {high_word(b) ^ c[1] ^ k[0], low_word(b), high_word(a) ^ c[3] ^ k[1], low_word(a)};
        k = {k[0] + 0x9E3779B9U, k[1] + 0xBB67AE85U};
    }
    return c;
}

std::uint32_t purpose_of(std::string_view name) noexcept {  // FNV-1a
    std::uint32_t hash = 2'166'136'261U;
    for (const char c : name) hash = (hash ^ static_cast<unsigned char>(c)) * 16'777'619U;
    return hash;
}

Draws::Draws(std::uint64_t seed, std::uint64_t index, std::string_view purpose) noexcept
    : key_{low_word(seed), high_word(seed)},
      counter_{0, purpose_of(purpose), low_word(index), high_word(index)} {}

std::uint64_t Draws::bits() noexcept {
    const auto words = philox(counter_, key_);
    ++counter_[0];
    return std::uint64_t{words[1]} << 32 | words[0];
}

double Draws::uniform() noexcept { return (static_cast<double>(bits() >> 12) + 0.5) * 0x1p-52; }

double Draws::normal() noexcept {  // Box and Muller; one of the two is enough
    const double radius = std::sqrt(-2 * std::log(uniform()));
    return radius * std::cos(2 * std::numbers::pi * uniform());
}

double Distribution::draw(Draws& draws) const {
    switch (shape) {
        case Shape::normal:
            for (int i = 0; i < kMostTries; ++i) {
                const double x = first + second * draws.normal();
                if (x >= low && x <= high) return x;
            }
            throw std::runtime_error("a normal distribution that the key's range cuts away");
        case Shape::rectangular:
            return std::clamp(first + (second - first) * draws.uniform(), first, second);
        case Shape::triangular: {
            const double sum = draws.uniform() + draws.uniform();
            return std::clamp(first + (second - first) * sum / 2, first, second);
        }
        case Shape::arcsine: {
            const double turn = std::cos(std::numbers::pi * draws.uniform());
            return std::clamp((first + second) / 2 + (second - first) / 2 * turn, first, second);
        }
    }
    return first;
}

}  // namespace vibrig::study
