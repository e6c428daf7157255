#include "daemon/study/campaigns.hpp"

#include <Eigen/Core>
#include <cmath>
#include <nlohmann/json.hpp>

#include "daemon/dwells/anew.hpp"
#include "daemon/dwells/player.hpp"
#include "daemon/order/campaign_order.hpp"
#include "daemon/record/digest.hpp"
#include "daemon/study/rig_keys.hpp"
#include "daemon/study/statistics.hpp"
#include "estimator/commissioning/contradiction.hpp"
#include "estimator/filter/angles.hpp"
#include "estimator/uncertainty/assessment.hpp"
#include "estimator/uncertainty/verdict.hpp"
#include "tests/plant/recording.hpp"

namespace vibrig::study {

using Json = nlohmann::ordered_json;

namespace {

namespace uncertainty = estimator::uncertainty;

constexpr std::size_t kMostCombinations = 10'000;

std::vector<Setting> settings_at(const Study& study, const std::vector<std::size_t>& place) {
    std::vector<Setting> settings = study.configuration;
    for (std::size_t a = 0; a < study.grid.size(); ++a) {
        if (!study.grid[a].settings.empty()) put(settings, study.grid[a].settings[place[a]]);
    }
    return settings;
}

std::vector<RigSetting> rig_at(const Study& study, const std::vector<std::size_t>& place) {
    std::vector<RigSetting> rig = study.rig;
    for (std::size_t a = 0; a < study.grid.size(); ++a) {
        if (study.grid[a].rig.empty()) continue;
        const RigSetting& setting = study.grid[a].rig[place[a]];
        std::erase_if(rig, [&](const RigSetting& one) { return one.key == setting.key; });
        rig.push_back(setting);
    }
    return rig;
}

/// "accelerometer.matrix" in the truth's JSON.
Json& entry_of(Json& truth, const std::string& key) {
    const std::size_t dot = key.find('.');
    return truth[key.substr(0, dot)][key.substr(dot + 1)];
}

Json drawn(const RigKey& what, std::size_t depth, const Distribution& distribution, Draws& draws) {
    if (depth == what.elements.size()) return distribution.draw(draws);
    Json list = Json::array();
    for (std::size_t i = 0; i < what.elements[depth]; ++i)
        list.push_back(drawn(what, depth + 1, distribution, draws));
    return list;
}

void misalign(Json& truth, const Json& arcsec, const std::string& place) {
    if (!arcsec.is_array() || arcsec.size() != 6 ||
        !std::ranges::all_of(arcsec, [](const Json& one) { return one.is_number(); }))
        throw StudyError(place + ": rig." + kMisalignment + ": found " + arcsec.dump() +
                         ", expected six numbers: xy, xz, yx, yz, zx, zy");
    Json& matrix = entry_of(truth, "accelerometer.matrix");
    std::size_t at = 0;
    for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t j = 0; j < 3; ++j) {
            if (i == j) continue;
            matrix[i][j] =
                matrix[i][j].get<double>() + estimator::kRadPerArcsec * arcsec[at++].get<double>();
        }
    }
}

/// The rig of one task. Distributions are drawn from (seed, index, key).
plant::Truth truth_of(const Json& base, const std::vector<RigSetting>& rig, std::uint64_t seed,
                      std::uint64_t index) {
    Json truth = base;
    std::optional<std::pair<Json, std::string>> misalignment;
    for (const RigSetting& setting : rig) {
        Draws draws(seed, index, setting.key);
        const Json value = setting.json.empty()
                               ? drawn(rig_keys().at(setting.key), 0, setting.distribution, draws)
                               : Json::parse(setting.json);
        if (setting.key == kMisalignment) {
            misalignment.emplace(value, setting.place);
        } else {
            entry_of(truth, setting.key) = value;
        }
    }
    if (misalignment) misalign(truth, misalignment->first, misalignment->second);
    truth["seed"] = Draws(seed, index, "noise").bits();
    return plant::parse_truth(truth.dump(), "rig");
}

