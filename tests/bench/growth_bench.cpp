// What tests/bench/growth measures as processes of their own, and its charts:
//   growth_bench make-journal FOLDER EVENTS      a journal with so many events
//   growth_bench open-journal FOLDER             the start of a daemon on it
//   growth_bench make-index FOLDER CAMPAIGNS     an index of so many campaigns
//   growth_bench open-index FOLDER               opened, and one campaign looked up
//   growth_bench make-campaign FOLDER POSITIONS DWELL_S    a recorded campaign
//   growth_bench make-recording FOLDER MB        a recording so large, as the daemon writes it
//   growth_bench verdict DWELLS                  what follows a dwell
//   growth_bench adaptive DWELLS                 the choice of the next one
//   growth_bench history HOURS                   the page's curves; says a look's time, s
//   growth_bench status DWELLS                   a status as JSON; likewise
//   growth_bench serve                           a status server, until standard input ends
//   growth_bench chart FILE.json FILE.svg
#include <cstdio>
#include <ctime>
#include <exception>
#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>
#include <string>
#include <thread>

#include "daemon/journal/database.hpp"
#include "daemon/journal/journal.hpp"
#include "daemon/plan/adaptive.hpp"
#include "daemon/plot/chart.hpp"
#include "daemon/record/campaign_writer.hpp"
#include "daemon/record/index.hpp"
#include "daemon/record/replay.hpp"
#include "daemon/serve/history.hpp"
#include "daemon/serve/status_json.hpp"
#include "estimator/filter/encoder_angles.hpp"
#include "estimator/filter/parameters.hpp"
#include "estimator/identification/crlb.hpp"
#include "estimator/uncertainty/assessment.hpp"
#include "proto/durable_file.hpp"
#include "tests/bench/growth_server.hpp"
#include "tests/plant/recording.hpp"
#include "tests/unit/estimator/uncertainty/theory_rows.hpp"

