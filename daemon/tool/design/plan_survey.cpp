// `vibrig plan --frequencies`: a plan over frequency, for coefficients that may depend on it.
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "daemon/results/spectrum_json.hpp"
#include "daemon/tool/analysis/profile_options.hpp"
#include "daemon/tool/design/plan_study.hpp"
#include "daemon/tool/design/plan_sweeps.hpp"
#include "estimator/filter/angles.hpp"
#include "estimator/filter/kinematics.hpp"
#include "estimator/identification/crlb.hpp"
#include "estimator/spectrum/sampling.hpp"
#include "estimator/spectrum/survey.hpp"
#include "estimator/uncertainty/balanced_order.hpp"
#include "proto/json_file.hpp"

namespace vibrig::tool::planner {

namespace {

namespace spectrum = estimator::spectrum;
using Eigen::Index;
using planning::Vec3;

constexpr double kLevel = 6;           ///< g at the platform
constexpr std::size_t kAtFurther = 7;  ///< dwells of each further frequency
constexpr double kIsolatedUpTo = 30;   ///< Hz; beyond it little passes the isolators
constexpr Index kOfFrequency = 6;

class SurveyPlan {
  public:
    explicit SurveyPlan(const PlanRequest& request)
        : request_(request), c_(configuration::load(request.config, false).configuration) {
        timing_ = timing_of(request, c_);
        choose_mount();
    }

    PlanStudy run() {
        choose_positions();
        choose_profile();
        choose_lines();
        choose_places();
        PlanRequest ordered = request_;
        ordered.given = in_order();
        ordered.positions.clear();
        PlanStudy out = study(ordered);
        if (task_.lines.size() > 1)
            out.warnings.emplace_back(
                "the standard errors of the 30 coefficients are those of coefficients that do not "
                "depend on the frequency");
        tell(out);
        if (!request_.survey.sweeps.empty())
            PlannedSweeps(request_, c_, mount_, level(), positions_).put_before(out, timing_);
        return out;
    }

  private:
    void choose_mount() {
        mount_ = c_.spectrum.mount;
        if (request_.survey.mount == "hard") mount_ = {true, {}, {}};
        if (request_.survey.mount != "isolated" || !mount_.hard) return;
        if (c_.spectrum.hard || !(c_.estimator.transmission < 1))
            throw std::runtime_error(
                "--mount: found isolated with a configuration that has no isolators, expected "
                "vibration.transmission below 1 and spectrum.mount \"isolated\"");
    }

    void choose_positions() {
        std::vector<Vec3> listed;
        if (!request_.positions.empty()) {
            for (const Vec3& p : plan::read_positions(request_.positions, warnings_))
                listed.push_back(to_readings(c_.estimator, p));
        } else {
            listed = c_.campaign.positions_deg;
        }
        if (listed.size() < kAtFurther - 1)
            throw std::runtime_error("--positions: found " + std::to_string(listed.size()) +
                                     ", expected 6 at least: so many coefficients has a frequency");
        positions_ = listed;
        for (const Vec3& position : positions_) {
            ups_.push_back(planning::up_at(c_.estimator, position));
            const Vec3 deg = planning::attitude_of(c_.estimator, position);
            task_.gimbal_rad.push_back(Eigen::Vector3d(deg[0], deg[1], deg[2]) *
                                       estimator::kRadPerDeg);
        }
        task_.settings = c_.estimator;
        task_.rate_variance =
            estimator::rate_variance(c_.estimator, timing_.dwell_s, period_of(c_));
    }

    void choose_profile() {
        if (request_.survey.profile.empty()) return;
        const auto stated = find_profile(request_.survey.profile, c_);
        profile_ = stated.profile;
        configuration::Configuration with = c_;
        with.spectrum.mount = mount_;
        with.spectrum.mount_stated = true;
        const AtPlatform there =
            at_platform(profile_, stated.at.empty() ? "platform" : stated.at, with);
        std::vector<Eigen::Vector3d> attitudes = task_.gimbal_rad;
        if (!request_.survey.attitudes.empty()) attitudes.clear();
        for (const std::string& one : request_.survey.attitudes) {
            const auto deg = read_attitude(one);
            attitudes.push_back(Eigen::Vector3d(deg[0], deg[1], deg[2]) * estimator::kRadPerDeg);
        }
        for (const auto& attitude : attitudes)
            situations_.push_back({attitude, there.moment, there.bands, 0, false, there.moments});
        for (const auto& band : there.bands) profile_top_ = std::max(profile_top_, band.hz);
        if (!profile_.psd.empty()) profile_top_ = profile_.psd.back().first;
        for (const auto& axis : profile_.axes.psd) {
            if (!axis.empty()) profile_top_ = std::max(profile_top_, axis.back().first);
        }
    }

