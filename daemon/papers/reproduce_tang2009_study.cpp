#include "daemon/papers/reproduce_tang2009.hpp"

#include <algorithm>
#include <atomic>
#include <exception>
#include <thread>

#include "daemon/results/progress.hpp"
#include "estimator/filter/angles.hpp"
#include "estimator/filter/linear_algebra.hpp"
#include "estimator/filter/mapped.hpp"
#include "estimator/identification/crlb.hpp"
#include "estimator/identification/result.hpp"
#include "tests/plant/recording.hpp"

namespace vibrig::tool::tang2009 {

namespace {

using estimator::Identification;
using estimator::kParameters;
using estimator::Method;

constexpr std::array<double, 4> kTable_g{9, 7, 0, 2};
constexpr double kPeriod_s = 0.025;                ///< of the paper's samples
constexpr std::size_t kSamplesBetweenNotes = 400;  ///< 10 s

struct Plan {
    Method method;
    std::array<bool, 4> uses;  ///< of kTable_g
    bool all_at_once = false;
};
constexpr std::array<Plan, kRoutes> kPlans{{{Method::two_step, {true, true, false, false}},
                                            {Method::joint, {true, true, false, false}},
                                            {Method::two_step, {false, false, true, true}},
                                            {Method::joint, {false, false, true, true}},
                                            {Method::two_step, {true, false, false, false}, true},
                                            {Method::joint, {true, false, true, false}},
                                            {Method::joint, {true, false, false, false}}}};

estimator::Covariance correlation_of(const estimator::Result& result) {
    const Eigen::Map<const Eigen::Matrix<double, kParameters, 1>> sigma(result.sigma.data());
    return sigma.cwiseInverse().asDiagonal() * estimator::mapped(result.covariance) *
           sigma.cwiseInverse().asDiagonal();
}

double nees(const estimator::Result& result) {
    // On the correlation matrix: the coefficients differ by orders of magnitude.
    Eigen::Matrix<double, kParameters, 1> error;
    for (std::size_t i = 0; i < kParameters; ++i) {
        const auto k = static_cast<Eigen::Index>(i);
        error[k] = (result.value[i] - truth()[i]) / result.sigma[i];
    }
    return error.dot(estimator::linear_algebra::covariance_inverse(correlation_of(result)) * error);
}

/// One route while the rig runs.
struct Follower {
    Identification identification;
    Plan plan;
    std::size_t run = 0, position = 0;
    std::size_t samples = 0;

    explicit Follower(const Plan& of)
        : identification([&of] {
              estimator::Settings settings;
              settings.method = of.method;
              settings.all_at_once = of.all_at_once;
              return settings;
          }()),
          plan(of) {}

    /// Where it goes, every 10 s.
    void note(Convergence& convergence) const {
        estimator::Estimate estimate;
        identification.estimate(estimate);
        convergence.minutes.push_back(static_cast<double>(samples) * kPeriod_s / 60);
        convergence.value.push_back(estimate.value);
    }

    void take(const plant::PlannedSample& sample, const estimator::Measurement& measurement,
              double table_g, Convergence* convergence) {
        if (!plan.uses[sample.run - 1]) return;
        if (sample.run != run || sample.position != position) {
            run = sample.run;
            position = sample.position;
            identification.begin_dwell(
                {static_cast<int>(run), static_cast<int>(position), table_g});
        }
        static_cast<void>(identification.add(measurement));
        if (++samples % kSamplesBetweenNotes == 0 && convergence != nullptr) note(*convergence);
    }

