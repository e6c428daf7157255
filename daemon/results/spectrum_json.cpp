#include "daemon/results/spectrum_json.hpp"

#include <Eigen/Eigenvalues>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <utility>

#include "daemon/results/assessment_json.hpp"
#include "daemon/results/spectrum_text.hpp"
#include "daemon/results/text_line.hpp"
#include "estimator/filter/mapped.hpp"
#include "estimator/filter/parameters.hpp"
#include "estimator/spectrum/prediction.hpp"
#include "proto/text.hpp"

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

using ReadJson = nlohmann::json;

constexpr std::size_t kLongestSentence = 1000;  ///< of a verdict: its reasons are of use whole
constexpr double kMost = 1e12;  ///< of a coefficient, deg/h/g^2; beyond it sums are no numbers
constexpr double kMostHz = 1e5;
constexpr double kMostElevation = 2;  ///< as of the configuration's site.elevation_deg
constexpr double kRounding = 1e-6;    ///< of correlations and weights, by their computation

[[noreturn]] void refuse(const std::string& place, const std::string& found,
                         const std::string& expected) {
    throw std::runtime_error(place + ": found " + found + ", expected " + expected);
}

std::string shown(const ReadJson& value) { return value.dump().substr(0, 60); }

const ReadJson& member(const ReadJson& in, const char* key, const std::string& place) {
    const auto found = in.find(key);
    if (found == in.end()) refuse(place + key, "nothing", "the result of vibrig identify --json");
    return *found;
}

double read_number(const ReadJson& value, const std::string& place, double least, double most) {
    if (!value.is_number() || !(value.get<double>() >= least && value.get<double>() <= most))
        refuse(place, shown(value), printed("a number from %g to %g", least, most));
    return value.get<double>();
}

const ReadJson& list_of(const ReadJson& value, std::size_t size, const std::string& place) {
    if (!value.is_array()) refuse(place, shown(value), "a list of " + std::to_string(size));
    if (value.size() != size)
        refuse(place, std::to_string(value.size()) + " entries", std::to_string(size));
    return value;
}

std::string at(const std::string& place, std::size_t index) {
    return place + "[" + std::to_string(index) + "]";
}

VectorXd read_vector(const ReadJson& list, Index size, double most, const std::string& place) {
    VectorXd out(size);
    const auto count = static_cast<std::size_t>(size);
    list_of(list, count, place);
    for (std::size_t i = 0; i < count; ++i)
        out[static_cast<Index>(i)] = read_number(list[i], at(place, i), -most, most);
    return out;
}

/// Symmetric and positive semidefinite, as far as their computation rounds.
void check_covariance(const MatrixXd& p, const std::string& place) {
    MatrixXd correlation = p;
    for (Index i = 0; i < p.rows(); ++i) {
        const std::string row = at(place, static_cast<std::size_t>(i));
        if (!(p(i, i) >= 0))
            refuse(at(row, static_cast<std::size_t>(i)), printed("%g", p(i, i)),
                   "a variance of 0 or above");
        for (Index j = 0; j < i; ++j) {
            const double scale = std::sqrt(p(i, i) * p(j, j));
            if (!(std::abs(p(i, j)) <= (1 + kRounding) * scale &&
                  std::abs(p(i, j) - p(j, i)) <= kRounding * scale))
                refuse(at(row, static_cast<std::size_t>(j)),
                       printed("%g, and %g across", p(i, j), p(j, i)),
                       printed("a symmetric covariance of at most %g", scale));
            correlation(i, j) = correlation(j, i) = scale > 0 ? p(i, j) / scale : 0;
        }
        correlation(i, i) = p(i, i) > 0 ? 1 : 0;
    }
    const double least =
        Eigen::SelfAdjointEigenSolver<MatrixXd>(correlation, Eigen::EigenvaluesOnly)
            .eigenvalues()
            .minCoeff();
    if (!(least >= -kRounding))
        refuse(place, printed("correlations with an eigenvalue of %g", least),
               "a positive semidefinite covariance");
}

