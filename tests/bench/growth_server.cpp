#include "tests/bench/growth_server.hpp"

#include <sys/resource.h>

#include <atomic>
#include <cstdio>
#include <string>
#include <vector>

#include "daemon/serve/status_server.hpp"
#include "daemon/status/source.hpp"
#include "estimator/identification/result.hpp"

namespace vibrig::bench {
namespace {

constexpr std::size_t kDwells = 28;
constexpr std::size_t kConnections = 2000;

/// Of a campaign; another one each time it is asked for.
class Campaign : public StatusSource {
  public:
    [[nodiscard]] StatusData status() const override {
        StatusData status;
        status.state = CampaignState::recording;
        status.dwells.resize(kDwells);
        status.time = ++asked_ * drivers::kSecond;
        return status;
    }
    [[nodiscard]] std::vector<EventRecord> events(std::uint64_t /*after_id*/,
                                                  std::size_t /*at_most*/) const override {
        return {};
    }
    [[nodiscard]] estimator::Result result() const override { return {}; }
    [[nodiscard]] std::string effective_configuration() const override { return {}; }
    CommandReply command(const CommandRequest& /*request*/) override { return {}; }

  private:
    mutable std::atomic<drivers::Time> asked_{0};
};

}  // namespace

void serve_status() {
    rlimit files{};
    ::getrlimit(RLIMIT_NOFILE, &files);
    files.rlim_cur = files.rlim_max;
    ::setrlimit(RLIMIT_NOFILE, &files);
    Campaign campaign;
    serve::ServerSettings settings;
    settings.page = "127.0.0.1:0";
    settings.limits.connections = kConnections;
    serve::StatusServer server(campaign, settings);
    server.answer();
    std::puts(server.page_address().c_str());
    std::fflush(stdout);
    while (std::getchar() != EOF) {
    }
}

}  // namespace vibrig::bench
