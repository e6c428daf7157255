#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "tests/plant/faults.hpp"

namespace vibrig::plant {
namespace {

std::string complaint(const char* spec) {
    try {
        static_cast<void>(parse_fault(spec, 0));
    } catch (const PlantError& error) {
        return error.what();
    }
    return "none";
}

TEST(FaultSpec, ReadsNameChannelValueAndTimes) {
    Fault fault = parse_fault("lose=0.01@100..200", 5);
    EXPECT_EQ(fault.kind, FaultKind::lose);
    EXPECT_EQ(fault.value, 0.01);
    EXPECT_EQ(fault.from_s, 100);
    EXPECT_EQ(fault.to_s, 200);
    fault = parse_fault("stuck:inner", 5);
    EXPECT_EQ(fault.channel, 1U);
    EXPECT_EQ(fault.from_s, 5);
    EXPECT_TRUE(std::isinf(fault.to_s));
    fault = parse_fault("spike:azimuth=0.5,0.001@10", 0);
    EXPECT_EQ(fault.channel, 2U);
    EXPECT_EQ(fault.value, 0.5);
    EXPECT_EQ(fault.rate, 0.001);
    fault = parse_fault("bus-silent=3", 7);
    EXPECT_EQ(fault.to_s, 10);
    EXPECT_EQ(parse_fault("lose:0.25", 0).value, 0.25);
    EXPECT_EQ(parse_fault("nan:x", 0).kind, FaultKind::out_of_range);
    EXPECT_EQ(parse_fault("gyro-noise=8", 0).value, 8);
    fault = parse_fault("sync_growth=4,25.1@30", 0);
    EXPECT_EQ(fault.kind, FaultKind::sync_growth);
    EXPECT_EQ(fault.value, 4);
    EXPECT_EQ(fault.hz, 25.1);
    EXPECT_EQ(fault.from_s, 30);
    EXPECT_TRUE(fault.at(25.1));
    EXPECT_FALSE(fault.at(15));
    EXPECT_TRUE(parse_fault("cross-growth=4", 0).at(15));
    EXPECT_EQ(parse_fault("distorted=0.2,65.1", 0).hz, 65.1);
    EXPECT_EQ(parse_fault("ack_without_stop@3", 0).kind, FaultKind::ack_without_stop);
    EXPECT_EQ(parse_fault("timeout-register=0", 0).value, 0);
}

TEST(FaultSpec, SaysWhatIsWrong) {
    const auto expect = [](const char* spec, const char* part) {
        EXPECT_NE(complaint(spec).find(part), std::string::npos) << complaint(spec);
        EXPECT_NE(complaint(spec).find(spec), std::string::npos) << complaint(spec);
    };
    expect("", "unknown fault");
    expect("loose=1", "unknown fault \"loose\"");
    expect("lose", "no value");
    expect("sync-growth=4,often", "expected a frequency from 0.1 to 2000 Hz");
    expect("distorted=0.7", "expected a share from 0 to 0.5");
    expect("lose=2", "rate from 0 to 1");
    expect("lose=nan", "rate from 0 to 1");
    expect("lose=", "rate from 0 to 1");
    expect("gyro-noise=-1", "a factor from 0 to 1000");
    expect("lose=0.1,0.2", "expected one value");
    expect("lose:outer=0.1", "expected none");
    expect("stuck:alpha", "outer, inner, azimuth");
    expect("stuck=1", "takes no value");
    expect("spike:x=1", "outer, inner or azimuth");
    expect("lose=0.1@", "a time");
    expect("lose=0.1@5..", "a time");
    expect("lose=0.1@200..100", "after the first");
    expect("lose=0.1@200..200", "after the first");
    expect("bus-silent=3@5..9", "expected one end: =S or ..TO");
    expect("modbus-wrong=maybe", "exception or value");
    expect("stuck-contactor=1", "takes no value");
    expect("amplitude_scaled", "no value");
    expect("slow_ramp=0.5", "a factor from 1 to 1000");
    expect("timeout_register=0.5", "a whole number from 0 to 65535");
    expect("timeout_register=65536", "a whole number from 0 to 65535");
    expect("timeout_register", "no value");
    // AND what is no text or moves the terminal's cursor is shown, not sent
    EXPECT_EQ(complaint("lo\xff\x1bse").substr(0, 51),
              R"(fault "lo\xff\x1bse": unknown fault "lo\xff\x1bse",)");
}

}  // namespace
}  // namespace vibrig::plant
