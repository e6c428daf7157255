#include "daemon/study/rig_keys.hpp"

#include <array>
#include <optional>

#include "tests/plant/truth_fields.hpp"

namespace vibrig::study {

namespace {

struct Collector {
    std::map<std::string, RigKey>& keys;

    static void shape(const double&, RigKey& key) { key.number = true; }
    static void shape(const int&, RigKey& key) { key.number = key.whole = true; }
    template <typename T>
    static void shape(const std::optional<T>&, RigKey& key) {
        shape(T{}, key);
    }
    template <typename T, std::size_t N>
    static void shape(const std::array<T, N>& list, RigKey& key) {
        key.elements.push_back(N);
        shape(list[0], key);
    }
    template <typename T>
    static void shape(const T&, RigKey&) {}

    template <typename T, typename Low>
    void operator()(const char* section, const char* name, const T& value, Low low, Low high) {
        RigKey key;
        shape(value, key);
        key.low = static_cast<double>(low);
        key.high = static_cast<double>(high);
        keys.emplace(std::string(section) + "." + name, key);
    }
};

std::map<std::string, RigKey> all_keys() {
    std::map<std::string, RigKey> keys;
    const plant::Truth truth;
    plant::for_each_field(truth, Collector{keys});
    for (std::size_t gyro = 0; gyro < 3; ++gyro) {
        for (std::size_t term = 0; term < plant::kTerms; ++term)
            keys.emplace("coefficients." + plant::coefficient_name(gyro, term),
                         RigKey{true, false, {}, -1000, 1000});
    }
    keys.emplace(kMisalignment, RigKey{true, false, {6}, -36e3, 36e3});
    return keys;
}

}  // namespace

const std::map<std::string, RigKey>& rig_keys() {
    static const std::map<std::string, RigKey> keys = all_keys();
    return keys;
}

}  // namespace vibrig::study
