#include <array>
#include <cmath>
#include <iostream>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "daemon/plan/number_table.hpp"
#include "daemon/plot/chart.hpp"
#include "daemon/results/text_line.hpp"
#include "daemon/tool/commands.hpp"
#include "daemon/tool/design/plan_terms.hpp"
#include "estimator/allan/edf.hpp"
#include "estimator/plan/calibration.hpp"
#include "proto/json_number.hpp"
#include "proto/json_text.hpp"

namespace vibrig::tool::calibration {

namespace {

namespace planning = estimator::plan;
using Json = nlohmann::ordered_json;

struct Options {
    std::string file;
    double sigma = 0;  ///< of one reading; 0: the file's, or unknown
    std::vector<std::string> without;
    double level = 0.01;
    std::string plot;
    bool json = false;
};

struct Study {
    planning::SensorCalibration result;
    planning::Terms terms{};
    std::vector<planning::Reading> readings;
    std::vector<std::size_t> lines;
    std::vector<std::string> warnings;
    double level = 0;
    [[nodiscard]] bool passed() const { return !result.test || result.test->probability >= level; }
};

/// Of the row at `place`, within what can be reckoned with.
void require_within(const std::string& place, const char* column, double value, double low,
                    double high) {
    if (value >= low && value <= high) return;
    plan::refuse(place + ": column " + column, Json(value).dump(),
                 printed("a number from %g to %g", low, high));
}

planning::Reading reading_at(const std::string& place, const std::array<double, 4>& row,
                             double sigma) {
    constexpr std::array kInputs{"x1", "x2", "x3"};
    for (std::size_t k = 0; k < kInputs.size(); ++k)
        require_within(place, kInputs[k], row[k], -planning::kLargestInput,
                       planning::kLargestInput);
    require_within(place, "y", row[3], -planning::kLargestOutput, planning::kLargestOutput);
    return {{row[0], row[1], row[2]}, row[3], sigma};
}

void read(const Options& options, Study& study) {
    const auto table = plan::read_table(plan::content_of(options.file), options.file,
                                        {{"x1", "x2", "x3", "y", "sigma", "count"}});
    if (!table.warning.empty()) study.warnings.push_back(table.warning);
    std::array<std::size_t, 4> column{};
    for (std::size_t k = 0; k < column.size(); ++k) {
        const auto* name = std::array{"x1", "x2", "x3", "y"}[k];
        const auto found = table.find(name);
        if (!found)
            plan::refuse(options.file + ":1", "no column " + std::string(name),
                         "the columns x1, x2, x3 and y, and sigma and count if known");
        column[k] = *found;
    }
    const auto sigma = table.find("sigma"), count = table.find("count");
    if (sigma && options.sigma > 0) {
        throw std::runtime_error("found --sigma and a column sigma in " + options.file +
                                 ", expected one of them");
    }
    for (std::size_t i = 0; i < table.rows.size(); ++i) {
        const std::vector<double>& row = table.rows[i];
        const std::string place = options.file + ":" + std::to_string(table.lines[i]);
        planning::Reading reading =
            reading_at(place, {row[column[0]], row[column[1]], row[column[2]], row[column[3]]},
                       sigma ? row[*sigma] : options.sigma);
        if (sigma)
            require_within(place, "sigma", reading.sigma, planning::kSmallestSigma,
                           planning::kLargestSigma);
        if (count) {
            // A mean of so many readings.
            require_within(place, "count", row[*count], 1, planning::kMostMeant);
            if (!(reading.sigma > 0) && row[*count] != 1)
                plan::refuse(place + ": column count", "a mean without a sigma",
                             "--sigma or a column sigma, of one reading");
            reading.sigma /= std::sqrt(row[*count]);
        }
        study.readings.push_back(reading);
    }
    study.lines = table.lines;
}

void warn_of_outliers(Study& study) {
    const auto n = static_cast<double>(study.readings.size());
    const double limit = estimator::allan::normal_quantile(1 - study.level / (2 * n));
    for (std::size_t i = 0; i < study.readings.size(); ++i) {
        const double size = std::abs(study.result.standardised[i]);
        if (size > limit) {
            study.warnings.push_back(
                printed("line %zu: the output is %.3g standard deviations off the model, %.3g "
                        "expected at most among so many",
                        study.lines[i], size, limit));
        }
    }
    if (!study.result.test)
        study.warnings.push_back("no test of the residuals: " + study.result.untested);
}

Json test_json(const Study& study) {
    if (!study.result.test) return nullptr;
    const planning::ResidualTest& test = *study.result.test;
    const bool stated = test.error_degrees == 0;
    return {{"kind", stated ? "chi-square" : "lack of fit, F"},
            {"statistic", proto::number_or_null(test.statistic)},
            {"degrees", test.degrees},
            {"error_degrees", stated ? Json(nullptr) : Json(test.error_degrees)},
            {"probability", proto::number_or_null(test.probability)},
            {"level", study.level},
            {"passed", study.passed()}};
}

std::string json_text(const Study& study) {
    const planning::SensorCalibration& r = study.result;
    Json coefficients = Json::array(), null = Json::array(), residuals = Json::array();
    for (std::size_t k = 0; k < planning::kTerms; ++k) {
        if (!study.terms[k]) continue;
        const bool determined = std::isfinite(r.plan.sigma[k]);
        coefficients.push_back(
            {{"name", planning::kTermNames[k]},
             {"value", determined ? proto::number_or_null(r.value[k]) : Json(nullptr)},
             {"sigma", determined ? proto::number_or_null(r.sigma[k]) : Json(nullptr)},
             {"determined", determined}});
    }
    for (const planning::Row& row : r.plan.null_vectors) {
        Json weights = Json::object();
        for (std::size_t k = 0; k < planning::kTerms; ++k) {
            if (row[k] != 0) weights[planning::kTermNames[k]] = row[k];
        }
        null.push_back(std::move(weights));
    }
    for (std::size_t i = 0; i < study.readings.size(); ++i) {
        residuals.push_back({{"line", study.lines[i]},
                             {"residual", r.residual[i]},
                             {"standardised", proto::number_or_null(r.standardised[i])}});
    }
    Json covariance = Json::array();
    for (Eigen::Index i = 0; i < r.covariance.rows(); ++i) {
        Json row = Json::array();
        for (Eigen::Index j = 0; j < r.covariance.cols(); ++j)
            row.push_back(proto::number_or_null(r.covariance(i, j)));
        covariance.push_back(std::move(row));
    }
    return proto::json_text(Json{{"coefficients", std::move(coefficients)},
                                 {"covariance", std::move(covariance)},
                                 {"rank", r.plan.rank},
                                 {"condition", proto::number_or_null(r.plan.condition)},
                                 {"null_vectors", std::move(null)},
                                 {"readings", study.readings.size()},
                                 {"degrees_of_freedom", r.degrees},
                                 {"noise", proto::number_or_null(r.noise)},
                                 {"test", test_json(study)},
                                 {"residuals", std::move(residuals)},
                                 {"warnings", study.warnings}});
}

std::string table_text(const Study& study) {
    const planning::SensorCalibration& r = study.result;
    std::string text = "coefficient          value        1 sigma\n";
    for (std::size_t k = 0; k < planning::kTerms; ++k) {
        if (!study.terms[k]) continue;
        text +=
            std::isfinite(r.plan.sigma[k])
                ? printed("  %-5s %18.9g %14.3g\n", planning::kTermNames[k], r.value[k], r.sigma[k])
                : printed("  %-5s     not determined\n", planning::kTermNames[k]);
    }
    text += printed("\n%zu readings, rank %zu of %zu", study.readings.size(), r.plan.rank,
                    r.plan.coefficients);
    text += r.plan.identifies_all() ? printed(", condition %.4g\n", r.plan.condition) : "\n";
    if (std::isfinite(r.noise)) text += printed("noise of y %.4g, 1 sigma\n", r.noise);
    if (r.test) {
        const planning::ResidualTest& t = *r.test;
        text += t.error_degrees == 0
                    ? printed("residuals: chi-square %.4g of %g", t.statistic, t.degrees)
                    : printed("lack of fit: F %.4g of %g and %g", t.statistic, t.degrees,
                              t.error_degrees);
        text += printed(", probability %.3g: %s\n", t.probability,
                        study.passed() ? "the model holds" : "the model does NOT hold");
    }
    for (const std::string& warning : study.warnings) text += "warning: " + warning + '\n';
    return text;
}

plot::Chart residual_chart(const Study& study) {
    plot::Chart chart{"Residuals of the calibration", plot::Axis("reading"),
                      plot::Axis("residual over its own sigma")};
    plot::Curve dots{.look = plot::Look::dots};
    for (std::size_t i = 0; i < study.readings.size(); ++i) {
        dots.add(static_cast<double>(i + 1), study.result.standardised[i]);
    }
    chart.curves.push_back(dots);
    const double last = static_cast<double>(study.readings.size());
    for (const double level : {-2.0, 2.0})
        chart.curves.push_back(plot::level_line(level > 0 ? "two sigma" : "", 1, last, level));
    return chart;
}

int run(const Options& options) {
    Study study;
    study.level = options.level;
    study.terms = planner::terms_without(options.without);
    read(options, study);
    try {
        study.result = planning::calibrate(study.readings, study.terms);
    } catch (const planning::PlanError& error) {
        throw std::runtime_error(options.file + ": " + error.what());
    }
    warn_of_outliers(study);
    if (!options.plot.empty())
        plot::write_pictures(options.plot, {{"residuals", residual_chart(study).svg()}});
    std::cout << (options.json ? json_text(study) + "\n" : table_text(study));
    const bool complete = study.result.plan.identifies_all();
    if (!complete) {
        std::cerr << "not determined: " << study.result.plan.undetermined()
                  << (study.result.plan.null_vectors.empty()
                          ? ""
                          : "; readings on one sphere only leave D0 and the squares "
                            "undetermined, see vibrig plan --turntable")
                  << '\n';
    }
    return complete && study.passed() ? 0 : kNo;
}

}  // namespace

}  // namespace vibrig::tool::calibration

