#include "daemon/results/spectrum_json.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "daemon/results/assessment_json.hpp"
#include "daemon/results/spectrum_text.hpp"
#include "estimator/filter/mapped.hpp"
#include "estimator/filter/parameters.hpp"
#include "estimator/spectrum/prediction.hpp"

namespace vibrig::tool {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using estimator::kParameters;
using namespace estimator::spectrum;
using Json = nlohmann::ordered_json;

std::string axis_text(const estimator::SignedAxis& axis) {
    return std::string(axis.sign < 0 ? "-" : "+") + "xyz"[axis.axis];
}

/// What of a rig's frames the drift depends on.
Json frame_json(const estimator::Settings& settings) {
    Json gyros = Json::array();
    for (const auto& gyro : settings.gyro_axes) {
        Json axes = Json::array();
        for (const auto& axis : gyro) axes.push_back(axis_text(axis));
        gyros.push_back(std::move(axes));
    }
    return {{"up", axis_text(settings.up)},
            {"gyro_axes", std::move(gyros)},
            {"elevation_deg", settings.elevation_deg}};
}

Json groups_json(const SpectrumResult& of) {
    Json list = Json::array();
    for (std::size_t k = 0; k < of.table.kinds().size(); ++k) {
        const Index begin = kBase - kElastic + kElastic * static_cast<Index>(k);
        Json value = Json::array(), sigma = Json::array();
        for (Index j = 0; j < 3; ++j) {
            for (Index q = 0; q < kElastic; ++q) {
                value.push_back(number_or_null(of.analysis.groups.value(begin + q, j)));
                sigma.push_back(number_or_null(of.analysis.groups.sigma(begin + q, j)));
            }
        }
        const std::string& profile = of.table.kinds()[k].profile;
        list.push_back({{"hz", of.table.kinds()[k].hz()},
                        {"profile", text_or_null(profile)},
                        {"dwells", of.table.dwells_of(k)},
                        {"coefficients", std::move(value)},
                        {"sigma", std::move(sigma)}});
    }
    return list;
}

Json sweeps_json(const std::vector<Sweep>& sweeps) {
    Json list = Json::array();
    for (const Sweep& sweep : sweeps)
        list.push_back({{"run", sweep.run},
                        {"position", sweep.position},
                        {"from_hz", sweep.blocks.front().from_hz},
                        {"to_hz", sweep.blocks.back().to_hz},
                        {"seconds", sweep.blocks.size()},
                        {"used", sweep.known()}});
    return list;
}

Json flat_json(const Flatness& flat) {
    Json seen = Json::object();
    for (const auto& [hz, share] : flat.smallest_seen)
        seen[std::to_string(static_cast<int>(hz))] = number_or_null(share);
    return {{"chi_square", number_or_null(flat.chi_square)},
            {"dof", flat.degrees},
            {"p", number_or_null(flat.p)},
            {"alarm", flat.alarm},
            {"smallest_share_seen", std::move(seen)}};
}

Json estimate_json(const ResonanceEstimate& estimate) {
    return {{"hz", estimate.hz.mean},
            {"hz_interval", {estimate.hz.low, estimate.hz.high}},
            {"damping", estimate.damping.mean},
            {"damping_interval", {estimate.damping.low, estimate.damping.high}},
            {"elastic", numbers_or_null(estimate.elastic)},
            {"sigma", numbers_or_null(estimate.sigma)}};
}

/// One resonance as itself, two as a list, none as null.
template <class List, class Each>
Json one_or_list(const List& list, const Each& each) {
    if (list.empty()) return nullptr;
    if (list.size() == 1) return each(list.front());
    Json out = Json::array();
    for (const auto& one : list) out.push_back(each(one));
    return out;
}

Json mixture_json(const std::vector<Hypothesis>& mixture) {
    Json list = Json::array();
    for (const Hypothesis& one : mixture)
        list.push_back(
            {{"w", one.weight},
             {"hz", one_or_list(one.resonances, [](auto& r) { return Json(r.hz); })},
             {"damping", one_or_list(one.resonances, [](auto& r) { return Json(r.damping); })},
             {"x", numbers_or_null(one.x)},
             {"p", matrix_or_null(one.covariance)}});
    return list;
}

Json effects_json(const std::vector<Effect>& effects) {
    Json list = Json::array();
    for (const Effect& effect : effects) {
        Json change = Json::array();
        for (const VectorXd& gyro : effect.change) change.push_back(numbers_or_null(gyro));
        list.push_back({{"input", effect.input},
                        {"element", text_or_null(effect.element)},
                        {"change", std::move(change)}});
    }
    return list;
}

/// Of each pair the places in the list of effects, and the correlation.
Json correlated_json(const std::vector<estimator::uncertainty::Correlated>& pairs) {
    Json list = Json::array();
    for (const auto& pair : pairs) list.push_back({pair.first, pair.second, pair.value});
    return list;
}

/// Rates of the dwells held out, those predicted for what happened in them, deg/h, and what is
/// between the two in standard uncertainties of both.
Json held_out_json(const SpectrumResult& of) {
    Json list = Json::array();
    if (of.held_out.empty()) return list;
    std::vector<Situation> situations;
    std::vector<Eigen::Matrix3d> variances;
    std::vector<double> errors;
    MatrixXd rates(static_cast<Index>(of.held_out.size()), 3);
    for (const auto& [row, kind] : of.held_out) {
        rates.row(static_cast<Index>(situations.size())) = estimator::mapped(row.rate);
        situations.push_back(
            {estimator::mapped(row.angles), level_moment(row.vibration),
             estimator::spectrum::bands_of(of.analysis.model.frame, row, kind.bands),
             row.duration_s, true});
        variances.emplace_back(estimator::mapped(row.variance));
        errors.push_back(row.relative_error);
    }
    const Prediction predicted = predict(of.analysis.model, situations);
    const Verification verified = verify(predicted, rates, variances, errors);
    for (Index k = 0; k < rates.rows(); ++k) {
        const auto& [row, kind] = of.held_out[static_cast<std::size_t>(k)];
        VectorXd u(3);
        for (Index j = 0; j < 3; ++j) u[j] = predicted.u(k, j);
        list.push_back({{"run", row.run},
                        {"position", row.position},
                        {"hz", kind.hz()},
                        {"profile", text_or_null(kind.profile)},
                        {"rate", numbers_or_null(row.rate)},
                        {"predicted", numbers_or_null(predicted.drift.row(k))},
                        {"u", numbers_or_null(u)},
                        {"z", numbers_or_null(verified.z.row(k))}});
    }
    return list;
}

const nlohmann::json& member(const nlohmann::json& in, const char* key, const std::string& place) {
    const auto found = in.find(key);
    if (found == in.end())
        throw std::runtime_error(place + key +
                                 ": found nothing, expected the result of vibrig identify --json");
    return *found;
}

estimator::SignedAxis read_axis(const std::string& text) {
    const auto at = text.size() == 2 ? std::string("xyz").find(text[1]) : std::string::npos;
    if (at == std::string::npos)
        throw std::runtime_error("found '" + text + "', expected an axis such as +y");
    return {static_cast<int>(at), text[0] == '-' ? -1 : 1};
}

VectorXd read_vector(const nlohmann::json& list) {
    const auto values = list.get<std::vector<double>>();
    return Eigen::Map<const VectorXd>(values.data(), static_cast<Index>(values.size()));
}

MatrixXd read_rows(const nlohmann::json& list) {
    MatrixXd out(static_cast<Index>(list.size()), static_cast<Index>(list.at(0).size()));
    for (std::size_t i = 0; i < list.size(); ++i)
        out.row(static_cast<Index>(i)) = read_vector(list[i]);
    return out;
}

void read_frame(const nlohmann::json& frame, estimator::Settings& settings) {
    settings.up = read_axis(frame.at("up").get<std::string>());
    for (std::size_t j = 0; j < 3; ++j) {
        for (std::size_t k = 0; k < 3; ++k)
            settings.gyro_axes[j][k] =
                read_axis(frame.at("gyro_axes").at(j).at(k).get<std::string>());
    }
    settings.elevation_deg = frame.at("elevation_deg").get<double>();
}

/// Earlier versions have none: their effects are mixed so that they are independent.
void read_correlated(const nlohmann::json& spectrum, const std::string& place, Model& model) {
    const auto pairs = spectrum.find("effects_correlation");
    if (pairs == spectrum.end()) return;
    for (const auto& pair : *pairs) {
        const estimator::uncertainty::Correlated one{
            pair.at(0).get<std::size_t>(), pair.at(1).get<std::size_t>(), pair.at(2).get<double>()};
        const std::size_t count = model.effects.size();
        if (one.first >= count || one.second >= count || !(std::abs(one.value) <= 1 + 1e-9))
            throw std::runtime_error(place + "effects_correlation: found " + pair.dump() +
                                     ", expected two of " + std::to_string(count) +
                                     " effects and a number from -1 to 1");
        model.correlated.push_back(one);
    }
}

}  // namespace

