#include "daemon/serve/history.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <stdexcept>

namespace vibrig::serve {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

bool is_active(CampaignState state) {
    switch (state) {
        case CampaignState::idle:
        case CampaignState::armed:
        case CampaignState::finished:
        case CampaignState::aborted:
        case CampaignState::tripped:
        case CampaignState::checking:
        case CampaignState::commissioning:
            return false;
        default:
            return true;
    }
}

/// In the order of History::kChannels; not finite: there is none.
std::array<double, History::kChannels.size()> values_of(
    const StatusData& s, const std::array<double, estimator::kParameters>& target) {
    std::array<double, 3> largest{kNone, kNone, kNone};  // bias, linear, quadratic
    for (std::size_t i = 0; i < estimator::kParameters; ++i) {
        if (!s.estimate.observable[i] || !(target[i] > 0)) continue;
        double& of_order = largest[estimator::order_of(i)];
        of_order = std::fmax(of_order, s.estimate.sigma[i] / target[i]);
    }
    const auto flagged = std::ranges::count_if(s.dwells, [](const auto& d) { return d.flagged; });
    const bool filters = s.estimate.samples > 0;
    return {s.shaker.valid ? s.shaker.measured_g : kNone,
            s.command_table_g,
            s.shaker.valid ? s.shaker.amplitude_g : kNone,
            s.shaker.valid ? s.shaker.frequency_hz : kNone,
            s.platform_state() == ChannelState::good ? s.platform.temperature_c : kNone,
            filters ? s.estimate.innovation_arcsec[0] : kNone,
            filters ? s.estimate.innovation_arcsec[1] : kNone,
            filters ? s.estimate.innovation_arcsec[2] : kNone,
            filters ? s.estimate.nis_per_dof : kNone,
            static_cast<double>(s.estimate.rejected),
            static_cast<double>(flagged),
            s.progress,
            largest[0],
            largest[1],
            largest[2]};
}

}  // namespace

void History::Span::add(const Span& other) {
    if (other.count == 0) return;
    least = count == 0 ? other.least : std::min(least, other.least);
    greatest = count == 0 ? other.greatest : std::max(greatest, other.greatest);
    sum += other.sum;
    count += other.count;
}

void History::expect(const PlanData& plan) {
    for (std::size_t i = 0; i < target_.size(); ++i)
        target_[i] = plan.target[i] > 0 ? plan.target[i] : plan.sigma[i];
}

void History::add(const StatusData& status) {
    const double now_s = drivers::to_seconds(status.time);
    const bool active = is_active(status.state);
    const bool begins = active && !was_active_ && status.dwells.empty();
    was_active_ = active;
    if (begins || steps_.empty() || now_s < newest_s_) {
        steps_.clear();
        // All that it will ever have, now: it would come by pieces, when depends on how often
        // somebody looked.
        steps_.resize(kMostSteps);
        steps_.clear();
        begin_s_ = now_s;
        step_s_ = kFirstStep_s;
    }
    newest_s_ = now_s;
    while ((now_s - begin_s_) / step_s_ >= static_cast<double>(kMostSteps)) {
        for (std::size_t i = 0; i < steps_.size(); ++i) {
            Step both = steps_[i];
            if (i % 2 == 0) {
                steps_[i / 2] = both;
            } else {
                for (std::size_t c = 0; c < both.size(); ++c) steps_[i / 2][c].add(both[c]);
            }
        }
        steps_.resize((steps_.size() + 1) / 2);
        step_s_ *= 2;
    }
    const auto at = static_cast<std::size_t>((now_s - begin_s_) / step_s_);
    if (steps_.size() <= at) steps_.resize(at + 1);
    const auto values = values_of(status, target_);
    for (std::size_t c = 0; c < values.size(); ++c)
        if (std::isfinite(values[c])) steps_[at][c].add({values[c], values[c], values[c], 1});
}

std::string History::json(std::string_view channels, double from_s) const {
    std::vector<std::size_t> wanted;
    std::string known;
    for (const Channel& channel : kChannels)
        known += (known.empty() ? "" : ", ") + std::string(channel.name);
    while (!channels.empty()) {
        const std::string_view name = channels.substr(0, channels.find(','));
        channels.remove_prefix(std::min(name.size() + 1, channels.size()));
        const auto found =
            std::ranges::find_if(kChannels, [&](const Channel& c) { return name == c.name; });
        if (found == kChannels.end() || wanted.size() == kChannels.size())
            throw std::invalid_argument("channel: expected one or more, with commas, of " + known);
        wanted.push_back(static_cast<std::size_t>(found - kChannels.begin()));
    }
    if (wanted.empty()) throw std::invalid_argument("channel: missing, expected of " + known);
    nlohmann::ordered_json answer{{"step_s", step_s_}, {"time_s", nlohmann::ordered_json::array()}};
    auto& curves = answer["channels"] = nlohmann::ordered_json::array();
    for (const std::size_t c : wanted)
        curves.push_back({{"name", kChannels[c].name},
                          {"unit", kChannels[c].unit},
                          {"min", nlohmann::ordered_json::array()},
                          {"max", nlohmann::ordered_json::array()},
                          {"mean", nlohmann::ordered_json::array()}});
    for (std::size_t i = 0; i < steps_.size(); ++i) {
        const double begin_s = begin_s_ + static_cast<double>(i) * step_s_;
        const bool any =
            std::ranges::any_of(wanted, [&](std::size_t c) { return steps_[i][c].count > 0; });
        if (!any || begin_s + step_s_ <= from_s) continue;
        answer["time_s"].push_back(std::min(begin_s + step_s_ / 2, newest_s_));
        for (std::size_t k = 0; k < wanted.size(); ++k) {
            const Span& span = steps_[i][wanted[k]];
            const bool there = span.count > 0;
            const auto value = [there](double x) {
                return there ? nlohmann::ordered_json(x) : nlohmann::ordered_json();
            };
            curves[k]["min"].push_back(value(span.least));
            curves[k]["max"].push_back(value(span.greatest));
            curves[k]["mean"].push_back(
                value(there ? span.sum / static_cast<double>(span.count) : 0));
        }
    }
    return answer.dump();
}

}  // namespace vibrig::serve