/// Of the coefficients, and where it is linearised, of each resonance's frequency and damping too.
MatrixXd read_covariance(const ReadJson& list, Index columns, Index resonances) {
    const std::string place = "p";
    const Index linearised = columns + 2 * resonances;
    const bool longer = list.is_array() && list.size() == static_cast<std::size_t>(linearised);
    const Index size = longer ? linearised : columns;
    list_of(list, static_cast<std::size_t>(size), place);
    MatrixXd out(size, size);
    for (Index i = 0; i < size; ++i) {
        const auto row = static_cast<std::size_t>(i);
        out.row(i) = read_vector(list[row], size, kMost * kMost, at(place, row));
    }
    check_covariance(out, place);
    return out;
}

/// None, itself or a list, as one_or_list() writes it.
std::vector<estimator::spectrum::Resonance> read_resonances(const ReadJson& from) {
    const auto listed = [&](const char* key) {
        const ReadJson& value = member(from, key, "");
        if (value.is_null()) return std::vector<double>{};
        if (!value.is_array()) return std::vector<double>{read_number(value, key, 1e-9, kMostHz)};
        std::vector<double> out;
        for (const ReadJson& one : value)
            out.push_back(read_number(one, at(key, out.size()), 1e-9, kMostHz));
        return out;
    };
    const auto hz = listed("hz"), damping = listed("damping");
    if (hz.size() != damping.size())
        refuse("damping", std::to_string(damping.size()) + " values",
               "as many as of hz, " + std::to_string(hz.size()));
    std::vector<estimator::spectrum::Resonance> out;
    for (std::size_t r = 0; r < hz.size(); ++r) out.push_back({hz[r], damping[r]});
    return out;
}

estimator::SignedAxis read_axis(const ReadJson& value, const std::string& place) {
    const std::string text = value.is_string() ? value.get<std::string>() : "";
    const auto axis = text.size() == 2 ? std::string("xyz").find(text[1]) : std::string::npos;
    if (axis == std::string::npos || (text[0] != '+' && text[0] != '-'))
        refuse(place, shown(value), "an axis such as \"+y\"");
    return {static_cast<int>(axis), text[0] == '-' ? -1 : 1};
}

void read_frame(const ReadJson& frame, const std::string& place, estimator::Settings& settings) {
    settings.up = read_axis(member(frame, "up", place), place + "up");
    const std::string of_gyros = place + "gyro_axes";
    const ReadJson& gyros = list_of(member(frame, "gyro_axes", place), 3, of_gyros);
    for (std::size_t j = 0; j < 3; ++j) {
        std::array<bool, 3> seen{};
        for (std::size_t k = 0; k < 3; ++k) {
            const auto axis =
                read_axis(list_of(gyros[j], 3, at(of_gyros, j))[k], at(at(of_gyros, j), k));
            if (std::exchange(seen.at(static_cast<std::size_t>(axis.axis)), true))
                refuse(at(of_gyros, j), shown(gyros[j]), "x, y and z once each");
            settings.gyro_axes[j][k] = axis;
        }
    }
    settings.elevation_deg = read_number(member(frame, "elevation_deg", place),
                                         place + "elevation_deg", -kMostElevation, kMostElevation);
}

std::vector<Hypothesis> read_mixture(const ReadJson& list, const std::string& place) {
    if (!list.is_array() || list.empty()) refuse(place, shown(list), "a list of hypotheses");
    std::vector<Hypothesis> out;
    double sum = 0;
    for (const ReadJson& one : list) {
        try {
            out.push_back(read_hypothesis(one));
        } catch (const std::runtime_error& error) {
            throw std::runtime_error(at(place, out.size()) + "." + error.what());
        }
        sum += out.back().weight;
    }
    if (!(std::abs(sum - 1) <= kRounding)) refuse(place, printed("weights w of sum %g", sum), "1");
    return out;
}

void read_effects(const ReadJson& effects, const std::string& place, Model& model) {
    if (!effects.is_array()) refuse(place, shown(effects), "a list");
    for (const ReadJson& one : effects) {
        const std::string here = at(place, model.effects.size()) + ".";
        const ReadJson& input = member(one, "input", here);
        if (!input.is_string()) refuse(here + "input", shown(input), "a text");
        Effect effect{input.get<std::string>(), "", {}};
        const ReadJson& change = list_of(member(one, "change", here), 3, here + "change");
        for (std::size_t j = 0; j < 3; ++j)
            effect.change[j] = read_vector(change[j], model.mixture[j].front().x.size(), kMost,
                                           at(here + "change", j));
        model.effects.push_back(std::move(effect));
    }
}

