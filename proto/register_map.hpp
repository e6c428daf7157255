#pragma once

#include <cstdint>
#include <optional>
#include <span>

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

/// What a controller measured of a random vibration at the table, and keeps until the next one: one
/// behind the other Hz and g^2/Hz of so many lines, pairs of floats. Those that are not used are 0
/// at the end.
struct PsdBlock {
    Register first{16, RegisterType::f32, WordOrder::big, RegisterTable::input, Access::read,
                   1};  ///< the scale is that of the densities
    int pairs = 200;
    int attempts = 2;  ///< how often it is tried after a dwell
};

/// Of a controller that plays random vibration by profiles of its own.
struct RandomRegisters {
    Register profile_number{
        9, RegisterType::u16, WordOrder::big, RegisterTable::holding, Access::read_write, 1};
    Register profile_level_db{
        10, RegisterType::i16, WordOrder::big, RegisterTable::holding, Access::read_write,
        0.1};  ///< about the profile
    /// CRC-32 of the profile in force: of hz and g^2/Hz of each breakpoint, big-endian floats.
    Register profile_checksum{
        5, RegisterType::u32, WordOrder::big, RegisterTable::input, Access::read, 1};
    Register measured_g_rms{
        7, RegisterType::u32, WordOrder::big, RegisterTable::input, Access::read, 1e-4};
    /// Low four bits: 0 idle, 1 levelling, 2 at level, 3 aborted; then 1: its abort bands are
    /// armed; the high byte: why it aborted.
    Register control_state{9, RegisterType::u16, WordOrder::big, RegisterTable::input, Access::read,
                           1};
    std::optional<PsdBlock> psd_block{};  ///< none: it is not reported
};

/// Of a controller that goes from one frequency to another by itself, exponentially, and stays
/// there. It begins once the level is reached.
struct SweepRegisters {
    Register from{
        11,  RegisterType::u32, WordOrder::big, RegisterTable::holding, Access::read_write,
        1e-3};  ///< Hz
    Register to{13,  RegisterType::u32, WordOrder::big, RegisterTable::holding, Access::read_write,
                1e-3};  ///< Hz
    Register rate{
        15,  RegisterType::u16, WordOrder::big, RegisterTable::holding, Access::read_write,
        1e-2};  ///< octaves per minute, either way
    Register actual_frequency{
        10,  RegisterType::u32, WordOrder::big, RegisterTable::input, Access::read,
        1e-3};  ///< Hz, where it is
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
    /// 0 sine, 1 random, 2 sweep; of a controller that has one of the two.
    Register mode{8, RegisterType::u16, WordOrder::big, RegisterTable::holding, Access::read_write,
                  1};
    std::optional<RandomRegisters> random;  ///< none: no random vibration
    std::optional<SweepRegisters> sweep;    ///< none: no sweeps
};

[[nodiscard]] double decode(const Register& reg, std::span<const std::uint16_t> words) noexcept;
/// Nearest raw value; false if it does not fit the type or is not finite (words untouched).
[[nodiscard]] bool encode(const Register& reg, double value,
                          std::span<std::uint16_t> words) noexcept;

}  // namespace vibrig::proto
