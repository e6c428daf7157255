// A campaign's files against the index beside its folder.
#include <gmock/gmock.h>

#include <fstream>

#include "daemon/record/digest.hpp"
#include "daemon/record/index.hpp"
#include "tests/unit/daemon/record/parts.hpp"

namespace vibrig::record {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST_F(Parts, OfTheSameLengthAndChangedAreFoundByTheirHash) {
    write(head(1), 10 * kSecond, {1}, 1);
    std::vector<std::string> reported;
    const auto tell = [&reported](const std::string& words) { reported.push_back(words); };
    EXPECT_THAT(changed_parts(folder_.string(), tell), IsEmpty()) << "without an index";
    Index(recordings_.string(), tell).note(folder_.string());
    EXPECT_THAT(changed_parts(folder_.string(), tell), IsEmpty());
    // WHEN a byte is another
    const fs::path part = folder_ / "campaign.h5";
    const std::string sha256 = sha256_of_file(part.string());
    {
        std::fstream file(part, std::ios::in | std::ios::out | std::ios::binary);
        file.seekp(static_cast<std::streamoff>(fs::file_size(part)) / 2);
        file.put('?');
    }
    // THEN the length says nothing, and the hash does
    compare_with_index(folder_.string(), tell);
    EXPECT_THAT(reported, IsEmpty());
    EXPECT_THAT(changed_parts(folder_.string(), tell),
                ElementsAre(HasSubstr("campaign.h5: found SHA-256 " +
                                      sha256_of_file(part.string()) + ", expected " + sha256)));
}

}  // namespace
}  // namespace vibrig::record
