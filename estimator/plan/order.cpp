#include "estimator/plan/order.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

namespace vibrig::estimator::plan {

namespace {

constexpr int kDraws = 200;

double correlation(const std::vector<double>& x, const std::vector<double>& y) {
    const auto n = static_cast<double>(x.size());
    const double mx = std::accumulate(x.begin(), x.end(), 0.0) / n;
    const double my = std::accumulate(y.begin(), y.end(), 0.0) / n;
    double xx = 0, yy = 0, xy = 0;
    for (std::size_t i = 0; i < x.size(); ++i) {
        xx += (x[i] - mx) * (x[i] - mx);
        yy += (y[i] - my) * (y[i] - my);
        xy += (x[i] - mx) * (y[i] - my);
    }
    return xx > 0 && yy > 1e-12 * n ? xy / std::sqrt(xx * yy) : 0;
}

}  // namespace

double slew_s(const Vec3& from, const Vec3& to, const Timing& timing) noexcept {
    double furthest = 0;
    for (std::size_t k = 0; k < 3; ++k) {
        furthest = std::max(furthest, std::abs(std::remainder(to[k] - from[k], 360.0)));
    }
    return furthest / timing.slew_deg_per_s;
}

Duration duration(const std::vector<Visit>& visits, const Order& order, const Timing& timing) {
    Duration result;
    Vec3 here{};
    for (const std::size_t i : order) {
        const Visit& visit = visits[i];
        const double slew = slew_s(here, visit.position_deg, timing);
        const double rest = timing.settle_s + timing.dwell_s;
        result.slewing_s += slew;
        result.total_s += slew + timing.look_s + rest;
        if (visit.level_g > 0) {
            result.total_s += 2 * timing.ramp_s;
            result.vibrating_s += rest + 2 * timing.ramp_s;
        }
        here = visit.position_deg;
    }
    return result;
}

double drift_imbalance(const std::vector<Row>& regressors, const Order& order) {
    std::vector<double> place(order.size());
    std::iota(place.begin(), place.end(), 0.0);
    double worst = 0;
    for (std::size_t term = 1; term < kTerms; ++term) {
        std::vector<double> value;
        for (const std::size_t i : order) value.push_back(regressors[i][term]);
        worst = std::max(worst, std::abs(correlation(place, value)));
    }
    return worst;
}

Order shortest_travel(const std::vector<Visit>& visits, const Timing& timing) {
    const std::size_t n = visits.size();
    Order order;
    std::vector<bool> used(n, false);
    Vec3 here{};
    for (std::size_t k = 0; k < n; ++k) {
        std::size_t nearest = n;
        for (std::size_t i = 0; i < n; ++i) {
            if (!used[i] &&
                (nearest == n || slew_s(here, visits[i].position_deg, timing) <
                                     slew_s(here, visits[nearest].position_deg, timing))) {
                nearest = i;
            }
        }
        used[nearest] = true;
        order.push_back(nearest);
        here = visits[nearest].position_deg;
    }
    const auto step = [&](std::size_t a, std::size_t b) {  // before place b, from place a
        const Vec3 from = a == n ? Vec3{} : visits[order[a]].position_deg;
        return b == n ? 0.0 : slew_s(from, visits[order[b]].position_deg, timing);
    };
    for (bool better = true; better;) {
        better = false;
        for (std::size_t i = 0; i < n; ++i) {
            for (std::size_t j = i + 1; j < n; ++j) {
                const std::size_t before = i == 0 ? n : i - 1;
                const double now = step(before, i) + step(j, j + 1);
                const double then = step(before, j) + (j + 1 == n ? 0.0 : step(i, j + 1));
                if (then < now - 1e-9) {
                    std::reverse(order.begin() + static_cast<std::ptrdiff_t>(i),
                                 order.begin() + static_cast<std::ptrdiff_t>(j) + 1);
                    better = true;
                }
            }
        }
    }
    return order;
}

Order randomised(const std::vector<Row>& regressors, std::size_t block, std::uint64_t seed) {
    std::mt19937_64 random(seed);
    const std::size_t n = regressors.size();
    // Dealt like cards, so that every block holds its share of each level.
    const std::size_t blocks = (n + block - 1) / std::max<std::size_t>(block, 1);
    std::vector<std::size_t> begin;
    Order dealt;
    for (std::size_t b = 0; b < blocks; ++b) {
        begin.push_back(dealt.size());
        for (std::size_t i = b; i < n; i += blocks) dealt.push_back(i);
    }
    begin.push_back(n);
    Order best = dealt;
    double least = 2;
    for (int draw = 0; draw < kDraws; ++draw) {
        Order order = dealt;
        for (std::size_t b = 0; b < blocks; ++b) {
            std::shuffle(order.begin() + static_cast<std::ptrdiff_t>(begin[b]),
                         order.begin() + static_cast<std::ptrdiff_t>(begin[b + 1]), random);
        }
        const double imbalance = drift_imbalance(regressors, order);
        if (imbalance < least) {
            least = imbalance;
            best = order;
        }
    }
    return best;
}

}  // namespace vibrig::estimator::plan
