#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "drivers/shaker/shaker.hpp"
#include "proto/register_map.hpp"

namespace vibrig::drivers {

/// Values of the mode register.
inline constexpr int kModeSine = 0, kModeRandom = 1, kModeSweep = 2;

/// Registers of one table that one request reads.
struct RegisterRange {
    proto::RegisterTable table = proto::RegisterTable::holding;
    std::uint16_t address = 0;
    std::vector<std::uint16_t> words;  ///< as last read
};

/// The device's registers as last read, joined into as few requests as contiguous addresses allow.
/// Shaker thread only.
class ShakerImage {
  public:
    explicit ShakerImage(const proto::ShakerRegisters& registers);

    [[nodiscard]] std::span<RegisterRange> ranges() noexcept { return ranges_; }
    /// The words of a register of the map; empty if it is not read.
    [[nodiscard]] std::span<std::uint16_t> words_of(const proto::Register& reg) noexcept;
    [[nodiscard]] double value_of(const proto::Register& reg) noexcept;
    /// The reading of the present image. Not valid if a value is not finite.
    [[nodiscard]] ShakerReading reading(Time time) noexcept;

  private:
    [[nodiscard]] RandomReading random_reading(const proto::RandomRegisters& map) noexcept;
    [[nodiscard]] SweepReading sweep_reading(const proto::SweepRegisters& map) noexcept;

    proto::ShakerRegisters registers_;
    std::vector<RegisterRange> ranges_;
};

/// True if `read` holds what was written; of a bits register only the masked bits count.
[[nodiscard]] bool same_raw(const proto::Register& reg, std::span<const std::uint16_t> written,
                            std::span<const std::uint16_t> read) noexcept;

/// Throws ShakerError naming the key under shaker.registers.
void check_registers(const ShakerSettings& settings);

}  // namespace vibrig::drivers
