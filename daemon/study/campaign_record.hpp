#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "estimator/identification/identification.hpp"

namespace vibrig::study {

/// What is kept of a simulated campaign.
struct CampaignRecord {
    using Numbers = std::array<double, estimator::kParameters>;

    std::string failed;  ///< empty: it did not
    Numbers error{}, u_a{},
        u{};  ///< against the truth's mean over the samples; NaN: not determined
    double nees_a = 0, nees = 0;  ///< with the covariance of noise alone, and of all; NaN: none
    double hours = 0;             ///< that the campaign takes on the rig
    std::uint8_t verdict = 0;     ///< as estimator::uncertainty::Level
    std::string reasons = {};     ///< codes with commas between, the strongest first
};

/// Record of a task that has failed; cut to a readable length, always UTF-8.
[[nodiscard]] std::string failed_record(std::string why);
[[nodiscard]] std::string encode(const CampaignRecord& record);
/// Throws std::runtime_error.
[[nodiscard]] CampaignRecord decode(std::string_view bytes);

}  // namespace vibrig::study
