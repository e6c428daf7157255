#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "proto/register_map.hpp"
#include "tests/plant/shaker_controller.hpp"

namespace vibrig::plant {

/// [shaker.registers] of a TOML file, with the defaults of a configuration's. Throws PlantError.
[[nodiscard]] proto::ShakerRegisters read_map(const std::string& path);

/// The controller behind registers that are not its own: other addresses, types, word orders and
/// scales. Between and behind them lie registers that mean nothing, which can be read and not
/// written.
class ForeignMap {
  public:
    explicit ForeignMap(const proto::ShakerRegisters& map);

    [[nodiscard]] std::size_t size(proto::RegisterTable table) const noexcept {
        return table == proto::RegisterTable::holding ? holding_.size() : input_.size();
    }
    /// As they are to be read now.
    [[nodiscard]] std::span<const std::uint16_t> holding(const ShakerController& shaker);
    [[nodiscard]] std::span<const std::uint16_t> input(const ShakerController& shaker);
    /// Words from the wire, all or nothing.
    [[nodiscard]] ShakerController::Answer write(ShakerController& shaker, std::size_t address,
                                                 std::span<const std::uint16_t> values);

  private:
    struct Role {
        proto::Register own, foreign;
        std::vector<std::uint16_t> written;  ///< as last written; empty: nothing was
    };
    [[nodiscard]] const Role* role_at(std::size_t address) const noexcept;
    void show(Role& role, std::span<const std::uint16_t> own, std::vector<std::uint16_t>& image);

    std::vector<Role> written_, seen_;
    std::vector<std::uint16_t> holding_, input_;
};

}  // namespace vibrig::plant
