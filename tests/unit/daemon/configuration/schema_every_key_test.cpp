#include <functional>
#include <sstream>

#include "daemon/configuration/schema.hpp"
#include "tests/unit/daemon/configuration/support.hpp"

// Every key that there is, whatever is added later, against what it cannot be.
namespace vibrig::configuration {
namespace {

using ::testing::AllOf;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;

/// Each of these keys with this value, a batch in one file; `exact`: the column is the value's own.
void all_refused(const std::function<bool(const Key&)>& which, const std::string& value,
                 bool exact = true) {
    constexpr std::size_t kBatch = 60;  // fewer than the messages that are shown
    std::vector<std::string> names;
    const auto inside = [](const Key& key) {  // a whole table goes by that name
        return std::any_of(schema().begin(), schema().end(), [&key](const Key& other) {
            return other.name.starts_with(key.name + ".");
        });
    };
    for (const Key& key : schema())
        if (which(key) && !inside(key)) names.push_back(key.name);
    ASSERT_FALSE(names.empty());
    for (std::size_t first = 0; first < names.size(); first += kBatch) {
        const std::size_t end = std::min(names.size(), first + kBatch);
        std::string text;
        for (std::size_t i = first; i < end; ++i) text += names[i] + " = " + value + '\n';
        std::istringstream said(complaint(text));
        for (std::size_t i = first; i < end; ++i) {
            std::string line;
            std::getline(said, line);
            const std::string column =
                exact ? std::to_string(names[i].size() + 4) : std::string("[0-9]+");
            EXPECT_THAT(line, AllOf(ContainsRegex("^rig.toml:" + std::to_string(i - first + 1) +
                                                  ":" + column + ": " + names[i]),
                                    HasSubstr(": found "), HasSubstr(", expected ")))
                << names[i] << " = " << value;
        }
    }
}

bool is_number(const Key& key) { return key.type == "number" || key.type == "integer"; }

TEST(EveryKey, RefusesWhatIsOfNoTypeOfItsOwn) {
    all_refused([](const Key&) { return true; }, "1979-05-27");
    all_refused([](const Key&) { return true; }, "[[[]]]", false);
}

TEST(EveryKey, OfANumberRefusesWhatIsNoneOrBeyondAll) {
    for (const char* value : {"nan", "inf", "-inf", "1e300", "-1e300", "\"1\"", "true", "[1]",
                              "9223372036854775807", "-9223372036854775808"})
        all_refused(is_number, value);
    all_refused([](const Key& key) { return key.type == "integer"; }, "1.5");
}

TEST(EveryKey, OfAWordOrATextRefusesNumbers) {
    all_refused(
        [](const Key& key) {
            return key.type == "string" || key.type == "choice" || key.type == "boolean";
        },
        "7.5");
}

TEST(EveryKey, IsThereInEachSectionOfSafety) {
    for (const char* section :
         {"commission.", "selftest.", "guard.", "annunciator.", "interlock"}) {
        const auto& keys = schema();
        const auto in = [section](const Key& key) { return key.name.starts_with(section); };
        EXPECT_TRUE(std::any_of(keys.begin(), keys.end(), in)) << section;
    }
}

}  // namespace
}  // namespace vibrig::configuration