namespace {

using namespace vibrig;
namespace fs = std::filesystem;
using Json = nlohmann::json;

std::string journal_in(const std::string& folder) { return folder + "/journal.sqlite3"; }

void make_journal(const std::string& folder, std::uint64_t events) {
    constexpr std::uint64_t kAtOnce = 4000;
    journal::Journal journal(journal_in(folder), 1);
    journal.start();
    EventRecord event;
    event.source = "campaign";
    event.text = "position 7 of 14: 112 samples rejected by the gate";
    for (std::uint64_t i = 1; i <= events; ++i) {
        event.id = i;
        event.utc_ns = static_cast<std::int64_t>(i) * 1'000'000;
        journal.event(event);
        while (i % kAtOnce == 0 && journal.status().taken > journal.status().written)
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    journal.stop();
}

void open_journal(const std::string& folder) {
    const journal::Journal journal(journal_in(folder), 1);
}

void make_index(const std::string& folder, int campaigns) {
    const auto ignore = [](const std::string&) {};
    record::Index made(folder, ignore);  // its tables
    journal::Database database(record::Index::path_in(folder));
    database.execute("PRAGMA synchronous = OFF");
    database.execute("BEGIN");
    const std::string digest(64, 'a');
    for (int i = 0; i < campaigns; ++i) {
        const std::string key = "platform-17-" + std::to_string(1'000'000 + i);
        database.run(
            "INSERT INTO campaign VALUES (?, ?, ?, ?, ?)",
            {std::string_view(key), std::string_view("platform-17"), std::string_view("A. Person"),
             std::int64_t{i} * 1'000'000'000, std::string_view("finished")});
        for (int part = 0; part < 8; ++part) {
            const std::string name =
                part == 0 ? "campaign.h5" : "raw-000" + std::to_string(part) + ".log.zst";
            database.run(
                "INSERT INTO file VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)",
                {std::string_view(key), std::string_view(name), std::int64_t{part == 0 ? 1 : 0},
                 std::int64_t{1}, std::int64_t{1}, std::int64_t{2}, std::int64_t{3},
                 std::int64_t{4}, std::string_view(digest)});
        }
        fs::create_directory(folder + "/" + key);
    }
    database.execute("COMMIT");
}

void open_index(const std::string& folder) {
    const std::string found =
        record::find_campaign("platform-17-1000000", {folder}, [](const std::string&) {});
    if (!found.ends_with("platform-17-1000000")) throw std::runtime_error("found " + found);
}

void make_campaign(const std::string& folder, std::size_t positions, double dwell_s) {
    plant::CampaignPlan plan;
    plan.dwell_s = dwell_s;
    std::mt19937 random(1);
    std::uniform_real_distribution<double> angle(-180, 180);
    plan.positions_deg.clear();
    while (plan.positions_deg.size() < positions)
        plan.positions_deg.push_back({angle(random), 0, angle(random)});
    record::Campaign campaign;
    campaign.path = folder + "/campaign.h5";
    campaign.head.name = "growth";
    campaign.head.campaign = fs::path(folder).filename();
    campaign.head.clock = "rig";
    campaign.head.simulated = true;
    std::size_t dwell = 0;
    plant::simulate(plant::Truth{}, plan, [&](const plant::PlannedSample& from) {
        drivers::Sample sample;
        sample.time = drivers::from_seconds(from.time_s);
        for (std::size_t k = 0; k < 3; ++k) {
            sample.angle[k] = from.readings.encoder_deg[k] * (std::numbers::pi / 180);
            sample.force[k] = from.readings.raw_g[k];
        }
        sample.table_accel = from.readings.table_g;
        const std::size_t now = (from.run - 1) * plan.positions_deg.size() + from.position;
        if (now != dwell)
            campaign.orders.push_back({sample.time, sample.time,
                                       sample.time + drivers::from_seconds(dwell_s),
                                       static_cast<int>(from.run), static_cast<int>(from.position),
                                       plan.table_g[from.run - 1]});
        dwell = now;
        campaign.samples.push_back(sample);
    });
    const auto replayed = record::replay(campaign, {}, {});
    record::CampaignWriter writer(campaign.path, campaign.head);
    for (const auto& order : campaign.orders) writer.put(order);
    for (const auto& sample : campaign.samples) writer.put(sample);
    for (const auto& one : replayed.dwells) writer.put(one);
    writer.commit();
    writer.end({"finished", "", "", "", 0});
}

/// A platform at rest, with noise in all digits.
void make_recording(const std::string& folder, std::uintmax_t megabytes) {
    constexpr drivers::Time kPeriod = drivers::kMillisecond;
    constexpr std::size_t kAtOnce = 100'000, kDwell = 100'000;
    record::Head head;
    head.name = head.campaign = "growth";
    head.clock = "real";
    head.simulated = true;
    const std::string path = folder + "/campaign.h5";
    record::CampaignWriter writer(path, head);
    std::minstd_rand random(1);
    drivers::Sample sample;
    for (std::size_t n = 0;; ++n) {
        sample.time = static_cast<drivers::Time>(n) * kPeriod;
        for (double& angle : sample.angle) angle = 1e-9 * static_cast<double>(random());
        for (double& force : sample.force) force = 1e-9 * static_cast<double>(random());
        writer.put(sample);
        if (n % kDwell == 0) {
            record::Order order;
            order.announced = order.from = sample.time;
            order.to = order.from + static_cast<drivers::Time>(kDwell) * kPeriod;
            order.run = 1 + static_cast<int>(n / kDwell / 14);
            order.position = 1 + static_cast<int>(n / kDwell % 14);
            order.table_g = 7;
            writer.put(order);
        }
        if (n % kAtOnce != kAtOnce - 1) continue;
        writer.commit();
        if (fs::file_size(path) >= megabytes * 1'000'000) break;
    }
    writer.end({"finished", "", "", "", 0});
}

estimator::Result result_of(std::size_t dwells) {
    namespace rows = estimator::testing;
    const auto order = rows::balanced(6, 14.0 / 3);
    std::vector<rows::PlannedRow> plan;
    while (plan.size() < dwells) plan.push_back(order[plan.size() % order.size()]);
    auto all = rows::theory_rows({}, plan);
    std::mt19937_64 noise(1);
    rows::add_noise(all, noise);
    return rows::result_of(std::move(all));
}

void verdict(std::size_t dwells) {
    static_cast<void>(estimator::uncertainty::assess({}, result_of(dwells)));
}

/// Towards targets so far away that as many dwells are foreseen as ever are: what costs most.
void adaptive(std::size_t dwells) {
    namespace planning = estimator::plan;
    constexpr double kDwell_s = 100, kPeriod_s = 0.025;
    const estimator::Settings settings;
    std::vector<planning::Experiment> done;
    for (const auto& direction : planning::cube_directions()) {
        for (const double level_g : {0.0, 14.0 / 3}) {
            const auto position = planning::position_for(settings, direction, {});
            if (!position) continue;
            done.push_back({estimator::rate_rows(settings,
                                                 {estimator::gimbal_deg(settings, *position),
                                                  planning::kappa_of(level_g), kDwell_s},
                                                 {}, kPeriod_s),
                            1});
        }
    }
    const auto prior = estimator::prior_sigma(settings);
    std::vector<double> prior_sigma;
    for (std::size_t i = 0; i < estimator::kParameters; ++i)
        prior_sigma.push_back(prior[estimator::internal_of(i)]);
    const double times = static_cast<double>(dwells) / static_cast<double>(done.size());
    const auto covariance =
        planning::covariance_after(prior_sigma, done, std::vector<double>(done.size(), times));
    plan::AdaptiveSettings wanted;
    wanted.table_g = {0, 2, 4, 7};
    wanted.target = {1e-9, 1e-9, 1e-9};
    wanted.timing.dwell_s = kDwell_s;
    wanted.period_s = kPeriod_s;
    const plan::AdaptivePlan chooser(settings, wanted);
    const auto next =
        chooser.next(plan::widened(covariance, settings, result_of(dwells)), {}, 0, dwells);
    if (next.verdict != plan::AdaptivePlan::Verdict::go_on) throw std::runtime_error(next.words);
}

/// Prints the processor time, s, of one of many calls.
void say_cost(const std::function<std::size_t()>& call) {
    constexpr int kCalls = 20;
    const auto cpu_s = [] {
        timespec t{};
        ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
        return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
    };
    const double begin = cpu_s();
    std::size_t bytes = 0;
    for (int i = 0; i < kCalls; ++i) bytes += call();
    std::printf("%.9f\n", (cpu_s() - begin) / kCalls);
    if (bytes == 0) throw std::runtime_error("found nothing to measure");
}

/// Twice a second a status, then the curves that the page asks for when it is opened.
void history(double hours) {
    serve::History history;
    StatusData status;
    status.state = CampaignState::recording;
    for (std::int64_t half = 0; half < static_cast<std::int64_t>(hours * 7200); ++half) {
        status.time = half * drivers::kSecond / 2;
        status.command_table_g = static_cast<double>(half % 7);
        status.progress = 0.5;
        history.add(status);
    }
    say_cost([&] { return history.json("measured_g,command_g,progress", -1).size(); });
}

void status(std::size_t dwells) {
    StatusData status;
    status.state = CampaignState::recording;
    status.dwells = result_of(dwells).dwells;
    say_cost([&] { return serve::status_json(status).size(); });
}

/// {"title", "x", "y", "curves": [{"name", "x": [...], "y": [...]}]}, both axes logarithmic.
void chart(const std::string& from, const std::string& to) {
    const Json what = Json::parse(std::ifstream(from));
    tool::plot::Chart chart;
    chart.title = what.at("title");
    chart.x = tool::plot::Axis(what.at("x"), true);
    chart.y = tool::plot::Axis(what.at("y"), true);
    for (const Json& one : what.at("curves")) {
        tool::plot::Curve curve;
        curve.name = one.at("name");
        curve.x = one.at("x").get<std::vector<double>>();
        curve.y = one.at("y").get<std::vector<double>>();
        // More than there are colours.
        if (chart.curves.size() >= 8) curve.look = tool::plot::Look::dashed;
        chart.curves.push_back(curve);
    }
    proto::write_output(to, chart.svg());
}

}  // namespace

int main(int argc, char** argv) {
    const std::vector<std::string> words(argv + 1, argv + argc);
    const auto is = [&](const char* name, std::size_t arguments) {
        return words.size() == 1 + arguments && words[0] == name;
    };
    try {
        if (is("make-journal", 2)) {
            make_journal(words[1], std::stoull(words[2]));
        } else if (is("open-journal", 1)) {
            open_journal(words[1]);
        } else if (is("make-index", 2)) {
            make_index(words[1], std::stoi(words[2]));
        } else if (is("open-index", 1)) {
            open_index(words[1]);
        } else if (is("make-campaign", 3)) {
            make_campaign(words[1], std::stoul(words[2]), std::stod(words[3]));
        } else if (is("make-recording", 2)) {
            make_recording(words[1], std::stoull(words[2]));
        } else if (is("verdict", 1)) {
            verdict(std::stoul(words[1]));
        } else if (is("adaptive", 1)) {
            adaptive(std::stoul(words[1]));
        } else if (is("history", 1)) {
            history(std::stod(words[1]));
        } else if (is("status", 1)) {
            status(std::stoul(words[1]));
        } else if (is("serve", 0)) {
            bench::serve_status();
        } else if (is("chart", 2)) {
            chart(words[1], words[2]);
        } else {
            std::fputs("growth_bench: expected the words that its first lines name\n", stderr);
            return 2;
        }
    } catch (const std::exception& error) {
        std::fprintf(stderr, "growth_bench: %s\n", error.what());
        return 2;
    }
    return 0;
}
