#include "estimator/spectrum/resonance.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "estimator/filter/angles.hpp"
#include "estimator/filter/linear_algebra.hpp"

namespace vibrig::estimator::spectrum {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using linear_algebra::Cholesky;
using Point = Eigen::Vector2d;  ///< ln hz, ln damping

constexpr double kLeastWeight = 1e-4;
constexpr double kWorse = 12;  ///< so much less likely a maximum does not count
constexpr int kScanned = 90, kDampings = 5;
constexpr std::size_t kMaxima = 3;
constexpr int kReach = 3;  ///< nodes either way, one standard deviation apart
/// Of the intervals: cells of half a standard deviation out to 3.75, each of 4 x 4 points.
constexpr int kCells = 7, kInCell = 4;
constexpr double kTail = 0.025;

double log_sum(double a, double b) {
    const double most = std::max(a, b);
    return most + std::log(std::exp(a - most) + std::exp(b - most));
}

Resonance at(const Point& p) { return {std::exp(p[0]), std::exp(p[1])}; }

VectorXd prior_of(const VectorXd& base_sigma, std::size_t resonances, double elastic_sigma) {
    VectorXd sigma(kBase + kElastic * static_cast<Index>(resonances));
    sigma.head(kBase) = base_sigma;
    sigma.tail(sigma.size() - kBase).setConstant(elastic_sigma);
    return sigma;
}

/// Normal equations of whitened columns with a prior about zero.
struct Normal {
    MatrixXd square;       ///< of the columns
    VectorXd right;        ///< with the rates
    double rate_square{};  ///< of the rates
};
struct Solved {
    VectorXd x;
    MatrixXd covariance;
    double log_evidence = 0;  ///< less what is common to all models of the same rates
};
/// With its covariance, or without: the evidence alone, over a plane, needs none.
template <bool kWithCovariance = true>
Solved solve(const Normal& normal, const VectorXd& sigma) {
    MatrixXd information = normal.square;
    information.diagonal().array() += sigma.array().square().inverse();
    const auto factor = Cholesky::or_nan(information);
    Solved out;
    out.x = factor.solve(normal.right);
    if constexpr (kWithCovariance) out.covariance = factor.inverse();
    out.log_evidence = -0.5 * factor.log_det() - sigma.array().log().sum() -
                       0.5 * (normal.rate_square - normal.right.dot(out.x));
    return out;
}

/// The likelihood of a resonance, linear terms integrated out.
class Likelihood {
  public:
    Likelihood(const SpectralTable& table, std::size_t gyro, const GyroProblem& problem)
        : table_(table),
          gyro_(gyro),
          problem_(problem),
          factor_(Cholesky::or_nan(problem.covariance)),
          base_(factor_.whiten(table.base(gyro))),
          rate_(factor_.whiten(problem.rate)) {
        Index n = rate_.size();
        for (const SweptRates& swept : problem.swept) n += swept.size();
        base_.conservativeResize(n, Eigen::NoChange);
        rate_.conservativeResize(n);
        n = problem.rate.size();
        for (const SweptRates& swept : problem.swept) {
            base_.middleRows(n, swept.size()) = swept.base();
            rate_.segment(n, swept.size()) = swept.rate();
            n += swept.size();
        }
        flat_ = {linear_algebra::gram(base_), base_.transpose() * rate_, rate_.squaredNorm()};
    }

