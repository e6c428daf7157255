#include "tests/unit/estimator/spectrum/survey.hpp"

#include <algorithm>
#include <cmath>
#include <random>

#include "estimator/filter/drift_model.hpp"
#include "estimator/filter/kinematics.hpp"
#include "estimator/filter/mapped.hpp"
#include "tests/unit/estimator/rig_simulator.hpp"

namespace vibrig::estimator::spectrum::testing {
namespace {

using Eigen::Index;
using estimator::testing::kTable1;
using estimator::testing::kTable2;

constexpr double kRateVariance = 4.891201e-5, kDegree = kPi / 180;
constexpr std::array<int, 7> kSeven{4, 5, 6, 7, 10, 13, 14};

Eigen::Matrix3d vertical(double mean_square) {
    Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();
    moment(1, 1) = mean_square;
    return moment;
}

}  // namespace

Settings undeclared() {
    Settings settings;
    settings.uncertainty.gain_between_frequencies.u = 0;
    settings.uncertainty.accelerometer_gain.u = 0;
    settings.uncertainty.resolver_harmonics = {};
    return settings;
}

Settings gain_declared() {
    Settings declared = undeclared();
    declared.uncertainty.gain_between_frequencies.u = 0.005;
    return declared;
}

ParameterArray table2() {
    ParameterArray truth{};
    for (std::size_t i = 0; i < kParameters; ++i) truth[internal_of(i)] = kTable2[i];
    return truth;
}

Truth Truth::common(double share, const Resonance& resonance) {
    Truth out;
    const ParameterArray all = table2();
    for (std::size_t j = 0; j < kGyros; ++j) {
        ElasticPart part{resonance, {}};
        for (std::size_t g = kDii; g < kGroups; ++g)
            part.coefficients[g - kDii] = share * all[internal_index(g, j)];
        out.elastic[j] = {part};
    }
    return out;
}

std::vector<PlannedDwell> survey(double amplitude_g) {
    std::vector<PlannedDwell> plan;
    for (int p = 1; p <= 14; ++p) plan.push_back({p, 15, 1, amplitude_g});
    for (int p = 1; p <= 13; p += 2) plan.push_back({p, 0, 1, 0});
    for (const double hz : {25., 35., 45., 65., 85., 125.}) {
        for (const int p : kSeven) plan.push_back({p, hz, 1, amplitude_g});
    }
    return plan;
}

std::vector<PlannedDwell> isolated_survey(const Resonance& pads, double at_15_g) {
    std::vector<PlannedDwell> plan = survey();
    for (PlannedDwell& dwell : plan)
        if (dwell.hz > 0)
            dwell.amplitude_g =
                (dwell.hz > 15 ? 12 : at_15_g) * std::sqrt(pads_power(dwell.hz, pads));
    return plan;
}

std::vector<PlannedDwell> today() {
    std::vector<PlannedDwell> plan;
    for (int p = 1; p <= 14; ++p) plan.push_back({p, 15, 1, 6});
    for (int p = 1; p <= 14; ++p) plan.push_back({p, 0, 1, 0});
    return plan;
}

void shuffle(std::vector<PlannedDwell>& plan, std::mt19937_64& random) {
    std::shuffle(plan.begin(), plan.end(), random);
}

Eigen::Vector3d drift_of(const Settings& settings, const Truth& truth, const Situation& in) {
    const Attitude at = attitude(settings, in.gimbal_rad, in.moment);
    const ParameterArray all = table2();
    Eigen::Vector3d out = Eigen::Vector3d::Zero();
    for (std::size_t j = 0; j < kGyros; ++j) {
        double drift = 0;
        for (std::size_t g = 0; g < kGroups; ++g)
            drift += at.base[j][static_cast<Index>(g)] * all[internal_index(g, j)];
        for (const ElasticPart& part : truth.elastic[j]) {
            const double weight = elastic_weight(in.bands, part.resonance);
            for (std::size_t q = 0; q < 6; ++q)
                drift += weight * at.vibration[j][static_cast<Index>(q)] * part.coefficients[q];
        }
        out[static_cast<Index>(j)] = drift;
    }
    return out;
}

Dwells dwells_of(const Settings& settings, const Truth& truth,
                 const std::vector<PlannedDwell>& plan) {
    const Kinematics kinematics(settings);
    const DriftModel model(settings);
    Dwells out;
    for (const PlannedDwell& planned : plan) {
        SpectralDwell dwell;
        DwellRow& row = dwell.row;
        row.run = planned.hz > 0 ? 1 : 2;
        row.position = planned.position;
        row.duration_s = 100;
        row.middle_s = 160 * static_cast<double>(out.list.size()) + 50;
        row.common_clock = true;
        mapped(row.variance) = kRateVariance * Eigen::Matrix3d::Identity();
        row.frequency_hz = planned.hz;
        const double moment = planned.hz > 0 ? planned.amplitude_g * planned.amplitude_g / 2 : 0;
        Situation in{{}, vertical(moment), {{planned.hz, 1, 0}}, 0};
        // The platform half way through its turn, by the static coefficients.
        const auto& deg = kTable1[static_cast<std::size_t>(planned.position - 1)];
        in.gimbal_rad = Eigen::Vector3d(deg[0], deg[1], deg[2]) * kDegree;
        const Pose start = kinematics.pose(in.gimbal_rad);
        const Eigen::Vector3d rate =
            model.drift_sign() * drift_of(settings, {}, in) - start.earth_rate;
        in.gimbal_rad += start.m * rate * (50 / kArcsecPerRad);
        mapped(row.angles) = in.gimbal_rad;
        mapped(row.rate) = drift_of(settings, truth, in);
        // What the accelerometers say.
        row.vibration.kappa = 1 + moment * planned.gain * planned.gain;
        const Attitude seen = attitude(settings, in.gimbal_rad, vertical(row.vibration.kappa - 1));
        for (std::size_t j = 0; j < kGyros; ++j) mapped(row.regressors[j]) = seen.base[j];
        if (planned.hz > 0) {
            const auto found =
                std::find_if(out.kinds.begin(), out.kinds.end(),
                             [&](const Kind& kind) { return kind.bands[0].hz == planned.hz; });
            dwell.kind = static_cast<std::size_t>(found - out.kinds.begin());
            if (found == out.kinds.end()) out.kinds.push_back({"", {{planned.hz, 1, 0}}});
        }
        out.list.push_back(dwell);
    }
    return out;
}

void add_noise(Dwells& dwells, std::mt19937_64& random) {
    std::normal_distribution<double> normal;
    for (SpectralDwell& dwell : dwells.list) {
        for (std::size_t j = 0; j < 3; ++j)
            dwell.row.rate[j] += std::sqrt(dwell.row.variance[j][j]) * normal(random);
    }
}

Analysis campaign(const Settings& settings, const Truth& truth, std::vector<PlannedDwell> plan,
                  unsigned seed, bool mixed, Form form) {
    std::mt19937_64 random(seed);
    if (mixed) shuffle(plan, random);
    Dwells dwells = dwells_of(settings, truth, plan);
    add_noise(dwells, random);
    return analyse(settings, SpectralTable(settings, dwells.list, dwells.kinds), form);
}

Truth random_rig(unsigned seed) {
    std::mt19937_64 random(5000 + seed);
    std::uniform_real_distribution<double> uniform;
    std::normal_distribution<double> normal;
    Truth truth = Truth::common(1, kSixty);
    for (auto& gyro : truth.elastic) {
        if (uniform(random) < 0.3) {
            gyro.clear();
            continue;
        }
        gyro[0].resonance = {25 * std::pow(12, uniform(random)),
                             0.015 * std::pow(10, uniform(random))};
        for (double& e : gyro[0].coefficients) e = 0.3 * 0.03 * normal(random);
    }
    return truth;
}

Truth two_resonances_of(double first_hz, double first_share, double second_hz,
                        double second_share) {
    Truth truth = Truth::common(first_share, {first_hz, 0.05});
    const Truth more = Truth::common(second_share, {second_hz, 0.05});
    for (std::size_t j = 0; j < 3; ++j) truth.elastic[j].push_back(more.elastic[j][0]);
    return truth;
}

Situation situation_of(const Profile& profile, const std::array<double, 3>& deg) {
    return {Eigen::Vector3d(deg[0], deg[1], deg[2]) * kDegree, vertical(mean_square(profile)),
            bands_of(profile), 0};
}

std::vector<Profile> six_profiles() {
    const auto flat = [](const char* name, double from, double to, double rms) {
        const double density = rms * rms / (to - from);
        return Profile{name, {{from, density}, {to, density}}, {}, {0, 1, 0}, 0};
    };
    Profile truck = built_in_profiles()[1];
    const double scale = 9 / mean_square(truck);
    for (auto& [hz, density] : truck.psd) density *= scale;
    return {{"55 Hz", {}, {{55, 3}}, {0, 1, 0}, 0},
            {"75 Hz", {}, {{75, 3}}, {0, 1, 0}, 0},
            flat("20-200 Hz", 20, 200, 3),
            truck,
            built_in_profiles()[0],
            flat("70-90 Hz", 70, 90, 1)};
}

std::vector<std::array<double, 3>> eight_attitudes() {
    return {{30, 10, -20}, {0, 0, 0},      {45, 0, 45},   {90, 20, 10},
            {-60, 0, 30},  {120, -15, 75}, {200, 5, 140}, {-30, 30, -100}};
}

unsigned at_least(unsigned of, double rate) {
    double term = std::pow(1 - rate, of), below = 0;
    for (unsigned k = 0; k <= of; ++k) {
        below += term;
        if (below > 1e-3) return k;
        term *= (of - k) * rate / ((k + 1) * (1 - rate));
    }
    return of;
}

unsigned at_most(unsigned of, double rate) { return of - at_least(of, 1 - rate); }

}  // namespace vibrig::estimator::spectrum::testing
