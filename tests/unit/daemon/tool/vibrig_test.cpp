#include <gtest/gtest.h>

#include <string>

#include "tests/unit/support/vibrig_command.hpp"

namespace vibrig::test {
namespace {

class VibrigOptions : public VibrigCommand {
  protected:
    /// Of another program: its exit code.
    int run(const std::string& program, const std::string& arguments) {
        return vibrig("--version; cd '" + folder_.string() + "' && '" + program +
                      "' >out 2>error </dev/null " + arguments);
    }
};

TEST_F(VibrigOptions, AnEmptyValueIsNoDefault) {
    // GIVEN values of variables that are not set
    // WHEN options are given them, whose absence would mean something else
    for (const char* const arguments :
         {"plan --config ''", "plan --positions ''", "plan --evaluate ''", "plan -o ''",
          "plan --plot ''", "level design --plot ''", "identify ''", "identify a.csv --config ''",
          "arm --host ''", "status --socket ''", "zero simulate --write ''",
          "pki init --p12-password ''"}) {
        // THEN each says which
        expect_refusal(arguments, "found nothing, expected a value: ");
        EXPECT_EQ(out, "") << arguments;
    }
    expect_refusal("arm --host ''", "--host: found nothing");
    // AND so do the daemon and the simulated rig
    EXPECT_EQ(run(VIBRIGD, "--check --config ''"), 2);
    EXPECT_NE(error.find("--config: found nothing"), std::string::npos) << error;
    EXPECT_EQ(run(VIBRIG_PLANT, "record -o x.csv --truth ''"), 2);
    EXPECT_NE(error.find("--truth: found nothing"), std::string::npos) << error;
}

}  // namespace
}  // namespace vibrig::test