double rate_of(const configuration::Configuration& c) {
    return 1 / drivers::to_seconds(c.assembler.sample_period);
}

/// A rig that samples as the configuration says; what a study states of its rig comes on top.
Json base_of(const configuration::Configuration& c) {
    plant::Truth truth;
    truth.sample_rate_hz = rate_of(c);
    return Json::parse(plant::to_json(truth));
}

plant::CampaignPlan plan_of(const configuration::Configuration& c,
                            const std::vector<std::size_t>& sequence) {
    plant::CampaignPlan plan;
    plan.positions_deg = c.campaign.positions_deg;
    plan.table_g = c.campaign.table_g;
    plan.frequency_hz = {c.campaign.frequency_hz};
    plan.dwell_s = c.campaign.dwell_s;
    plan.ramp_s = c.campaign.ramp_s;
    plan.settle_s = c.campaign.settle_s;
    for (const std::size_t at : sequence)
        plan.order.emplace_back(at / plan.positions_deg.size() + 1,
                                at % plan.positions_deg.size() + 1);
    return plan;
}

/// Samples of one campaign into the daemon's own dwell logic.
class Bench {
  public:
    /// `found`: the noise that all of it was found to have, in place of the configured one.
    Bench(const estimator::Settings& settings, const plant::CampaignPlan& plan,
          const std::optional<noise::Found>& found)
        : plan_(plan), player_(settings, found ? Noise::given : Noise::decided) {
        if (found) player_.book().use_noise(found->levels);
        samples_.reserve(dwells::Player::kMost);
    }

    void take(const plant::PlannedSample& from) {
        drivers::Sample sample;
        sample.time = drivers::from_seconds(from.time_s);
        for (std::size_t k = 0; k < 3; ++k) {
            sample.angle[k] = from.readings.encoder_deg[k] * estimator::kRadPerDeg;
            sample.force[k] = from.readings.raw_g[k];
            for (std::size_t t = 0; t < plant::kTerms; ++t)
                truth_[plant::kTerms * k + t] += from.coefficients[k][t];
        }
        sample.table_accel = from.readings.table_g;
        if (!begun_) begin(sample.time, from);
        samples_.push_back(sample);
        ++count_;
        if (samples_.size() == dwells::Player::kMost) flush();
    }
    void end_dwell() {
        flush();
        rt::DwellOrder cancel;
        cancel.cancel = true;
        player_.order(cancel);
        rt::DwellDone done;
        while (player_.take_done(done)) {
        }
        begun_ = false;
    }

    [[nodiscard]] std::optional<noise::Found> noise_found() const {
        return player_.book().noise().found();
    }
    [[nodiscard]] estimator::Result result() { return player_.book().identification().result(); }
    /// Of its dwells.
    [[nodiscard]] const std::vector<estimator::DwellMeans>& means() {
        return player_.book().identification().means();
    }
    /// Mean over the samples: what an identification of a rig that drifts is to be judged by.
    [[nodiscard]] double truth(std::size_t i) const {
        return truth_[i] / static_cast<double>(count_);
    }
    [[nodiscard]] double hours() const { return drivers::to_seconds(player_.now()) / 3600; }

  private:
    using Noise = dwells::DwellBook::Noise;
    void begin(drivers::Time time, const plant::PlannedSample& from) {
        rt::DwellOrder order;
        order.from = time;
        order.to = time + drivers::from_seconds(plan_.dwell_s);
        order.dwell = {static_cast<int>(from.run), static_cast<int>(from.position),
                       plan_.table_g[from.run - 1], drivers::to_seconds(time)};
        player_.order(order);
        begun_ = true;
    }
    void flush() {
        player_.push(samples_);
        samples_.clear();
    }

