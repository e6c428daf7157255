#include "daemon/configuration/schema.hpp"

namespace vibrig::configuration {

const std::vector<Key>& schema() {
    static const std::vector<Key> keys = joined(
        {identification_keys(), spectrum_keys(), uncertainty_keys(), campaign_keys(), shaker_keys(),
         bus_keys(), guard_keys(), daemon_keys(), interlock_keys(), paperwork_keys()});
    return keys;
}

std::vector<Key> joined(std::initializer_list<std::vector<Key>> parts) {
    std::vector<Key> all;
    for (const std::vector<Key>& part : parts) all.insert(all.end(), part.begin(), part.end());
    return all;
}

}  // namespace vibrig::configuration
