#include "estimator/uncertainty/signatures.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include "estimator/filter/angles.hpp"

namespace vibrig::estimator::uncertainty {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr std::array<const char*, 3> kGyro{"x", "y", "z"};
constexpr std::array<const char*, 3> kGimbalName{"outer", "inner", "azimuth"};
constexpr std::array<const char*, 3> kLinear{"I", "S", "O"};  ///< filter order

/// a_i, a_s or a_o of a gyro.
double linear(const DwellRow& row, std::size_t gyro, std::size_t term) {
    return row.regressors[gyro][kDi + term];
}

VectorXd step_at(const DwellTable& table, int after_dwell) {
    VectorXd z = VectorXd::Zero(table.dwells());
    z.tail(table.dwells() - after_dwell).setOnes();
    return z.array() - z.mean();
}

VectorXd trend(const DwellTable& table) { return table.time_h.array() - table.time_h.mean(); }

class Builder {
  public:
    Builder(const DwellTable& table, const ForwardModel& model, double size, const char* unit)
        : table_(table), model_(model) {
        out_.size = size;
        out_.unit = unit;
    }
    /// One more unknown; `set` gives the disturbance a size in SI units, `in_unit` is one unit.
    Builder& add(std::string element, double in_unit,
                 const std::function<void(Disturbance&, double)>& set) {
        const double size = out_.size * in_unit;
        push(std::move(element), size * signature(table_, model_, set, size),
             [set, size](Disturbance& d, double x) { set(d, size * x); });
        return *this;
    }
    /// A drift of one gyro, deg/h, with the number of the row.
    template <class Of>
    void add_drift(std::string element, std::size_t gyro, const Of& of_row) {
        VectorXd z = VectorXd::Zero(3 * table_.dwells());
        for (Index k = 0; k < table_.dwells(); ++k)
            z[3 * k + static_cast<Index>(gyro)] =
                out_.size * of_row(table_.rows[static_cast<std::size_t>(k)], k);
        push(std::move(element), std::move(z), {});
    }
    Signatures take() { return std::move(out_); }

  private:
    void push(std::string element, const VectorXd& z,
              std::function<void(Disturbance&, double)> set) {
        out_.z.conservativeResize(z.size(), out_.z.cols() + 1);
        out_.z.rightCols<1>() = z;
        out_.elements.push_back(std::move(element));
        out_.sets.push_back(std::move(set));
    }
    const DwellTable& table_;
    const ForwardModel& model_;
    Signatures out_;
};

Signatures resolver(const DwellTable& table, const ForwardModel& model, int order, double size) {
    Builder of(table, model, size, "arcsec");
    for (std::size_t k = 0; k < 3; ++k) {
        for (std::size_t part = 0; part < 2; ++part) {
            of.add(std::string(kGimbalName[k]) + (part == 0 ? " cosine" : " sine"),
                   kRadPerArcmin / 60.0,
                   [=](Disturbance& d, double x) { d.resolver_rad(order, k, part) = x; });
        }
    }
    return of.take();
}

Signatures of_bias(const DwellTable& table, const ForwardModel& model, const VectorXd& when,
                   double size, const char* unit) {
    Builder of(table, model, size, unit);
    for (std::size_t j = 0; j < 3; ++j)
        of.add_drift(kGyro[j], j, [&](const DwellRow&, Index k) { return when[k]; });
    return of.take();
}

Signatures of_unbalance(const DwellTable& table, const ForwardModel& model, const VectorXd& when,
                        double size, const char* unit) {
    Builder of(table, model, size, unit);
    for (std::size_t j = 0; j < 3; ++j) {
        for (std::size_t q = 0; q < 3; ++q) {
            of.add_drift(std::string("D_") + kLinear[q] + kGyro[j], j,
                         [&](const DwellRow& row, Index k) { return when[k] * linear(row, j, q); });
        }
    }
    return of.take();
}

}  // namespace

