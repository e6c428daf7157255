#include "estimator/spectrum/survey.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "estimator/filter/linear_algebra.hpp"
#include "estimator/filter/text.hpp"
#include "estimator/spectrum/sampling.hpp"

namespace vibrig::estimator::spectrum {

using Eigen::Index;
using Eigen::MatrixXd;
using plan::PlanError;

namespace {

constexpr std::size_t kFirst = 14;
constexpr double kTogether = 0.02;  ///< closer ones are one frequency, relative
constexpr Index kSquares = 6;

std::string short_text(double value) { return text("%.6g", value); }

/// [1, u, u u'] of a direction.
MatrixXd direction_rows(const std::vector<plan::Vec3>& ups) {
    MatrixXd rows(static_cast<Index>(ups.size()), kBase);
    for (Index i = 0; i < rows.rows(); ++i) {
        const plan::Vec3& u = ups[static_cast<std::size_t>(i)];
        rows.row(i) << 1, u[0], u[1], u[2], u[0] * u[0], u[1] * u[1], u[2] * u[2], u[0] * u[1],
            u[0] * u[2], u[1] * u[2];
    }
    return rows;
}

double log_det(const MatrixXd& information) {
    const auto factor = linear_algebra::Cholesky::of(information);
    return factor ? factor->log_det() : -1e300;
}

MatrixXd information_of(const MatrixXd& of, const Places& places, const MatrixXd& before) {
    MatrixXd sum = before;
    for (const std::size_t place : places) {
        const auto row = of.row(static_cast<Index>(place));
        sum += row.transpose() * row;
    }
    return sum;
}

}  // namespace

std::vector<double> survey_frequencies(const std::vector<double>& listed, double highest_hz) {
    std::vector<double> all = listed;
    std::sort(all.begin(), all.end());
    const double last = all.back();
    if (highest_hz <= 0 || std::abs(highest_hz / last - 1) < kTogether) return all;
    if (highest_hz < last)
        throw PlanError("--highest: found " + short_text(highest_hz) + " Hz, expected " +
                        short_text(last) + " Hz at least, the highest of the listed frequencies");
    const double ratio =
        all.size() > 1 ? std::max(last / all[all.size() - 2], 1 + kTogether) : kSurveyRatio;
    // A hair less than a whole number of steps is that number.
    const double steps = std::ceil(std::log(highest_hz / last) / std::log(ratio) - 1e-6);
    if (steps > 100)
        throw PlanError("--highest: found " + short_text(highest_hz) + " Hz, " + short_text(steps) +
                        " steps from the listed frequencies, expected 100 at most");
    for (int k = 1; k <= static_cast<int>(steps); ++k) {
        const double hz = last * std::pow(highest_hz / last, k / steps);
        all.push_back(k == static_cast<int>(steps) ? highest_hz : std::round(hz * 10) / 10);
    }
    return all;
}

std::vector<SurveyLine> survey_lines(const std::vector<double>& hz, double level_g,
                                     const Sampling& sampling, const Mount& mount,
                                     const TableLimits& limits) {
    std::vector<SurveyLine> lines;
    for (const double asked : hz) {
        SurveyLine line;
        line.asked_hz = asked;
        const std::string place = "--frequencies: found " + short_text(asked) + " Hz, expected ";
        const auto free = nearest_free(asked, sampling.sample_hz, sampling.window_s);
        if (!free)
            throw PlanError(place + "another: " +
                            nearest_free_words(asked, sampling.sample_hz, sampling.window_s));
        line.hz = std::round(1e3 * *free) / 1e3;  // whole mHz, which a file and a register hold
        if (line.hz < mount.lowest_hz())
            throw PlanError(place + short_text(mount.lowest_hz()) +
                            " Hz at least: below it the isolators amplify");
        const auto transmission = mount.transmission(line.hz);
        if (!transmission)
            throw PlanError(place + "a frequency within " +
                            short_text(mount.measured.front().first) + " to " +
                            short_text(mount.measured.back().first) +
                            " Hz, where spectrum.transmission is known");
        if (!lines.empty() && line.hz < lines.back().hz * (1 + kTogether))
            throw PlanError(place + "one 2 % above " + short_text(lines.back().hz) +
                            " Hz: it would be planned at " + short_text(line.hz) + " Hz");
        line.transmission = *transmission;
        line.table_g = level_g / line.transmission;
        const double most = limits.table_g(line.hz);
        if (line.table_g > most) {
            line.limited = true;
            // Three decimals, rounded down: what is written out stays within the limit.
            line.table_g = std::floor(most * 1e3) / 1e3;
        }
        line.level_g = line.table_g * line.transmission;
        lines.push_back(line);
    }
    return lines;
}

Places choose_rows(const MatrixXd& of, std::size_t count, const MatrixXd& before,
                   const std::string& what) {
    // With a trace of a prior every step of the search has a determinant.
    const MatrixXd start = before + 1e-9 * MatrixXd::Identity(of.cols(), of.cols());
    Places chosen;
    const auto best_with = [&](Places rest) {
        rest.push_back(0);
        std::size_t best = 0;
        double most = -1e300;
        for (std::size_t i = 0; i < static_cast<std::size_t>(of.rows()); ++i) {
            rest.back() = i;
            const double value = log_det(information_of(of, rest, start));
            if (value > most + 1e-9) {
                most = value;
                best = i;
            }
        }
        return std::pair{best, most};
    };
    while (chosen.size() < count) chosen.push_back(best_with(chosen).first);
    for (bool better = true; better;) {
        better = false;
        for (std::size_t k = 0; k < chosen.size(); ++k) {
            Places rest = chosen;
            rest.erase(rest.begin() + static_cast<std::ptrdiff_t>(k));
            const double now = log_det(information_of(of, chosen, start));
            const auto [place, value] = best_with(rest);
            if (value <= now + 1e-9) continue;
            chosen[k] = place;
            better = true;
        }
    }
    const MatrixXd information = information_of(of, chosen, before);
    const auto rank = linear_algebra::rank(information, 1e-9);
    if (rank < of.cols())
        throw PlanError(what + ": found positions of rank " + std::to_string(rank) + ", expected " +
                        std::to_string(of.cols()) + ": more, or other, positions");
    std::sort(chosen.begin(), chosen.end());
    return chosen;
}

SurveyPlaces survey_places(const std::vector<plan::Vec3>& ups, const std::vector<SurveyLine>& lines,
                           std::size_t at_further) {
    const MatrixXd rows = direction_rows(ups);
    SurveyPlaces out;
    if (ups.size() <= kFirst) {
        out.first.resize(ups.size());
        std::iota(out.first.begin(), out.first.end(), std::size_t{0});
    } else {
        // At one level D0 and the sum of the squares are one column.
        out.first = choose_rows(rows.rightCols(kBase - 1), kFirst,
                                MatrixXd::Zero(kBase - 1, kBase - 1), "the first frequency");
    }
    const double kappa = plan::kappa_of(lines.front().level_g);
    MatrixXd vibrating = rows;
    vibrating.rightCols(kSquares) *= kappa;
    const MatrixXd before = information_of(vibrating, out.first, MatrixXd::Zero(kBase, kBase));
    out.rest =
        choose_rows(rows, (out.first.size() + 1) / 2, before, "the first frequency and rest");
    for (std::size_t k = 1; k < lines.size(); ++k) {
        out.further.push_back(choose_rows(rows.rightCols(kSquares), at_further,
                                          MatrixXd::Zero(kSquares, kSquares),
                                          short_text(lines[k].hz) + " Hz"));
    }
    return out;
}

}  // namespace vibrig::estimator::spectrum
