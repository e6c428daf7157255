#include "tests/plant/foreign_map.hpp"

#include <toml++/toml.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string_view>

#include "tests/plant/truth.hpp"

namespace vibrig::plant {

using proto::Register;
using proto::RegisterTable;
using proto::RegisterType;
using Answer = ShakerController::Answer;

namespace {

constexpr std::size_t kBehind = 8;  // registers that mean nothing, behind the last one

std::map<std::string, Register*, std::less<>> roles_of(proto::ShakerRegisters& map) {
    return {{"frequency", &map.frequency},
            {"amplitude", &map.amplitude},
            {"ramp_time", &map.ramp_time},
            {"run", &map.run},
            {"watchdog", &*map.watchdog},
            {"watchdog_timeout", &map.watchdog_timeout},
            {"state", &map.state},
            {"fault", &map.fault},
            {"emergency_stop", &map.emergency_stop},
            {"measured_amplitude", &map.measured_amplitude}};
}

class MapReader {
  public:
    explicit MapReader(std::string file) : file_(std::move(file)) {}

    void read(const std::string& role, const toml::node& node, Register& reg) const {
        const toml::table* table = node.as_table();
        if (table == nullptr) fail(role, "expected a table with address, type, ...");
        if (!table->contains("address") || !table->contains("type"))
            fail(role, "expected address and type");
        for (const auto& [key, value] : *table) {
            const std::string name(key.str()), at = role + "." + name;
            if (name == "address") {
                reg.address = whole(at, value);
            } else if (name == "mask") {
                reg.mask = whole(at, value);
            } else if (name == "type") {
                reg.type =
                    one_of<RegisterType>(at, value, {"u16", "i16", "u32", "i32", "f32", "bits"});
            } else if (name == "word_order") {
                reg.order = one_of<proto::WordOrder>(at, value, {"big", "little"});
            } else if (name == "table") {
                reg.table = one_of<RegisterTable>(at, value, {"holding", "input"});
            } else if (name == "scale") {
                reg.scale = value.value<double>().value_or(0);
                if (!(reg.scale > 0) || !std::isfinite(reg.scale)) fail(at, "expected above 0");
            } else {
                fail(at, "unknown, expected address, type, word_order, table, scale or mask");
            }
        }
    }
    [[noreturn]] void fail(const std::string& key, const std::string& what) const {
        throw PlantError(file_ + ": " + key + ": " + what);
    }

  private:
    [[nodiscard]] std::uint16_t whole(const std::string& key, const toml::node& node) const {
        const auto value = node.value<std::int64_t>().value_or(-1);
        if (value < 0 || value > 65535) fail(key, "expected a whole number from 0 to 65535");
        return static_cast<std::uint16_t>(value);
    }
    template <class Word>
    [[nodiscard]] Word one_of(const std::string& key, const toml::node& node,
                              std::initializer_list<std::string_view> words) const {
        const auto text = node.value<std::string_view>().value_or("");
        const auto* const at = std::ranges::find(words, text);
        std::string all;
        for (const auto word : words) all += (all.empty() ? "" : ", ") + std::string(word);
        if (at == words.end()) fail(key, "expected one of " + all);
        return static_cast<Word>(at - words.begin());
    }