namespace vibrig::tool {

void add_calibrate(CLI::App& app, int& exit_code) {
    const auto [command, options] = add_command<calibration::Options>(
        app, exit_code, "calibrate",
        "Ten coefficients of an accelerometer or gyro from a turntable test", calibration::run);
    command
        .add_option("FILE", options.file,
                    "CSV with x1, x2, x3 (input along input, output, spin axis: g, deg/s ...) and "
                    "y (output); sigma (1 sigma of y) and count (readings that y is the mean of) "
                    "if known")
        ->required();
    add_number(command, "--sigma", options.sigma, "1 sigma of one reading, if known",
               calibration::planning::kSmallestSigma, calibration::planning::kLargestSigma);
    command.add_option("--without", options.without, "terms the model has not, such as D12,D13")
        ->delimiter(',');
    add_number(command, "--level", options.level, "of the tests of the residuals (0.01)", 1e-9,
               0.5);
    command.add_option("--plot", options.plot, "an SVG file, or a folder: the residuals")
        ->check(proto::charts());
    command.add_flag("--json", options.json, "print the result as JSON");
    command.footer(
        "Example: vibrig calibrate turntable.csv --sigma 2e-6 --json\n"
        "The model: y = D0 + sum Di xi + sum Dii xi^2 + sum Dij xi xj. A plan for the test: vibrig "
        "plan --turntable.\n"
        "Exit codes: 0 done, 1 not all coefficients are determined or the model does not hold, 2 "
        "bad usage\nor input.");
}

}  // namespace vibrig::tool