    Outcome end() {
        static_cast<void>(identification.end_dwell());
        const estimator::Result result = identification.result();
        Outcome outcome;
        estimator::Estimate estimate;
        identification.solved(estimate);  // also of what is not determined
        outcome.value = estimate.value;
        outcome.sigma = estimate.sigma;
        outcome.covariance = result.covariance;
        outcome.nees = nees(result);
        outcome.nis = result.nis_per_dof;
        outcome.correlation_square = correlation_of(result).squaredNorm();
        return outcome;
    }
};

std::array<Outcome, kRoutes> run_seed(double scale, std::uint64_t seed,
                                      std::array<Convergence, kRoutes>* convergence,
                                      const std::function<void()>& dwell_done) {
    plant::Truth rig;
    rig.seed = seed;
    rig.slew_deg_per_s = 360;
    plant::CampaignPlan plan;
    plan.ramp_s = 1;
    plan.table_g.clear();
    for (const double g : kTable_g) plan.table_g.push_back(scale * g);
    std::vector<Follower> followers;
    for (const Plan& of : kPlans) followers.emplace_back(of);

    plant::simulate(
        rig, plan,
        [&](const plant::PlannedSample& sample) {
            estimator::Measurement m;
            m.time_s = sample.time_s;
            for (std::size_t k = 0; k < 3; ++k) {
                m.angle_rad[k] = sample.readings.encoder_deg[k] * estimator::kRadPerDeg;
                m.force_g[k] = sample.readings.raw_g[k];
            }
            for (std::size_t r = 0; r < kRoutes; ++r) {
                followers[r].take(sample, m, plan.table_g[sample.run - 1],
                                  convergence != nullptr ? &(*convergence)[r] : nullptr);
            }
        },
        [&](std::size_t, std::size_t) { dwell_done(); });
    std::array<Outcome, kRoutes> outcomes;
    for (std::size_t r = 0; r < kRoutes; ++r) {
        outcomes[r] = followers[r].end();
        if (convergence != nullptr) followers[r].note((*convergence)[r]);
    }
    return outcomes;
}

Coefficients bound_of(const Study& study, const std::array<double, 2>& levels) {
    std::vector<estimator::PlannedDwell> plan;
    for (const double table_g : levels) {
        const double a0 = study.platform_g(table_g);
        for (const plant::Vec3& p : plant::CampaignPlan::table1()) {
            plan.push_back({{p[0], p[1], p[2]}, 1 + a0 * a0 / 2, 100});
        }
    }
    return estimator::predicted_sigma({}, plan, truth(), kPeriod_s);
}

}  // namespace

const Coefficients& truth() {
    static const Coefficients values = [] {
        Coefficients all{};
        const auto gyros = plant::Truth::table2();
        for (std::size_t i = 0; i < kParameters; ++i) all[i] = gyros[i / 10][i % 10];
        return all;
    }();
    return values;
}

std::vector<Study> run_studies(const std::vector<double>& scales, std::size_t seeds) {
    std::vector<Study> studies(scales.size());
    for (std::size_t s = 0; s < scales.size(); ++s) {
        studies[s].scale = scales[s];
        studies[s].seeds.resize(seeds);
        studies[s].bound = bound_of(studies[s], {9, 7});
        studies[s].bound_trial_2 = bound_of(studies[s], {0, 2});
    }
    const std::size_t jobs = scales.size() * seeds;
    const std::size_t all = jobs * kTable_g.size() * plant::CampaignPlan::table1().size();
    std::atomic<std::size_t> next{0}, done{0};
    const auto work = [&](Progress* progress) {
        for (std::size_t job = next++; job < jobs; job = next++) {
            Study& study = studies[job % scales.size()];
            const std::size_t seed = job / scales.size();
            study.seeds[seed] =
                run_seed(study.scale, seed + 1, seed == 0 ? &study.convergence : nullptr, [&] {
                    ++done;
                    if (progress != nullptr) progress->show(done, all);
                });
        }
    };
    // Results do not depend on who computes them: each job has a place of its own.
    std::exception_ptr failed;
    std::atomic<bool> failure{false};
    const auto guarded = [&](Progress* progress) {
        try {
            work(progress);
        } catch (...) {
            if (!failure.exchange(true)) failed = std::current_exception();
            next = jobs;
        }
    };
    {
        std::vector<std::jthread> others;
        const unsigned cores = std::max(1U, std::thread::hardware_concurrency());
        for (unsigned i = 1; i < cores; ++i) others.emplace_back(guarded, nullptr);
        Progress progress("simulating the rig");
        guarded(&progress);
    }
    if (failed) std::rethrow_exception(failed);
    return studies;
}

}  // namespace vibrig::tool::tang2009
