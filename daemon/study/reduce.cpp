#include "daemon/study/reduce.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "estimator/uncertainty/assessment.hpp"
#include "proto/json_number.hpp"

namespace vibrig::study {

using Json = nlohmann::ordered_json;

namespace {

/// Quantiles of the normal distribution: errors within so many u.
constexpr std::array<double, kCoverages.size()> kWithin{0.994457883209753, 1.959963984540054,
                                                        2.575829303548901};
constexpr double kDegrees = estimator::kParameters;
constexpr std::size_t kMostReasons = 100;

Json json_of(const Interval& interval) {
    return {{"value", proto::number_or_null(interval.value)},
            {"low", proto::number_or_null(interval.low)},
            {"high", proto::number_or_null(interval.high)}};
}

void count(std::map<std::string, std::uint64_t>& counts, const std::string& what) {
    if (counts.size() < kMostReasons || counts.contains(what)) {
        ++counts[what];
    } else {
        ++counts["other"];
    }
}

}  // namespace

CampaignSums::CampaignSums() : bounds_(chi_square_bounds(kNeesBins, kDegrees)) {}

void CampaignSums::add(Claim& claim, double error, double u) {
    const double z = error / u;
    claim.sigma_squares.add(u * u);
    claim.z_squares.add(z * z);
    for (std::size_t k = 0; k < kWithin.size(); ++k) {
        if (std::abs(z) <= kWithin[k]) ++claim.within[k];
    }
}

void CampaignSums::add(Nees& nees, double value) {
    if (!std::isfinite(value)) return;
    ++nees.count;
    nees.sum.add(value);
    const auto bin = std::ranges::upper_bound(bounds_, value) - bounds_.begin();
    ++nees.bins[static_cast<std::size_t>(bin)];
}

void CampaignSums::add(const CampaignRecord& record) {
    ++runs_;
    if (!record.failed.empty()) {
        ++failed_;
        return count(failures_, record.failed);
    }
    ++verdicts_.at(record.verdict);
    std::size_t at = 0;
    while (at < record.reasons.size()) {
        const std::size_t end = std::min(record.reasons.find(',', at), record.reasons.size());
        count(reasons_, record.reasons.substr(at, end - at));
        at = end + 1;
    }
    hours_.add(record.hours);
    for (std::size_t i = 0; i < estimator::kParameters; ++i) {
        if (!std::isfinite(record.error[i]) || !(record.u_a[i] > 0) || !(record.u[i] > 0)) continue;
        Coefficient& c = coefficients_[i];
        ++c.count;
        c.error.add(record.error[i]);
        c.error_squares.add(record.error[i] * record.error[i]);
        add(c.noise, record.error[i], record.u_a[i]);
        add(c.all, record.error[i], record.u[i]);
    }
    add(nees_noise_, record.nees_a);
    add(nees_all_, record.nees);
}

Json CampaignSums::json(const Claim& claim, std::uint64_t runs) {
    const auto n = static_cast<double>(runs);
    Json coverage;
    for (std::size_t k = 0; k < kCoverages.size(); ++k)
        coverage[std::to_string(kCoverages[k])] = json_of(share_interval(claim.within[k], runs));
    return {{"sigma", proto::number_or_null(std::sqrt(claim.sigma_squares.value() / n))},
            {"rms_z", json_of(rms_interval(claim.z_squares.value(), runs))},
            {"coverage", coverage}};
}

Json CampaignSums::json(const Nees& nees) {
    if (nees.count == 0) return {{"n", 0}};
    const ChiSquareMean mean = chi_square_mean(nees.sum.value(), nees.count, kDegrees);
    return {{"n", nees.count},   {"mean", mean.mean}, {"expected", kDegrees},  {"low", mean.low},
            {"high", mean.high}, {"p", mean.p},       {"histogram", nees.bins}};
}

Json CampaignSums::json() const {
    Json out{{"runs", runs_}, {"failed", failed_}, {"failures", failures_}};
    out["verdicts"] = {
        {"valid", verdicts_[0]}, {"doubtful", verdicts_[1]}, {"not_valid", verdicts_[2]}};
    out["reasons"] = reasons_;
    const std::uint64_t good = runs_ - failed_;
    out["campaign_h"] =
        good > 0 ? proto::number_or_null(hours_.value() / static_cast<double>(good)) : Json();
    out["nees"] = {{"noise", json(nees_noise_)}, {"all", json(nees_all_)}};
    Json list = Json::array();
    for (std::size_t i = 0; i < estimator::kParameters; ++i) {
        const Coefficient& c = coefficients_[i];
        Json one{{"name", estimator::parameter_names()[i]},
                 {"unit", estimator::parameter_unit(i)},
                 {"n", c.count}};
        if (c.count > 0) {
            const auto n = static_cast<double>(c.count);
            one["mean_error"] = proto::number_or_null(c.error.value() / n);
            one["rms_error"] = proto::number_or_null(std::sqrt(c.error_squares.value() / n));
            one["noise"] = json(c.noise, c.count);
            one["all"] = json(c.all, c.count);
        }
        list.push_back(one);
    }
    out["coefficients"] = list;
    return out;
}

Reduction::Reduction(const Folder& folder)
    : folder_(folder),
      points_(std::make_unique<Json>(Json::array())),
      propagation_(folder.study.digits) {}
Reduction::~Reduction() = default;

void Reduction::close_point() {
    if (!sums_) return;
    Json at = Json::object();
    const auto place = folder_.study.place_of(point_);
    for (std::size_t a = 0; a < place.size(); ++a)
        at[folder_.study.grid[a].key] = folder_.study.grid[a].values[place[a]];
    Json point{{"point", point_}, {"grid", at}};
    point.update(sums_->json());
    points_->push_back(std::move(point));
    sums_.reset();
}

void Reduction::add(std::uint64_t index, const std::string& bytes) {
    if (folder_.study.kind != "campaigns") {
        if (bytes[0] == 'F') ++failed_;
        ++done_;
        if (folder_.study.kind == "uncertainty") return propagation_.add(bytes);
        return recordings_.add(folder_.study.recordings.at(index), bytes);
    }
    const std::uint64_t point = index / folder_.study.runs;
    if (sums_ && point != point_) close_point();
    point_ = point;
    if (!sums_) sums_ = std::make_unique<CampaignSums>();
    const CampaignRecord record = decode(bytes);
    if (!record.failed.empty()) ++failed_;
    ++done_;
    sums_->add(record);
}

Json Reduction::result(std::uint64_t missing) {
    close_point();
    const bool campaigns = folder_.study.kind == "campaigns";
    Json out{{"study", folder_.study.name}, {"kind", folder_.study.kind}, {"id", folder_.id_text}};
    if (folder_.study.kind != "recordings") out["seed"] = folder_.study.seed;
    if (campaigns) out.update({{"runs", folder_.study.runs}, {"simulated", true}});
    out.update({{"tasks", folder_.tasks()},
                {"done", done_},
                {"failed", failed_},
                {"partial", missing > 0},
                {"missing", missing},
                {"version", folder_.version},
                {"compiler", folder_.compiler},
                {"instruction_set", folder_.instruction_set}});
    if (!campaigns) {
        Json settings = Json::object();
        for (const Setting& setting : folder_.study.configuration)
            settings[setting.key] = setting.value;
        out["settings"] = settings;
        if (folder_.study.kind == "recordings") {
            out["recordings"] = recordings_.take();
        } else {
            out["recording"] = folder_.study.recordings.at(0).folder;
            out.update(propagation_.json());
        }
        return out;
    }
    out["points"] = std::move(*points_);
    *points_ = Json::array();
    return out;
}

}  // namespace vibrig::study
