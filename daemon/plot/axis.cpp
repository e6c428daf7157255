#include "daemon/plot/axis.hpp"

#include <algorithm>
#include <cmath>

#include "proto/printed.hpp"

namespace vibrig::tool::plot {

namespace {

constexpr double kMostTicks = 8;
constexpr double kMostDecades = 12;

}  // namespace

void Axis::include(double value) {
    if (!std::isfinite(value) || (log && value <= 0)) {
        return;
    }
    if (empty_ && !(low < high)) {
        low = high = value;
    }
    empty_ = false;
    low = std::min(low, value);
    high = std::max(high, value);
}

double Axis::step() const {
    const double raw = (high - low) / kMostTicks;
    const double decade = std::pow(10.0, std::floor(std::log10(raw)));
    for (const double nice : {1.0, 2.0, 5.0}) {
        if (raw <= nice * decade * (1 + 1e-9)) {
            return nice * decade;
        }
    }
    return 10 * decade;
}

void Axis::settle() {
    if (log) {
        low = low > 0 ? low : 1;
        high = std::max(high, low);
        // Half decades keep a short curve from being squeezed into a corner.
        const auto round = [](double v, bool up) {
            const double x = 2 * std::log10(v);
            return std::pow(10.0, (up ? std::ceil(x - 1e-9) : std::floor(x + 1e-9)) / 2);
        };
        low = round(low, false);
        high = round(high, true);
        high = high > low ? high : 10 * low;
    } else {
        if (!(high > low)) {
            const double margin = high == 0.0 ? 1 : std::abs(high) / 2;
            low -= margin;
            high += margin;
        }
        if (exact) return;
        const double by = step();
        low = by * std::floor(low / by + 1e-9);
        high = by * std::ceil(high / by - 1e-9);
    }
}

double Axis::place(double value) const {
    return log ? std::log(value / low) / std::log(high / low) : (value - low) / (high - low);
}

std::vector<double> Axis::ticks() const {
    std::vector<double> at;
    for (const auto& [value, name] : named) at.push_back(value);
    if (!at.empty()) return at;
    // Between two powers of ten an axis would have one label, or none.
    if (log && std::log10(high / low) < 2 - 1e-9) {
        const bool wide = std::log10(high / low) > 1 - 1e-9;
        for (double decade = std::pow(10.0, std::floor(std::log10(low))); decade <= high * 1.001;
             decade *= 10) {
            for (const double k : wide ? std::vector{1.0, 3.0} : std::vector{1.0, 2.0, 3.0, 5.0}) {
                const double tick = k * decade;
                if (tick >= low * (1 - 1e-9) && tick <= high * (1 + 1e-9)) at.push_back(tick);
            }
        }
        return at;
    }
    if (log) {
        const double first = std::ceil(std::log10(low) - 1e-9);
        const double last = std::floor(std::log10(high) + 1e-9);
        const double by = std::max(1.0, std::ceil((last - first) / kMostDecades));
        for (double exponent = first; exponent <= last; exponent += by) {
            at.push_back(std::pow(10.0, exponent));
        }
    } else {
        const double by = step();
        for (double k = std::ceil(low / by - 1e-9); k * by <= high + by * 1e-9; ++k) {
            at.push_back(k * by);
        }
    }
    return at;
}

std::vector<double> Axis::minor() const {
    std::vector<double> at;
    if (!log || std::log10(high / low) > kMostDecades / 2) {
        return at;
    }
    for (double decade = std::pow(10.0, std::floor(std::log10(low))); decade < high; decade *= 10) {
        for (int k = 2; k < 10; ++k) {
            if (k * decade > low && k * decade < high) {
                at.push_back(k * decade);
            }
        }
    }
    return at;
}

std::string Axis::text_of(double tick) const {
    for (const auto& [value, name] : named) {
        if (value == tick) return name;
    }
    // As many digits as tell one tick from the next.
    int digits = 6;
    if (!log && high > low)
        digits = std::max(
            digits,
            2 + static_cast<int>(std::log10(std::max(std::abs(low), std::abs(high)) / step())));
    return proto::printed("%.*g", std::min(digits, 15),
                          !log && std::abs(tick) < 1e-12 * (high - low) ? 0 : tick);
}

}  // namespace vibrig::tool::plot
