#include "daemon/tool/recordings/export_csv.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <iostream>
#include <stdexcept>
#include <vector>

#include "daemon/configuration/configuration.hpp"
#include "daemon/record/replay.hpp"
#include "daemon/report/paperwork.hpp"
#include "estimator/filter/angles.hpp"
#include "proto/recording_csv.hpp"

namespace vibrig::tool {

namespace {

using estimator::kDegPerRad;

/// Hz at a time, by the sweep's readings: between two of them its logarithm goes straight.
double swept_hz(const std::vector<std::array<double, 2>>& readings, double time_s) {
    const auto after = std::ranges::lower_bound(readings, time_s, {},
                                                [](const auto& reading) { return reading[0]; });
    if (after == readings.end()) return readings.empty() ? 0 : readings.back()[1];
    if (after == readings.begin()) return after->at(1);
    const auto& [from_s, from_hz] = *(after - 1);
    const auto& [to_s, to_hz] = *after;
    return from_hz * std::pow(to_hz / from_hz, (time_s - from_s) / (to_s - from_s));
}

/// What the rows of a dwell say beside angles and forces.
class DwellColumns {
  public:
    explicit DwellColumns(const record::Campaign& campaign) : campaign_(campaign) {
        const auto any = [&campaign](auto has) {
            return std::ranges::any_of(campaign.orders, has);
        };
        random_ = any([](const record::Order& order) { return order.random.mean_square_g2 > 0; });
        stated_ = random_ || any([](const record::Order& order) {
                      return order.frequency_hz > 0 || order.sweep.any();
                  });
        if (stated_) rig_ = report::configuration_of(campaign);
    }

    void begin(const record::RecordedDwell& dwell) {
        order_ = dwell.order;
        swept_.clear();
        if (order_->sweep.any())
            swept_ = record::sweep_of(campaign_, estimator::Settings{}, dwell).readings();
        profile_ = order_->random.mean_square_g2 > 0 ? place_of(order_->random.profile) : 0;
    }
    void put(proto::RecordingRow& row, double since_begin_s) const {
        row.run = order_->run;
        row.position = order_->position;
        row.held_out = order_->held_out;
        if (!stated_) return;
        row.profile = static_cast<std::uint16_t>(profile_);
        row.level_db = profile_ > 0 ? order_->random.level_db : 0;
        row.frequency_hz = order_->sweep.any()                    ? swept_hz(swept_, since_begin_s)
                           : profile_ > 0 || order_->table_g <= 0 ? 0
                           : order_->frequency_hz > 0             ? order_->frequency_hz
                                                                  : rig_.estimator.frequency_hz;
    }
    [[nodiscard]] const std::vector<std::string>& profiles() const { return profiles_; }

  private:
    /// From 1, by its name in the configuration; by its number where that is none for CSV.
    std::size_t place_of(int number) {
        std::string name = std::to_string(number);
        for (const auto& one : rig_.profiles) {
            if (one.number == number &&
                one.profile.name.find_first_of("\"\n\r") == std::string::npos)
                name = one.profile.name;
        }
        const auto known = std::ranges::find(profiles_, name);
        const auto place = known - profiles_.begin();
        if (known == profiles_.end()) profiles_.push_back(name);
        return static_cast<std::size_t>(place) + 1;
    }

    const record::Campaign& campaign_;
    configuration::Configuration rig_;
    bool random_ = false, stated_ = false;  ///< what shook is said
    const record::Order* order_ = nullptr;
    std::vector<std::array<double, 2>> swept_;
    std::size_t profile_ = 0;
    std::vector<std::string> profiles_;
};

}  // namespace

void export_csv(const record::Campaign& campaign, const std::string& path) {
    std::vector<proto::RecordingRow> rows;
    std::size_t left_out = 0;
    DwellColumns columns(campaign);
    const auto dwells = record::recorded_dwells(campaign);
    // One clock where all of them are on it: how long a bias walked is stated, too.
    const bool common_clock = std::ranges::all_of(
        dwells, [](const auto& dwell) { return std::isfinite(dwell.order->begin_s); });
    for (const auto& dwell : dwells) {
        columns.begin(dwell);
        const double begin_s = common_clock ? dwell.order->begin_s : 0;
        for (std::size_t i = dwell.first; i < dwell.first + dwell.count; ++i) {
            const auto& sample = campaign.samples[i];
            if (!record::angles_known(sample) || !record::force_known(sample)) {
                ++left_out;
                continue;
            }
            proto::RecordingRow row;
            const double since_s = drivers::to_seconds(sample.time - dwell.order->from);
            row.time_s = begin_s + since_s;
            for (std::size_t k = 0; k < 3; ++k) {
                row.angle_deg[k] = sample.angle[k] * kDegPerRad;
                row.force_g[k] = sample.force[k] - dwell.order->zero_g[k];
            }
            columns.put(row, since_s);
            rows.push_back(row);
        }
    }
    if (rows.empty())
        throw std::runtime_error(campaign.path +
                                 ": found no good sample in a dwell, expected some");
    proto::write_recording(path, rows, campaign.head.simulated, columns.profiles());
    std::cerr << path << ": " << rows.size() << " samples of " << dwells.size() << " dwells";
    if (left_out > 0) std::cerr << "; " << left_out << " without good quality are left out";
    const auto reported = std::ranges::count_if(campaign.orders, [](const record::Order& order) {
        return order.played && order.played->word == estimator::PlayedRandom::Word::good;
    });
    if (reported > 0)
        std::cerr << "; of " << reported
                  << " random dwells the controller's PSD is not in it: their profiles' stand";
    std::cerr << '\n';
}

}  // namespace vibrig::tool