DwellTable dwell_table(std::span<const DwellRow> rows) {
    DwellTable table{rows, VectorXd::Zero(static_cast<Index>(rows.size())), false};
    table.times_assumed = !std::all_of(rows.begin(), rows.end(),
                                       [](const DwellRow& row) { return row.common_clock; });
    // A clock that was set back between two dwells is none that they have in common.
    for (std::size_t k = 1; k < rows.size(); ++k)
        table.times_assumed |= !(rows[k].middle_s > rows[k - 1].middle_s);
    double at = 0;
    for (std::size_t k = 0; k < rows.size(); ++k) {
        const double before = k > 0 ? rows[k - 1].duration_s : 0;
        if (k > 0) at += 0.5 * (before + rows[k].duration_s) + kAssumedPause_s;
        table.time_h[static_cast<Index>(k)] =
            (table.times_assumed ? at : rows[k].middle_s - rows[0].middle_s) / 3600.0;
    }
    return table;
}

VectorXd signature(const DwellTable& table, const ForwardModel& model,
                   const std::function<void(Disturbance&, double)>& set, double step) {
    Disturbance plus, minus;
    set(plus, step);
    set(minus, -step);
    VectorXd z(3 * table.dwells());
    for (Index k = 0; k < table.dwells(); ++k) {
        const DwellRow& row = table.rows[static_cast<std::size_t>(k)];
        z.segment<3>(3 * k) =
            (model.apparent(row, plus) - model.apparent(row, minus)) / (2.0 * step);
    }
    return z;
}

Signatures signatures(Misfit misfit, const DwellTable& table, const ForwardModel& model, double s0,
                      int after_dwell) {
    switch (misfit) {
        case Misfit::cross_axis:
            return Builder(table, model, 0.02, "")
                .add("north", 1, [](Disturbance& d, double x) { d.cross_north = x; })
                .add("east", 1, [](Disturbance& d, double x) { d.cross_east = x; })
                .take();
        case Misfit::azimuth:
            return Builder(table, model, 3, "arcmin")
                .add("", kRadPerArcmin, [](Disturbance& d, double x) { d.azimuth_rad = x; })
                .take();
        case Misfit::latitude:
            return Builder(table, model, 3, "arcmin")
                .add("", kRadPerArcmin, [](Disturbance& d, double x) { d.latitude_rad = x; })
                .take();
        case Misfit::time_base:
            return Builder(table, model, 2e-4, "")
                .add("", 1, [](Disturbance& d, double x) { d.time_base = x; })
                .take();
        case Misfit::encoder_zero: {
            Builder of(table, model, 1, "arcmin");
            for (std::size_t k = 0; k < 3; ++k)
                of.add(kGimbalName[k], kRadPerArcmin,
                       [k](Disturbance& d, double x) { d.encoder_zero_rad[k] = x; });
            return of.take();
        }
        case Misfit::non_orthogonality:
            return Builder(table, model, 1, "arcmin")
                .add("outer-inner", kRadPerArcmin,
                     [](Disturbance& d, double x) { d.non_orthogonality_rad[0] = x; })
                .add("inner-azimuth", kRadPerArcmin,
                     [](Disturbance& d, double x) { d.non_orthogonality_rad[1] = x; })
                .take();
        case Misfit::resolver_1:
            return resolver(table, model, 1, 20);
        case Misfit::resolver_2:
            return resolver(table, model, 2, 20);
        case Misfit::resolver_16:
            return resolver(table, model, 16, 5);
        case Misfit::cubic: {
            Builder of(table, model, 3e-4, "deg/h/g^3");
            for (std::size_t j = 0; j < 3; ++j) {
                for (std::size_t q = 0; q < 3; ++q) {
                    const std::string axes(3, *kLinear[q]);
                    of.add_drift("D_" + axes + kGyro[j], j, [=](const DwellRow& row, Index) {
                        const double a = linear(row, j, q);
                        return a * a * a * (3.0 * row.vibration.kappa - 2.0);
                    });
                }
            }
            return of.take();
        }
        case Misfit::trend:
            return of_bias(table, model, trend(table), 0.01, "deg/h/h");
        case Misfit::step:
            return of_bias(table, model, step_at(table, after_dwell), 3 * s0, "deg/h");
        case Misfit::unbalance_trend:
            return of_unbalance(table, model, trend(table), 0.01, "deg/h/g/h");
        case Misfit::unbalance_step:
            return of_unbalance(table, model, step_at(table, after_dwell), 3 * s0, "deg/h/g");
        default:
            return {};  // a state of the drift, not a disturbance of known shape
    }
}

}  // namespace vibrig::estimator::uncertainty
