#include "tests/plant/simulation.hpp"

#include <gtest/gtest.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <map>
#include <memory>
#include <mutex>
#include <thread>

#include "tests/plant/seqpacket_hub.hpp"
#include "tests/unit/plant/bus_client.hpp"
#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::plant {
namespace {

proto::Dbc rig_dbc() { return proto::parse_dbc(proto::rig_dbc_text(), "rig.dbc"); }

double value_of(const proto::Dbc& dbc, const can_frame& frame, const char* signal) {
    const proto::Message* message = dbc.find(frame.can_id, false);
    return proto::decode(*message->find(signal), std::span(frame.data, frame.len)).value_or(NAN);
}

/// The rig on its own thread, with a client that talks to it as the daemon would.
class SimulationTest : public testing::Test {
  protected:
    void start(SimulationSettings settings, std::uint64_t seed = 1, int commands = -1) {
        Truth truth;
        truth.seed = seed;
        shared_ = std::make_unique<SharedRig>(truth);
        hub_ = std::make_unique<SeqpacketHub>(path_);
        simulation_ = std::make_unique<Simulation>(*shared_, *hub_, dbc_, settings, stop_, commands,
                                                   [] { return true; });
        thread_ = std::thread([this] { simulation_->run(); });
    }
    void stop() {
        if (!thread_.joinable()) return;
        const std::uint64_t one = 1;
        ASSERT_EQ(::write(stop_, &one, sizeof(one)), 8);
        thread_.join();
    }
    void TearDown() override {
        stop();
        close(stop_);
    }

    double shared_time_s() {
        const std::scoped_lock lock(shared_->mutex);
        return shared_->now_s();
    }

    /// Frames of one tick, ended by RigTime with TickEnd.
    std::vector<can_frame> read_tick(BusClient& client) {
        std::vector<can_frame> frames;
        for (;;) {
            const auto frame = client.read();
            if (!frame) {
                ADD_FAILURE() << "no frame within 5 s";
                return frames;
            }
            frames.push_back(*frame);
            if (frame->can_id == 0x10 && value_of(dbc_, *frame, "TickEnd") == 1) return frames;
        }
    }
    void acknowledge(BusClient& client, double time_us) {
        client.write(FrameLayout(dbc_, "RigAck", {"TimeUs"}).encode({time_us}));
    }
    void command(BusClient& client, double outer, double inner, double azimuth, double mode,
                 double counter) {
        client.write(
            FrameLayout(dbc_, "GimbalCommand", {"Outer", "Inner", "Azimuth", "Mode", "Counter"})
                .encode({outer, inner, azimuth, mode, counter}));
    }

