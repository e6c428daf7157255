#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace vibrig::proto {

/// A DBC file that cannot be read: "file:line:column: found X, expected Y".
class DbcError : public std::runtime_error {
  public:
    DbcError(const std::string& file, int line, int column, const std::string& what);
    [[nodiscard]] int line() const noexcept { return line_; }
    [[nodiscard]] int column() const noexcept { return column_; }

  private:
    int line_;
    int column_;
};

enum class ByteOrder : std::uint8_t { little, big };
enum class ValueType : std::uint8_t { integer, float32, float64 };

struct Signal {
    std::string name;
    std::uint16_t start_bit = 0;  ///< as in the DBC (big endian: the most significant bit)
    std::uint16_t length = 0;     ///< bits, 1 to 64
    ByteOrder order = ByteOrder::little;
    bool is_signed = false;
    ValueType type = ValueType::integer;
    double scale = 1;
    double offset = 0;
    double minimum = 0;  ///< physical; minimum == maximum: no range
    double maximum = 0;
    std::string unit;
    bool is_multiplexor = false;
    std::optional<std::uint32_t>
        multiplex_value;  ///< present only when the multiplexor has this value
    std::map<std::int64_t, std::string> value_names;
    std::optional<std::uint32_t>
        multiplex_last;  ///< end of a range (SG_MUL_VAL_); absent: one value
};

struct Message {
    std::string name;
    std::uint32_t id = 0;  ///< without flags
    bool extended = false;
    std::uint8_t size = 0;  ///< bytes, up to 64
    std::string sender;
    std::optional<std::uint32_t> cycle_time_ms;  ///< GenMsgCycleTime
    std::vector<Signal> signals;
    [[nodiscard]] const Signal* find(std::string_view signal_name) const noexcept;
    [[nodiscard]] const Signal* multiplexor() const noexcept;
};

/// A DBC file in memory.
struct Dbc {
    std::vector<Message> messages;
    [[nodiscard]] const Message* find(std::string_view message_name) const noexcept;
    [[nodiscard]] const Message* find(std::uint32_t id, bool extended) const noexcept;
};

/// Throws DbcError.
[[nodiscard]] Dbc parse_dbc(std::string_view text, const std::string& file_name);
/// Throws DbcError, also when the file cannot be read.
[[nodiscard]] Dbc read_dbc(const std::string& path);
/// The text of proto/rig.dbc, built into the library.
[[nodiscard]] std::string_view rig_dbc_text() noexcept;

/// The raw bits of a signal, sign-extended where it is signed. Payload shorter than the signal
/// needs: nullopt.
[[nodiscard]] std::optional<std::int64_t> decode_raw(
    const Signal& signal, std::span<const std::uint8_t> payload) noexcept;
/// Physical value, raw * scale + offset (unsigned 64-bit and floats included). Shorter payload:
/// nullopt.
[[nodiscard]] std::optional<double> decode(const Signal& signal,
                                           std::span<const std::uint8_t> payload) noexcept;
/// Writes the nearest raw value; clamps to what the bits hold. False if the payload is too short or
/// value not finite.
[[nodiscard]] bool encode(const Signal& signal, double value,
                          std::span<std::uint8_t> payload) noexcept;
[[nodiscard]] bool encode_raw(const Signal& signal, std::uint64_t raw,
                              std::span<std::uint8_t> payload) noexcept;
/// True if the signal is in this frame: not multiplexed, or its multiplexor has its value.
[[nodiscard]] bool present(const Message& message, const Signal& signal,
                           std::span<const std::uint8_t> payload) noexcept;
/// True if a range is declared and the value lies outside it, or the value is not finite.
[[nodiscard]] bool out_of_range(const Signal& signal, double value) noexcept;

}  // namespace vibrig::proto
