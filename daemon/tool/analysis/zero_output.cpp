#include "daemon/tool/analysis/zero_command.hpp"

#include <cmath>

#include "daemon/results/text_line.hpp"
#include "proto/json_number.hpp"

namespace vibrig::tool::zero_command {

namespace {

/// What accelerometer i shows of 1 g along axis k.
struct Share {
    std::string key;    ///< of JSON
    std::string words;  ///< of the table
    double unit = 1;
    const char* unit_name = "";
};

Share share_of(std::size_t i, std::size_t k) {
    if (i == k) return {"scale_ppm", "scale error", 1e-6, "ppm"};
    // Towards z, the axis that every calibration has, it has no more of a name.
    const std::string to = k == 2 ? "" : std::string("_to_") + kAxisLetters[k];
    return {"misalignment" + to + "_arcsec",
            k == 2 ? "misalignment" : std::string("towards ") + kAxisLetters[k], kRadPerArcsec,
            "arcsec"};
}

}  // namespace

plot::Chart chart_of(const std::vector<zeros::CalibrationTrace>& trace) {
    plot::Chart chart{"Accelerometer zeros while the azimuth turns", plot::Axis("time [s]"),
                      plot::Axis("zero [mg]")};
    for (std::size_t i = 0; i < 3; ++i) {
        plot::Curve curve{kAxisLetters[i]};
        for (const zeros::CalibrationTrace& point : trace) {
            if (point.sigma_mg[i] > 2) continue;  // the first guesses would stretch the axis
            curve.add(point.time_s, point.zero_mg[i], point.zero_mg[i] - point.sigma_mg[i],
                      point.zero_mg[i] + point.sigma_mg[i]);
        }
        chart.curves.push_back(curve);
    }
    chart.notes.emplace_back(
        "Bands: 1 sigma of the filter. x, y: zero + 1 g x misalignment, z: zero + 1 g x scale "
        "error.");
    return chart;
}

constexpr std::array kWhat{"zero + 1 g x misalignment", "zero + 1 g x misalignment",
                           "zero + 1 g x scale error"};

Json result_json(const zeros::CalibrationResult& r, const zeros::Observability& seen) {
    Json axes = Json::array();
    for (std::size_t i = 0; i < 3; ++i) {
        const zeros::AxisResult& axis = r.axis[i];
        axes.push_back(
            {{"axis", kAxisLetters[i]},
             {"what", kWhat[i]},
             {"observable", false},
             {"zero_mg", proto::number_or_null(axis.zero_mg)},
             {"sigma_mg", proto::number_or_null(axis.sigma_mg)},
             {"filter_sigma_mg", proto::number_or_null(axis.filter_sigma_mg)},
             {"level_arcmin",
              proto::number_or_null(axis.zero_mg * 1e-3 / estimator::kRadPerDeg * 60)},
             {"movement_mg", proto::number_or_null(axis.movement_mg)},
             {"converged_s", axis.converged_s ? Json(*axis.converged_s) : Json(nullptr)}});
    }
    Json degrees = Json::object();
    for (std::size_t i = 0; i < seen.degree.size(); ++i) {
        degrees[zeros::kStateNames[i]] = seen.degree[i];
    }
    return {{"valid", r.valid},
            {"time_s", r.time_s},
            {"zeros", axes},
            {"covariance_mg2", r.covariance_mg2},
            {"gyro_bias_deg_h", r.gyro_bias_deg_h},
            {"gyro_sigma_deg_h", r.gyro_sigma_deg_h},
            {"observability",
             {{"rank", seen.rank},
              {"singular", seen.singular},
              {"degree", degrees},
              {"unobservable", seen.unobservable()}}},
            {"innovation",
             {{"mean_nis", r.innovation.mean_nis},
              {"low", r.innovation.low},
              {"high", r.innovation.high},
              {"blocks", r.innovation.blocks},
              {"outside", r.innovation.outside}}},
            {"updates", r.updates},
            {"gaps", r.gaps},
            {"problems", r.problems},
            {"notes", r.notes}};
}

std::string result_table(const zeros::CalibrationResult& r, const zeros::Observability& seen) {
    std::string out = "axis      zero [mg]   sigma [mg]   level [']   converged\n";
    for (std::size_t i = 0; i < 3; ++i) {
        const zeros::AxisResult& axis = r.axis[i];
        out += printed("%-4s %14.5f %12.5f %11.4f   %s\n", kAxisLetters[i], axis.zero_mg,
                       axis.sigma_mg, axis.zero_mg * 1e-3 / estimator::kRadPerDeg * 60,
                       axis.converged_s ? printed("%.0f s", *axis.converged_s).c_str() : "no");
    }
    out += printed(
        "x and y are zero + 1 g x misalignment, z is zero + 1 g x scale error; of their "
        "sigma the filter's share is %.5f, %.5f, %.5f mg\n",
        r.axis[0].filter_sigma_mg, r.axis[1].filter_sigma_mg, r.axis[2].filter_sigma_mg);
    if (r.gyro_gain) {
        out +=
            printed("vertical gyro against the azimuth read-out: %+.1f ppm\n", *r.gyro_gain * 1e6);
    }
    out += printed("gyro biases %.4f, %.4f, %.4f deg/h (1 sigma %.2g, %.2g, %.2g)\n",
                   r.gyro_bias_deg_h[0], r.gyro_bias_deg_h[1], r.gyro_bias_deg_h[2],
                   r.gyro_sigma_deg_h[0], r.gyro_sigma_deg_h[1], r.gyro_sigma_deg_h[2]);
    out += printed("observability: rank %d of 15, smallest singular values %.2g, %.2g, %.2g\n",
                   seen.rank, seen.singular[12], seen.singular[13], seen.singular[14]);
    for (std::size_t i = 0; i < seen.degree.size(); ++i) {
        out += printed("  %-10s %-9.3g%s", zeros::kStateNames[i], seen.degree[i],
                       i % 3 == 2 ? "\n" : "");
    }
    if (r.innovation.blocks > 0) {
        out += printed("innovations: mean normalised square %.3f, expected %.3f to %.3f\n",
                       r.innovation.mean_nis, r.innovation.low, r.innovation.high);
    }
    for (const std::string& note : r.notes) out += "note: " + note + "\n";
    for (const std::string& problem : r.problems) out += "not valid: " + problem + "\n";
    return out;
}

Json apart_json(const zeros::ZerosApart& apart, bool valid) {
    const auto known = [valid](double value) { return valid ? Json(value) : Json(nullptr); };
    Json json = Json::array();
    for (std::size_t i = 0; i < 3; ++i) {
        Json axis{{"axis", kAxisLetters[i]},
                  {"what", "zero"},
                  {"observable", valid},
                  {"zero_mg", known(apart.zero_mg[i])},
                  {"sigma_mg", known(std::sqrt(apart.covariance_mg2[i][i]))}};
        for (std::size_t k = 0; k < 3; ++k) {
            if (apart.share_sigma[i][k] <= 0) continue;
            const Share share = share_of(i, k);
            axis[share.key] = known(apart.share[i][k] / share.unit);
            axis[share.key + "_sigma"] = known(apart.share_sigma[i][k] / share.unit);
        }
        json.push_back(std::move(axis));
    }
    return json;
}

std::string apart_table(const zeros::ZerosApart& apart, bool valid) {
    if (!valid) return "zeros apart from misalignment and scale: none, not every run is valid\n";
    std::string out = "zeros apart from misalignment and scale\n";
    for (std::size_t i = 0; i < 3; ++i) {
        out += printed("%-4s zero %.5f +- %.5f mg", kAxisLetters[i], apart.zero_mg[i],
                       std::sqrt(apart.covariance_mg2[i][i]));
        for (std::size_t k = 0; k < 3; ++k) {
            if (apart.share_sigma[i][k] <= 0) continue;
            const Share share = share_of(i, k);
            out +=
                printed(", %s %.3f +- %.3f %s", share.words.c_str(), apart.share[i][k] / share.unit,
                        apart.share_sigma[i][k] / share.unit, share.unit_name);
        }
        out += '\n';
    }
    return out;
}

}  // namespace vibrig::tool::zero_command
