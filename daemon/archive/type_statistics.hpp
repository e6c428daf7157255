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
};

/// `without`: this unit's are no evidence about itself.
[[nodiscard]] TypeCampaigns campaigns_of_type(Index& index, const std::string& type,
                                              const std::string& without, bool simulated);
[[nodiscard]] TypeCampaigns by_unit(const std::vector<Entry>& campaigns, const std::string& without,
                                    bool simulated);

}  // namespace vibrig::archive