    [[nodiscard]] bool sees(double hz) const {
        return c_.estimator.accelerometer_response.power(hz) >= estimator::kLeastSeen;
    }
    void tell_unseen(double hz) {
        warnings_.push_back(
            printed("%.6g Hz is left out: the accelerometers see %.6g of its power, half of it is "
                    "needed",
                    hz, c_.estimator.accelerometer_response.power(hz)));
    }
    void leave_out_unseen(std::vector<double>& listed) {
        std::erase_if(listed, [this](double hz) {
            if (!sees(hz)) tell_unseen(hz);
            return !sees(hz);
        });
        if (listed.empty())
            throw std::runtime_error(
                "--frequencies: found none of which the accelerometers see half of the power, "
                "expected one at least (accelerometer.bandwidth_hz, accelerometer.response)");
    }
    /// The highest frequency up to this one, and from `least` on, that they see.
    [[nodiscard]] double seen_up_to(double highest, double least) {
        constexpr double kStep = 0.995;
        double hz = highest;
        while (hz > least && !sees(hz)) hz = std::max(least, std::round(10 * kStep * hz) / 10);
        if (hz < highest)
            warnings_.push_back(
                printed("the plan goes up to %.6g Hz and not to %.6g Hz: beyond it the "
                        "accelerometers see less than half of the power",
                        hz, highest));
        return hz;
    }

    /// Frequencies about those that a result names.
    void add_resonances(std::vector<double>& listed) {
        const std::string& path = request_.survey.about;
        if (path.empty()) return;
        const auto result = proto::read_json(path);
        about_ =
            spectrum::about_resonances(read_model(result, path).mixture,
                                       {1 / period_of(c_), c_.estimator.level_window_s}, listed);
        if (const auto verdict = read_verdict(result, path); verdict.not_valid || verdict.doubtful)
            warnings_.push_back(path + " is " + verdict.sentence);
        for (const double hz : spectrum::frequencies_of(about_)) {
            if (std::ranges::find(listed, hz) == listed.end()) listed.push_back(hz);
        }
    }

    /// g at the platform that are asked for.
    [[nodiscard]] double level() const {
        if (request_.levels_g.empty()) return kLevel;
        const double level = *std::max_element(request_.levels_g.begin(), request_.levels_g.end());
        for (const double other : request_.levels_g) {
            if (other != 0 && other != level)
                throw std::runtime_error(printed(
                    "--levels: found %.6g and %.6g g, expected one level with --frequencies", other,
                    level));
        }
        if (!(level > 0)) throw std::runtime_error("--levels: found 0 g, expected a level above 0");
        return level;
    }

    void choose_lines() {
        const SurveyRequest& asked = request_.survey;
        std::vector<double> listed = asked.frequencies;
        if (listed.empty()) listed = {c_.estimator.frequency_hz};
        add_resonances(listed);
        leave_out_unseen(listed);
        double highest = asked.highest_hz;
        const double last = *std::max_element(listed.begin(), listed.end());
        if (highest <= 0 && profile_top_ > last) {
            highest = std::min(profile_top_, std::max(last, c_.spectrum.highest_hz));
            if (highest < profile_top_)
                warnings_.push_back(
                    printed("the profile reaches to %.6g Hz, the plan to %.6g Hz "
                            "(spectrum.highest_hz): what lies beyond is not measured",
                            profile_top_, highest));
        }
        highest = seen_up_to(highest, last);
        const double level = this->level();
        const spectrum::TableLimits limits{
            c_.campaign.max_acceleration_g, c_.campaign.max_velocity_mps,
            c_.campaign.max_displacement_mm, c_.estimator.gravity_mps2};
        task_.lines = spectrum::survey_lines(spectrum::survey_frequencies(listed, highest), level,
                                             {1 / period_of(c_), c_.estimator.level_window_s},
                                             mount_, limits);
        // The nearest free one may lie beyond.
        std::erase_if(task_.lines, [this](const auto& line) {
            if (!sees(line.hz)) tell_unseen(line.hz);
            return !sees(line.hz);
        });
        if (task_.lines.empty())
            throw std::runtime_error(
                "--frequencies: found none that the accelerometers see half of");
        for (const auto& line : task_.lines) {
            const double rate = 1 / period_of(c_);
            const bool bad = spectrum::forbidden(line.asked_hz, rate, c_.estimator.level_window_s);
            if (line.hz != line.asked_hz)
                warnings_.push_back(
                    printed("%.6g Hz is %s at %.6g samples/s: the nearest free frequency, %.6g Hz, "
                            "is planned",
                            line.asked_hz, bad ? "forbidden" : "not free up to its 8th harmonic",
                            rate, line.hz));
            if (line.limited)
                warnings_.push_back(
                    printed("%.6g Hz: the shaker's limits leave %.6g g of %.6g g at the platform%s",
                            line.hz, line.level_g, level,
                            !mount_.hard && line.hz > kIsolatedUpTo
                                ? ": frequencies above 30 Hz want the hard mount"
                                : ""));
        }
    }