    struct Both {
        std::array<Solved, 2> by_size;
        double log_prior = 0;
        [[nodiscard]] double total() const {
            return log_prior + std::log(0.5) +
                   log_sum(by_size[0].log_evidence, by_size[1].log_evidence);
        }
    };
    /// With the prior's density in ln hz and ln damping.
    template <bool kWithCovariance = true>
    [[nodiscard]] Both both(const Point& p) const {
        const Normal normal = normal_at(at(p));
        Both out;
        for (std::size_t s = 0; s < kElasticSizes.size(); ++s)
            out.by_size[s] =
                solve<kWithCovariance>(normal, prior_of(problem_.prior_sigma, 1, kElasticSizes[s]));
        const double z = (p[1] - std::log(kDamping)) / kDampingSpread;
        out.log_prior = -std::log(std::log(kHighestResonance / kLowestResonance)) - z * z / 2 -
                        std::log(kDampingSpread * std::sqrt(2 * kPi));
        return out;
    }
    [[nodiscard]] double operator()(const Point& p) const {
        if (p[0] < std::log(kLowestResonance) || p[0] > std::log(kHighestResonance) ||
            !(std::abs(p[1]) < 20))
            return -1e300;
        return both<false>(p).total();
    }
    [[nodiscard]] Solved flat() const { return solve(flat_, problem_.prior_sigma); }

  private:
    [[nodiscard]] Normal normal_at(const Resonance& of) const {
        const MatrixXd elastic = whitened_elastic(of);
        Normal out{MatrixXd(kColumns, kColumns), VectorXd(kColumns), flat_.rate_square};
        out.square.topLeftCorner(kBase, kBase) = flat_.square;
        out.square.topRightCorner(kBase, kElastic).noalias() = base_.transpose() * elastic;
        out.square.bottomLeftCorner(kElastic, kBase) =
            out.square.topRightCorner(kBase, kElastic).transpose();
        out.square.bottomRightCorner(kElastic, kElastic).noalias() = elastic.transpose() * elastic;
        out.right << flat_.right, elastic.transpose() * rate_;
        return out;
    }
    [[nodiscard]] MatrixXd whitened_elastic(const Resonance& of) const {
        MatrixXd out(rate_.size(), kElastic);
        Index n = table_.dwells();
        out.topRows(n) = factor_.whiten(
            MatrixXd(table_.elastic_weights(of).asDiagonal() * table_.vibration(gyro_)));
        for (const SweptRates& swept : problem_.swept) {
            out.middleRows(n, swept.size()) = swept.elastic(of);
            n += swept.size();
        }
        return out;
    }

