#include "daemon/serve/status_json.hpp"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/util/json_util.h>
#include <gtest/gtest.h>

#include <limits>

#include "daemon/serve/status_message.hpp"
#include "daemon/status/values.hpp"
#include "proto/vibrig.pb.h"
#include "tests/unit/daemon/serve/fake_source.hpp"

namespace vibrig::serve {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

bool carries(const std::string& text, const std::string& part) {
    return text.find(part) != std::string::npos;
}

/// Names of fields that are unset or have their default value, anywhere in the message.
void collect_empty(const google::protobuf::Message& message, const std::string& prefix,
                   std::vector<std::string>& empty) {
    const auto& descriptor = *message.GetDescriptor();
    if (descriptor.full_name().rfind("google.", 0) == 0) return;
    std::vector<const google::protobuf::FieldDescriptor*> set;
    message.GetReflection()->ListFields(message, &set);
    for (int i = 0; i < descriptor.field_count(); ++i) {
        const auto* field = descriptor.field(i);
        if (std::find(set.begin(), set.end(), field) == set.end()) {
            empty.push_back(prefix + field->name());
        } else if (field->cpp_type() == google::protobuf::FieldDescriptor::CPPTYPE_MESSAGE &&
                   !field->is_map()) {
            const auto& inner = field->is_repeated()
                                    ? message.GetReflection()->GetRepeatedMessage(message, field, 0)
                                    : message.GetReflection()->GetMessage(message, field);
            collect_empty(inner, prefix + field->name() + '.', empty);
        }
    }
}

TEST(StatusJson, EveryValueOfTheTableHasItsField) {
    using Field = google::protobuf::FieldDescriptor;
    for (const StatusValue& row : status_values()) {
        EXPECT_TRUE(row.mqtt_name == nullptr || row.kind > 0) << row.mqtt_name;
        std::string_view rest = row.field;
        if (rest.empty()) continue;
        const auto* message = v1::Status::descriptor();
        if (const auto dot = rest.find('.'); dot != rest.npos) {
            const auto* part = message->FindFieldByName(std::string(rest.substr(0, dot)));
            ASSERT_NE(part, nullptr) << row.field;
            message = part->message_type();
            rest.remove_prefix(dot + 1);
        }
        const auto* field = message->FindFieldByName(std::string(rest));
        ASSERT_NE(field, nullptr) << row.field;
        const auto type = field->cpp_type();
        const std::size_t kind = type == Field::CPPTYPE_BOOL     ? 1
                                 : type == Field::CPPTYPE_DOUBLE ? 3
                                 : type == Field::CPPTYPE_STRING ? 4
                                                                 : 2;
        EXPECT_EQ(row.kind, kind) << row.field;
    }
}

template <typename Message>
Message parsed(const std::string& json) {
    Message message;
    const auto done = google::protobuf::util::JsonStringToMessage(json, &message);
    EXPECT_TRUE(done.ok()) << done.ToString() << '\n' << json;
    return message;
}

TEST(StatusJson, HoldsHundredsOfDwellsAsOneTextOfProtobufsWould) {
    StatusData status = full_status();
    status.dwells.resize(420, status.dwells.at(0));
    for (std::size_t i = 0; i < status.dwells.size(); ++i)
        status.dwells[i].position = static_cast<int>(i) + 1;
    status.reason = R"("dwells":[])";  // what a person may write anywhere
    v1::Status message;
    fill(message, status);
    google::protobuf::util::JsonPrintOptions options;
    options.always_print_primitive_fields = true;
    options.preserve_proto_field_names = true;
    std::string whole;
    ASSERT_TRUE(google::protobuf::util::MessageToJsonString(message, &whole, options).ok());
    EXPECT_EQ(status_json(status), whole);
}

TEST(StatusJson, CarriesEveryFieldOfTheSchema) {
    // GIVEN a status in which nothing has its default value
    const auto status = parsed<v1::Status>(status_json(full_status()));
    // THEN no field of the schema is left empty
    std::vector<std::string> empty;
    collect_empty(status, "", empty);
    EXPECT_EQ(empty, std::vector<std::string>{});
}

TEST(StatusJson, CarriesEveryFieldOfTheParameters) {
    NoiseStatus noise;
    noise.surface = std::make_shared<const std::vector<NoiseStatus::Curve>>(
        1, NoiseStatus::Curve{2,
                              5,
                              true,
                              {1, 2},
                              {{{0.5, 0.25}, {0.5, 0.25}, {0.5, std::nan("")}}},
                              {{{0.4, 0.2}, {0.4, 0.2}, {0.3, 0.2}}}});
    const auto surface = parsed<v1::Surface>(surface_json(noise));
    ASSERT_EQ(surface.curves_size(), 1);
    EXPECT_EQ(surface.curves(0).position(), 5U);
    EXPECT_TRUE(surface.curves(0).alarm());
    ASSERT_EQ(surface.curves(0).tau_s_size(), 1);  // what is not a number is in no answer
    EXPECT_EQ(surface.curves(0).z_deg_h(0), 0.5);
    ASSERT_EQ(surface.curves(0).z_classical_deg_h_size(), 1);
    EXPECT_EQ(surface.curves(0).z_classical_deg_h(0), 0.3);
    const auto result =
        parsed<v1::Parameters>(parameters_json(full_result(), full_status().verdict));
    std::vector<std::string> empty;
    collect_empty(result, "", empty);
    EXPECT_EQ(empty, std::vector<std::string>{});
    EXPECT_EQ(result.combinations(0).weights().at("D_OOx"), 19.0);
}

TEST(StatusJson, SaysTheNumbersInTheUnitsOfTheEdge) {
    const auto status = parsed<v1::Status>(status_json(full_status()));
    EXPECT_DOUBLE_EQ(status.time_s(), 1234.5);
    EXPECT_DOUBLE_EQ(status.uptime_s(), 1300);
    EXPECT_EQ(status.utc().nanos(), 250'000'000);
    EXPECT_EQ(status.campaign().state(), v1::Campaign::recording);
    EXPECT_DOUBLE_EQ(status.campaign().position_angles().azimuth_deg(), 45);
    EXPECT_EQ(status.shaker().link(), v1::Link::degraded);
    EXPECT_EQ(status.shaker().read_back_mismatches(), 19u);
    EXPECT_EQ(status.can().transitions(), 29u);
    EXPECT_EQ(status.assembler().resyncs(), 40u);
    ASSERT_EQ(status.sample().channels_size(), 7);
    EXPECT_NEAR(status.sample().channels(0).value(), 180, 1e-12);
    EXPECT_EQ(status.sample().channels(0).unit(), "deg");
    EXPECT_DOUBLE_EQ(status.sample().channels(4).value(), 1.2);
    EXPECT_EQ(status.sample().channels(6).name(), "table_accel");
    ASSERT_EQ(status.estimate().parameters_size(), 30);
    EXPECT_EQ(status.estimate().parameters(0).name(), "D_Fx");
    EXPECT_EQ(status.estimate().parameters(0).unit(), "deg/h");
    EXPECT_EQ(status.estimate().parameters(29).name(), "D_OSz");
    EXPECT_EQ(status.estimate().parameters(29).unit(), "deg/h/g^2");
    EXPECT_EQ(status.campaign().dwells(0).reason(), "rejected");
    ASSERT_EQ(status.noise().gyros_size(), 3);
    EXPECT_DOUBLE_EQ(status.noise().gyros(2).fit().n().value(), 0.0011);
    EXPECT_EQ(status.noise().gyros(2).fit().n().unit(), "deg/rt-h");
    EXPECT_FALSE(status.noise().gyros(2).fit().k().has_value());
    EXPECT_DOUBLE_EQ(status.noise().gyros(2).fit().k().below(), 0.03);
    EXPECT_EQ(status.noise().alarms(0).gyro(), "y");
    EXPECT_EQ(status.noise().level().samples(), 7U);
    EXPECT_DOUBLE_EQ(status.noise().level().innovation_deg_h(1), -0.06);
}

TEST(StatusJson, PrintsZerosAndOriginalNames) {
    const std::string json = status_json(StatusData{});
    EXPECT_TRUE(carries(json, "\"uptime_s\":0")) << json;
    EXPECT_TRUE(carries(json, "\"state\":\"idle\"")) << json;
    EXPECT_TRUE(carries(json, "\"armed_by\":\"\"")) << json;
    EXPECT_TRUE(carries(json, "\"progress\":0")) << json;
    EXPECT_TRUE(carries(json, "\"kernel_dropped\":\"0\"")) << json;
    EXPECT_TRUE(carries(json, "\"dwells\":[]")) << json;
    EXPECT_TRUE(carries(json, "\"command_table_g\":0")) << json;
    EXPECT_FALSE(carries(json, "uptimeS")) << json;
}

TEST(StatusJson, LeavesOutWhatIsNotValid) {
    // GIVEN no reading of the shaker, no status of the platform, a stale channel, and NaN here and
    // there
    StatusData data = full_status();
    data.shaker.valid = false;
    data.platform.time = 0;
    data.platform.gimbal_time = 0;
    data.sample.quality[1] = drivers::Quality::stale;
    data.sample.force[0] = kNaN;
    data.channel_age_s[2] = kInfinity;
    data.progress = kNaN;
    data.remaining_s = kInfinity;
    data.estimate.value[4] = kNaN;
    data.estimate.observable[5] = false;
    data.estimate.nis_per_dof = -kInfinity;
    data.dwells[0].kappa = kNaN;
    // WHEN it becomes JSON
    const std::string json = status_json(data);
    // THEN it has no word for NaN, and what is not valid is absent
    EXPECT_FALSE(carries(json, "NaN")) << json;
    EXPECT_FALSE(carries(json, "Infinity")) << json;
    const auto status = parsed<v1::Status>(json);
    EXPECT_FALSE(status.shaker().has_measured_g());
    EXPECT_FALSE(status.shaker().has_emergency_stop_open());
    EXPECT_FALSE(status.platform().has_ready());
    EXPECT_FALSE(status.platform().has_in_position());
    EXPECT_FALSE(status.sample().channels(1).has_value());
    EXPECT_EQ(status.sample().channels(1).quality(), v1::Channel::silent);
    EXPECT_FALSE(status.sample().channels(3).has_value());
    EXPECT_FALSE(status.sample().channels(2).has_age_s());
    EXPECT_FALSE(status.campaign().has_progress());
    EXPECT_FALSE(status.campaign().has_remaining_s());
    EXPECT_FALSE(status.estimate().parameters(4).has_value());
    EXPECT_FALSE(status.estimate().parameters(5).has_value());
    EXPECT_FALSE(status.estimate().parameters(5).has_sigma());
    EXPECT_FALSE(status.estimate().has_nis_per_dof());
    EXPECT_FALSE(status.campaign().dwells(0).has_kappa());
    // Before the first sample of a campaign the filter's zeros are no measurement.
    data.estimate = {};
    const auto none = parsed<v1::Status>(status_json(data)).estimate();
    EXPECT_FALSE(none.has_nis_per_dof() || none.has_amplitude_g() || none.has_frequency_hz() ||
                 none.has_kappa() || none.innovation().has_x_arcsec());
}

TEST(StatusJson, WritesNullWhereTheCovarianceIsNotDetermined) {
    estimator::Result result = full_result();
    result.observable[0] = false;
    result.covariance[0].fill(kNaN);
    for (auto& row : result.covariance) row[0] = kNaN;
    result.combinations[0].sigma = kNaN;
    const std::string json = parameters_json(result, {});
    EXPECT_FALSE(carries(json, "NaN")) << json;
    EXPECT_TRUE(carries(json, "[null,1,0")) << json.substr(0, 6000);
}

TEST(StatusJson, UncertaintiesStandBesideWhatTheFilterHas) {
    // GIVEN an assessment that does not determine the second coefficient
    VerdictStatus verdict = full_status().verdict;
    auto coefficients = *verdict.coefficients;
    coefficients[1] = {kNaN, kNaN};
    verdict.coefficients = std::make_shared<const decltype(coefficients)>(coefficients);
    // THEN its values and u are apart from the filter's, with the dwells that they rest on
    const auto all = parsed<v1::Parameters>(parameters_json(full_result(), verdict));
    EXPECT_EQ(all.assessed().dwells(), verdict.dwells);
    EXPECT_EQ(all.assessed().verdict(), verdict.word);
    ASSERT_EQ(all.assessed().parameters_size(), 30);
    EXPECT_EQ(all.assessed().parameters(0).name(), "D_Fx");
    EXPECT_EQ(all.assessed().parameters(0).value(), 0.5);
    EXPECT_EQ(all.assessed().parameters(0).u(), 0.02);
    EXPECT_EQ(all.assessed().parameters(0).unit(), "deg/h");
    EXPECT_FALSE(all.assessed().parameters(1).has_value());
    EXPECT_FALSE(all.assessed().parameters(1).has_u());
    EXPECT_NE(all.parameters(0).value(), 0.5);
    ASSERT_EQ(all.assessed().combinations_size(), 1);
    EXPECT_EQ(all.assessed().combinations(0).weights().at("D_OOx"), 19.0);
    EXPECT_EQ(all.assessed().combinations(0).value(), 0.75);
    EXPECT_EQ(all.assessed().combinations(0).u(), 0.04);
    // and before there is one, nothing is in its place
    EXPECT_FALSE(parsed<v1::Parameters>(parameters_json(full_result(), {})).has_assessed());
}

TEST(StatusJson, OfARunAtRestAndOfNoSampleThereIsNoNumber) {
    estimator::Result result;
    EXPECT_FALSE(parsed<v1::Parameters>(parameters_json(result, {})).has_nis());
    result.amplitudes.push_back({2, 0, 1, 0, 0});
    const auto run = parsed<v1::Parameters>(parameters_json(result, {})).amplitudes(0);
    EXPECT_TRUE(run.has_amplitude_g());
    EXPECT_FALSE(run.has_sigma_g());
    EXPECT_FALSE(run.has_frequency_hz());
}

TEST(StatusJson, EveryEnumValueHasItsName) {
    StatusData data = full_status();
    for (int i = 0; i <= static_cast<int>(CampaignState::tripped); ++i) {
        data.state = static_cast<CampaignState>(i);
        const std::string name = name_of(data.state);
        EXPECT_TRUE(carries(campaign_json(data), "\"state\":\"" + name + "\"")) << name;
    }
    const char* const qualities[] = {"good",    "missing",      "silent",
                                     "flagged", "out_of_range", "unbound"};
    for (std::size_t i = 0; i < 6; ++i) {
        data.sample.quality[0] = static_cast<drivers::Quality>(i);
        const std::string expected = std::string("\"quality\":\"") + qualities[i] + '"';
        EXPECT_TRUE(carries(status_json(data), expected)) << expected;
    }
}

TEST(StatusJson, MendsTextThatIsNotUtf8) {
    StatusData data;
    data.reason = "broken \xFE text";
    EXPECT_TRUE(carries(status_json(data), "broken ? text"));
}

TEST(StatusJson, CarriesEventsWithUtcAndId) {
    EventRecord record{7, -1, 5 * drivers::kSecond, Severity::trip, "interlock", "stop"};
    const auto events = parsed<v1::Events>(events_json("abc", {record}));
    EXPECT_EQ(events.instance(), "abc");
    ASSERT_EQ(events.events_size(), 1);
    EXPECT_EQ(events.events(0).id(), 7u);
    EXPECT_EQ(events.events(0).severity(), v1::Event::trip);
    EXPECT_EQ(events.events(0).utc().seconds(), -1);
    EXPECT_EQ(events.events(0).utc().nanos(), 999'999'999);
}

}  // namespace
}  // namespace vibrig::serve
