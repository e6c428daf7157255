#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "estimator/filter/settings.hpp"
#include "estimator/plan/model.hpp"
#include "estimator/spectrum/flatness.hpp"
#include "estimator/spectrum/mount.hpp"
#include "estimator/spectrum/prediction.hpp"

namespace vibrig::estimator::spectrum {

/// Samples of the accelerometers, which a survey's frequencies must suit.
struct Sampling {
    double sample_hz = 0, window_s = 0;  ///< of the vibration level
};

/// A frequency of a survey, with what the platform gets there.
struct SurveyLine {
    double asked_hz = 0, hz = 0;  ///< the second off what sampling forbids
    double transmission = 1;
    double level_g = 0, table_g = 0;  ///< peak at the platform and at the table
    bool limited = false;             ///< the table cannot do what was asked for
};

/// Ratio of neighbours where a survey's frequencies are not listed.
inline constexpr double kSurveyRatio = 1.4;

/// The listed ones and, up to the highest, as many more at even ratios as the listed ones' last
/// ratio asks for. Throws plan::PlanError.
[[nodiscard]] std::vector<double> survey_frequencies(const std::vector<double>& listed,
                                                     double highest_hz);
/// Frequencies moved to the nearest free ones, levels down to the limits. Throws plan::PlanError
/// where two fall together, isolators amplify, or the transmission is not known.
[[nodiscard]] std::vector<SurveyLine> survey_lines(const std::vector<double>& hz, double level_g,
                                                   const Sampling& sampling, const Mount& mount,
                                                   const TableLimits& limits);

/// Places in a list of positions, one for each dwell.
using Places = std::vector<std::size_t>;
/// Rows of `of`, as often as they are chosen, with the largest determinant of `before` + their
/// information, by exchange. Throws plan::PlanError where they do not determine all columns.
[[nodiscard]] Places choose_rows(const Eigen::MatrixXd& of, std::size_t count,
                                 const Eigen::MatrixXd& before, const std::string& what);

/// Positions of a survey: of its first frequency, at rest, and of each further frequency.
struct SurveyPlaces {
    Places first, rest;
    std::vector<Places> further;
};
/// `ups`: directions of the vertical at the candidates. The first frequency takes each of them, 14
/// at most; rest half as many; further ones `at_further` each, whose six coefficients they
/// determine.
[[nodiscard]] SurveyPlaces survey_places(const std::vector<plan::Vec3>& ups,
                                         const std::vector<SurveyLine>& lines,
                                         std::size_t at_further);

/// What a survey measures and is to predict.
struct SurveyTask {
    Settings settings;
    std::vector<Eigen::Vector3d> gimbal_rad;  ///< of the candidates
    std::vector<SurveyLine> lines;            ///< the first frequency first
    double rate_variance = 0;                 ///< of a dwell, (deg/h)^2
};
/// Standard uncertainty of the drift in these situations, rms over them, the gyros and draws of the
/// resonance from its prior; deg/h.
[[nodiscard]] double predicted_u(const SurveyTask& task, const SurveyPlaces& places,
                                 const std::vector<Situation>& situations);
/// Further frequencies' positions exchanged until that is as small as one exchange makes it; six
/// coefficients of each frequency stay determined.
[[nodiscard]] SurveyPlaces exchange_for(const SurveyTask& task, SurveyPlaces places,
                                        const std::vector<Situation>& situations);
/// What the test of flatness will see of it.
[[nodiscard]] Flatness planned_flatness(const SurveyTask& task, const SurveyPlaces& places);

}  // namespace vibrig::estimator::spectrum
