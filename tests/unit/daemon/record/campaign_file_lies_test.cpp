#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "daemon/record/campaign_file.hpp"
#include "daemon/record/campaign_writer.hpp"
#include "daemon/record/hdf5.hpp"
#include "drivers/sample/sample.hpp"
#include "parts.hpp"

namespace vibrig::record {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

constexpr double kNoNumber = std::numeric_limits<double>::quiet_NaN();

/// A file of a campaign of which somebody changed one thing.
class Lies : public Parts {
  protected:
    Lies() { write(head(1), 0, {1, 2}, 2); }

    [[nodiscard]] std::string path() const { return (folder_ / "campaign.h5").string(); }
    /// Takes the place of a column.
    void column(const std::string& name, const std::vector<double>& values,
                std::vector<std::size_t> shape) const {
        auto file = hdf5::File::open(path(), hdf5::File::Mode::write);
        file.write_numbers(name, values, shape, "", "");
        file.close();
    }
    void attribute(const char* name, std::int64_t number) const {
        auto file = hdf5::File::open(path(), hdf5::File::Mode::write);
        file.set("/", name, number);
        file.close();
    }
    /// With nothing at this place of the file, whatever `put` makes there.
    void instead(const char* name, const auto& put) const {
        const hid_t file = H5Fopen(path().c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
        H5Ldelete(file, name, H5P_DEFAULT);
        EXPECT_GE(put(file), 0);
        H5Fclose(file);
    }
    void refused(const std::string& place, const std::string& words) const {
        EXPECT_THAT(refusal(), HasSubstr(path() + ": " + place + ": " + words));
    }
};

TEST_F(Lies, APartOfAnyNumberIsRefusedAtOnce) {
    attribute("part", 2'147'483'647);
    try {
        static_cast<void>(read_campaign(path()));
        FAIL();
    } catch (const std::runtime_error& error) {
        EXPECT_THAT(error.what(), HasSubstr("missing campaign.h5, campaign-2.h5, "));
        EXPECT_THAT(error.what(), HasSubstr("expected all 2147483647 parts"));
    }
}

TEST_F(Lies, OfALinkAreRefusedWhereverItLeads) {
    constexpr const char* kTimes = "/samples/time_ns";
    instead(kTimes, [](hid_t file) {
        return H5Lcreate_soft("/estimates/time_ns", file, kTimes, H5P_DEFAULT, H5P_DEFAULT);
    });
    refused(kTimes, "found a link, expected what it leads to");
    instead("/samples", [](hid_t file) {
        return H5Lcreate_external("/dev/zero", "/samples", file, "/samples", H5P_DEFAULT,
                                  H5P_DEFAULT);
    });
    refused("/samples", "found a link, expected what it leads to");
    instead("/samples", [](hid_t) { return 0; });
    refused("/samples/time_ns", "found nothing, expected a dataset");
}

TEST_F(Lies, OfAConfigurationAreRefused) {
    ASSERT_EQ(refusal(), "");
    instead("/configuration", [](hid_t) { return 0; });
    auto file = hdf5::File::open(path(), hdf5::File::Mode::write);
    file.write_text("/configuration", "unit.serial = \"0018\"\n", "");
    file.close();
    refused("/configuration", "found SHA-256 ");
    // Of an older vibrigd nothing is known.
    const hid_t older = H5Fopen(path().c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
    H5Adelete(older, kConfigurationDigest);
    H5Fclose(older);
    EXPECT_EQ(refusal(), "");
}

TEST_F(Lies, OfValuesInAnotherFileAreRefused) {
    instead("/samples/time_ns", [](hid_t file) {
        const hid_t list = H5Pcreate(H5P_DATASET_CREATE);
        H5Pset_external(list, "/etc/passwd", 0, H5F_UNLIMITED);
        const hsize_t size = 400;
        const hid_t space = H5Screate_simple(1, &size, nullptr);
        const hid_t made = H5Dcreate2(file, "/samples/time_ns", H5T_NATIVE_INT64, space,
                                      H5P_DEFAULT, list, H5P_DEFAULT);
        H5Sclose(space);
        H5Pclose(list);
        return H5Dclose(made);
    });
    refused("/samples/time_ns", "found values of another file, expected them in this");
}

TEST_F(Lies, OfTextsInAColumnOfNumbersAreRefused) {
    auto file = hdf5::File::open(path(), hdf5::File::Mode::write);
    file.write_text("/samples/force_g", "no", "");
    file.close();
    refused("/samples/force_g", "found no numbers, expected them");
}

TEST_F(Lies, OfTimesThatNoClockShowsAreRefused) {
    column("/orders/to_ns", {5e9, 0x1p61}, {2});
    refused("/orders/to_ns", "row 2: found 2305843009213693952, expected a time");
    attribute("utc_offset_ns", std::numeric_limits<std::int64_t>::max());
    refused("attribute utc_offset_ns", "found 9223372036854775807, expected a time");
}

TEST_F(Lies, OfAPartFarAwayAreRefused) {
    write(head(2, true, 2), 0, {3}, 1);
    attribute("utc_offset_ns", -drivers::Time{1} << 59);
    EXPECT_THAT(refusal(), HasSubstr("campaign-2.h5: attribute utc_offset_ns: found 1700000000"));
}

TEST_F(Lies, OfNumbersThatDoNotFitAreRefused) {
    column("/orders/run", {1, 0x1p40}, {2});
    refused("/orders/run", "row 2: found 1099511627776, expected a number that fits its column");
    attribute("part", 1LL << 40);
    refused("attribute part", "found 1099511627776, expected a number that it can be");
    attribute("part", 0);
    refused("attribute part", "found 0, expected 1 or more");
}

TEST_F(Lies, OfOrdersWithoutNumbersAreRefused) {
    column("/orders/zero_g", {0, 0, 0, 0, kNoNumber, 0}, {2, 3});
    refused("/orders/zero_g", "row 2: found nan, expected a finite number");
    column("/orders/zero_g", std::vector<double>(6), {2, 3});
    column("/orders/to_ns", {5e9, 1e15}, {2});
    refused("/orders/to_ns", "row 2: found a dwell of 999998 s, expected at most 172800");
}

TEST_F(Lies, InTextsThatATerminalObeysAreShown) {
    auto file = hdf5::File::open(path(), hdf5::File::Mode::write);
    file.set("/", "name", "a\x1b[2J\xff\xc2\x9b" + std::string(2000, 'x'));
    file.set("/", "reason", "\r\n");
    file.close();
    const Campaign campaign = read_campaign(path());
    EXPECT_THAT(campaign.head.name, StartsWith("a\\x1b[2J\\xff\\u009bxx"));
    EXPECT_LT(campaign.head.name.size(), 1100U);
    EXPECT_EQ(campaign.reason, "\\r\\n");
}

TEST_F(Lies, OfSamplesThatAreNoNumbersAreNotKnown) {
    std::vector<double> angles(400 * 3, 0.1), forces(400 * 3, 0.5);
    angles[1] = kNoNumber;
    forces[3 + 2] = -std::numeric_limits<double>::infinity();
    column("/samples/angle_rad", angles, {400, 3});
    column("/samples/force_g", forces, {400, 3});
    const auto samples = read_campaign(path()).samples;
    EXPECT_TRUE(samples[0].angles_good() && samples[1].force_good());
    EXPECT_FALSE(angles_known(samples[0]) || force_known(samples[1]));
    EXPECT_TRUE(force_known(samples[0]) && angles_known(samples[1]) && force_known(samples[2]));
}

}  // namespace
}  // namespace vibrig::record