    const plant::CampaignPlan& plan_;
    dwells::Player player_;
    std::vector<drivers::Sample> samples_;
    std::array<double, estimator::kParameters> truth_{};
    std::uint64_t count_ = 0;
    bool begun_ = false;
};

CampaignRecord campaign(const estimator::Settings& settings, const plant::CampaignPlan& plan,
                        const plant::Truth& truth) {
    const auto played = [&](const std::optional<noise::Found>& found) {
        auto bench = std::make_unique<Bench>(settings, plan, found);
        plant::simulate(
            truth, plan, [&](const plant::PlannedSample& sample) { bench->take(sample); },
            [&](std::size_t, std::size_t) { bench->end_dwell(); });
        return bench;
    };
    auto playing = played({});
    const auto found = playing->noise_found();
    // As the daemon does; the same samples come again.
    if (found) playing = played(found);
    Bench& bench = *playing;
    const auto result = bench.result();
    auto assessed = dwells::assess(settings, found, result);
    // As the daemon at a campaign's end: a rig that is not what the configuration says.
    uncertainty::contradict(assessed.verdict, estimator::commissioning::first_contradiction(
                                                  settings, result.dwells, bench.means()));
    CampaignRecord record;
    record.hours = bench.hours();
    record.verdict = static_cast<std::uint8_t>(assessed.verdict.level);
    for (const auto& reason : assessed.verdict.reasons)
        record.reasons += (record.reasons.empty() ? "" : ",") + reason.code;
    Eigen::VectorXd error(estimator::kParameters);
    for (std::size_t i = 0; i < estimator::kParameters; ++i) {
        const auto& c = assessed.coefficients[i];
        record.error[i] = c.value - bench.truth(i);
        record.u_a[i] = c.u_a;
        record.u[i] = c.u;
        error[static_cast<Eigen::Index>(i)] = record.error[i];
    }
    record.nees_a = nees(error, assessed.covariance_a);
    record.nees = nees(error, assessed.covariance_combined);
    return record;
}

}  // namespace

configuration::Loaded load_settings(const std::vector<Setting>& settings, const std::string& file) {
    try {
        return configuration::parse(configuration_text(settings), file, false);
    } catch (const configuration::ConfigurationError& error) {
        throw StudyError(with_own_places(error.what(), file, settings));
    }
}

std::size_t combination_of(const Study& study, std::uint64_t point) {
    const auto place = study.place_of(point);
    std::size_t combination = 0;
    for (std::size_t a = 0; a < study.grid.size(); ++a) {
        if (study.grid[a].settings.empty()) continue;
        combination = combination * study.grid[a].settings.size() + place[a];
    }
    return combination;
}

Effective configuration_of(const Study& study, const std::string& file) {
    Effective out;
    for (auto& one : load_settings(settings_at(study, study.place_of(0)), file).effective)
        out.emplace_back(one.key, one.value);
    return out;
}

Sequences check_campaigns(const Study& study, const std::string& file) {
    Sequences out;
    const Json base = Json::parse(plant::to_json(plant::Truth{}));
    Study only_settings = study;
    std::erase_if(only_settings.grid, [](const Axis& axis) { return axis.settings.empty(); });
    if (only_settings.points() > kMostCombinations)
        throw StudyError(file + ": grid: found " + std::to_string(only_settings.points()) +
                         " configurations, expected at most " + std::to_string(kMostCombinations));
    for (std::uint64_t point = 0; point < only_settings.points(); ++point) {
        const auto loaded =
            load_settings(settings_at(only_settings, only_settings.place_of(point)), file);
        out.push_back(visit_sequence(loaded.configuration));
    }
    // Every value of the rig once, with the first of the others.
    std::vector<std::vector<std::size_t>> places{study.place_of(0)};
    for (std::size_t a = 0; a < study.grid.size(); ++a) {
        for (std::size_t v = 0; v < study.grid[a].rig.size(); ++v) {
            places.push_back(study.place_of(0));
            places.back()[a] = v;
        }
    }
    for (const auto& place : places) {
        const auto rig = rig_at(study, place);
        try {
            static_cast<void>(truth_of(base, rig, study.seed, 0));
        } catch (const plant::PlantError& error) {
            std::string at = file;
            for (const RigSetting& one : rig) {
                if (std::string(error.what()).find(one.key) != std::string::npos) at = one.place;
            }
            throw StudyError(at + ": " + error.what());
        }
    }
    return out;
}