    const SpectralTable& table_;
    std::size_t gyro_;
    const GyroProblem& problem_;
    Cholesky factor_;
    MatrixXd base_;
    VectorXd rate_;
    Normal flat_;  ///< of the base alone
};

/// Maximum by Nelder and Mead's simplex: no derivatives of a likelihood that is steep far away.
Point climb(const Likelihood& likelihood, const Point& start) {
    std::array<std::pair<double, Point>, 3> simplex;
    for (std::size_t i = 0; i < 3; ++i) {
        const Point p = start + Point(i == 1 ? 0.02 : 0, i == 2 ? 0.3 : 0);
        simplex[i] = {likelihood(p), p};
    }
    const auto better = [](const auto& a, const auto& b) { return a.first > b.first; };
    for (int step = 0; step < 160; ++step) {
        std::stable_sort(simplex.begin(), simplex.end(), better);
        if (simplex[0].first - simplex[2].first < 1e-6) break;
        const Point middle = (simplex[0].second + simplex[1].second) / 2;
        const auto tried = [&](double factor) {
            const Point p = middle + factor * (simplex[2].second - middle);
            return std::pair(likelihood(p), p);
        };
        auto next = tried(-1);
        if (next.first > simplex[0].first) {
            const auto further = tried(-2);
            if (further.first > next.first) next = further;
        } else if (next.first < simplex[1].first) {
            next = tried(next.first > simplex[2].first ? -0.5 : 0.5);
        }
        if (next.first > simplex[2].first) {
            simplex[2] = next;
            continue;
        }
        for (std::size_t i = 1; i < 3; ++i) {
            simplex[i].second = (simplex[0].second + simplex[i].second) / 2;
            simplex[i].first = likelihood(simplex[i].second);
        }
    }
    std::stable_sort(simplex.begin(), simplex.end(), better);
    return simplex[0].second;
}

/// The best local maxima of a scan.
std::vector<Point> scan(const Likelihood& likelihood) {
    MatrixXd value(kScanned, kDampings);
    const auto point = [](int i, int k) {
        const double share = (i + 0.5) / kScanned;
        return Point(
            std::log(kLowestResonance) + share * std::log(kHighestResonance / kLowestResonance),
            std::log(kDamping) + 0.8 * kDampingSpread * (k - kDampings / 2));
    };
    for (int i = 0; i < kScanned; ++i) {
        for (int k = 0; k < kDampings; ++k) value(i, k) = likelihood(point(i, k));
    }
    std::vector<std::pair<double, Point>> maxima;
    for (int i = 0; i < kScanned; ++i) {
        for (int k = 0; k < kDampings; ++k) {
            const int rows = std::min(3, kScanned - std::max(0, i - 1));
            const int columns = std::min(3, kDampings - std::max(0, k - 1));
            const auto near = value.block(std::max(0, i - 1), std::max(0, k - 1),
                                          std::min(rows, i == 0 ? 2 : rows),
                                          std::min(columns, k == 0 ? 2 : columns));
            if (value(i, k) >= near.maxCoeff()) maxima.emplace_back(value(i, k), point(i, k));
        }
    }
    std::stable_sort(maxima.begin(), maxima.end(),
                     [](const auto& a, const auto& b) { return a.first > b.first; });
    // Before they are climbed, peaks narrower than the grid tell little by their height.
    if (maxima.size() > 2 * kMaxima) maxima.resize(2 * kMaxima);
    for (auto& [height, p] : maxima) {
        p = climb(likelihood, p);
        height = likelihood(p);
    }
    std::stable_sort(maxima.begin(), maxima.end(),
                     [](const auto& a, const auto& b) { return a.first > b.first; });
    std::vector<Point> out;
    for (const auto& [height, p] : maxima) {
        const bool again = std::any_of(out.begin(), out.end(), [&p = p](const Point& other) {
            return std::abs(p[0] - other[0]) < 1e-3 && std::abs(p[1] - other[1]) < 0.05;
        });
        if (!again && out.size() < kMaxima && height > maxima.front().first - kWorse)
            out.push_back(p);
    }
    return out;
}

constexpr double kOutside = -1e299;

/// Along one direction: so far that the likelihood falls by about a half. A maximum at the edge of
/// the prior falls to one side only.
double drop(const Likelihood& likelihood, const Point& top, double height, const Point& along,
            double most) {
    double step = 1e-4;
    while (step < most) {
        const double up = likelihood(top + step * along), down = likelihood(top - step * along);
        const double fall = height - (up < kOutside     ? down
                                      : down < kOutside ? up
                                                        : (up + down) / 2);
        if (fall > 0.1) return step / std::sqrt(2 * fall);
        step *= 1.5;
    }
    return most;
}

/// Axes of the curvature, each a standard deviation long.
Eigen::Matrix2d axes(const Likelihood& likelihood, const Point& top) {
    const double height = likelihood(top);
    const double of_hz = drop(likelihood, top, height, Point(1, 0), 0.5);
    const double of_damping = drop(likelihood, top, height, Point(0, 1), kDampingSpread);
    // In units of the two, where the curvature is one on the diagonal.
    const auto corner = [&](double a, double b) {
        return likelihood(top + Point(0.5 * a * of_hz, 0.5 * b * of_damping));
    };
    const std::array<double, 4> corners{corner(1, 1), corner(-1, -1), corner(1, -1), corner(-1, 1)};
    const bool inside =
        std::ranges::all_of(corners, [](double height_there) { return height_there > kOutside; });
    const double mixed =
        inside ? std::clamp(-(corners[0] + corners[1] - corners[2] - corners[3]), -0.98, 0.98) : 0;
    Eigen::Matrix2d curvature;
    curvature << 1, mixed, mixed, 1;
    const auto eigen = linear_algebra::symmetric_eigen(curvature);
    Eigen::Matrix2d out = eigen.vectors;
    for (int k = 0; k < 2; ++k) out.col(k) /= std::sqrt(eigen.values[k]);
    return Eigen::Vector2d(of_hz, of_damping).asDiagonal() * out;
}

struct Node {
    double log_weight;
    Hypothesis what;
};

void add_nodes(const Likelihood& likelihood, const Point& top, std::vector<Node>& nodes) {
    const Eigen::Matrix2d axis = axes(likelihood, top);
    const double log_area = std::log(std::abs(axis.determinant()));
    for (int a = -kReach; a <= kReach; ++a) {
        for (int b = -kReach; b <= kReach; ++b) {
            const Point p = top + axis * Point(a, b);
            if (!(likelihood(p) > kOutside)) continue;
            const Likelihood::Both both = likelihood.both(p);
            for (const Solved& one : both.by_size)
                nodes.push_back({both.log_prior + std::log(0.5) + one.log_evidence + log_area,
                                 {0, {at(p)}, one.x, one.covariance}});
        }
    }
}

/// Where a share `tail` of the weights lies below.
double quantile(std::vector<std::pair<double, double>> value_weight, double tail) {
    std::sort(value_weight.begin(), value_weight.end());
    double all = 0, below = 0;
    for (const auto& [value, weight] : value_weight) all += weight;
    for (const auto& [value, weight] : value_weight) {
        below += weight;
        if (below >= tail * all) return value;
    }
    return value_weight.back().first;
}

/// The intervals of a resonance. The mixture's own nodes are a standard deviation apart, too coarse
/// for a quantile: of a normal distribution its 2.5 % would lie 8 to 13 % too far out. So the
/// density is taken at twice as many along each axis, even within a cell, and nothing of a cell
/// counts that lies outside the prior.
void set_intervals(const Likelihood& likelihood, const std::vector<Point>& tops, Mixture& out) {
    struct Cell {
        double log_weight;
        Point middle;
        Eigen::Matrix2d sides;
    };
    std::vector<Cell> cells;
    double most = -1e300;
    for (const Point& top : tops) {
        const Eigen::Matrix2d sides = axes(likelihood, top) / 2;
        const double log_area = std::log(std::abs(sides.determinant()));
        for (int a = -kCells; a <= kCells; ++a) {
            for (int b = -kCells; b <= kCells; ++b) {
                const Point middle = top + sides * Point(a, b);
                const double height = likelihood(middle);
                if (!(height > kOutside)) continue;
                cells.push_back({height + log_area, middle, sides});
                most = std::max(most, cells.back().log_weight);
            }
        }
    }
    std::vector<std::pair<double, double>> hz, damping;
    for (const Cell& cell : cells) {
        const double weight = std::exp(cell.log_weight - most);
        if (weight < 1e-9) continue;
        for (int i = 0; i < kInCell * kInCell; ++i) {
            const Point within((i % kInCell + 0.5) / kInCell - 0.5,
                               (i / kInCell + 0.5) / kInCell - 0.5);
            const Resonance one = at(cell.middle + cell.sides * within);
            if (one.hz < kLowestResonance || one.hz > kHighestResonance) continue;
            hz.emplace_back(one.hz, weight);
            damping.emplace_back(one.damping, weight);
        }
    }
    if (hz.empty()) return;
    out.hz = {quantile(hz, kTail), quantile(hz, 1 - kTail)};
    out.damping = {quantile(damping, kTail), quantile(damping, 1 - kTail)};
}

/// By all that the one model weighs and the other: a resonance's weight lies on many nodes.
void put_likelier_first(Mixture& of) {
    const bool resonant = of.log_odds > 0;
    const auto likelier = [resonant](const Hypothesis& one) {
        return one.resonances.empty() != resonant;
    };
    std::stable_sort(of.list.begin(), of.list.end(), [&](const auto& a, const auto& b) {
        return likelier(a) != likelier(b) ? likelier(a) : a.weight > b.weight;
    });
}

void finish(const SpectralTable& table, std::size_t gyro, const GyroProblem& problem,
            Mixture& out) {
    put_likelier_first(out);
    const Hypothesis& best = out.list.front();
    const VectorXd left = problem.rate - design(table, gyro, best.resonances) * best.x;
    out.chi_square = linear_algebra::squared_distance(problem.covariance, left);
    out.degrees = static_cast<int>(problem.rate.size() - best.x.size()) -
                  2 * static_cast<int>(best.resonances.size());
    if (problem.swept.empty()) return;
    // What sweeps determine takes nothing from the dwells' rates.
    const MatrixXd x = design(table, gyro, best.resonances);
    out.degrees = static_cast<int>(std::lround(static_cast<double>(problem.rate.size()) -
                                               (gain(table, gyro, problem, best) * x).trace()));
}

/// Of the one model over the other.
double log_odds(const std::vector<Node>& nodes, const Solved& flat) {
    if (nodes.empty()) return -std::numeric_limits<double>::infinity();
    const double most = std::ranges::max(nodes, {}, &Node::log_weight).log_weight;
    double sum = 0;
    for (const Node& node : nodes) sum += std::exp(node.log_weight - most);
    return most - flat.log_evidence + std::log(sum);
}

/// How much less likely a resonance is where inputs may differ as declared: what they explain is
/// none.
double declared_explains(const SpectralTable& table, std::size_t gyro, GyroProblem problem,
                         double without) {
    if (problem.declared.size() == 0 || !(without > 0)) return 0;
    problem.covariance += problem.declared * problem.declared.transpose();
    const Likelihood likelihood(table, gyro, problem);
    std::vector<Node> nodes;
    for (const Point& top : scan(likelihood)) add_nodes(likelihood, top, nodes);
    return std::max(0.0, without - log_odds(nodes, likelihood.flat()));
}

}  // namespace

