#pragma once

#include <array>
#include <cstdint>
#include <string_view>

namespace vibrig::study {

/// Philox 4x32-10 (Salmon et al. 2011): ten rounds of multiplications turn a counter and a key into
/// four random words. Nothing is kept from one call to the next.
[[nodiscard]] std::array<std::uint32_t, 4> philox(std::array<std::uint32_t, 4> counter,
                                                  std::array<std::uint32_t, 2> key) noexcept;

/// What a draw is for, as a number that stays when other draws are added.
[[nodiscard]] std::uint32_t purpose_of(std::string_view name) noexcept;

/// Random numbers of one purpose in one task: those of (seed, index, purpose), whoever asks and
/// whenever.
class Draws {
  public:
    Draws(std::uint64_t seed, std::uint64_t index, std::string_view purpose) noexcept;

    [[nodiscard]] std::uint64_t bits() noexcept;
    [[nodiscard]] double uniform() noexcept;  ///< in (0, 1)
    [[nodiscard]] double normal() noexcept;   ///< standard

  private:
    std::array<std::uint32_t, 2> key_;
    std::array<std::uint32_t, 4> counter_;
};

/// What a number of the rig is drawn from.
struct Distribution {
    enum class Shape : std::uint8_t { normal, rectangular, triangular, arcsine };
    Shape shape = Shape::normal;
    double first = 0, second = 1;  ///< mean and sigma of a normal one, else its ends
    double low = 0, high = 0;      ///< what the key takes: a normal one is cut there

    [[nodiscard]] double draw(Draws& draws) const;
};

}  // namespace vibrig::study
