#pragma once

#include <string>
#include <vector>

#include "daemon/campaign/rig_frame.hpp"
#include "daemon/campaign/settings.hpp"
#include "daemon/interlock/mean_motion.hpp"

namespace vibrig::campaign {

/// The opening check: before anything shakes the configuration is held against free drift and
/// gravity at rest (docs/commissioning.md). Control thread only.
class OpeningCheck {
  public:
    explicit OpeningCheck(const Settings& settings);

    void begin();
    void end() { stops_.clear(), under_way_ = false; }
    [[nodiscard]] bool under_way() const { return under_way_; }
    /// "opening check, position 2 of 5".
    [[nodiscard]] std::string words() const;
    [[nodiscard]] const Vector& target_deg() const { return here().position_deg; }
    /// The gimbals are let go there.
    [[nodiscard]] bool drifts() const { return here().drifts; }
    /// In position, and let go if it is to drift.
    void arrived(drivers::Time now);
    /// A second that began before the gimbals had come to rest, or is known, is left out.
    void add(const rt::MeanMotion& second);
    [[nodiscard]] bool measured() const;
    /// It takes longer than it may.
    [[nodiscard]] bool overdue(drivers::Time now) const;
    /// On to the next position; false: that was the last one.
    [[nodiscard]] bool next();

    struct Verdict {
        std::string refused, warned;  ///< empty: nothing is
        /// Keys that alone, changed, would explain what is refused, or else warned of, best
        /// first.
        std::vector<std::string> suspects;
        std::string apart;  ///< which position tells the first two of them apart; empty: no matter
        /// "suspects: a; b"; "no single key explains it".
        [[nodiscard]] std::string suspects_text() const;
    };
    /// `zero_g`: of the accelerometers, raw, on top of the configuration's.
    [[nodiscard]] Verdict judge(const Vector& zero_g) const;
    [[nodiscard]] double expected_s() const;

  private:
    struct Stood {
        OpeningStop stop;
        std::vector<rt::MeanMotion> seconds;
    };
    [[nodiscard]] const OpeningStop& here() const { return settings_.opening[at_]; }
    [[nodiscard]] std::size_t wanted() const;

    Settings settings_;
    bool under_way_ = false;
    std::size_t at_ = 0;
    drivers::Time since_ = 0;
    std::vector<Stood> stops_;
};

}  // namespace vibrig::campaign
