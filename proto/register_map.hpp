#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

namespace vibrig::proto {

enum class RegisterType : std::uint8_t { u16, i16, u32, i32, f32, bits };
enum class WordOrder : std::uint8_t { big, little };  ///< big: high word first
enum class RegisterTable : std::uint8_t { holding, input };
enum class Access : std::uint8_t { read, write, read_write };

/// One quantity of the shaker controller in Modbus registers: value = raw * scale.
struct Register {
    std::uint16_t address = 0;  ///< zero-based, as on the wire
    RegisterType type = RegisterType::u16;
    WordOrder order = WordOrder::big;
    RegisterTable table = RegisterTable::holding;
    Access access = Access::read;
    double scale = 1;
    std::uint16_t mask = 0xffff;  ///< bits only: value is 1 if any masked bit is set
    [[nodiscard]] std::size_t words() const noexcept;
};

/// The roles Vibrig knows. The configuration's [shaker.registers] table gives each its Register.
struct ShakerRegisters {
    Register frequency{
        0,   RegisterType::u32, WordOrder::big, RegisterTable::holding, Access::read_write,
        1e-3};  ///< Hz
    Register amplitude{
        2,   RegisterType::u32, WordOrder::big, RegisterTable::holding, Access::read_write,
        1e-4};  ///< g peak at the table
    Register ramp_time{
        4,   RegisterType::u16, WordOrder::big, RegisterTable::holding, Access::read_write,
        1e-2};  ///< s
    Register run{5, RegisterType::u16, WordOrder::big, RegisterTable::holding, Access::read_write,
                 1};  ///< 1 run, 0 stop
    std::optional<Register> watchdog{Register{6, RegisterType::u16, WordOrder::big,
                                              RegisterTable::holding, Access::read_write, 1}};
    Register watchdog_timeout{
        7,   RegisterType::u16, WordOrder::big, RegisterTable::holding, Access::read_write,
        1e-3};  ///< s
    Register state{0, RegisterType::u16, WordOrder::big, RegisterTable::input, Access::read, 1};
    Register fault{1, RegisterType::u16, WordOrder::big, RegisterTable::input, Access::read, 1};
    Register emergency_stop{
        2,     RegisterType::bits, WordOrder::big, RegisterTable::input, Access::read, 1,
        0x0001};  ///< 1: chain open
    Register measured_amplitude{
        3,   RegisterType::u32, WordOrder::big, RegisterTable::input, Access::read,
        1e-4};  ///< g peak at the table
};

[[nodiscard]] double decode(const Register& reg, std::span<const std::uint16_t> words) noexcept;
/// Nearest raw value; false if it does not fit the type or is not finite (words untouched).
[[nodiscard]] bool encode(const Register& reg, double value,
                          std::span<std::uint16_t> words) noexcept;

}  // namespace vibrig::proto