void add_spectrum(const SpectrumResult& of, Json& root) {
    const Analysis& a = of.analysis;
    for (std::size_t i = 0; i < kParameters; ++i)
        root["parameters"][i]["at_hz"] = number_or_null(of.at_hz(i));
    if (of.several()) {
        for (std::size_t k = 0; k < of.table.list().size(); ++k) {
            const SpectralDwell& dwell = of.table.list()[k];
            Json lines = Json::array();
            const double moment = dwell.row.vibration.kappa - 1;
            const Kind* kind = dwell.kind ? &of.table.kinds()[*dwell.kind] : nullptr;
            if (kind != nullptr && !kind->profile.empty()) {
                root["dwell_rates"][k]["profile"] = kind->profile;
            } else {
                if (kind != nullptr) {
                    for (const Band& band : dwell.bands.empty() ? kind->bands : dwell.bands)
                        lines.push_back({band.hz, std::sqrt(2 * moment * band.share)});
                }
                root["dwell_rates"][k]["lines"] = std::move(lines);
            }
            root["dwell_rates"][k]["r_relative_error"] = dwell.relative_error;
        }
    }
    Json odds = Json::array(), resonance = Json::array(), mixture = Json::array();
    Json lack = Json::array();
    for (std::size_t j = 0; j < 3; ++j) {
        const Mixture& gyro = a.gyros[j];
        odds.push_back(of.several() ? number_or_null(gyro.log_odds) : Json(nullptr));
        resonance.push_back(one_or_list(estimates(gyro), estimate_json));
        mixture.push_back(mixture_json(gyro.list));
        lack.push_back(of.several() ? number_or_null(a.lack_of_fit[j]) : Json(nullptr));
    }
    root["spectrum"] = {{"model", name_of(a.form)},
                        {"frequencies", groups_json(of)},
                        {"sweeps", sweeps_json(of.sweeps)},
                        {"flat", of.table.kinds().size() > 1 ? flat_json(a.flat) : Json(nullptr)},
                        {"log_odds", std::move(odds)},
                        {"resonance", std::move(resonance)},
                        {"mixture", std::move(mixture)},
                        {"lack_of_fit", std::move(lack)},
                        {"lowest_hz", a.model.lowest_hz},
                        {"highest_hz", a.model.highest_hz},
                        {"held_out", held_out_json(of)},
                        {"refusal", text_or_null(a.model.refusal)},
                        {"not_told", not_shown()},
                        {"effects", effects_json(a.model.effects)},
                        {"effects_correlation", correlated_json(a.model.correlated)},
                        {"platform", frame_json(a.model.frame)}};
}

