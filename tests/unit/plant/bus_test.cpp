#include "tests/plant/bus.hpp"

#include <gtest/gtest.h>

#include <array>
#include <filesystem>
#include <memory>
#include <vector>

#include "tests/plant/seqpacket_hub.hpp"
#include "tests/plant/truth.hpp"
#include "tests/unit/plant/bus_client.hpp"
#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::plant {
namespace {

can_frame frame_with(canid_t id, std::uint8_t first) {
    can_frame frame{};
    frame.can_id = id;
    frame.len = 8;
    frame.data[0] = first;
    return frame;
}

class HubTest : public testing::Test {
  protected:
    void pump() {
        for (int i = 0; i < 4; ++i) {
            hub_.receive([this](const canfd_frame& frame) { seen_.push_back(frame); });
        }
    }
    TemporaryFolder folder_;
    std::string path_ = folder_.file("bus.sock");
    SeqpacketHub hub_{path_};
    std::vector<canfd_frame> seen_;
};

TEST_F(HubTest, SendsToAllClientsInOrder) {
    BusClient a(path_);
    BusClient b(path_);
    pump();
    EXPECT_EQ(hub_.connections(), 2U);
    std::vector<can_frame> frames;
    for (std::uint8_t i = 0; i < 150; ++i) frames.push_back(frame_with(0x100, i));
    hub_.send(frames, true);
    for (BusClient* client : {&a, &b}) {
        for (std::uint8_t i = 0; i < 150; ++i) {
            const auto frame = client->read();
            ASSERT_TRUE(frame);
            EXPECT_EQ(frame->data[0], i);
        }
    }
    EXPECT_EQ(hub_.dropped(), 0U);
}

TEST_F(HubTest, ForwardsToTheOthersAndNeverBack) {
    BusClient a(path_);
    BusClient b(path_);
    pump();
    a.write(frame_with(0x200, 7));
    pump();
    ASSERT_EQ(seen_.size(), 1U);
    EXPECT_EQ(seen_[0].can_id, 0x200U);
    const auto frame = b.read();
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->data[0], 7);
    EXPECT_FALSE(a.read(MSG_DONTWAIT));
}

TEST_F(HubTest, DropsWhatIsNoFrameAndTakesFdFrames) {
    BusClient a(path_);
    pump();
    const std::array<char, 100> garbage{};
    a.write_bytes(garbage.data(), 5);
    a.write_bytes(garbage.data(), 100);
    can_frame long_one = frame_with(1, 1);
    long_one.len = 60;  // more than a classic frame has
    a.write(long_one);
    canfd_frame fd{};
    fd.can_id = 0x300;
    fd.len = 64;
    a.write_bytes(&fd, CANFD_MTU);
    pump();
    ASSERT_EQ(seen_.size(), 1U);
    EXPECT_EQ(seen_[0].len, 64);
}

TEST_F(HubTest, SurvivesClientsThatComeGoAndDoNotRead) {
    auto lazy = std::make_unique<BusClient>(path_);
    pump();
    ASSERT_TRUE(hub_.somebody_there());
    const std::vector<can_frame> frames(2000, frame_with(0x100, 1));
    for (int i = 0; i < 20; ++i) hub_.send(frames, false);
    EXPECT_GT(hub_.dropped(), 0U);
    EXPECT_TRUE(hub_.somebody_there());
    lazy.reset();
    pump();
    EXPECT_FALSE(hub_.somebody_there());
    BusClient again(path_);
    pump();
    hub_.send(std::span(frames).first(1), true);
    EXPECT_TRUE(again.read());
}

TEST(Hub, TakesOverAStaleSocketButNotALivingOne) {
    const TemporaryFolder folder;
    const std::string path = folder.file("bus.sock");
    {
        const SeqpacketHub hub(path);
        EXPECT_THROW(SeqpacketHub{path}, PlantError);
        EXPECT_TRUE(std::filesystem::exists(path));
    }
    EXPECT_FALSE(std::filesystem::exists(path));
    const int fd = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path.copy(address.sun_path, sizeof(address.sun_path) - 1);
    ASSERT_EQ(bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
    close(fd);  // as after a crash: the file stays
    ASSERT_TRUE(std::filesystem::exists(path));
    const SeqpacketHub hub(path);
    EXPECT_NO_THROW(BusClient{path});
}

TEST(Bus, NamesABadAddress) {
    EXPECT_THROW((void)open_bus("seqpacket:"), PlantError);
    EXPECT_THROW((void)open_bus("seqpacket:/no/such/folder/bus"), PlantError);
    EXPECT_THROW((void)open_bus("seqpacket:" + std::string(200, 'a')), PlantError);
    EXPECT_THROW((void)open_bus("nosuchcan0"), PlantError);
}

}  // namespace
}  // namespace vibrig::plant
