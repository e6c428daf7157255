#pragma once

#include <string>
#include <vector>

#include "daemon/archive/index.hpp"
#include "estimator/uncertainty/population.hpp"

namespace vibrig::archive {

/// Older campaigns of a type are not asked for: so many of the newest tell enough.
inline constexpr std::size_t kNewestOfType = 2000;

/// The campaigns of each unit of a type that say something about others: valid or doubtful, all
/// coefficients determined, on simulated rigs or on real ones.
struct TypeCampaigns {
    std::vector<std::vector<estimator::uncertainty::Found>> units;
    std::size_t campaigns = 0, left_out = 0;
    std::string vibration;               ///< of which the quadratic coefficients are, in words
    std::size_t of_other_vibration = 0;  ///< left out for that
};

/// `without`: this unit's are no evidence about itself. Campaigns of one vibration: of the same as
/// `like` has, and where it has none, as the newest.
[[nodiscard]] TypeCampaigns campaigns_of_type(Index& index, const std::string& type,
                                              const std::string& without, bool simulated,
                                              const Coefficients& like, const std::string& folder);
[[nodiscard]] TypeCampaigns by_unit(const std::vector<Entry>& campaigns, const std::string& without,
                                    bool simulated, const Coefficients& like = {});

}  // namespace vibrig::archive