MatrixXd swept_design(const SweptRates& swept, const std::vector<Resonance>& resonances) {
    MatrixXd out(swept.size(), kBase + kElastic * static_cast<Index>(resonances.size()));
    out.leftCols(kBase) = swept.base();
    for (std::size_t r = 0; r < resonances.size(); ++r)
        out.middleCols(kBase + kElastic * static_cast<Index>(r), kElastic) =
            swept.elastic(resonances[r]);
    return out;
}

MatrixXd design(const SpectralTable& table, std::size_t gyro,
                const std::vector<Resonance>& resonances) {
    MatrixXd out(table.dwells(), kBase + kElastic * static_cast<Index>(resonances.size()));
    out.leftCols(kBase) = table.base(gyro);
    for (std::size_t r = 0; r < resonances.size(); ++r)
        out.middleCols(kBase + kElastic * static_cast<Index>(r), kElastic) =
            table.elastic_weights(resonances[r]).asDiagonal() * table.vibration(gyro);
    return out;
}

MatrixXd gain(const SpectralTable& table, std::size_t gyro, const GyroProblem& problem,
              const Hypothesis& of) {
    const MatrixXd x = design(table, gyro, of.resonances);
    const MatrixXd of_x = Cholesky::or_nan(problem.covariance).solve(x);
    const VectorXd sigma =
        prior_of(problem.prior_sigma, of.resonances.size(), kElasticSizes.back());
    MatrixXd information = x.transpose() * of_x;
    information.diagonal().array() += sigma.array().square().inverse();
    for (const SweptRates& swept : problem.swept) {
        const MatrixXd columns = swept_design(swept, of.resonances);
        information += linear_algebra::gram(columns);
    }
    return Cholesky::or_nan(information).solve(of_x.transpose());
}

