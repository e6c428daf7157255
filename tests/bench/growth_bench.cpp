// What tests/bench/growth measures as processes of their own, and its charts:
//   growth_bench make-journal FOLDER EVENTS      a journal with so many events
//   growth_bench open-journal FOLDER             the start of a daemon on it
//   growth_bench make-index FOLDER CAMPAIGNS     an index of so many campaigns
//   growth_bench open-index FOLDER               opened, and one campaign looked up
//   growth_bench make-campaign FOLDER POSITIONS DWELL_S    a recorded campaign
//   growth_bench verdict DWELLS                  what follows a dwell
//   growth_bench chart FILE.json FILE.svg
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>
#include <string>
#include <thread>

#include "daemon/journal/database.hpp"
#include "daemon/journal/journal.hpp"
#include "daemon/plot/chart.hpp"
#include "daemon/record/campaign_writer.hpp"
#include "daemon/record/index.hpp"
#include "daemon/record/replay.hpp"
#include "estimator/uncertainty/assessment.hpp"
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
    for (const auto& order : campaign.orders) writer.order(order);
    for (const auto& sample : campaign.samples) writer.sample(sample);
    for (const auto& one : replayed.dwells) writer.dwell(one);
    writer.commit();
    writer.end({"finished", "", "", "", 0});
}

void verdict(std::size_t dwells) {
    namespace rows = estimator::testing;
    const auto order = rows::balanced(6, 14.0 / 3);
    std::vector<rows::PlannedRow> plan;
    while (plan.size() < dwells) plan.push_back(order[plan.size() % order.size()]);
    auto all = rows::theory_rows({}, plan);
    std::mt19937_64 noise(1);
    rows::add_noise(all, noise);
    static_cast<void>(estimator::uncertainty::assess({}, rows::result_of(std::move(all))));
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
    tool::plot::write_file(to, chart.svg());
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
        } else if (is("verdict", 1)) {
            verdict(std::stoul(words[1]));
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
