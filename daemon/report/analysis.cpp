#include "daemon/report/analysis.hpp"

#include <algorithm>
#include <cmath>
#include <future>
#include <numbers>
#include <set>
#include <utility>

#include "daemon/record/shaken.hpp"
#include "daemon/report/paperwork.hpp"
#include "estimator/filter/angles.hpp"
#include "estimator/filter/encoder_angles.hpp"
#include "estimator/identification/crlb.hpp"
#include "estimator/identification/dwell_residual.hpp"

namespace vibrig::report {

using estimator::kParameters;
using record::Campaign;
using record::RecordedDwell;

namespace {

constexpr std::size_t kFolds = 14;
constexpr std::size_t kLags = 40;
constexpr std::size_t kThinned = 600;
constexpr double kBlock_s = 1.0;

/// Between the samples of the first dwell that has any, s; 0: there is none.
double period_of(const Campaign& campaign, const std::vector<RecordedDwell>& dwells) {
    const auto dwell = std::ranges::find_if(dwells, [](const auto& d) { return d.count > 1; });
    if (dwell == dwells.end()) return 0;
    std::vector<double> times_s;
    for (std::size_t i = dwell->first; i < dwell->first + dwell->count; ++i)
        times_s.push_back(drivers::to_seconds(campaign.samples[i].time - dwell->order->from));
    return estimator::median_interval(times_s);
}

/// Means of the good angles of a dwell, second by second; raw encoder angles, not wrapped.
std::vector<estimator::AngleBlock> blocks_of(const Campaign& campaign, const RecordedDwell& dwell) {
    std::vector<estimator::AngleBlock> blocks;
    std::array<double, 3> first{}, sum{};
    double time = 0;
    std::size_t count = 0, number = 0;
    bool begun = false;
    const auto close = [&] {
        if (count == 0) return;
        estimator::AngleBlock block;
        block.number = number;
        block.time_s = time / static_cast<double>(count);
        for (std::size_t k = 0; k < 3; ++k)
            block.angle_rad[k] = first[k] + sum[k] / static_cast<double>(count);
        blocks.push_back(block);
        count = 0;
        time = 0;
        sum = {};
    };
    for (std::size_t i = dwell.first; i < dwell.first + dwell.count; ++i) {
        const auto& sample = campaign.samples[i];
        if (!record::angles_known(sample)) continue;
        const double t = drivers::to_seconds(sample.time - dwell.order->from);
        if (const auto at = static_cast<std::size_t>(std::max(0.0, t / kBlock_s)); at != number) {
            close();
            number = at;
        }
        if (!std::exchange(begun, true)) first = sample.angle;
        for (std::size_t k = 0; k < 3; ++k)
            sum[k] += std::remainder(sample.angle[k] - first[k], 2 * std::numbers::pi);
        time += t;
        ++count;
    }
    close();
    return blocks;
}

struct Line {
    double slope = 0, sigma = 0;
};
/// Least squares; the slope's standard error from white noise `noise` of one point.
Line fit(const std::vector<estimator::AngleBlock>& blocks, const std::vector<double>& y,
         double noise) {
    const auto n = static_cast<double>(y.size());
    double mean_t = 0, mean_y = 0;
    for (std::size_t i = 0; i < y.size(); ++i) {
        mean_t += blocks[i].time_s / n;
        mean_y += y[i] / n;
    }
    double tt = 0, ty = 0;
    for (std::size_t i = 0; i < y.size(); ++i) {
        tt += (blocks[i].time_s - mean_t) * (blocks[i].time_s - mean_t);
        ty += (blocks[i].time_s - mean_t) * (y[i] - mean_y);
    }
    if (!(tt > 0)) return {};
    return {ty / tt, noise / std::sqrt(tt)};
}

/// Coefficients from all positions but those of one fold.
Coefficients without(const Campaign& campaign, const estimator::Settings& settings,
                     const std::vector<RecordedDwell>& dwells, const std::set<int>& left_out) {
    estimator::Identification identification(settings, dwells.size());
    for (const auto& dwell : dwells) {
        if (left_out.contains(dwell.order->position)) continue;
        record::feed(identification, campaign, dwell);
    }
    estimator::Estimate estimate;
    identification.solved(estimate);
    return combined(
        estimator::uncertainty::assess(settings, identification.result()),
        {estimate.value, estimate.sigma, estimate.observable, identification.covariance()});
}

std::vector<HeldOut> judge_fold(const Campaign& campaign, const estimator::Settings& settings,
                                const std::vector<RecordedDwell>& dwells,
                                const record::ReplayResult& replayed,
                                const std::set<int>& left_out) {
    std::vector<HeldOut> judged;
    const Coefficients others = without(campaign, settings, dwells, left_out);
    const estimator::NoiseLevels noise =
        campaign.found ? campaign.found->levels : estimator::noise_levels(settings);
    for (std::size_t d = 0; d < dwells.size() && d < replayed.dwells.size(); ++d) {
        const RecordedDwell& dwell = dwells[d];
        // What is apart is nothing that these coefficients foretell.
        if (apart(settings, *dwell.order) || !left_out.contains(dwell.order->position)) continue;
        const auto blocks = blocks_of(campaign, dwell);
        if (blocks.size() < 10) continue;
        HeldOut out;
        out.run = dwell.order->run;
        out.position = dwell.order->position;
        out.table_g = dwell.order->table_g;
        const auto vibration = replayed.dwells[d].summary.vibration();
        const auto before = estimator::dwell_residual(settings, {}, vibration, blocks);
        const auto after = estimator::dwell_residual(settings, others.value, vibration, blocks);
        std::array<double, 3> middle{};
        for (std::size_t k = 0; k < 3; ++k)
            middle[k] = blocks[blocks.size() / 2].angle_rad[k] * estimator::kDegPerRad;
        const Prediction expected =
            predict(settings, others, estimator::gimbal_deg(settings, middle), vibration);
        const double span_s = blocks.back().time_s - blocks.front().time_s + kBlock_s;
        const double in_block =
            static_cast<double>(dwell.count) / static_cast<double>(blocks.size());
        for (std::size_t k = 0; k < 3; ++k) {
            const double white =
                noise.angle_arcsec * std::sqrt(after.noise_gain[k] / std::max(1.0, in_block));
            const Line line = fit(blocks, after.angle_arcsec[k], white);
            out.before_dph[k] = fit(blocks, before.angle_arcsec[k], white).slope;
            out.after_dph[k] = line.slope;
            // Angle random walk N moves the slope over T by 6/5 of N^2 / T (least squares of a
            // random walk); N in deg/sqrt(h) is 60 arcsec/sqrt(s).
            const double walk = 60 * noise.gyro_random_walk_deg_per_rt_h[k];
            out.sigma_dph[k] = std::sqrt(expected.residual_dph[k] * expected.residual_dph[k] +
                                         line.sigma * line.sigma + 1.2 * walk * walk / span_s);
            out.determined = out.determined && expected.determined[k];
        }
        judged.push_back(out);
    }
    return judged;
}

Innovations innovations_of(const Campaign& campaign, const estimator::Settings& settings,
                           const std::vector<RecordedDwell>& dwells) {
    Innovations out;
    estimator::Identification identification(settings, dwells.size());
    std::array<std::array<double, kLags + 1>, 3> products{};
    std::array<double, kLags + 1> pairs{};
    std::vector<std::array<double, 3>> recent;
    std::size_t total = 0, at = 0;
    for (const auto& dwell : dwells) total += dwell.count;
    const std::size_t every = std::max<std::size_t>(1, total / kThinned);
    const auto take = [&](std::size_t i, const estimator::StepResult& step) {
        const bool shown = at++ % every == 0;
        if (step.outcome != estimator::StepOutcome::used) return recent.clear();
        recent.push_back(step.innovation_arcsec);
        ++out.count;
        const std::size_t lags = std::min(kLags, recent.size() - 1);
        for (std::size_t lag = 0; lag <= lags; ++lag) {
            const auto& other = recent[recent.size() - 1 - lag];
            for (std::size_t k = 0; k < 3; ++k) products[k][lag] += recent.back()[k] * other[k];
            pairs[lag] += 1;
        }
        if (recent.size() > 4 * kLags) recent.erase(recent.begin(), recent.end() - kLags);
        if (!shown) return;
        out.time_s.push_back(
            drivers::to_seconds(campaign.samples[i].time - campaign.samples[0].time));
        for (std::size_t k = 0; k < 3; ++k) out.arcsec[k].push_back(step.innovation_arcsec[k]);
    };
    for (const auto& dwell : dwells) {
        recent.clear();
        record::feed(identification, campaign, dwell, take);
    }
    for (std::size_t k = 0; k < 3 && pairs[0] > 0; ++k) {
        const double variance = products[k][0] / pairs[0];
        out.deviation_arcsec[k] = std::sqrt(variance);
        for (std::size_t lag = 0; lag <= kLags && pairs[lag] > 0 && variance > 0; ++lag)
            out.correlation[k].push_back(products[k][lag] / pairs[lag] / variance);
    }
    return out;
}

/// Mean of the dwells' overlapping Allan variances of the residual rates, with a line taken out.
void allan_of(const Campaign& campaign, const std::vector<RecordedDwell>& dwells, Analysis& out) {
    using namespace estimator::allan;
    for (std::size_t k = 0; k < 3; ++k) {
        std::vector<Point> sum;
        std::vector<double> square, weight;
        for (std::size_t d = 0; d < dwells.size() && d < out.replayed.dwells.size(); ++d) {
            const auto blocks = blocks_of(campaign, dwells[d]);
            if (blocks.size() < 16) continue;
            const auto residual =
                estimator::dwell_residual(out.settings, out.coefficients.value,
                                          out.replayed.dwells[d].summary.vibration(), blocks);
            std::vector<double> rate;  // arcsec/s, which is deg/h
            for (std::size_t i = 1; i < blocks.size(); ++i)
                rate.push_back((residual.angle_arcsec[k][i] - residual.angle_arcsec[k][i - 1]) /
                               (blocks[i].time_s - blocks[i - 1].time_s));
            for (std::size_t m = 1, j = 0; 3 * m <= rate.size(); m *= 2, ++j) {
                // sigma^2 = <(mean over m after - mean over m before)^2> / 2
                double total = 0;
                std::size_t terms = 0;
                for (std::size_t i = 0; i + 2 * m <= rate.size(); ++i, ++terms) {
                    double difference = 0;
                    for (std::size_t l = 0; l < m; ++l) difference += rate[i + m + l] - rate[i + l];
                    difference /= static_cast<double>(m);
                    total += difference * difference / 2;
                }
                if (square.size() <= j) {
                    square.push_back(0);
                    weight.push_back(0);
                    Point point;
                    point.m = m;
                    point.tau = static_cast<double>(m) * kBlock_s;
                    sum.push_back(point);
                }
                square[j] += total;
                weight[j] += static_cast<double>(terms);
                // Independent pairs only, for the bars.
                sum[j].edf += static_cast<double>(rate.size()) / static_cast<double>(2 * m);
                sum[j].n += terms;
            }
        }
        for (std::size_t j = 0; j < sum.size(); ++j) {
            sum[j].dev = std::sqrt(square[j] / weight[j]);
            const double relative = 1 / std::sqrt(2 * std::max(1.0, sum[j].edf));
            sum[j].lo = sum[j].dev * (1 - std::min(0.9, relative));
            sum[j].hi = sum[j].dev * (1 + relative);
        }
        out.allan[k] = std::move(sum);
    }
}

/// What the plan, as it was run, lets expect of the coefficients at the reference frequency.
void expect(const Campaign& campaign, const std::vector<RecordedDwell>& dwells, Analysis& out) {
    const estimator::Settings& settings = out.settings;
    std::vector<estimator::PlannedDwell> plan;
    for (std::size_t d = 0; d < dwells.size() && d < out.replayed.dwells.size(); ++d) {
        if (dwells[d].count == 0 || apart(settings, *dwells[d].order)) continue;
        estimator::PlannedDwell planned;
        const auto& angle = campaign.samples[dwells[d].first].angle;
        for (std::size_t k = 0; k < 3; ++k)
            planned.angles_deg[k] = settings.encoder_sign[k] * (angle[k] * estimator::kDegPerRad -
                                                                settings.encoder_zero_deg[k]);
        planned.kappa = out.replayed.dwells[d].summary.kappa;
        planned.duration_s = drivers::to_seconds(dwells[d].order->to - dwells[d].order->from);
        plan.push_back(planned);
    }
    out.expected_sigma.fill(std::numeric_limits<double>::infinity());
    // Of readings closer together than any rig's (10 kHz) it would be a sum of billions.
    constexpr double kShortest_s = 1e-5;
    if (const double period_s = period_of(campaign, dwells);
        !plan.empty() && period_s > kShortest_s) {
        out.expected_sigma =
            estimator::predicted_sigma(settings, plan, out.coefficients.value, period_s);
    }
}

}  // namespace

bool apart(const estimator::Settings& settings, const record::Order& order) {
    return order.held_out || order.random.mean_square_g2 > 0 || order.sweep.any() ||
           (order.frequency_hz > 0 && !estimator::at_reference(settings, order.frequency_hz));
}

double origin_s(const Campaign& campaign) {
    return campaign.samples.empty() ? 0 : drivers::to_seconds(campaign.samples.front().time);
}

configuration::Configuration rig_of(const Campaign& campaign) {
    auto rig = configuration_of(campaign);
    rig.estimator = dwells::Anew::settings_of(rig.estimator, campaign.found);
    return rig;
}

Coefficients final_coefficients(const std::string& path, const record::ReplayResult& replayed) {
    if (!replayed.anew) return final_coefficients(path, replayed.dwells);
    const record::Dwell& anew = *replayed.anew;
    return {anew.value, anew.sigma, anew.observable, anew.covariance};
}

Coefficients final_coefficients(const std::string& path, const std::vector<record::Dwell>& dwells) {
    if (dwells.empty()) throw std::runtime_error(path + ": found no dwell done, expected one");
    const record::Dwell& last = dwells.back();
    return {last.value, last.sigma, last.observable, last.covariance};
}

Frequencies frequencies_of(const tool::Assessed& found, const estimator::Settings& settings) {
    Frequencies hz{};
    const bool at_rest = std::ranges::all_of(found.assessed.rates,
                                             [](const auto& rate) { return rate.level_g == 0; });
    if (!at_rest) hz.fill(settings.frequency_hz);
    if (found.assessed.over_frequency)
        for (std::size_t i = 0; i < kParameters; ++i) hz[i] = found.spectrum->at_hz(i);
    return hz;
}

Analysis analyse(const Campaign& campaign, const configuration::Configuration& rig,
                 const Progress& progress) {
    const estimator::Settings& settings = rig.estimator;
    Analysis out;
    out.settings = settings;
    progress(0);
    out.replayed = record::replay(campaign, settings, {});
    out.coefficients = final_coefficients(campaign.path, out.replayed);
    auto judgement = tool::assess(settings, out.replayed.found, out.replayed.result,
                                  out.replayed.rows, record::shaken_of(campaign, rig));
    out.at_hz = frequencies_of(judgement, settings);
    out.assessed = std::move(judgement.assessed);
    out.spectrum = std::move(judgement.spectrum);
    progress(0.2);
    const auto dwells = record::recorded_dwells(campaign);
    std::set<int> positions;
    for (const auto& dwell : dwells) positions.insert(dwell.order->position);
    // Held out in turn: far positions of the list together, so that no axis is lost at once.
    std::vector<std::set<int>> folds(std::min(kFolds, positions.size()));
    std::size_t at = 0;
    for (const int position : positions) folds[at++ % folds.size()].insert(position);
    if (positions.size() > 1) {
        std::vector<std::future<std::vector<HeldOut>>> judged;
        for (const auto& fold : folds)
            judged.push_back(
                std::async(std::launch::async, [&campaign, &settings, &dwells, &out, &fold] {
                    return judge_fold(campaign, settings, dwells, out.replayed, fold);
                }));
        for (auto& one : judged) {
            const auto found = one.get();
            out.held_out.insert(out.held_out.end(), found.begin(), found.end());
            progress(0.2 + 0.6 * static_cast<double>(out.held_out.size()) /
                               static_cast<double>(std::max<std::size_t>(1, dwells.size())));
        }
        std::ranges::sort(out.held_out, [](const HeldOut& a, const HeldOut& b) {
            return std::pair(a.run, a.position) < std::pair(b.run, b.position);
        });
    }
    out.innovations = innovations_of(campaign, settings, dwells);
    progress(0.9);
    allan_of(campaign, dwells, out);
    expect(campaign, dwells, out);
    progress(1);
    return out;
}

}  // namespace vibrig::report