    void choose_places() {
        const std::size_t first = std::min<std::size_t>(positions_.size(), 14);
        std::size_t at_further = kAtFurther;
        const std::size_t further = task_.lines.size() - 1;
        if (request_.runs > 0) {
            const std::size_t fixed = first + (first + 1) / 2;
            if (further == 0 || request_.runs < fixed + 6 * further ||
                (request_.runs - fixed) % further != 0)
                throw std::runtime_error(
                    "--runs: found " + std::to_string(request_.runs) + ", expected " +
                    std::to_string(fixed) + " of the first frequency and rest, and 6 or more for " +
                    "each of " + std::to_string(further) + " further frequencies");
            at_further = (request_.runs - fixed) / further;
        }
        places_ = spectrum::survey_places(ups_, task_.lines, at_further);
        if (situations_.empty()) return;
        places_ = spectrum::exchange_for(task_, places_, situations_);
        predicted_u_ = spectrum::predicted_u(task_, places_, situations_);
    }

    void add(const spectrum::Places& at, const spectrum::SurveyLine* line) {
        for (const std::size_t place : at) {
            PlanRun run;
            run.visit = {positions_[place], line != nullptr ? line->level_g : 0};
            run.table_g = line != nullptr ? line->table_g : 0;
            run.frequency_hz = line != nullptr ? line->hz : 0;
            runs_.push_back(run);
            up_of_.push_back(ups_[place]);
        }
    }

    /// Rows of the model with six quadratic coefficients for every frequency.
    [[nodiscard]] Eigen::MatrixXd grouped() const {
        const Index further = static_cast<Index>(task_.lines.size()) - 1;
        Eigen::MatrixXd rows =
            Eigen::MatrixXd::Zero(static_cast<Index>(runs_.size()), 10 + kOfFrequency * further);
        for (Index i = 0; i < rows.rows(); ++i) {
            const PlanRun& run = runs_[static_cast<std::size_t>(i)];
            Index group = 0;
            for (Index k = 1; k <= further; ++k) {
                if (run.frequency_hz == task_.lines[static_cast<std::size_t>(k)].hz) group = k;
            }
            const auto& up = up_of_[static_cast<std::size_t>(i)];
            const double level = run.visit.level_g;
            const auto row = planning::vibration_row(up, group == 0 ? level : 0);
            for (Index c = 0; c < 10; ++c) rows(i, c) = row[static_cast<std::size_t>(c)];
            if (group > 0)
                rows.block(i, 10 + kOfFrequency * (group - 1), 1, kOfFrequency) =
                    (planning::kappa_of(level) - 1) * rows.block(i, 4, 1, kOfFrequency);
        }
        return rows;
    }

    std::vector<PlanRun> in_order() {
        add(places_.first, &task_.lines.front());
        for (std::size_t k = 0; k < places_.further.size(); ++k)
            add(places_.further[k], &task_.lines[k + 1]);
        add(places_.rest, nullptr);
        std::vector<planning::Visit> visits;
        std::vector<planning::Row> rows;
        for (std::size_t i = 0; i < runs_.size(); ++i) {
            visits.push_back(runs_[i].visit);
            rows.push_back(planning::vibration_row(up_of_[i], runs_[i].visit.level_g));
        }
        planning::Order order(runs_.size());
        for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
        if (request_.order == "balanced") {
            estimator::uncertainty::SearchSettings how;
            how.starts = 1;
            how.seed = request_.seed;
            order = estimator::uncertainty::balanced_order(visits, grouped(), timing_,
                                                           task_.rate_variance, how);
        } else if (request_.order == "travel") {
            order = planning::shortest_travel(visits, timing_);
        } else if (request_.order == "random") {
            order =
                planning::randomised(rows, std::max<std::size_t>(request_.block, 1), request_.seed);
        }
        std::vector<PlanRun> out;
        for (const std::size_t i : order) out.push_back(runs_[i]);
        return out;
    }

    void tell(PlanStudy& out) const {
        out.warnings.insert(out.warnings.begin(), warnings_.begin(), warnings_.end());
        const auto flat = spectrum::planned_flatness(task_, places_);
        Survey survey;
        survey.hard = mount_.hard;
        survey.lines = task_.lines;
        survey.dwells = {places_.first.size()};
        for (const auto& places : places_.further) survey.dwells.push_back(places.size());
        survey.smallest_seen = flat.smallest_seen;
        survey.highest_hz = flat.highest_hz;
        survey.profile = profile_.name;
        survey.about = about_;
        if (!situations_.empty()) survey.predicted_u_deg_h = predicted_u_;
        out.survey = std::move(survey);
        out.transmission = task_.lines.front().transmission;
    }

    const PlanRequest& request_;
    configuration::Configuration c_;
    planning::Timing timing_;
    spectrum::Mount mount_;
    std::vector<Vec3> positions_, ups_;
    spectrum::SurveyTask task_;
    spectrum::SurveyPlaces places_;
    spectrum::Profile profile_;
    double profile_top_ = 0, predicted_u_ = 0;
    std::vector<spectrum::Situation> situations_;
    std::vector<spectrum::About> about_;
    std::vector<PlanRun> runs_;
    std::vector<Vec3> up_of_;
    std::vector<std::string> warnings_;
};

}  // namespace

PlanStudy survey_study(const PlanRequest& request) { return SurveyPlan(request).run(); }

}  // namespace vibrig::tool::planner
