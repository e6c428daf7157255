#include "daemon/results/progress.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pty.h>
#include <unistd.h>

#include <array>
#include <optional>
#include <string>
#include <string_view>

namespace vibrig::tool {
namespace {

/// Standard error is a terminal for as long as this lives.
class Terminal {
  public:
    Terminal() : before_(::dup(STDERR_FILENO)) {
        int slave = -1;
        if (::openpty(&master_, &slave, nullptr, nullptr, nullptr) != 0) return;
        ::dup2(slave, STDERR_FILENO);
        ::close(slave);
    }
    ~Terminal() {
        ::dup2(before_, STDERR_FILENO);
        ::close(before_);
        ::close(master_);
    }
    Terminal(const Terminal&) = delete;
    Terminal& operator=(const Terminal&) = delete;

    /// Waits for it; what was shown until then.
    std::string until(std::string_view text) {
        std::string shown;
        std::array<char, 256> part{};
        while (shown.find(text) == std::string::npos) {
            const auto n = ::read(master_, part.data(), part.size());
            if (n <= 0) break;
            shown.append(part.data(), static_cast<std::size_t>(n));
        }
        return shown;
    }

  private:
    int before_, master_ = -1;
};

TEST(Working, TellsHowLongWhatHasNoStepsHasTaken) {
    Terminal terminal;
    std::optional<Working> working("planning");
    EXPECT_THAT(terminal.until(" s\033[K"), testing::HasSubstr("\rplanning, "));
    EXPECT_THAT(terminal.until("planning, 1 s\033[K"), testing::HasSubstr("planning, 1 s"));
    working.reset();
    EXPECT_THAT(terminal.until("\r\033[K"), testing::EndsWith("\r\033[K")) << "the line is cleared";
}

}  // namespace
}  // namespace vibrig::tool
