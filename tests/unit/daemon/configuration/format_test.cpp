#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "daemon/configuration/forms.hpp"
#include "daemon/configuration/schema.hpp"
#include "tests/unit/daemon/configuration/support.hpp"

namespace vibrig::configuration {
namespace {

using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::Not;

const EffectiveValue& value_of(const Loaded& loaded, const std::string& key) {
    const auto found = std::find_if(loaded.effective.begin(), loaded.effective.end(),
                                    [&](const EffectiveValue& v) { return v.key == key; });
    if (found == loaded.effective.end()) {
        throw std::out_of_range(key);
    }
    return *found;
}

TEST(Format, CorrelationsThatExcludeOneAnotherAreRefusedForRecordingsToo) {
    for (const bool daemon : {false, true}) {
        try {
            static_cast<void>(parse(as_simulated("[uncertainty]\ncorrelation = [[\"latitude\", "
                                                 "\"azimuth\", 0.9], [\"azimuth\", \"time_base\", "
                                                 "0.9], [\"latitude\", \"time_base\", -0.9]]\n",
                                                 daemon),
                                    "f", daemon));
            ADD_FAILURE() << "accepted, daemon " << daemon;
        } catch (const ConfigurationError& error) {
            EXPECT_NE(std::string(error.what()).find("exclude one another"), std::string::npos)
                << error.what();
        }
    }
}

TEST(Effective, EveryValueHasItsOrigin) {
    const Loaded loaded =
        parse(as_simulated("[site]\nlatitude_deg = 50\n\n[noise]\n\nresolver_bits = 18\n", true),
              "/etc/rig.toml", true);
    EXPECT_EQ(value_of(loaded, "site.latitude_deg").value, "50.0");
    EXPECT_EQ(value_of(loaded, "site.latitude_deg").unit, "deg");
    EXPECT_EQ(value_of(loaded, "site.latitude_deg").origin, "/etc/rig.toml:2");
    EXPECT_EQ(value_of(loaded, "noise.resolver_bits").origin, "/etc/rig.toml:6");
    EXPECT_EQ(value_of(loaded, "site.azimuth_deg").origin, "default");
    EXPECT_EQ(value_of(loaded, "site.azimuth_deg").value, "0.0");
    const std::string table = format_effective(loaded);
    EXPECT_THAT(table, ContainsRegex("site.latitude_deg +=  50.0 +# deg +/etc/rig.toml:2 +lat"));
    EXPECT_THAT(table,
                ContainsRegex("shaker.registers.amplitude.scale +=  0.0001 +# amplitude_unit"));
}

TEST(Effective, TheScaleIsShownAsDeclaredNotAsFolded) {
    EXPECT_EQ(value_of(parse("shaker.amplitude_unit = \"g_rms\"", "f", false),
                       "shaker.registers.amplitude.scale")
                  .value,
              "0.0001");
}

void expect_round_trip(const std::string& text) {
    // GIVEN the effective configuration of a file
    const Loaded first = parse(text, "f", false);
    // WHEN it is read as a configuration
    const Loaded second = parse(format_effective(first), "g", false);
    // THEN every value is the same and now stands in a file
    ASSERT_EQ(first.effective.size(), second.effective.size());
    for (std::size_t i = 0; i < first.effective.size(); ++i) {
        EXPECT_EQ(first.effective[i].key, second.effective[i].key);
        EXPECT_EQ(first.effective[i].value, second.effective[i].value) << first.effective[i].key;
        EXPECT_NE(second.effective[i].origin, "default") << second.effective[i].key;
    }
    EXPECT_EQ(first.configuration.assembler.sample_period,
              second.configuration.assembler.sample_period);
    EXPECT_EQ(first.configuration.shaker.registers.amplitude.scale,
              second.configuration.shaker.registers.amplitude.scale);
}

TEST(Effective, ReadsBackAsAConfiguration) {
    expect_round_trip("");
    expect_round_trip("shaker.registers.watchdog = false\n");
    expect_round_trip(R"(
        [can]
        sample_rate_hz = 30
        path = "@a \"quoted\" 'name' \\ # no comment"
        signals = { table_accel = "" }
        [estimator]
        prior_sigma = { bias = 3.3333333333333335 }
        [shaker]
        amplitude_unit = "mps2_peak"
        response_timeout_ms = 33.333
        [campaign]
        positions_deg = [[0.1, -0.2, 1e-7]]
        table_g = [9, 0, 0.30000000000000004])");
}

TEST(Effective, JsonHasEachValueByItsType) {
    const Loaded loaded = parse(R"(
        [can]
        path = "@a \"quoted\" 'name' \\ # no comment"
        [site]
        latitude_deg = -50
        [campaign]
        positions_deg = [[0.1, -0.2, 1e-7]]
        table_g = [9, 0, 0.30000000000000004]
        [[interlock]]
        name = "recording_degraded"
        reaction = "abort"
        dwell_s = 1.5)",
                                "/etc/rig.toml", false);
    const nlohmann::ordered_json list = effective_json(loaded);
    ASSERT_EQ(list.size(), loaded.effective.size());
    std::map<std::string, nlohmann::json> of_key;
    for (std::size_t i = 0; i < list.size(); ++i) {
        EXPECT_EQ(list[i]["key"], loaded.effective[i].key);
        EXPECT_EQ(list[i]["unit"], loaded.effective[i].unit);
        EXPECT_EQ(list[i]["origin"], loaded.effective[i].origin);
        EXPECT_EQ(list[i]["meaning"], loaded.effective[i].doc);
        EXPECT_FALSE(list[i]["value"].is_null()) << loaded.effective[i].key;
        of_key[loaded.effective[i].key] = list[i]["value"];
    }
    EXPECT_EQ(of_key["can.path"], "@a \"quoted\" 'name' \\ # no comment");
    EXPECT_EQ(of_key["site.latitude_deg"], -50.0);
    EXPECT_EQ(of_key["campaign.positions_deg"], nlohmann::json::parse("[[0.1, -0.2, 1e-7]]"));
    EXPECT_EQ(of_key["campaign.table_g"][2], 0.30000000000000004);
    EXPECT_EQ(of_key["threads.lock_memory"], true);
    const auto& rows = of_key["interlock"];
    EXPECT_TRUE(std::any_of(rows.begin(), rows.end(), [](const auto& row) {
        return row["name"] == "recording_degraded" && row["dwell_s"] == 1.5;
    })) << rows;
    EXPECT_EQ(of_key["threads.acquisition_cpu"], -1);
}

TEST(Schema, EveryKeyIsThereOnceWithTypeAndDoc) {
    std::set<std::string> names;
    for (const Key& key : schema()) {
        EXPECT_TRUE(names.insert(key.name).second) << key.name << " is there twice";
        EXPECT_FALSE(key.type.empty()) << key.name;
        EXPECT_FALSE(key.doc.empty()) << key.name;
    }
    EXPECT_EQ(names.count("estimator.prior_sigma.quadratic"), 1U);
    EXPECT_EQ(names.count("shaker.registers.emergency_stop.mask"), 1U);
    EXPECT_EQ(names.count("can.signals.message_sync_signal"), 1U);
}

TEST(Schema, DefaultsLieWithinTheBounds) {
    // reading every default back goes through the bounds
    expect_round_trip("");
}

TEST(Schema, ShowsTypeUnitDefaultBoundsAndDoc) {
    const std::string text = format_schema();
    EXPECT_THAT(text, HasSubstr("site.latitude_deg                 number, deg, -90 to 90\n"
                                "    = 45.75\n"
                                "    latitude of the rig\n"));
    EXPECT_THAT(text, ContainsRegex("shaker.transport +choice, \"tcp\" . \"rtu\"\n +. \"tcp\"\n"));
    EXPECT_THAT(text, ContainsRegex("shaker.registers.watchdog.address +integer"));
}

TEST(Schema, IsNoWiderThanATerminalAndHasEveryKey) {
    const std::string text = format_schema();
    std::istringstream lines(text);
    std::set<std::string> first;
    for (std::string line; std::getline(lines, line);) {
        EXPECT_LE(line.size(), 100u) << line;
        EXPECT_TRUE(line.empty() || line.back() != ' ') << line;
        first.insert(line.substr(0, line.find(' ')));
    }
    for (const Key& key : schema()) EXPECT_TRUE(first.contains(key.name)) << key.name;
}

}  // namespace
}  // namespace vibrig::configuration
