#include "daemon/configuration/forms.hpp"

#include <regex>
#include <string>

#include "daemon/configuration/schema.hpp"
#include "tests/unit/daemon/configuration/support.hpp"

namespace vibrig::configuration {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

std::string replaced(const std::string& text, const char* pattern, const char* by) {
    return std::regex_replace(text, std::regex(pattern), by);
}

TEST(Essentials, EachBlankIsNamedWithItsPlaceAndWhatIsExpected) {
    const std::string text = format_essentials();
    const std::string said = complaint(text, true);
    std::size_t blanks = 0, named = 0;
    for (std::size_t at = text.find("= \"FILL IN\""); at != std::string::npos;
         at = text.find("= \"FILL IN\"", at + 1))
        ++blanks;
    for (std::size_t at = said.find("found \"FILL IN\""); at != std::string::npos;
         at = said.find("found \"FILL IN\"", at + 1))
        ++named;
    EXPECT_GT(blanks, 10U);
    EXPECT_EQ(named, blanks) << said;
    EXPECT_THAT(said, HasSubstr("site.latitude_deg: found \"FILL IN\", expected -90 to 90 deg"));
}

TEST(Essentials, AreAcceptedWithTheirExamplesInPlaceOfTheBlanks) {
    const std::string filled =
        replaced(format_essentials(), "# for instance: ([^\n]*)\n([^\n]*= )\"FILL IN\"", "$2$1");
    ASSERT_EQ(filled.find("= \"FILL IN\""), std::string::npos);
    // A real rig's, so nothing is added that makes it a simulated one.
    EXPECT_NO_THROW(static_cast<void>(parse(filled, "rig.toml", true)));
}

TEST(Essentials, ABlankIsRefusedByKeysThatTakeAnyText) {
    EXPECT_THAT(complaint("[unit]\nserial = \"FILL IN\""),
                StartsWith("rig.toml:2:10: unit.serial: found \"FILL IN\", expected "));
    EXPECT_EQ(complaint("[unit]\nserial = \"FILL IN later\""), "");
}

TEST(JsonSchema, HasEveryKeyUnderItsLastName) {
    const std::string text = format_json_schema();
    for (const Key& key : schema()) {
        const std::string last = key.name.substr(key.name.rfind('.') + 1);
        EXPECT_THAT(text, HasSubstr('"' + last + "\":")) << key.name;
    }
}

}  // namespace
}  // namespace vibrig::configuration