    proto::Dbc dbc_ = rig_dbc();
    TemporaryFolder folder_;
    std::string path_ = folder_.file("bus.sock");
    int stop_ = eventfd(0, EFD_CLOEXEC);
    std::unique_ptr<SharedRig> shared_;
    std::unique_ptr<SeqpacketHub> hub_;
    std::unique_ptr<Simulation> simulation_;
    std::thread thread_;
};

TEST_F(SimulationTest, WaitsForTheAcknowledgementOfEachTick) {
    // GIVEN a rig in lockstep
    start({});
    BusClient client(path_);
    for (int tick = 0; tick < 50; ++tick) {
        // WHEN a tick is acknowledged THEN the next comes, Sync first, all with its time and count
        const std::vector<can_frame> frames = read_tick(client);
        ASSERT_GE(frames.size(), 8U);
        EXPECT_EQ(frames[0].can_id, 0x10U);
        EXPECT_EQ(value_of(dbc_, frames[0], "TimeUs"), tick * 25000.0);
        EXPECT_EQ(frames[1].can_id, 0x80U);
        EXPECT_EQ(value_of(dbc_, frames[1], "SyncCount"), tick);
        EXPECT_EQ(frames.back().can_id, 0x10U);
        EXPECT_FALSE(client.read(MSG_DONTWAIT));
        acknowledge(client, 1);  // of another tick: counts for nothing
        acknowledge(client, tick * 25000.0);
    }
    read_tick(client);
    stop();
    EXPECT_EQ(shared_->rig.tick(), 50);
}

TEST_F(SimulationTest, SendsTheTickEndAgainWhenNobodyAnswers) {
    SimulationSettings settings;
    settings.resend_ns = 20'000'000;
    start(settings);
    BusClient client(path_);
    read_tick(client);
    // WHEN no acknowledgement comes THEN the end of the tick comes again, alone
    const std::vector<can_frame> again = read_tick(client);
    ASSERT_EQ(again.size(), 1U);
    EXPECT_EQ(value_of(dbc_, again[0], "TimeUs"), 0);
}

TEST_F(SimulationTest, RepeatsTheWholeTickForAClientThatComesAnew) {
    start({});
    std::size_t frames = 0;
    {
        BusClient client(path_);
        frames = read_tick(client).size();
    }
    BusClient next(path_);
    EXPECT_EQ(read_tick(next).size(), frames);
}

TEST_F(SimulationTest, ObeysGimbalCommandsAndReportsThem) {
    start({});
    BusClient client(path_);
    std::map<canid_t, can_frame> last;
    const auto run_ticks = [&](int count) {
        for (int i = 0; i < count; ++i) {
            double time = 0;
            for (const can_frame& frame : read_tick(client)) {
                last[frame.can_id] = frame;
                if (frame.can_id == 0x10) time = value_of(dbc_, frame, "TimeUs");
            }
            acknowledge(client, time);
        }
    };
    run_ticks(4);
    command(client, 10, 0, -5, 1, 17);
    run_ticks(9);
    EXPECT_EQ(value_of(dbc_, last[0x210], "CommandEcho"), 17);
    EXPECT_EQ(value_of(dbc_, last[0x210], "Slewing"), 1);
    EXPECT_EQ(value_of(dbc_, last[0x210], "InPosition"), 0);
    run_ticks(90);
    EXPECT_EQ(value_of(dbc_, last[0x210], "InPosition"), 1);
    EXPECT_NEAR(value_of(dbc_, last[0x101], "Outer"), 10, 0.01);
    EXPECT_NEAR(value_of(dbc_, last[0x102], "Azimuth"), 355, 0.01);
    EXPECT_EQ(value_of(dbc_, last[0x101], "OuterValid"), 1);
    EXPECT_NEAR(value_of(dbc_, last[0x220], "Temperature"), 45 - 20 * std::exp(-2.5 / 20), 0.1);
    command(client, 0, 0, 0, 0, 18);
    run_ticks(9);
    EXPECT_EQ(value_of(dbc_, last[0x210], "CommandEcho"), 18);
    EXPECT_EQ(value_of(dbc_, last[0x210], "Mode"), 0);
    EXPECT_EQ(value_of(dbc_, last[0x210], "InPosition"), 0);
}

TEST_F(SimulationTest, RunsTheSameFramesForASeed) {
    std::vector<std::vector<can_frame>> runs;
    for (int run = 0; run < 2; ++run) {
        start({}, 77);
        std::vector<can_frame> all;
        {
            BusClient client(path_);
            for (int tick = 0; tick < 30; ++tick) {
                const auto frames = read_tick(client);
                all.insert(all.end(), frames.begin(), frames.end());
                acknowledge(client, tick * 25000.0);
            }
        }
        stop();
        std::uint64_t drained = 0;
        ASSERT_EQ(read(stop_, &drained, sizeof(drained)), 8);
        hub_.reset();
        runs.push_back(std::move(all));
    }
    ASSERT_EQ(runs[0].size(), runs[1].size());
    for (std::size_t i = 0; i < runs[0].size(); ++i) {
        EXPECT_EQ(runs[0][i].can_id, runs[1][i].can_id);
        EXPECT_TRUE(std::equal(std::begin(runs[0][i].data), std::end(runs[0][i].data),
                               std::begin(runs[1][i].data)));
    }
}

TEST_F(SimulationTest, TicksAloneOnTheRealClockWithoutRigTime) {
    // GIVEN the real clock for four ticks
    SimulationSettings settings;
    settings.lockstep = false;
    settings.duration_s = 0.1;
    start(settings);
    BusClient client(path_);
    // WHEN it has run THEN it has not waited for anybody and sent no RigTime
    thread_.join();
    EXPECT_EQ(simulation_->counters().ticks, 5U);
    while (const auto frame = client.read(MSG_DONTWAIT)) EXPECT_NE(frame->can_id, 0x10U);
}

TEST_F(SimulationTest, ItsTimeGoesOnWhileCommandsComeWithoutAPause) {
    // GIVEN commands of which there are always more
    const int flood = eventfd(1, EFD_CLOEXEC);
    SimulationSettings settings;
    settings.lockstep = false;
    settings.duration_s = 0.1;
    start(settings, 1, flood);
    // WHEN it runs on the real clock THEN it comes to its end, in which four ticks are due
    const auto patience = std::chrono::steady_clock::now() + std::chrono::seconds(5);
    while (shared_time_s() < 0.0999 && std::chrono::steady_clock::now() < patience)
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
    EXPECT_GE(shared_time_s(), 0.0999);
    stop();
    close(flood);
}

TEST(Frames, NamesWhatADbcLacks) {
    try {
        Frames frames(proto::parse_dbc(
            "VERSION \"\"\nBU_: A\nBO_ 16 RigTime: 8 A\n SG_ TimeUs : 0|56@1+ (1,0) [0|1] "
            "\"us\" A\n",
            "small.dbc"));
        FAIL() << "accepted";
    } catch (const PlantError& error) {
        EXPECT_NE(std::string(error.what()).find("RigTime: no signal TickEnd"), std::string::npos)
            << error.what();
    }
}

}  // namespace
}  // namespace vibrig::plant
