#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <optional>
#include <set>
#include <span>
#include <vector>

#include "daemon/configuration/key.hpp"
#include "daemon/configuration/value.hpp"

namespace vibrig::configuration {

namespace {

using C = Configuration;
using estimator::uncertainty::BiasModel;
using estimator::uncertainty::Declared;
using estimator::uncertainty::Drift;
using estimator::uncertainty::Inputs;
using estimator::uncertainty::Power;
using estimator::uncertainty::Shape;
using estimator::uncertainty::SyncMotionOf;

/// Half width over standard uncertainty.
struct ShapeName {
    const char* word;
    Shape shape;
    double width;
};
constexpr std::array<ShapeName, 4> kShapes{{{"normal", Shape::normal, 0},
                                            {"rectangular", Shape::rectangular, 1.7320508075688772},
                                            {"triangular", Shape::triangular, 2.449489742783178},
                                            {"arcsine", Shape::arcsine, 1.4142135623730951}}};
constexpr const char* kForm =
    "a standard uncertainty from 0 on, or { u = .. or half_width = .., shape = \"normal\" | "
    "\"rectangular\" | \"triangular\" | \"arcsine\", dof = .. }";

const ShapeName& name_of(Shape shape) { return kShapes[static_cast<std::size_t>(shape)]; }

std::optional<Declared> read_table(const Entry& entry, const toml::table& table, double largest,
                                   const std::string& unit) {
    Declared out;
    out.declared = true;
    std::optional<double> u, half_width;
    const std::size_t problems = entry.problems.count();
    for (const auto& [key, node] : table) {
        const Entry part = entry.part(node, std::string(key.str()));
        if (key == "u") {
            u = part.number({0, largest}, unit);
        } else if (key == "half_width") {
            half_width = part.number({0, largest}, unit);
        } else if (key == "dof") {
            out.dof = part.number({1, 1e9}, "").value_or(out.dof);
        } else if (key == "declared" && node.is_boolean()) {
            out.declared = node.as_boolean()->get();
        } else if (key == "shape") {
            const auto* word = node.as_string();
            const auto found = std::ranges::find_if(kShapes, [word](const ShapeName& one) {
                return word != nullptr && word->get() == one.word;
            });
            if (found == kShapes.end()) {
                part.refuse(R"("normal", "rectangular", "triangular" or "arcsine")");
            } else {
                out.shape = found->shape;
            }
        } else {
            part.refuse(kForm);
        }
    }
    if (entry.problems.count() > problems) return std::nullopt;
    const double width = name_of(out.shape).width;
    if (u.has_value() == half_width.has_value() || (half_width && !(width > 0))) {
        entry.refuse(u && half_width ? "both u and half_width"
                     : half_width    ? "half_width of a normal distribution, which has none"
                                     : "neither u nor half_width",
                     kForm);
        return std::nullopt;
    }
    out.u = u ? *u : *half_width / width;
    return out;
}

std::optional<Declared> read_declared(const Entry& entry, double largest, const std::string& unit) {
    if (const auto* table = entry.node.as_table()) return read_table(entry, *table, largest, unit);
    if (!entry.node.is_number()) {
        entry.refuse(kForm);
        return std::nullopt;
    }
    const auto value = entry.number({0, largest}, unit);
    if (!value) return std::nullopt;
    Declared out{*value};
    out.declared = true;
    return out;
}

std::string write_declared(const Declared& d) {
    std::string text = "{ u = " + write_number(d.u) + ", shape = \"" + name_of(d.shape).word + "\"";
    if (std::isfinite(d.dof)) text += ", dof = " + write_number(d.dof);
    return text + ", declared = " + (d.declared ? "true" : "false") + " }";
}

/// One input, or several with one value for all or an array of them.
Key declared(std::string name, std::function<std::span<Declared>(C&)> at, std::string unit,
             double largest, std::string doc) {
    auto read = [=](const Entry& entry, C& c) {
        const std::span<Declared> targets = at(c);
        const toml::array* list = targets.size() > 1 ? entry.node.as_array() : nullptr;
        if (list == nullptr) {
            if (const auto value = read_declared(entry, largest, unit))
                std::ranges::fill(targets, *value);
            return;
        }
        if (list->size() != targets.size())
            return entry.refuse(std::to_string(targets.size()) + " elements or one value for all");
        for (std::size_t i = 0; i < targets.size(); ++i) {
            if (const auto value = read_declared(entry.element(i), largest, unit))
                targets[i] = *value;
        }
    };
    auto write = [=](C& c) {
        const std::span<Declared> targets = at(c);
        return targets.size() == 1 ? write_declared(targets[0])
                                   : write_list(targets, write_declared);
    };
    return {name, "uncertainty", unit, "0 to " + plain(largest), doc, read, write};
}

/// For whose place something else stands until it is stated.
Key declared_if_stated(std::string name, At<std::optional<Declared>> at, std::string unit,
                       double largest, std::string doc) {
    auto read = [=](const Entry& entry, C& c) {
        if (const auto value = read_declared(entry, largest, unit)) at(c) = value;
    };
    auto write = [at](C& c) { return at(c) ? write_declared(*at(c)) : std::string(); };
    const std::string bounds = "0 to " + plain(largest) + "; none: not declared";
    return {name, "uncertainty", unit, bounds, doc, read, write};
}

Key harmonics() {
    using estimator::uncertainty::Harmonic;
    constexpr const char* kHarmonic = "{ order = .., arcsec = .. }";
    const auto read_one = [](const Entry& entry) -> std::optional<std::pair<Harmonic, bool>> {
        const auto* table = entry.node.as_table();
        const auto* order = table == nullptr ? nullptr : table->get_as<std::int64_t>("order");
        const auto* size = table == nullptr ? nullptr : table->get("arcsec");
        const auto* stated = table == nullptr ? nullptr : table->get_as<bool>("declared");
        if (order == nullptr || size == nullptr || table->size() != (stated == nullptr ? 2 : 3) ||
            order->get() < 1 || order->get() > 1000) {
            const auto* number = table == nullptr ? nullptr : table->get("order");
            (number == nullptr ? entry : entry.part(*number, "order"))
                .refuse(std::string(kHarmonic) + ", order a whole number from 1 to 1000");
            return std::nullopt;
        }
        const auto arcsec = entry.part(*size, "arcsec").number({0, 3600}, "arcsec");
        if (!arcsec) return std::nullopt;
        return std::pair(Harmonic{static_cast<int>(order->get()), *arcsec},
                         stated == nullptr || stated->get());
    };
    auto read = [read_one](const Entry& entry, C& c) {
        const auto list = entry.elements(0, 16, kHarmonic, read_one);
        if (!list) return;
        for (std::size_t i = 0; i < list->size(); ++i) {
            const int order = (*list)[i].first.order;
            const auto same = [order](const auto& one) { return one.first.order == order; };
            if (std::any_of(list->begin(), list->begin() + static_cast<std::ptrdiff_t>(i), same))
                return entry.element(i).refuse("order " + std::to_string(order) + " once more",
                                               "each order once");
        }
        Inputs& inputs = c.estimator.uncertainty;
        inputs.resolver_harmonics.clear();
        // No harmonics is a statement, too.
        inputs.resolver_harmonics_declared = list->empty();
        for (const auto& [harmonic, stated] : *list) {
            inputs.resolver_harmonics.push_back(harmonic);
            inputs.resolver_harmonics_declared |= stated;
        }
    };
    auto write = [](C& c) {
        const Inputs& inputs = c.estimator.uncertainty;
        const std::string stated = inputs.resolver_harmonics_declared ? "true" : "false";
        return write_list(inputs.resolver_harmonics, [&stated](const Harmonic& one) {
            return "{ order = " + std::to_string(one.order) +
                   ", arcsec = " + write_number(one.arcsec) + ", declared = " + stated + " }";
        });
    };
    return {"uncertainty.resolver_harmonics",
            "tables",
            "arcsec",
            "up to 16",
            "errors of the resolvers per turn: amplitude known, phase not",
            read,
            write};
}

Key correlations() {
    using estimator::uncertainty::Correlation;
    constexpr const char* kTriple = R"(["latitude", "azimuth", 0.3])";
    const auto read_one = [](const Entry& entry) -> std::optional<Correlation> {
        const auto* one = entry.node.as_array();
        const bool good = one != nullptr && one->size() == 3 && one->get(0)->is_string() &&
                          one->get(1)->is_string() && one->get(2)->is_number();
        if (!good) {
            entry.refuse(kTriple);
            return std::nullopt;
        }
        const auto r = entry.element(2).number({-1, 1}, "");
        if (!r) return std::nullopt;
        return Correlation{one->get(0)->as_string()->get(), one->get(1)->as_string()->get(), *r};
    };
    auto read = [read_one](const Entry& entry, C& c) {
        if (const auto list = entry.elements(0, 100, kTriple, read_one))
            c.estimator.uncertainty.correlations = *list;
    };
    auto write = [](C& c) {
        return write_list(c.estimator.uncertainty.correlations, [](const Correlation& one) {
            return "[" + write_text(one.first) + ", " + write_text(one.second) + ", " +
                   write_number(one.value) + "]";
        });
    };
    return {"uncertainty.correlation",
            "triples",
            "",
            "-1 to 1",
            "correlation of two inputs, by their names",
            read,
            write};
}

/// Structural classes of misfit, by the names that the verdict has for them.
Key freed_classes() {
    using estimator::uncertainty::kStructuralNames;
    using estimator::uncertainty::Misfit;
    std::string words;
    for (const char* word : kStructuralNames)
        words += (words.empty() ? "\"" : ", \"") + std::string(word) + "\"";
    auto read = [words](const Entry& entry, C& c) {
        std::set<Misfit> there;
        const auto read_one = [&](const Entry& one) -> std::optional<Misfit> {
            const auto* word = one.node.as_string();
            const auto at = std::ranges::find_if(kStructuralNames, [word](const char* known) {
                return word != nullptr && word->get() == known;
            });
            const auto misfit = static_cast<Misfit>(at - kStructuralNames.begin());
            if (at != kStructuralNames.end() && there.insert(misfit).second) return misfit;
            one.refuse("each once of " + words);
            return std::nullopt;
        };
        if (const auto list =
                entry.elements(0, kStructuralNames.size(), "classes of misfit", read_one))
            c.estimator.free = *list;
    };
    auto write = [](C& c) {
        return write_list(c.estimator.free, [](Misfit one) {
            return write_text(kStructuralNames[static_cast<std::size_t>(one)]);
        });
    };
    return {"estimator.free",
            "words",
            "",
            words,
            "what the data determine along with the coefficients: costs sigma, and what is "
            "declared of it no longer counts",
            read,
            write,
            schema_of_array("{\"enum\":[" + words + "]}", 0, kStructuralNames.size())};
}

/// Not declared while it is infinite inside; no value in a file says so.
Key optional_number(std::string name, At<double> at, std::string unit, Range range,
                    std::string doc) {
    auto read = [=](const Entry& entry, C& c) {
        at(c) = entry.number(range, unit).value_or(at(c));
    };
    auto write = [at](C& c) { return std::isinf(at(c)) ? std::string() : write_number(at(c)); };
    const std::string bounds = plain(range.low) + " to " + plain(range.high);
    return {name, "number", unit, bounds + "; none: not declared", doc, read, write};
}

std::span<Declared> all_of(Declared& one) { return {&one, 1}; }
template <std::size_t N>
std::span<Declared> all_of(std::array<Declared, N>& inputs) {
    return inputs;
}

std::vector<Key> input_keys() {
    const auto in = [](auto member) {
        return [member](C& c) { return all_of(c.estimator.uncertainty.*member); };
    };
    return {
        declared("uncertainty.latitude_arcsec", in(&Inputs::latitude_arcsec), "arcsec", 1e5,
                 "of site.latitude_deg"),
        declared("uncertainty.azimuth_arcsec", in(&Inputs::azimuth_arcsec), "arcsec", 1e5,
                 "of site.azimuth_deg"),
        declared("uncertainty.encoder_zero_arcsec", in(&Inputs::encoder_zero_arcsec), "arcsec", 1e5,
                 "of the encoders' zeros: outer, inner, azimuth"),
        declared("uncertainty.non_orthogonality_arcsec", in(&Inputs::non_orthogonality_arcsec),
                 "arcsec", 1e5, "of the gimbal axes: outer to inner, inner to azimuth"),
        harmonics(),
        declared("uncertainty.time_base", in(&Inputs::time_base), "", 1,
                 "of the time stamps, relative"),
        declared("uncertainty.accelerometer_gain", in(&Inputs::accelerometer_gain), "", 1,
                 "gain at the vibration's frequency over that for gravity"),
        declared("uncertainty.gain_between_frequencies", in(&Inputs::gain_between_frequencies), "",
                 1, "scatter of that gain from one frequency to another"),
        declared("uncertainty.accelerometer_zero_g", in(&Inputs::accelerometer_zero_g), "g", 1,
                 "of the accelerometers' zeros: x, y, z"),
        declared("uncertainty.accelerometer_cross", in(&Inputs::accelerometer_cross), "rad", 1,
                 "of the accelerometers' axes: xy, xz, yx, yz, zx, zy"),
        declared("uncertainty.cross_axis", in(&Inputs::cross_axis), "", 1,
                 "motion across the vertical that the accelerometers do not see, over that along "
                 "it: north, east"),
        declared("uncertainty.local_g", in(&Inputs::local_g), "", 1, "of local gravity, relative"),
        declared("uncertainty.bias_step_between_runs", in(&Inputs::bias_step_between_runs), "deg/h",
                 1e4, "of each gyro's bias where the power may be cut: at the end of each run"),
        correlations(),
    };
}

}  // namespace

std::vector<Key> uncertainty_keys() {
    const auto in = part(&C::estimator, &estimator::Settings::uncertainty);
    const auto drift = part(&C::estimator, &estimator::Settings::drift);
    std::vector<Key> others{
        choice<SyncMotionOf>("uncertainty.sync_motion", in(&Inputs::sync_motion),
                             {{"warn", SyncMotionOf::warn},
                              {"platform", SyncMotionOf::platform},
                              {"base", SyncMotionOf::base}},
                             "motion of the angles in step with the vibration: judged, taken into "
                             "u as the platform's, or declared as the base's rocking"),
        optional_number("uncertainty.noise_dof", in(&Inputs::noise_dof), "", {1, 1e9},
                        "degrees of freedom of the configured noise; none: known"),
        declared_if_stated("uncertainty.turn_on_bias", in(&Inputs::turn_on_bias), "deg/h", 1e6,
                           "repeatability of D_F from one switch-on to the next"),
        declared_if_stated("uncertainty.turn_on_linear", in(&Inputs::turn_on_linear), "deg/h/g",
                           1e6, "repeatability of D_I, D_O, D_S from one switch-on to the next"),
        declared_if_stated("uncertainty.ramp_in_dwell", in(&Inputs::ramp_in_dwell), "deg/h", 1e6,
                           "of D_F for another power-on, by a ramp of the bias in every dwell; "
                           "none: half of the mean ramp that the dwells show"),
        number("uncertainty.coverage", in(&Inputs::coverage), "", {0.5, 0.9999},
               "probability that the expanded uncertainty covers"),

        choice<BiasModel>(
            "drift.model", drift(&Drift::model),
            {{"auto", BiasModel::automatic},
             {"constant", BiasModel::constant},
             {"walk", BiasModel::walk}},
            "how the bias may move in a campaign: as the data say, not at all, as a random walk"),
        number("drift.walk_deg_h_rt_h", drift(&Drift::walk_deg_h_rt_h), "deg/h/sqrt(h)", {0, 1000},
               "random walk of the bias, for model \"walk\""),
        choice<Power>("drift.power", drift(&Drift::power),
                      {{"unknown", Power::unknown},
                       {"unbroken", Power::unbroken},
                       {"per-run", Power::per_run}},
                      "whether the gyros were powered all the time: not known, yes, switched on "
                      "for each run"),
    };
    return joined({{freed_classes()}, input_keys(), others});
}

}  // namespace vibrig::configuration