/// Earlier versions have none: their effects are mixed so that they are independent.
void read_correlated(const ReadJson& spectrum, const std::string& place, Model& model) {
    const auto pairs = spectrum.find("effects_correlation");
    if (pairs == spectrum.end()) return;
    const std::size_t count = model.effects.size();
    MatrixXd all = MatrixXd::Identity(static_cast<Index>(count), static_cast<Index>(count));
    for (const auto& pair : *pairs) {
        const bool whole = pair.is_array() && pair.size() == 3 && pair[0].is_number_unsigned() &&
                           pair[1].is_number_unsigned() && pair[2].is_number();
        const auto one = whole ? estimator::uncertainty::Correlated{pair[0].get<std::size_t>(),
                                                                    pair[1].get<std::size_t>(),
                                                                    pair[2].get<double>()}
                               : estimator::uncertainty::Correlated{};
        const auto first = static_cast<Index>(one.first), second = static_cast<Index>(one.second);
        if (!whole || one.first >= one.second || one.second >= count ||
            !(std::abs(one.value) <= 1 + kRounding) || all(first, second) != 0)
            refuse(place + "effects_correlation", shown(pair),
                   "two of " + std::to_string(count) +
                       " effects, the earlier first, once, and a number from -1 to 1");
        all(first, second) = all(second, first) = one.value;
        model.correlated.push_back(one);
    }
    if (!model.correlated.empty()) check_covariance(all, place + "effects_correlation");
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
    one.weight = read_number(member(from, "w", ""), "w", 0, 1);
    one.resonances = read_resonances(from);
    const auto resonances = static_cast<Index>(one.resonances.size());
    const Index columns = kBase + kElastic * resonances;
    one.x = read_vector(member(from, "x", ""), columns, kMost, "x");
    one.covariance = read_covariance(member(from, "p", ""), columns, resonances);
    one.linearised = one.covariance.rows() > one.x.size();
    return one;
}

Model read_model(const nlohmann::json& root, const std::string& path) {
    if (!root.is_object())
        throw std::runtime_error(path + ": expected the JSON of vibrig identify --json");
    if (!root.contains("spectrum"))
        refuse(
            path + ": spectrum", "nothing",
            "a result over frequency: of a table of samples (CSV), or of a campaign with several "
            "frequencies (at the one of a campaign vibrig compensate has the drift)");
    const nlohmann::json& spectrum = root["spectrum"];
    const std::string place = path + ": spectrum.";
    Model model;
    const auto& mixture = list_of(member(spectrum, "mixture", place), 3, place + "mixture");
    for (std::size_t j = 0; j < 3; ++j)
        model.mixture[j] = read_mixture(mixture[j], at(place + "mixture", j));
    read_frame(member(spectrum, "platform", place), place + "platform.", model.frame);
    read_effects(member(spectrum, "effects", place), place + "effects", model);
    read_correlated(spectrum, place, model);
    model.lowest_hz =
        read_number(member(spectrum, "lowest_hz", place), place + "lowest_hz", 0, kMostHz);
    model.highest_hz = read_number(member(spectrum, "highest_hz", place), place + "highest_hz",
                                   model.lowest_hz, kMostHz);
    const auto& refusal = member(spectrum, "refusal", place);
    if (!refusal.is_null() && !refusal.is_string())
        refuse(place + "refusal", shown(refusal), "a text or null");
    if (refusal.is_string()) model.refusal = refusal.get<std::string>();
    return model;
}

ResultVerdict read_verdict(const nlohmann::json& root, const std::string& path) {
    const auto& verdict = member(root, "verdict", path + ": ");
    const std::string place = path + ": verdict.";
    const auto& level = member(verdict, "level", place);
    if (level != 0 && level != 1 && level != 2)
        refuse(place + "level", shown(level), "0 (valid), 1 (doubtful) or 2 (not valid)");
    const auto& sentence = member(verdict, "sentence", place);
    if (!sentence.is_string()) refuse(place + "sentence", shown(sentence), "a text");
    return {level == 1, level == 2,
            proto::printable(sentence.get<std::string>(), kLongestSentence)};
}

}  // namespace vibrig::tool