struct CampaignWorker::Point {
    std::uint64_t number = 0;
    Json base;
    std::vector<RigSetting> rig;
    estimator::Settings settings;
    plant::CampaignPlan plan;
};

CampaignWorker::CampaignWorker(const Study& study, const Sequences& sequences)
    : study_(study), sequences_(sequences) {}
CampaignWorker::~CampaignWorker() = default;

const CampaignWorker::Point& CampaignWorker::point_of(std::uint64_t index) {
    const std::uint64_t number = index / study_.runs;
    if (point_ && point_->number == number) return *point_;
    const auto place = study_.place_of(number);
    auto next = std::make_unique<Point>();
    next->number = number;
    const auto loaded = load_settings(settings_at(study_, place), "study");
    next->base = base_of(loaded.configuration);
    next->rig = rig_at(study_, place);
    next->settings = loaded.configuration.estimator;
    next->plan = plan_of(loaded.configuration, sequences_.at(combination_of(study_, number)));
    point_ = std::move(next);
    return *point_;
}

std::string CampaignWorker::run(std::uint64_t index) {
    return record_of([&] {
        const Point& point = point_of(index);
        return encode(campaign(point.settings, point.plan,
                               truth_of(point.base, point.rig, study_.seed, index)));
    });
}

double expected_task_s(const Study& study, const Sequences& sequences) {
    constexpr double kRecordedByte_s = 3e-8, kBlock_s = 0.05;
    if (study.kind == "uncertainty") return kBlock_s;
    if (!study.recordings.empty()) {
        double bytes = 0;
        for (const Recording& recording : study.recordings) {
            for (const auto& file : recording.files) bytes += static_cast<double>(file.bytes);
        }
        return kRecordedByte_s * bytes / static_cast<double>(study.recordings.size());
    }
    constexpr double kSample_s = 3e-6, kMostPoints = 50;
    double sum_s = 0, count = 0;
    const auto points = static_cast<double>(study.points());
    for (double at = 0; at < points; at += std::max(1.0, points / kMostPoints)) {
        const auto point = static_cast<std::uint64_t>(at);
        const auto place = study.place_of(point);
        const auto loaded = load_settings(settings_at(study, place), "study");
        double rate_hz = rate_of(loaded.configuration);
        for (const RigSetting& setting : rig_at(study, place)) {
            if (setting.key == "platform.sample_rate_hz" && !setting.json.empty())
                rate_hz = Json::parse(setting.json).get<double>();
        }
        sum_s += static_cast<double>(sequences.at(combination_of(study, point)).size()) *
                 loaded.configuration.campaign.dwell_s * rate_hz * kSample_s;
        ++count;
    }
    return sum_s / count;
}

std::string arithmetic() {
    plant::CampaignPlan plan;
    plan.positions_deg.resize(4);
    plan.dwell_s = 2;
    plan.settle_s = 0.5;
    plant::Truth truth;
    truth.bias_markov_deg_h = 0.1;
    std::string bytes = encode(campaign({}, plan, truth));
    for (int i = 1; i <= 1000; ++i) {
        const double x = 0.0137 * i;
        for (const double y : {std::sin(x), std::cos(x), std::exp(-x), std::log(x),
                               std::atan2(x, 2), std::pow(x, 1.5)})
            bytes.append(std::to_string(std::bit_cast<std::uint64_t>(y)));
    }
    return record::sha256_of_text(bytes).substr(0, 16);
}

}  // namespace vibrig::study