Hypothesis without_resonance(const SpectralTable& table, std::size_t gyro,
                             const GyroProblem& problem) {
    Solved flat = Likelihood(table, gyro, problem).flat();
    return {1, {}, std::move(flat.x), std::move(flat.covariance)};
}

Mixture one_resonance(const SpectralTable& table, std::size_t gyro, const GyroProblem& problem) {
    const Likelihood likelihood(table, gyro, problem);
    std::vector<Node> nodes;
    const std::vector<Point> tops = scan(likelihood);
    for (const Point& top : tops) add_nodes(likelihood, top, nodes);
    Solved flat = likelihood.flat();
    const double declared = declared_explains(table, gyro, problem, log_odds(nodes, flat));
    for (Node& node : nodes) node.log_weight -= declared;
    double most = flat.log_evidence;
    for (const Node& node : nodes) most = std::max(most, node.log_weight);
    double resonant = 0;
    for (Node& node : nodes) resonant += node.what.weight = std::exp(node.log_weight - most);
    const double none = std::exp(flat.log_evidence - most);
    Mixture out;
    // Where the one or the other is beyond a double: by the largest term.
    out.log_odds = none > 0 && resonant > 0 ? std::log(resonant / none)
                   : none > 0               ? -700
                                            : most - flat.log_evidence + std::log(resonant);
    const double all = none + resonant;
    double kept = 0;
    const auto keep = [&](Hypothesis what, double weight) {
        if (weight / all < kLeastWeight) return;
        what.weight = weight;
        kept += weight;
        out.list.push_back(std::move(what));
    };
    keep({none, {}, std::move(flat.x), std::move(flat.covariance)}, none);
    for (Node& node : nodes) {
        const double weight = node.what.weight;
        keep(std::move(node.what), weight);
    }
    for (Hypothesis& one : out.list) one.weight /= kept;
    set_intervals(likelihood, tops, out);
    finish(table, gyro, problem, out);
    return out;
}

