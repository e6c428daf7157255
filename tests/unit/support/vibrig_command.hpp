#pragma once

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::test {

/// Runs the real program, whose path is the macro VIBRIG, in a folder of its own.
class VibrigCommand : public ::testing::Test {
  protected:
    [[nodiscard]] std::string content(const std::string& name) const {
        std::ostringstream text;
        text << std::ifstream(folder_ / name, std::ios::binary).rdbuf();
        return text.str();
    }
    void write(const std::string& name, const std::string& text) const {
        std::ofstream(folder_ / name, std::ios::binary) << text;
    }
    /// Its exit code; what it printed is in `out` and `error`.
    int vibrig(const std::string& arguments) {
        const std::string command =
            "cd '" + folder_.string() + "' && '" VIBRIG "' >out 2>error </dev/null " + arguments;
        const int status = std::system(command.c_str());
        out = content("out");
        error = content("error");
        return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    }

    /// Bad usage or input: exit code 2 and a message with these words.
    void expect_refusal(const std::string& arguments, const std::string& words) {
        EXPECT_EQ(vibrig(arguments), 2) << arguments << "\n" << out << error;
        EXPECT_NE(error.find(words), std::string::npos) << words << " not in: " << error;
    }

    TemporaryFolder folder_;
    std::string out;
    std::string error;
};

}  // namespace vibrig::test
