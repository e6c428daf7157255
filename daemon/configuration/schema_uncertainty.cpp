#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

#include "daemon/configuration/key.hpp"
#include "daemon/configuration/value.hpp"

namespace vibrig::configuration {

namespace {

using C = Configuration;
using estimator::uncertainty::BiasModel;
using estimator::uncertainty::Declared;
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

std::optional<Declared> read_table(const toml::table& table, const std::string& name,
                                   double largest, const std::string& unit, Problems& problems) {
    Declared out;
    out.declared = true;
    std::optional<double> u, half_width;
    bool good = true;
    for (const auto& [key, node] : table) {
        const std::string part = name + "." + std::string(key.str());
        const auto read_part = [&, &own = node](Range range) {
            const auto value = read_number(own, part, range, unit, problems);
            good = good && value.has_value();
            return value;
        };
        if (key == "u") {
            u = read_part({0, largest});
        } else if (key == "half_width") {
            half_width = read_part({0, largest});
        } else if (key == "dof") {
            if (const auto dof = read_part({1, 1e9})) out.dof = *dof;
        } else if (key == "declared" && node.is_boolean()) {
            out.declared = node.as_boolean()->get();
        } else if (key == "shape") {
            const auto* word = node.as_string();
            const ShapeName* found = nullptr;
            for (const ShapeName& one : kShapes) {
                if (word != nullptr && word->get() == one.word) found = &one;
            }
            if (found == nullptr) {
                problems.add(place_of(node.source()), part, describe(node),
                             R"("normal", "rectangular", "triangular" or "arcsine")");
                good = false;
            } else {
                out.shape = found->shape;
            }
        } else {
            problems.add(place_of(node.source()), part, describe(node), kForm);
            good = false;
        }
    }
    if (!good) return std::nullopt;
    const double width = name_of(out.shape).width;
    if (u.has_value() == half_width.has_value() || (half_width && !(width > 0))) {
        problems.add(place_of(table.source()), name,
                     u && half_width ? "both u and half_width"
                     : half_width    ? "half_width of a normal distribution, which has none"
                                     : "neither u nor half_width",
                     kForm);
        return std::nullopt;
    }
    out.u = u ? *u : *half_width / width;
    return out;
}

std::optional<Declared> read_declared(const toml::node& node, const std::string& name,
                                      double largest, const std::string& unit, Problems& problems) {
    if (const auto* table = node.as_table())
        return read_table(*table, name, largest, unit, problems);
    if (!node.is_number()) {
        problems.add(place_of(node.source()), name, describe(node), kForm);
        return std::nullopt;
    }
    const auto value = read_number(node, name, {0, largest}, unit, problems);
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
template <class At>
Key declared(std::string name, std::string unit, double largest, std::string doc, At at) {
    constexpr std::size_t kCount = std::tuple_size_v<decltype(at(std::declval<C&>()))>;
    auto read = [name, unit, largest, at](const toml::node& node, C& c, Problems& problems) {
        const auto targets = at(c);
        const toml::array* list = kCount > 1 ? node.as_array() : nullptr;
        if (list == nullptr) {
            if (const auto value = read_declared(node, name, largest, unit, problems)) {
                for (Declared* target : targets) *target = *value;
            }
            return;
        }
        if (list->size() != kCount) {
            problems.add(place_of(node.source()), name,
                         "an array of " + std::to_string(list->size()),
                         std::to_string(kCount) + " elements or one value for all");
            return;
        }
        for (std::size_t i = 0; i < kCount; ++i) {
            if (const auto value = read_declared(
                    *list->get(i), name + "[" + std::to_string(i) + "]", largest, unit, problems))
                *targets[i] = *value;
        }
    };
    auto write = [at](C& c) {
        const auto targets = at(c);
        if (kCount == 1) return write_declared(*targets[0]);
        std::string text = "[";
        for (std::size_t i = 0; i < kCount; ++i)
            text += (i > 0 ? ", " : "") + write_declared(*targets[i]);
        return text + "]";
    };
    return {std::move(name),
            "uncertainty",
            std::move(unit),
            "0 to " + plain(largest),
            std::move(doc),
            read,
            write};
}

/// Pointers to the elements of an array of inputs.
template <std::size_t N>
std::array<Declared*, N> each(std::array<Declared, N>& inputs) {
    std::array<Declared*, N> pointers{};
    for (std::size_t i = 0; i < N; ++i) pointers[i] = &inputs[i];
    return pointers;
}

Key harmonics() {
    const std::string name = "uncertainty.resolver_harmonics";
    auto read = [name](const toml::node& node, C& c, Problems& problems) {
        constexpr const char* kHarmonic = "{ order = .., arcsec = .. }";
        const toml::array* list = read_array(node, name, 0, 16, kHarmonic, problems);
        if (list == nullptr) return;
        std::vector<estimator::uncertainty::Harmonic> out;
        for (std::size_t i = 0; i < list->size(); ++i) {
            const std::string element = name + "[" + std::to_string(i) + "]";
            const auto* table = list->get(i)->as_table();
            const auto* order = table == nullptr ? nullptr : table->get_as<std::int64_t>("order");
            const auto* size = table == nullptr ? nullptr : table->get("arcsec");
            if (order == nullptr || size == nullptr || table->size() != 2 || order->get() < 1 ||
                order->get() > 1000) {
                problems.add(place_of(list->get(i)->source()), element, describe(*list->get(i)),
                             std::string(kHarmonic) + ", order from 1 to 1000");
                continue;
            }
            if (const auto arcsec =
                    read_number(*size, element + ".arcsec", {0, 3600}, "arcsec", problems))
                out.push_back({static_cast<int>(order->get()), *arcsec});
        }
        c.estimator.uncertainty.resolver_harmonics = std::move(out);
        c.estimator.uncertainty.resolver_harmonics_declared = true;
    };
    auto write = [](C& c) {
        std::string text;
        // A default that somebody states is declared from then on.
        if (!c.estimator.uncertainty.resolver_harmonics_declared) return text;
        for (const auto& harmonic : c.estimator.uncertainty.resolver_harmonics)
            text += (text.empty() ? "" : ", ") + ("{ order = " + std::to_string(harmonic.order)) +
                    ", arcsec = " + write_number(harmonic.arcsec) + " }";
        return "[" + text + "]";
    };
    return {name,
            "tables",
            "arcsec",
            "up to 16",
            "errors of the resolvers per turn: amplitude known, phase not",
            read,
            write};
}

Key correlations() {
    const std::string name = "uncertainty.correlation";
    auto read = [name](const toml::node& node, C& c, Problems& problems) {
        constexpr const char* kTriple = R"(["latitude", "azimuth", 0.3])";
        const toml::array* list = read_array(node, name, 0, 100, kTriple, problems);
        if (list == nullptr) return;
        std::vector<estimator::uncertainty::Correlation> out;
        for (std::size_t i = 0; i < list->size(); ++i) {
            const std::string element = name + "[" + std::to_string(i) + "]";
            const auto* one = list->get(i)->as_array();
            const bool good = one != nullptr && one->size() == 3 && one->get(0)->is_string() &&
                              one->get(1)->is_string() && one->get(2)->is_number();
            if (!good) {
                problems.add(place_of(list->get(i)->source()), element, describe(*list->get(i)),
                             kTriple);
                continue;
            }
            if (const auto r = read_number(*one->get(2), element + "[2]", {-1, 1}, "", problems))
                out.push_back(
                    {one->get(0)->as_string()->get(), one->get(1)->as_string()->get(), *r});
        }
        c.estimator.uncertainty.correlations = std::move(out);
    };
    auto write = [](C& c) {
        std::string text;
        for (const auto& one : c.estimator.uncertainty.correlations)
            text += (text.empty() ? "[" : ", [") + write_text(one.first) + ", " +
                    write_text(one.second) + ", " + write_number(one.value) + "]";
        return "[" + text + "]";
    };
    return {name, "triples", "", "-1 to 1", "correlation of two inputs, by their names",
            read, write};
}

/// Structural classes of misfit, by the names that the verdict has for them.
Key freed_classes() {
    using estimator::uncertainty::kStructuralNames;
    using estimator::uncertainty::Misfit;
    const std::string name = "estimator.free";
    std::string words;
    for (const char* word : kStructuralNames)
        words += (words.empty() ? "\"" : ", \"") + std::string(word) + "\"";
    auto read = [name, words](const toml::node& node, C& c, Problems& problems) {
        const std::string expected = "each once of " + words;
        const toml::array* list =
            read_array(node, name, 0, kStructuralNames.size(), "classes of misfit", problems);
        if (list == nullptr) return;
        std::vector<Misfit> out;
        for (std::size_t i = 0; i < list->size(); ++i) {
            const auto* word = list->get(i)->as_string();
            const auto at = std::find_if(
                kStructuralNames.begin(), kStructuralNames.end(),
                [&](const char* one) { return word != nullptr && word->get() == one; });
            const auto misfit = static_cast<Misfit>(at - kStructuralNames.begin());
            if (at == kStructuralNames.end() ||
                std::find(out.begin(), out.end(), misfit) != out.end()) {
                problems.add(place_of(list->get(i)->source()), name + "[" + std::to_string(i) + "]",
                             describe(*list->get(i)), expected);
                continue;
            }
            out.push_back(misfit);
        }
        c.estimator.free = std::move(out);
    };
    auto write = [](C& c) {
        std::string text;
        for (const Misfit one : c.estimator.free)
            text += (text.empty() ? "" : ", ") +
                    write_text(kStructuralNames[static_cast<std::size_t>(one)]);
        return "[" + text + "]";
    };
    return {name,
            "words",
            "",
            words,
            "what the data determine along with the coefficients: costs sigma, and what is "
            "declared of it no longer counts",
            read,
            write,
            schema_of_array("{\"enum\":[" + words + "]}", 0, kStructuralNames.size())};
}

/// Not declared while it is negative inside; no value in a file says so.
Key optional_number(std::string name, std::string unit, Range range, std::string doc,
                    At<double> at) {
    auto read = [name, unit, range, at](const toml::node& node, C& c, Problems& problems) {
        if (const auto value = read_number(node, name, range, unit, problems)) at(c) = *value;
    };
    auto write = [at](C& c) { return at(c) < 0 ? std::string() : write_number(at(c)); };
    return {std::move(name),
            "number",
            std::move(unit),
            plain(range.low) + " to " + plain(range.high) + "; none: not declared",
            std::move(doc),
            read,
            write};
}

void add_inputs(std::vector<Key>& keys) {
    const auto in = [](C & c) -> auto& { return c.estimator.uncertainty; };
    using One = std::array<Declared*, 1>;
    keys.push_back(declared("uncertainty.latitude_arcsec", "arcsec", 1e5, "of site.latitude_deg",
                            [in](C& c) { return One{&in(c).latitude_arcsec}; }));
    keys.push_back(declared("uncertainty.azimuth_arcsec", "arcsec", 1e5, "of site.azimuth_deg",
                            [in](C& c) { return One{&in(c).azimuth_arcsec}; }));
    keys.push_back(declared("uncertainty.encoder_zero_arcsec", "arcsec", 1e5,
                            "of the encoders' zeros: outer, inner, azimuth",
                            [in](C& c) { return each(in(c).encoder_zero_arcsec); }));
    keys.push_back(declared("uncertainty.non_orthogonality_arcsec", "arcsec", 1e5,
                            "of the gimbal axes: outer to inner, inner to azimuth",
                            [in](C& c) { return each(in(c).non_orthogonality_arcsec); }));
    keys.push_back(harmonics());
    keys.push_back(declared("uncertainty.time_base", "", 1, "of the time stamps, relative",
                            [in](C& c) { return One{&in(c).time_base}; }));
    keys.push_back(declared("uncertainty.accelerometer_gain", "", 1,
                            "gain at the vibration's frequency over that for gravity",
                            [in](C& c) { return One{&in(c).accelerometer_gain}; }));
    keys.push_back(declared("uncertainty.gain_between_frequencies", "", 1,
                            "scatter of that gain from one frequency to another",
                            [in](C& c) { return One{&in(c).gain_between_frequencies}; }));
    keys.push_back(declared("uncertainty.accelerometer_zero_g", "g", 1,
                            "of the accelerometers' zeros: x, y, z",
                            [in](C& c) { return each(in(c).accelerometer_zero_g); }));
    keys.push_back(declared("uncertainty.accelerometer_cross", "rad", 1,
                            "of the accelerometers' axes: xy, xz, yx, yz, zx, zy",
                            [in](C& c) { return each(in(c).accelerometer_cross); }));
    keys.push_back(declared("uncertainty.cross_axis", "", 1,
                            "motion across the vertical that the accelerometers do not see, over "
                            "that along it: north, east",
                            [in](C& c) { return each(in(c).cross_axis); }));
    keys.push_back(declared("uncertainty.local_g", "", 1, "of local gravity, relative",
                            [in](C& c) { return One{&in(c).local_g}; }));
    keys.push_back(declared("uncertainty.bias_step_between_runs", "deg/h", 1e4,
                            "of each gyro's bias where the run changes",
                            [in](C& c) { return One{&in(c).bias_step_between_runs}; }));
    keys.push_back(correlations());
}

}  // namespace

void add_uncertainty_keys(std::vector<Key>& keys) {
    keys.push_back(freed_classes());
    add_inputs(keys);
    const auto in = [](C & c) -> auto& { return c.estimator.uncertainty; };
    keys.push_back(choice<SyncMotionOf>(
        "uncertainty.sync_motion",
        {{"warn", SyncMotionOf::warn},
         {"platform", SyncMotionOf::platform},
         {"base", SyncMotionOf::base}},
        "motion of the angles in step with the vibration: judged, taken into u as the platform's, "
        "or declared as the base's rocking",
        [in](C& c) -> SyncMotionOf& { return in(c).sync_motion; }));
    keys.push_back(optional_number("uncertainty.noise_dof", "", {1, 1e9},
                                   "degrees of freedom of the configured noise; none: known",
                                   [in](C& c) -> double& { return in(c).noise_dof; }));
    keys.back().write = [in](C& c) {
        return std::isfinite(in(c).noise_dof) ? write_number(in(c).noise_dof) : std::string();
    };
    keys.push_back(optional_number("uncertainty.turn_on_bias", "deg/h", {0, 1e6},
                                   "repeatability of D_F from one switch-on to the next",
                                   [in](C& c) -> double& { return in(c).turn_on_bias; }));
    keys.push_back(optional_number("uncertainty.turn_on_linear", "deg/h/g", {0, 1e6},
                                   "repeatability of D_I, D_O, D_S from one switch-on to the next",
                                   [in](C& c) -> double& { return in(c).turn_on_linear; }));
    keys.push_back(number("uncertainty.coverage", "", {0.5, 0.9999},
                          "probability that the expanded uncertainty covers",
                          [in](C& c) -> double& { return in(c).coverage; }));

    const auto drift = [](C & c) -> auto& { return c.estimator.drift; };
    keys.push_back(choice<BiasModel>(
        "drift.model",
        {{"auto", BiasModel::automatic},
         {"constant", BiasModel::constant},
         {"walk", BiasModel::walk}},
        "how the bias may move in a campaign: as the data say, not at all, as a random walk",
        [drift](C& c) -> BiasModel& { return drift(c).model; }));
    keys.push_back(number("drift.walk_deg_h_rt_h", "deg/h/sqrt(h)", {0, 1000},
                          "random walk of the bias, for model \"walk\"",
                          [drift](C& c) -> double& { return drift(c).walk_deg_h_rt_h; }));
    keys.push_back(choice<Power>(
        "drift.power",
        {{"unknown", Power::unknown}, {"unbroken", Power::unbroken}, {"per-run", Power::per_run}},
        "whether the gyros were powered all the time: not known, yes, switched on for each run",
        [drift](C& c) -> Power& { return drift(c).power; }));
}

}  // namespace vibrig::configuration
