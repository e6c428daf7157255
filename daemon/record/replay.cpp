#include "daemon/record/replay.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <chrono>
#include <span>
#include <stdexcept>
#include <thread>
#include <utility>

#include "daemon/dwells/player.hpp"
#include "daemon/record/as_recorded.hpp"
#include "estimator/identification/dwell_row.hpp"

namespace vibrig::record {

using drivers::Time;

namespace {

void take_estimate(const estimator::Identification& identification, Dwell& to) {
    estimator::Estimate estimate;
    identification.solved(estimate);
    to.value = estimate.value;
    to.sigma = estimate.sigma;
    to.observable = estimate.observable;
    to.covariance = identification.covariance();
}

/// One dwell, with the noise levels in force.
void feed_as_it_is(estimator::Identification& identification, const Campaign& campaign,
                   const RecordedDwell& dwell, const OnStep& on_step) {
    const Order& order = *dwell.order;
    dwells::feed(
        identification, order.dwell(), dwell.count,
        [&](std::size_t n) {
            return rt::measurement_of(campaign.samples[dwell.first + n], order.from, order.zero_g);
        },
        dwell.cut_short,
        [&](std::size_t n, const estimator::StepResult& step) {
            if (on_step) on_step(dwell.first + n, step);
        });
}

/// One finished dwell as a recording has it, if there is one; `order`: the newest.
bool take_done(dwells::Player& player, Dwell& dwell, const Order* order) {
    rt::DwellDone done;
    if (!player.take_done(done)) return false;
    dwell.time = player.now();
    if (order != nullptr && order->played) player.book().played(*order->played, done.summary);
    dwell.summary = done.summary;
    dwell.reason = done.summary.reason;
    take_estimate(player.book().identification(), dwell);
    dwell.numbers = numbers_after(player.book().identification(), dwell.summary);
    return true;
}

}  // namespace

void qualify(const Campaign& campaign, std::size_t done, estimator::Result& result) {
    std::vector<std::pair<int, double>> variances;
    const auto dwells = recorded_dwells(campaign);
    for (std::size_t i = campaign.restarted_at; i < dwells.size() && i < done; ++i) {
        const double sigma = dwells[i].order->level_sigma_g;
        if (sigma > 0) variances.emplace_back(dwells[i].order->run, sigma * sigma);
    }
    estimator::widen_amplitudes(result, variances);
    if (!campaign.mark.empty()) result.warnings.push_back("campaign marked: " + campaign.mark);
}

estimator::spectrum::ReadSweep sweep_of(const Campaign& campaign,
                                        const estimator::Settings& settings,
                                        const RecordedDwell& dwell) {
    // Since its level was reached, before the dwell began, to the reading after its end.
    constexpr Time kAround = 60 * drivers::kSecond;
    const Order& order = *dwell.order;
    estimator::spectrum::ReadSweep sweep(settings, order.run, order.position);
    for (const SweptRow& row : campaign.swept) {
        if (row.run == order.run && row.position == order.position &&
            row.time > order.from - kAround && row.time < order.to + kAround)
            sweep.frequency(drivers::to_seconds(row.time - order.from), row.frequency_hz);
    }
    for (std::size_t i = dwell.first; i < dwell.first + dwell.count; ++i)
        sweep.add(rt::measurement_of(campaign.samples[i], order.from, order.zero_g));
    return sweep;
}

bool noise_known(const Campaign& campaign) {
    return std::ranges::all_of(campaign.orders, [](const Order& order) {
        return order.cancel || order.noise.angle_arcsec > 0;
    });
}

void forget_noise(Campaign& campaign) {
    for (Order& order : campaign.orders) order.noise = {};
    campaign.found.reset();
}

void feed(estimator::Identification& identification, const Campaign& campaign,
          const RecordedDwell& dwell, const OnStep& on_step) {
    dwells::use_noise(identification, campaign.found ? campaign.found->levels : dwell.order->noise);
    feed_as_it_is(identification, campaign, dwell, on_step);
}

dwells::Anew anew(const Campaign& campaign, const estimator::Settings& settings,
                  const noise::Found& found, const OnStep& on_step) {
    const auto dwells = recorded_dwells(campaign);
    dwells::Anew out(settings, found, dwells.size());
    for (const RecordedDwell& dwell : dwells)
        feed_as_it_is(out.identification(), campaign, dwell, on_step);
    return out;
}

estimator::Result live_result(const Campaign& campaign, const estimator::Settings& settings) {
    const auto dwells = recorded_dwells(campaign);
    estimator::Identification identification(settings, dwells.size());
    for (const RecordedDwell& dwell : dwells) {
        dwells::use_noise(identification, dwell.order->noise);
        feed_as_it_is(identification, campaign, dwell, {});
    }
    auto result = identification.result();
    qualify(campaign, dwells.size(), result);
    return result;
}

ReplayResult replay(const Campaign& campaign, const estimator::Settings& settings,
                    const ReplayOptions& options) {
    if (!campaign.incomplete.empty()) throw std::runtime_error(campaign.incomplete);
    const auto begin = std::chrono::steady_clock::now();
    ReplayResult out;
    const auto& samples = campaign.samples;
    out.samples = samples.size();
    if (!samples.empty())
        out.recorded_s = drivers::to_seconds(samples.back().time - samples.front().time);
    const bool decide = !noise_known(campaign);
    using Noise = dwells::DwellBook::Noise;
    dwells::Player player(settings, decide ? Noise::decided : Noise::given);
    const auto recorded = recorded_dwells(campaign);
    EstimatesAgain estimates(campaign, recorded);
    std::size_t at = 0;
    bool in_dwell = false;
    const auto push = [&](std::span<const drivers::Sample> some) {
        if (!in_dwell || !estimates.wanted()) return player.push(some);
        for (const auto& sample : some) {
            player.push({&sample, 1});
            estimator::Estimate estimate;
            player.book().identification().estimate(estimate);
            estimates.see(sample.time, estimate);
        }
    };
    const auto play_until = [&](std::size_t end) {
        while (at < end) {
            std::size_t n = std::min(end - at, dwells::Player::kMost);
            if (options.speed > 0) {
                // A tenth of a second of wall time at once.
                const Time step = drivers::from_seconds(0.1 * options.speed);
                while (n > 1 && samples[at + n - 1].time - samples[at].time > step) n = (n + 1) / 2;
                const double due =
                    drivers::to_seconds(samples[at].time - samples.front().time) / options.speed;
                std::this_thread::sleep_until(
                    begin + std::chrono::duration_cast<std::chrono::steady_clock::duration>(
                                std::chrono::duration<double>(due)));
            }
            push(std::span(samples).subspan(at, n));
            at += n;
            if (options.progress) options.progress(at, samples.size());
        }
    };
    const auto note_difference = [&out](const std::string& what) {
        if (!what.empty()) ++out.different;
        if (out.first_difference.empty()) out.first_difference = what;
    };
    const Order* newest = nullptr;
    const auto take = [&] {
        for (Dwell dwell; take_done(player, dwell, newest);) {
            if (out.dwells.size() < campaign.dwells.size()) {
                ++out.compared;
                const Dwell& was = campaign.dwells[out.dwells.size()];
                if (!decide) {
                    dwell.summary.flagged = was.summary.flagged;
                    dwell.reason = was.reason;
                }
                note_difference(dwell_difference(out.dwells.size(), was, dwell));
            }
            if (options.on_dwell) options.on_dwell(dwell);
            out.dwells.push_back(std::move(dwell));
        }
    };
    for (const RecordedDwell& dwell : recorded) {
        play_until(std::max(at, dwell.first));
        newest = dwell.order;
        player.book().use_noise(dwell.order->noise);
        rt::DwellOrder order;
        order.from = dwell.order->from;
        order.to = dwell.order->to;
        order.zero_g = dwell.order->zero_g;
        order.dwell = dwell.order->dwell();
        player.order(order);
        const std::size_t end = dwell.first + dwell.count;
        in_dwell = true;
        play_until(end);
        in_dwell = false;
        if (!dwell.cut_short && end < samples.size() && dwell.count > 0) {
            play_until(end + 1);  // the first sample behind it ends the dwell
        } else {
            rt::DwellOrder cancel;
            cancel.cancel = true;
            player.order(cancel);
        }
        if (dwell.count > 0) estimates.see(player.now(), player.shown());
        take();
    }
    play_until(samples.size());
    take();
    estimates.end();
    note_difference(row_difference(campaign, out.dwells.size()));
    note_difference(level_difference(campaign, recorded));
    out.estimates = estimates.compared();
    out.estimates_different = estimates.different();
    if (out.first_difference.empty()) out.first_difference = estimates.first_difference();
    out.result = player.book().identification().result();
    out.rows = player.book().identification().rows();
    out.means = player.book().identification().means();
    qualify(campaign, out.dwells.size(), out.result);
    out.found = decide ? player.book().noise().found() : campaign.found;
    if (out.found) {
        const dwells::Anew again = anew(campaign, settings, *out.found);
        out.live = std::exchange(out.result, again.result());
        out.rows = again.identification().rows();
        out.means = again.identification().means();
        take_estimate(again.identification(), out.anew.emplace());
        qualify(campaign, out.dwells.size(), out.result);
    }
    out.took_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    return out;
}

}  // namespace vibrig::record
