#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/status/source.hpp"

namespace vibrig::serve {

/// The present campaign as curves, for whoever comes late: least, greatest and mean of each channel
/// in steps of equal length. Bounded: when there are too many steps, two become one. Server thread
/// only.
class History {
  public:
    static constexpr std::size_t kMostSteps = 1200;
    struct Channel {
        const char* name;
        const char* unit;
    };
    static constexpr std::array<Channel, 15> kChannels{{{"measured_g", "g"},
                                                        {"command_g", "g"},
                                                        {"set_point_g", "g"},
                                                        {"frequency_hz", "Hz"},
                                                        {"temperature_c", "degC"},
                                                        {"innovation_x_arcsec", "arcsec"},
                                                        {"innovation_y_arcsec", "arcsec"},
                                                        {"innovation_z_arcsec", "arcsec"},
                                                        {"nis_per_dof", "1"},
                                                        {"rejected_samples", "1"},
                                                        {"flagged_dwells", "1"},
                                                        {"progress", "1"},
                                                        {"sigma_over_target_bias", "1"},
                                                        {"sigma_over_target_linear", "1"},
                                                        {"sigma_over_target_quadratic", "1"}}};

    /// What the standard errors are compared with: the plan's targets, or what it lets expect.
    void expect(const PlanData& plan);

    /// A campaign that begins, or a clock that goes back, begins a new history.
    void add(const StatusData& status);
    /// JSON of the channels named, "a,b", from this moment on (s of the daemon's clock). Throws
    /// std::invalid_argument that names what is not there.
    [[nodiscard]] std::string json(std::string_view channels, double from_s) const;
    [[nodiscard]] std::size_t steps() const noexcept { return steps_.size(); }

  private:
    struct Span {
        double least = 0, greatest = 0, sum = 0;
        std::size_t count = 0;
        void add(const Span& other);
    };
    using Step = std::array<Span, kChannels.size()>;

    static constexpr double kFirstStep_s = 0.5;
    double begin_s_ = 0, step_s_ = kFirstStep_s, newest_s_ = 0;
    bool was_active_ = false;
    std::array<double, estimator::kParameters> target_{};
    std::vector<Step> steps_;
};

}  // namespace vibrig::serve
