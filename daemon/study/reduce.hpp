#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "daemon/study/campaign_record.hpp"
#include "daemon/study/folder.hpp"
#include "daemon/study/propagation.hpp"
#include "daemon/study/recordings.hpp"
#include "daemon/study/statistics.hpp"

namespace vibrig::study {

inline constexpr std::size_t kNeesBins = 20;
inline constexpr std::array<int, 3> kCoverages{68, 95, 99};

/// Sums over the runs of one point of the grid, in their order.
class CampaignSums {
  public:
    CampaignSums();
    void add(const CampaignRecord& record);
    [[nodiscard]] nlohmann::ordered_json json() const;

  private:
    /// Sums of errors against one of the two claims.
    struct Claim {
        Sum sigma_squares, z_squares;
        std::array<std::uint64_t, kCoverages.size()> within{};
    };
    struct Coefficient {
        std::uint64_t count = 0;
        Sum error, error_squares;
        Claim noise, all;
    };
    struct Nees {
        std::uint64_t count = 0;
        Sum sum;
        std::array<std::uint64_t, kNeesBins> bins{};
    };
    void add(Nees& nees, double value);
    static void add(Claim& claim, double error, double u);
    [[nodiscard]] static nlohmann::ordered_json json(const Claim& claim, std::uint64_t count);
    [[nodiscard]] static nlohmann::ordered_json json(const Nees& nees);

    std::vector<double> bounds_;
    std::uint64_t runs_ = 0, failed_ = 0;
    std::map<std::string, std::uint64_t> failures_, reasons_;
    std::array<std::uint64_t, 3> verdicts_{};
    Sum hours_;
    std::array<Coefficient, estimator::kParameters> coefficients_;
    Nees nees_noise_, nees_all_;
};

/// Goes through a study's records in their order.
class Reduction {
  public:
    explicit Reduction(const Folder& folder);
    ~Reduction();
    void add(std::uint64_t index, const std::string& bytes);
    /// The result; it holds no time, host or path. `missing` tasks: partial.
    [[nodiscard]] nlohmann::ordered_json result(std::uint64_t missing);

  private:
    void close_point();

    const Folder& folder_;
    std::unique_ptr<nlohmann::ordered_json> points_;
    std::unique_ptr<CampaignSums> sums_;
    RecordingSums recordings_;
    PropagationSums propagation_;
    std::uint64_t point_ = 0, done_ = 0, failed_ = 0;
};

}  // namespace vibrig::study
