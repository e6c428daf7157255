#include "tests/unit/estimator/commissioning/unknown_rig.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace vibrig::estimator::commissioning {

namespace {

constexpr double kRadPerDegree = std::numbers::pi / 180;
using plant::operator+, plant::operator-, plant::operator*;

plant::Truth drawn(plant::Random& random) {
    plant::Truth truth;
    const auto within = [&](double most) { return most * (2 * random.uniform() - 1); };
    truth.latitude_deg = within(75);
    truth.azimuth_deg = within(180);
    truth.base_tilt_deg = {within(1), within(1)};
    for (auto& skew : truth.non_orthogonality_arcsec) skew = 120 * random.normal();
    for (auto& gyro : truth.coefficients)
        for (std::size_t term = 0; term < plant::kTerms; ++term)
            gyro[term] = random.normal() * (term == plant::kF ? 2 : term <= plant::kS ? 1 : 0.03);
    truth.drift_sign = random.uniform() < 0.5 ? 1 : -1;
    return truth;
}

}  // namespace

UnknownRig::UnknownRig(std::uint64_t seed) : random(seed, 5), model_(truth = drawn(random)) {
    const auto within = [&](double most) { return most * (2 * random.uniform() - 1); };
    const auto coin = [&] { return random.uniform() < 0.5 ? 1 : -1; };
    const auto shuffled = [&] {
        std::array<int, 3> order{0, 1, 2};
        for (std::size_t i = 2; i > 0; --i)
            std::swap(order[i], order[static_cast<std::size_t>(random.uniform() * double(i + 1))]);
        return order;
    };
    static const std::array<double, 9> kDegrees{1,   360, 1 / kRadPerDegree, 1 / 60.0,         0.9,
                                                0.5, 2,   360.0 / (1 << 16), 360.0 / (1 << 20)};
    channel = shuffled();
    const auto wiring = shuffled();
    for (std::size_t i = 0; i < 3; ++i) {
        degrees[i] = kDegrees[static_cast<std::size_t>(random.uniform() * kDegrees.size())];
        sign[i] = coin();
        direction[i] = coin();
        zero_deg[i] = within(180);
        start_deg_[i] = within(i == 1 ? 15 : 180);
        zero_g[i] = 5e-3 * random.normal();
        const double way = coin();
        for (std::size_t k = 0; k < 3; ++k) {
            const bool own = static_cast<int>(k) == wiring[i];
            accelerometers[i][k] = way * (own ? 1 + 0.01 * random.normal()
                                              : 10 / 60.0 * kRadPerDegree * random.normal());
        }
    }
    if (random.uniform() < 1 / 3.0) travel_deg = {100, 25, 120};
    angle_deg_ = start_deg_;
}

void UnknownRig::go(plant::Vec3 travel) {
    for (std::size_t i = 0; i < 3; ++i) {
        // A hand that turns one gimbal leaves the others where they are.
        if (stuck == i || travel[i] == asked_[i]) continue;
        asked_[i] = travel[i];
        if (by_hand && travel[i] != 0) travel[i] += 8 * (2 * random.uniform() - 1);
        travel[i] = std::clamp(travel[i], -travel_deg[i], travel_deg[i]);
        angle_deg_[i] = start_deg_[i] + direction[i] * travel[i];
    }
}

void UnknownRig::stand_up() {
    for (const double outer : {0.0, 45.0, -45.0, 90.0, -90.0}) {
        go({outer, 0, 0});
        if (std::abs(model_.up_at(kRadPerDegree * angle_deg_)[2]) > 0.5) return;
    }
}

Vec3 UnknownRig::reading_at(const plant::Vec3& angle_deg) const {
    Vec3 reading{};
    for (std::size_t i = 0; i < 3; ++i) {
        // Wrapped after a turn, as the encoder counts.
        const double turned = sign[i] * angle_deg[i] + zero_deg[i];
        reading[static_cast<std::size_t>(channel[i])] =
            (turned - 360 * std::floor(turned / 360)) / degrees[i];
    }
    return reading;
}

Vec3 UnknownRig::force_at(const plant::Vec3& angle_deg) const {
    Vec3 force = accelerometers * model_.up_at(kRadPerDegree * angle_deg) + zero_g;
    if (dead) force[*dead] = zero_g[*dead];
    return force;
}

Stop UnknownRig::look(int swept) {
    Stop stop{reading_at(angle_deg_ + (5 / 3600.0) * plant::Vec3{random.normal(), random.normal(),
                                                                 random.normal()}),
              force_at(angle_deg_), swept};
    for (double& f : stop.force) f += 1e-5 * random.normal();
    return stop;
}

