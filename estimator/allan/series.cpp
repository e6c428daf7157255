#include "estimator/allan/series.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "estimator/filter/median.hpp"
#include "estimator/filter/text.hpp"

namespace vibrig::estimator::allan {

namespace {

constexpr std::size_t kFewestSamples = 9;
constexpr double kLargestMissingShare = 0.1;
constexpr double kOutlierDeviations = 10.0;

void count_gaps(std::span<const double> values, Series& series) {
    std::size_t gap = 0;
    series.samples = values.size();
    for (const double value : values) {
        gap = std::isfinite(value) ? 0 : gap + 1;
        series.missing += gap > 0 ? 1 : 0;
        series.longest_gap = std::max(series.longest_gap, gap);
    }
}

}  // namespace

Series Series::from_rate(std::span<const double> rate, double tau0) {
    Series series;
    series.tau0 = tau0;
    count_gaps(rate, series);
    double sum = 0;
    for (const double y : rate) {
        sum += std::isfinite(y) ? y : 0;
    }
    const std::size_t present = rate.size() - series.missing;
    const double mean = present > 0 ? sum / static_cast<double>(present) : 0;
    series.phase.resize(rate.size() + 1);
    double theta = 0;
    std::size_t begin = 0;
    for (std::size_t i = 0; i < rate.size(); ++i) {
        series.phase[i] = theta;
        if (std::isfinite(rate[i])) {
            theta += (rate[i] - mean) * tau0;
        } else {
            if (i > begin) {
                series.segments.push_back({begin, i + 1});
            }
            begin = i + 1;
        }
    }
    series.phase[rate.size()] = theta;
    if (rate.size() > begin) {
        series.segments.push_back({begin, rate.size() + 1});
    }
    return series;
}

Series Series::from_phase(std::span<const double> phase, double tau0) {
    Series series;
    series.tau0 = tau0;
    count_gaps(phase, series);
    series.phase.assign(phase.begin(), phase.end());
    std::size_t begin = 0;
    const auto close = [&](std::size_t end) {
        if (end > begin + 1) {
            series.segments.push_back({begin, end});
        }
        begin = end + 1;
    };
    for (std::size_t i = 0; i < phase.size(); ++i) {
        if (!std::isfinite(phase[i])) {
            series.phase[i] = 0;
            close(i);
        }
    }
    close(phase.size());
    if (!series.segments.empty()) {
        const std::size_t first = series.segments.front().begin;
        const std::size_t last = series.segments.back().end - 1;
        const double offset = series.phase[first];
        const double slope = (series.phase[last] - offset) / static_cast<double>(last - first);
        for (const Segment& segment : series.segments) {
            for (std::size_t i = segment.begin; i < segment.end; ++i) {
                series.phase[i] -=
                    offset + slope * (static_cast<double>(i) - static_cast<double>(first));
            }
        }
    }
    return series;
}

Inspection inspect(std::span<const double> values) {
    Inspection found;
    double low = std::numeric_limits<double>::infinity();
    double high = -low;
    double last = std::numeric_limits<double>::quiet_NaN();
    for (const double value : values) {
        if (!std::isfinite(value)) {
            continue;
        }
        low = std::min(low, value);
        high = std::max(high, value);
        const double step = std::abs(value - last);
        if (step > 0 && (found.lsb <= 0 || step < found.lsb)) {
            found.lsb = step;
        }
        last = value;
    }
    found.constant = !(low < high);
    const std::vector<std::size_t> far = outliers(values);
    found.outliers = far.size();
    found.first_outlier = far.empty() ? 0 : far.front();
    return found;
}

std::vector<std::size_t> outliers(std::span<const double> values) {
    std::vector<double> present;
    present.reserve(values.size());
    std::copy_if(values.begin(), values.end(), std::back_inserter(present),
                 [](double v) { return std::isfinite(v); });
    std::vector<std::size_t> far;
    if (present.empty()) {
        return far;
    }
    const double centre = median(present);
    for (double& value : present) {
        value = std::abs(value - centre);
    }
    const double limit = kOutlierDeviations * median(present);
    // Coarsely quantised data may have a median deviation of zero: then nothing can be said.
    for (std::size_t i = 0; limit > 0 && i < values.size(); ++i) {
        if (std::isfinite(values[i]) && std::abs(values[i] - centre) > limit) {
            far.push_back(i);
        }
    }
    return far;
}

void require_usable(const Series& series, const Inspection& inspection, double first_value) {
    const std::size_t present = series.samples - series.missing;
    if (present < kFewestSamples)
        throw DataError(
            text("too few samples: %zu present, at least %zu needed", present, kFewestSamples));
    if (static_cast<double>(series.missing) >
        kLargestMissingShare * static_cast<double>(series.samples))
        throw DataError(
            text("too many missing samples: %zu of %zu (longest gap %zu), at most a "
                 "tenth may be missing",
                 series.missing, series.samples, series.longest_gap));
    if (inspection.constant)
        throw DataError(
            text("variance is zero: all %zu samples are %g; the sensor is stuck or "
                 "its resolution is coarser than its noise",
                 present, first_value));
}

}  // namespace vibrig::estimator::allan
