#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "daemon/configuration/configuration.hpp"
#include "proto/dbc.hpp"

namespace vibrig::commission {

/// Bits of "Message.Signal"; 0: the DBC has none of that name.
[[nodiscard]] int length_of(const proto::Dbc& dbc, const std::string& name);

/// A bit that somebody changes once, and back: of it alone is known that it says what it says.
class BitWatch {
  public:
    /// "Message.Signal". Throws std::invalid_argument: the DBC has none of that name.
    BitWatch(const proto::Dbc& dbc, const std::string& name);

    void add(std::uint32_t id, bool extended, std::span<const std::uint8_t> data);
    [[nodiscard]] bool heard() const noexcept { return heard_; }
    [[nodiscard]] bool changed() const noexcept { return changed_; }
    [[nodiscard]] bool came_back() const noexcept { return came_back_; }
    [[nodiscard]] int before() const noexcept { return before_; }

  private:
    const proto::Message* message_ = nullptr;
    const proto::Signal* signal_ = nullptr;
    bool heard_ = false, changed_ = false, came_back_ = false;
    int before_ = 0;
};

/// How a bit stands.
struct BitProof {
    std::string name;
    bool by_hand = false;         ///< it was changed and came back; else persons say so
    std::vector<std::string> by;  ///< who did; who confirm it, two
    int rests_at = 0;             ///< what it read before
};

/// Two different names, of "A. Person, B. Person"; empty: it is no such text.
[[nodiscard]] std::vector<std::string> two_names(const std::string& text);

/// What is kept beside the record: commission.folder, bus_bits.json.
class BitBook {
  public:
    using Json = nlohmann::ordered_json;

    /// The book of a DBC, by the SHA-256 of its file: bits of another one do not count.
    BitBook(const std::string& folder, std::string dbc_sha256);
    /// The book of the configuration's DBC. Throws std::runtime_error that names the file: it
    /// cannot be read.
    explicit BitBook(const configuration::Configuration& c);
    /// In place of what was said of these bits. Throws std::runtime_error that names the file.
    void keep(const std::vector<BitProof>& bits, std::int64_t utc_ns);
    /// As it is kept, by the bits' names; empty: nothing of this DBC.
    [[nodiscard]] Json bits() const;

  private:
    std::string path_, dbc_sha256_;
};

/// Valid bits, loop closed, gyros at speed, ready and fault of the configuration, "Message.Signal",
/// of which nobody knows whether they say what they are called.
[[nodiscard]] std::vector<std::string> unproven_bits(const configuration::Loaded& loaded,
                                                     const proto::Dbc& dbc);
/// What two persons confirm of bits that never changed, beside those that did.
[[nodiscard]] BitBook::Json with_confirmed(BitBook::Json bits, const BitBook::Json& names,
                                           const std::vector<std::string>& by, std::int64_t utc_ns);

}  // namespace vibrig::commission