std::vector<ResonanceEstimate> estimates(const Mixture& mixture) {
    const std::size_t count = mixture.list.front().resonances.size();
    std::vector<ResonanceEstimate> out;
    for (std::size_t r = 0; r < count; ++r) {
        const Index begin = kBase + kElastic * static_cast<Index>(r);
        double all = 0;
        Eigen::Vector2d mean = Eigen::Vector2d::Zero(), square = mean;
        Eigen::Matrix<double, kElastic, 1> value, squares;
        value.setZero();
        squares.setZero();
        for (const Hypothesis& one : mixture.list) {
            if (one.resonances.size() != count) continue;
            const Eigen::Vector2d p(one.resonances[r].hz, one.resonances[r].damping);
            Eigen::Vector2d own = Eigen::Vector2d::Zero();
            if (one.linearised) {
                const Index at = one.x.size() + static_cast<Index>(r);
                own[0] = p[0] * p[0] * one.covariance(at, at);
                const Index of_damping = at + static_cast<Index>(count);
                own[1] = p[1] * p[1] * one.covariance(of_damping, of_damping);
            }
            const auto x = one.x.segment<kElastic>(begin);
            all += one.weight;
            mean += one.weight * p;
            square += one.weight * (p.cwiseAbs2() + own);
            value += one.weight * x;
            squares +=
                one.weight * (x.cwiseAbs2() + one.covariance.diagonal().segment<kElastic>(begin));
        }
        mean /= all;
        square /= all;
        ResonanceEstimate estimate;
        const bool linearised = mixture.list.front().linearised;
        const auto spread = [linearised](double m, double s, const Interval& between) {
            const double sigma = std::sqrt(std::max(0.0, s - m * m));
            if (!linearised) return Spread{m, sigma, between.low, between.high};
            // On a logarithmic scale, where it is normal.
            const double factor = std::exp(1.96 * sigma / m);
            return Spread{m, sigma, m / factor, m * factor};
        };
        estimate.hz = spread(mean[0], square[0], mixture.hz);
        estimate.hz.low = std::max(estimate.hz.low, kLowestResonance);
        estimate.hz.high = std::min(estimate.hz.high, kHighestResonance);
        estimate.damping = spread(mean[1], square[1], mixture.damping);
        estimate.elastic = value / all;
        estimate.sigma = (squares / all - estimate.elastic.cwiseAbs2()).cwiseMax(0.0).cwiseSqrt();
        out.push_back(estimate);
    }
    return out;
}

}  // namespace vibrig::estimator::spectrum
