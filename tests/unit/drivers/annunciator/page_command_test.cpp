#include "drivers/annunciator/page_command.hpp"

#include <gtest/gtest.h>

#include "scripts.hpp"

namespace vibrig::drivers::test {
namespace {

// Its clock is the caller's: the limit of a run is tested in the test's own time.
constexpr Time kLimit = 10 * kSecond;

bool ends(PageCommand& command, Time now) {
    return eventually([&] {
        (void)command.attend(now);
        return command.idle();
    });
}

TEST(PageCommand, ReceivesTheTextOnItsInputAndTheEndOfIt) {
    const Script script("cat >paged && echo done >over");
    PageCommand command(script.path(), kLimit);
    const std::string text(PageCommand::kLongestText, 'x');
    ASSERT_EQ(command.start(text, 0), "");
    ASSERT_TRUE(ends(command, 0));
    EXPECT_EQ(script.text_of("paged"), text);
    EXPECT_EQ(script.text_of("over"), "done\n");
    EXPECT_EQ(command.counters().failed, 0u);
}

TEST(PageCommand, LeadsAGroupOfItsOwnWithoutForeignDescriptors) {
    const Script script("echo $$ >self; cut -d' ' -f5 /proc/$$/stat >group; ls /proc/$$/fd >files");
    const int foreign = ::dup(0);  // not marked close-on-exec
    PageCommand command(script.path(), kLimit);
    ASSERT_EQ(command.start("{}", 0), "");
    ASSERT_TRUE(ends(command, 0));
    EXPECT_EQ(script.text_of("group"), script.text_of("self"));
    const auto files = script.text_of("files");
    EXPECT_EQ(files.find("\n" + std::to_string(foreign) + "\n"), std::string::npos) << files;
    ::close(foreign);
}

TEST(PageCommand, WhatHangsIsKilledWithAllItsChildrenWhenItsTimeIsUp) {
    // GIVEN a script whose child hangs as well, and both ignore a polite end
    const Script script(
        "trap '' TERM\n(trap '' TERM; sleep 1000 & echo $! >child; wait) &\n"
        "echo $$ >self; while :; do sleep 1000; done");
    PageCommand command(script.path(), kLimit);
    ASSERT_EQ(command.start("{}", 0), "");
    ASSERT_TRUE(eventually([&] { return script.process_of("child") > 0; }));
    ASSERT_TRUE(eventually([&] { return script.process_of("self") > 0; }));
    // WHEN its time is not up yet, nothing happens
    EXPECT_EQ(command.attend(kLimit - 1), "");
    EXPECT_FALSE(command.idle());
    // THEN at its limit leader and child go
    std::string said;
    ASSERT_TRUE(eventually([&] {
        said += command.attend(kLimit);
        return command.idle();
    }));
    EXPECT_NE(said.find("killed after 10 s"), std::string::npos) << said;
    EXPECT_TRUE(eventually([&] { return dead(script.process_of("child")); }));
    EXPECT_TRUE(dead(script.process_of("self")));
    EXPECT_EQ(command.counters().timed_out, 1u);
    EXPECT_EQ(command.counters().failed, 0u);
}

TEST(PageCommand, ChildrenLeftBehindByAnEarlyEndGoWithTheirGroup) {
    const Script script("sleep 1000 & echo $! >child\nexit 0");
    PageCommand command(script.path(), kLimit);
    ASSERT_EQ(command.start("{}", 0), "");
    ASSERT_TRUE(ends(command, 0));
    EXPECT_TRUE(eventually([&] { return dead(script.process_of("child")); }));
    EXPECT_EQ(command.counters().failed, 0u);
}

TEST(PageCommand, AFloodOfOutputFillsNothing) {
    const Script script(
        "head -c 30000000 /dev/zero; head -c 30000000 /dev/zero >&2; echo ok >over");
    PageCommand command(script.path(), kLimit);
    ASSERT_EQ(command.start("{}", 0), "");
    ASSERT_TRUE(ends(command, 0));
    EXPECT_EQ(script.text_of("over"), "ok\n");
    EXPECT_EQ(command.counters().failed, 0u);
}

TEST(PageCommand, AFailureIsReportedWithItsStatus) {
    const Script script("exit 7");
    PageCommand command(script.path(), kLimit);
    ASSERT_EQ(command.start("{}", 0), "");
    std::string said;
    ASSERT_TRUE(eventually([&] {
        said += command.attend(0);
        return command.idle();
    }));
    EXPECT_NE(said.find("page-me: ended with status 7"), std::string::npos) << said;
    EXPECT_EQ(command.counters().failed, 1u);
}

TEST(PageCommand, WhatDoesNotExistOrMayNotRunIsReportedAtOnce) {
    const Script script("exit 0", false);
    PageCommand forbidden(script.path(), kLimit);
    EXPECT_NE(forbidden.start("{}", 0).find("page-me: cannot be started: Permission denied"),
              std::string::npos);
    PageCommand missing("/nowhere/page-me", kLimit);
    EXPECT_EQ(missing.start("{}", 0),
              "/nowhere/page-me: cannot be started: No such file or directory");
    EXPECT_TRUE(missing.idle());
    EXPECT_EQ(missing.counters().failed, 1u);
    EXPECT_EQ(missing.counters().started, 0u);
}

TEST(PageCommand, RunsAreBounded) {
    const Script script("exec sleep 1000");
    PageCommand command(script.path(), kLimit);
    for (std::size_t i = 0; i < PageCommand::kAtOnce; ++i) {
        ASSERT_TRUE(command.has_room());
        ASSERT_EQ(command.start("{}", 0), "");
    }
    EXPECT_FALSE(command.has_room());
}

TEST(PageCommand, ItsEndKillsWhatStillRuns) {
    const Script script("echo $$ >self; exec sleep 1000");
    {
        PageCommand command(script.path(), kLimit);
        ASSERT_EQ(command.start("{}", 0), "");
        ASSERT_TRUE(eventually([&] { return script.process_of("self") > 0; }));
    }
    EXPECT_TRUE(dead(script.process_of("self")));
}

}  // namespace
}  // namespace vibrig::drivers::test
