#include <spdlog/fmt/fmt.h>

#include "daemon/configuration/schema.hpp"
#include "tests/unit/configuration/support.hpp"

// Every key that there is, whatever is added later, against what it cannot be.
namespace vibrig::configuration {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

void refused(const Key& key, const std::string& value) {
    EXPECT_THAT(complaint(key.name + " = " + value + "\n"),
                AllOf(StartsWith(fmt::format("rig.toml:1:{}: {}", key.name.size() + 4, key.name)),
                      HasSubstr(": found "), HasSubstr(", expected ")))
        << key.name << " = " << value;
}

TEST(EveryKey, RefusesWhatIsOfNoTypeOfItsOwn) {
    for (const Key& key : schema()) {
        refused(key, "1979-05-27");
        refused(key, "[[[]]]");
        refused(key, "{ no = \"table\" }");
    }
}

TEST(EveryKey, OfANumberRefusesWhatIsNoneOrBeyondAll) {
    std::size_t seen = 0;
    for (const Key& key : schema()) {
        if (key.type != "number" && key.type != "integer") continue;
        ++seen;
        for (const char* value : {"nan", "inf", "-inf", "1e300", "-1e300", "\"1\"", "true", "[1]",
                                  "9223372036854775807", "-9223372036854775808"})
            refused(key, value);
        if (key.type == "integer") refused(key, "1.5");
    }
    EXPECT_GT(seen, 150U);
}

TEST(EveryKey, OfAWordOrATextRefusesNumbers) {
    for (const Key& key : schema()) {
        const bool words = key.type == "string" || key.type == "choice" || key.type == "boolean";
        if (words && key.name != "platform.drift_sign") refused(key, "7.5");
    }
}

TEST(EveryKey, TellsOfEachSectionOfSafety) {
    for (const char* section : {"commission.", "selftest.", "guard.", "annunciator.", "interlock"}) {
        const auto& keys = schema();
        const auto in = [section](const Key& key) { return key.name.starts_with(section); };
        EXPECT_TRUE(std::any_of(keys.begin(), keys.end(), in)) << section;
    }
}

}  // namespace
}  // namespace vibrig::configuration
