#include "daemon/configuration/schema.hpp"

namespace vibrig::configuration {

const std::vector<Key>& schema() {
    static const std::vector<Key> keys = [] {
        std::vector<Key> all;
        add_identification_keys(all);
        add_spectrum_keys(all);
        add_uncertainty_keys(all);
        add_campaign_keys(all);
        add_shaker_keys(all);
        add_bus_keys(all);
        add_guard_keys(all);
        add_daemon_keys(all);
        add_interlock_keys(all);
        add_paperwork_keys(all);
        return all;
    }();
    return keys;
}

}  // namespace vibrig::configuration
