#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "daemon/configuration/configuration.hpp"
#include "daemon/study/campaign_record.hpp"
#include "daemon/study/study.hpp"
#include "daemon/study/worker.hpp"

namespace vibrig::study {

/// Orders of the dwells, as places in the list of levels each with all positions: one for each
/// combination of the grid's configuration axes.
using Sequences = std::vector<std::vector<std::size_t>>;

/// Which of them a point of the grid has.
[[nodiscard]] std::size_t combination_of(const Study& study, std::uint64_t point);

/// Checks every value of the grid, and finds the orders. `file` is the study's name in messages.
/// Throws StudyError.
[[nodiscard]] Sequences check_campaigns(const Study& study, const std::string& file);

/// The effective configuration of the first point: keys and values.
using Effective = std::vector<std::pair<std::string, std::string>>;
[[nodiscard]] Effective configuration_of(const Study& study, const std::string& file);

/// Simulates and identifies.
class CampaignWorker final : public Worker {
  public:
    CampaignWorker(const Study& study, const Sequences& sequences);
    ~CampaignWorker() override;
    [[nodiscard]] std::string run(std::uint64_t index) override;

  private:
    struct Point;
    const Point& point_of(std::uint64_t index);

    const Study& study_;
    const Sequences& sequences_;
    std::unique_ptr<Point> point_;
};

/// By the daemon's own reader; what it refuses is reported with the study's places. Throws
/// StudyError.
[[nodiscard]] configuration::Loaded load_settings(const std::vector<Setting>& settings,
                                                  const std::string& file);

/// What a task takes of a processor, roughly.
[[nodiscard]] double expected_task_s(const Study& study, const Sequences& sequences);

/// Sixteen hexadecimal digits that differ where the last bit of a result would: of a tiny campaign
/// on this processor, with this library and compiler.
[[nodiscard]] std::string arithmetic();

}  // namespace vibrig::study