bool UnknownRig::hardly_responds(std::size_t gimbal, const plant::Vec3& from) {
    go(from);
    const auto before = force_at(angle_deg_);
    const auto there = angle_deg_;
    auto moved = from;
    moved[gimbal] += 9;
    go(moved);
    const auto change = force_at(angle_deg_) - before;
    const double turned = std::abs(angle_deg_[gimbal] - there[gimbal]) * kRadPerDegree;
    return std::sqrt(plant::dot(change, change)) < 0.3 * turned;
}

std::vector<Stop> UnknownRig::stops() {
    plant::Vec3 from{};
    if (hardly_responds(1, from) || hardly_responds(2, from)) from[0] = 40;
    const std::array<std::vector<double>, 3> sweeps{
        {{0, 31, 73, 118}, {-25, -9, 11, 25}, {0, 31, 73, 118}}};
    std::vector<Stop> all;
    for (std::size_t gimbal = 0; gimbal < 3; ++gimbal) {
        for (const double travel : sweeps[gimbal]) {
            plant::Vec3 to = gimbal == 0 ? plant::Vec3{} : from;
            const double limit = travel_deg[gimbal], farthest = gimbal == 1 ? 25 : 118;
            to[gimbal] =
                (gimbal == 0 ? 0 : from[gimbal]) + travel * std::min(1.0, limit / farthest);
            go(to);
            all.push_back(look(whose(gimbal)));
        }
    }
    for (const auto& travel : {plant::Vec3{-60, 25, 100}, plant::Vec3{-100, -25, 160},
                               plant::Vec3{80, 25, -130}, plant::Vec3{100, -20, -60}}) {
        go(travel);
        all.push_back(look());
    }
    return all;
}

FreeDrift UnknownRig::drift(const plant::Vec3& torque) {
    FreeDrift drift{look().reading, {}};
    const auto rate = model_.angle_rates(kRadPerDegree * angle_deg_, 0, torque);  // rad/s
    for (std::size_t i = 0; i < 3; ++i)
        drift.slope[static_cast<std::size_t>(channel[i])] =
            (sign[i] * rate[i] / kRadPerDegree * 3600 + 0.03 * random.normal()) / degrees[i];
    return drift;
}

std::vector<FreeDrift> UnknownRig::drifts(const Description& found) {
    std::vector<FreeDrift> all;
    go({});
    // Where a travel of the outer and inner gimbal brings the angles found to what is wanted.
    const auto begun = found.angles(look().reading);
    const auto to_go = [&](std::size_t gimbal, double wanted_deg) {
        // Of the gimbal that the description calls so, by the way that its angle was seen to go.
        const double delta =
            std::remainder(wanted_deg - begun[static_cast<int>(gimbal)] / kRadPerDegree, 360.0);
        return found.sign[gimbal] * sign[gimbal] * direction[gimbal] * delta;
    };
    const auto reachable = [&](std::size_t gimbal, double one, double other) {
        const double a = to_go(gimbal, one), b = to_go(gimbal, other);
        return std::abs(a) <= std::abs(b) ? a : b;
    };
    const double upright = reachable(0, 90, -90), level = reachable(0, 0, 180);
    for (const double azimuth : {-85.0, 85.0}) {
        go({upright, to_go(1, 0), azimuth});
        all.push_back(drift());
    }
    for (const double azimuth : {85.0, -85.0, 0.0}) {
        go({level, to_go(1, 0), azimuth});
        all.push_back(drift());
    }
    return all;
}

bool UnknownRig::grows_anticlockwise() const {
    // The azimuth axis is platform z: how a small turn about it moves a vector that stands still.
    const plant::Vec3 angle = kRadPerDegree * angle_deg_;
    plant::Vec3 turned = angle;
    turned[2] += 1e-6;
    const bool up = model_.up_at(angle)[2] > 0;
    const auto before = plant::PlatformModel::to_platform(angle, {0.3, 0.5, 0.7});
    const auto after = plant::PlatformModel::to_platform(turned, {0.3, 0.5, 0.7});
    // The platform turns anticlockwise about z when what stands still goes clockwise in its axes.
    const double about_z = before[0] * after[1] - before[1] * after[0];
    const bool anticlockwise_about_z = about_z < 0;
    const bool angle_grows = anticlockwise_about_z == up;
    return (sign[2] > 0) == angle_grows;
}

}  // namespace vibrig::estimator::commissioning