    std::string file_;
};

}  // namespace

proto::ShakerRegisters read_map(const std::string& path) {
    toml::table file;
    try {
        file = toml::parse_file(path);
    } catch (const toml::parse_error& error) {
        throw PlantError(path + ": " + std::string(error.description()) +
                         ", expected [shaker.registers] (TOML)");
    }
    const toml::table* registers = file["shaker"]["registers"].as_table();
    const MapReader reader(path);
    if (registers == nullptr) reader.fail("shaker.registers", "missing");
    proto::ShakerRegisters map;
    const auto roles = roles_of(map);
    for (const auto& [name, reg] : roles) {
        const std::string key = "shaker.registers." + name;
        const toml::node* node = registers->get(name);
        if (node == nullptr) reader.fail(key, "missing");
        reader.read(key, *node, *reg);
    }
    for (const auto& [key, value] : *registers)
        if (!roles.contains(key.str()))
            reader.fail("shaker.registers." + std::string(key.str()), "unknown");
    return map;
}

ForeignMap::ForeignMap(const proto::ShakerRegisters& map) {
    proto::ShakerRegisters own_map, foreign_map = map;
    auto own = roles_of(own_map), foreign = roles_of(foreign_map);
    std::array<std::size_t, 2> last{};
    for (const auto& [name, reg] : own) {
        const Register& to = *foreign[name];
        (reg->table == RegisterTable::holding ? written_ : seen_).push_back({*reg, to, {}});
        auto& end = last[static_cast<std::size_t>(to.table)];
        end = std::max(end, to.address + to.words());
    }
    holding_.resize(last[0] + kBehind);
    input_.resize(last[1] + kBehind);
    for (auto* image : {&holding_, &input_})
        for (std::size_t i = 0; i < image->size(); ++i)
            (*image)[i] = static_cast<std::uint16_t>(37 * (i + 1) % 9001);
}

void ForeignMap::show(Role& role, std::span<const std::uint16_t> own,
                      std::vector<std::uint16_t>& image) {
    const auto at = std::span(image).subspan(role.foreign.address, role.foreign.words());
    const auto now = own.subspan(role.own.address, role.own.words());
    std::array<std::uint16_t, 2> words{};
    const auto as_written = std::span(words).first(role.own.words());
    // Its own registers may be coarser: what was written is what is read back.
    if (!role.written.empty() &&
        proto::encode(role.own, proto::decode(role.foreign, role.written), as_written) &&
        std::ranges::equal(as_written, now)) {
        std::ranges::copy(role.written, at.begin());
        return;
    }
    role.written.clear();
    // A value that the foreign register cannot hold stays what it was, as with a real one.
    static_cast<void>(proto::encode(role.foreign, proto::decode(role.own, now), at));
}

std::span<const std::uint16_t> ForeignMap::holding(const ShakerController& shaker) {
    const auto input = shaker.input();
    for (Role& role : written_)
        if (role.foreign.table == RegisterTable::holding) show(role, shaker.holding(), holding_);
    for (Role& role : seen_)
        if (role.foreign.table == RegisterTable::holding) show(role, input, holding_);
    return holding_;
}

std::span<const std::uint16_t> ForeignMap::input(const ShakerController& shaker) {
    const auto input = shaker.input();
    for (Role& role : written_)
        if (role.foreign.table == RegisterTable::input) show(role, shaker.holding(), input_);
    for (Role& role : seen_)
        if (role.foreign.table == RegisterTable::input) show(role, input, input_);
    return input_;
}

/// That may be written.
const ForeignMap::Role* ForeignMap::role_at(std::size_t address) const noexcept {
    for (const Role& role : written_)
        if (role.foreign.table == RegisterTable::holding && address >= role.foreign.address &&
            address < role.foreign.address + role.foreign.words())
            return &role;
    return nullptr;
}

Answer ForeignMap::write(ShakerController& shaker, std::size_t address,
                         std::span<const std::uint16_t> values) {
    for (std::size_t i = 0; i < values.size(); ++i)
        if (role_at(address + i) == nullptr) return Answer::illegal_address;
    if (values.empty()) return Answer::illegal_address;
    auto next = std::vector<std::uint16_t>(holding(shaker).begin(), holding(shaker).end());
    std::ranges::copy(values, next.begin() + static_cast<std::ptrdiff_t>(address));
    // As one request to the controller's own registers, which are next to each other.
    auto own = shaker.holding();
    std::size_t first = own.size(), end = 0;
    std::vector<std::pair<Role*, std::vector<std::uint16_t>>> written;
    for (Role& role : written_) {
        const Register& to = role.foreign;
        if (to.table != RegisterTable::holding || to.address >= address + values.size() ||
            to.address + to.words() <= address)
            continue;
        const auto words = std::span(next).subspan(to.address, to.words());
        const auto at = std::span(own).subspan(role.own.address, role.own.words());
        if (!proto::encode(role.own, proto::decode(to, words), at)) return Answer::illegal_value;
        first = std::min<std::size_t>(first, role.own.address);
        end = std::max(end, role.own.address + role.own.words());
        written.emplace_back(&role, std::vector(words.begin(), words.end()));
    }
    const auto answer = shaker.write(first, std::span(own).subspan(first, end - first));
    if (answer == Answer::accepted)
        for (auto& [role, words] : written) role->written = std::move(words);
    return answer;
}

}  // namespace vibrig::plant