Hypothesis read_hypothesis(const nlohmann::json& from) {
    Hypothesis one;
    one.weight = from.at("w").get<double>();
    if (!(one.weight > 0 && one.weight <= 1))
        throw std::runtime_error("w: found " + from.at("w").dump() + ", expected a weight to 1");
    const auto& hz = from.at("hz");
    const auto& damping = from.at("damping");
    if (hz.is_array()) {
        for (std::size_t r = 0; r < hz.size(); ++r)
            one.resonances.push_back({hz[r].get<double>(), damping.at(r).get<double>()});
    } else if (hz.is_number()) {
        one.resonances = {{hz.get<double>(), damping.get<double>()}};
    }
    one.x = read_vector(from.at("x"));
    one.covariance = read_rows(from.at("p"));
    const Index columns = kBase + kElastic * static_cast<Index>(one.resonances.size());
    if (one.x.size() != columns || one.covariance.rows() != one.covariance.cols())
        throw std::runtime_error("found x of " + std::to_string(one.x.size()) + " and p of " +
                                 std::to_string(one.covariance.rows()) + " x " +
                                 std::to_string(one.covariance.cols()) + ", expected " +
                                 std::to_string(columns) + " coefficients and a square");
    if (!one.x.allFinite() || !one.covariance.allFinite())
        throw std::runtime_error("x, p: found what is no number, expected numbers");
    one.linearised = one.covariance.rows() > one.x.size();
    return one;
}

Model read_model(const nlohmann::json& root, const std::string& path) {
    if (!root.is_object())
        throw std::runtime_error(path + ": expected the JSON of vibrig identify --json");
    const nlohmann::json& spectrum = member(root, "spectrum", path + ": ");
    const std::string place = path + ": spectrum.";
    Model model;
    const auto& mixture = member(spectrum, "mixture", place);
    const auto& effects = member(spectrum, "effects", place);
    try {
        read_frame(member(spectrum, "platform", place), model.frame);
        for (std::size_t j = 0; j < 3; ++j) {
            for (const auto& one : mixture.at(j)) {
                try {
                    model.mixture[j].push_back(read_hypothesis(one));
                } catch (const std::runtime_error& error) {
                    throw std::runtime_error(place + "mixture[" + std::to_string(j) + "][" +
                                             std::to_string(model.mixture[j].size()) +
                                             "]: " + error.what());
                }
            }
            if (model.mixture[j].empty())
                throw std::runtime_error(place + "mixture[" + std::to_string(j) +
                                         "]: found it empty, expected hypotheses");
        }
        for (const auto& one : effects) {
            Effect effect{one.at("input").get<std::string>(), "", {}};
            for (std::size_t j = 0; j < 3; ++j) {
                effect.change[j] = read_vector(one.at("change").at(j));
                const auto& heaviest = model.mixture[j].front();
                if (effect.change[j].size() != heaviest.x.size())
                    throw std::runtime_error(
                        place + "effects: found " + std::to_string(effect.change[j].size()) +
                        " numbers, expected " + std::to_string(heaviest.x.size()));
            }
            model.effects.push_back(std::move(effect));
        }
        read_correlated(spectrum, place, model);
        model.lowest_hz = member(spectrum, "lowest_hz", place).get<double>();
        model.highest_hz = member(spectrum, "highest_hz", place).get<double>();
        const auto& refusal = member(spectrum, "refusal", place);
        if (refusal.is_string()) model.refusal = refusal.get<std::string>();
    } catch (const nlohmann::json::exception& error) {
        throw std::runtime_error(place + "mixture: " + error.what() +
                                 ", expected the result of vibrig identify --json");
    }
    return model;
}

}  // namespace vibrig::tool
