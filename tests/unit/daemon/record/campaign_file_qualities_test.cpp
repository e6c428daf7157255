#include "daemon/record/campaign_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>

#include <array>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "daemon/record/campaign_writer.hpp"
#include "daemon/record/hdf5.hpp"
#include "drivers/sample/channels.hpp"
#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::record {
namespace {

namespace fs = std::filesystem;
using drivers::Quality;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr const char* kQuality = "/samples/quality";
constexpr std::size_t kSamples = 5;

/// A file whose qualities another build wrote, or which lies about them.
class CampaignFile : public ::testing::Test {
  protected:
    CampaignFile() { path_ = (folder_ / "campaign.h5").string(); }

    /// Samples whose channels all have another quality, channel c that of number c % 5.
    void write(std::size_t samples = kSamples) const {
        Head head;
        head.name = "test";
        CampaignWriter writer(path_, head);
        for (std::size_t i = 0; i < samples; ++i) {
            drivers::Sample sample;
            sample.time = static_cast<drivers::Time>(i + 1) * drivers::kSecond;
            for (std::size_t c = 0; c < drivers::kChannels; ++c) sample.quality[c] = quality_of(c);
            sample.table_accel = 0.5;
            writer.put(sample);
        }
        writer.end({"finished", "", "", "", 1});
    }
    static Quality quality_of(std::size_t channel) { return static_cast<Quality>(channel % 5); }

    /// Takes the place of the qualities; without names as recordings had them before they did.
    void lie(std::vector<std::size_t> shape, const std::vector<double>& row,
             const std::string& names = "") const {
        std::size_t numbers = 1;
        for (const std::size_t d : shape) numbers *= d;
        std::vector<double> values(numbers);
        for (std::size_t i = 0; i < numbers && !row.empty(); ++i) values[i] = row[i % row.size()];
        hdf5::File file = hdf5::File::open(path_, hdf5::File::Mode::write);
        file.write_numbers(kQuality, values, shape, "", "");
        if (!names.empty()) file.set(kQuality, "names", names);
        file.close();
    }
    std::string refusal() const {
        try {
            static_cast<void>(read_campaign(path_));
        } catch (const std::runtime_error& error) {
            return error.what();
        }
        return {};
    }

    TemporaryFolder folder_;
    std::string path_;
};

std::vector<int> qualities(const drivers::Sample& sample) {
    std::vector<int> all;
    for (std::size_t c = 0; c < drivers::kChannels; ++c)
        all.push_back(static_cast<int>(sample.quality[c]));
    return all;
}

TEST_F(CampaignFile, NamesTheChannelsOfItsQualities) {
    write();
    std::string names;
    for (const auto& row : drivers::kChannelTable)
        names += (names.empty() ? "" : " ") + std::string(row.name);
    const auto file = hdf5::File::open(path_, hdf5::File::Mode::read);
    EXPECT_EQ(file.text(kQuality, "names"), names);
    EXPECT_THAT(file.read_text("/head"), HasSubstr(R"("channels":["outer","inner")"));
    for (const auto& sample : read_campaign(path_).samples)
        for (std::size_t c = 0; c < drivers::kChannels; ++c)
            EXPECT_EQ(sample.quality[c], quality_of(c)) << drivers::kChannelTable[c].name;
}

TEST_F(CampaignFile, OfAnOlderBuildLacksAChannelWhichIsUnboundThen) {
    write();
    lie({kSamples, 6}, {0, 1, 2, 3, 4, 0}, "outer inner azimuth accel_x accel_y accel_z");
    auto samples = read_campaign(path_).samples;
    ASSERT_EQ(samples.size(), kSamples);
    EXPECT_THAT(qualities(samples.back()), ElementsAre(0, 1, 2, 3, 4, 0, 5));
    // AND before the file named them they were the first ones
    lie({kSamples, 6}, {0, 1, 2, 3, 4, 0});
    EXPECT_THAT(qualities(read_campaign(path_).samples.back()), ElementsAre(0, 1, 2, 3, 4, 0, 5));
    lie({kSamples, 7}, {0, 1, 2, 3, 4, 0, 1});
    EXPECT_THAT(qualities(read_campaign(path_).samples.back()), ElementsAre(0, 1, 2, 3, 4, 0, 1));
    // AND a single row is one
    fs::remove(path_);
    write(1);
    lie({1, 6}, {0, 1, 2, 3, 4, 0});
    samples = read_campaign(path_).samples;
    ASSERT_EQ(samples.size(), 1U);
    EXPECT_THAT(qualities(samples.back()), ElementsAre(0, 1, 2, 3, 4, 0, 5));
}

TEST_F(CampaignFile, InAnotherOrderIsReadByItsNames) {
    write();
    lie({kSamples, 7}, {1, 0, 2, 3, 4, 0, 3},
        "inner outer azimuth table_accel accel_x accel_y accel_z");
    EXPECT_THAT(qualities(read_campaign(path_).samples.back()), ElementsAre(0, 1, 2, 4, 0, 3, 3));
    lie({kSamples, 2}, {1, 2}, "accel_z inner");
    EXPECT_THAT(qualities(read_campaign(path_).samples.back()), ElementsAre(5, 2, 5, 5, 5, 1, 5));
}

TEST_F(CampaignFile, WithoutSamplesIsReadWhateverItsWidth) {
    write(0);
    EXPECT_EQ(read_campaign(path_).samples.size(), 0U);
    lie({0, 6}, {});
    EXPECT_EQ(read_campaign(path_).samples.size(), 0U);
    lie({0, 8}, {});
    EXPECT_THAT(refusal(), HasSubstr("found 8 numbers in a row without names, expected 7 at most"));
}

TEST_F(CampaignFile, OfANewerBuildIsRefusedWithWhatItHas) {
    write();
    const std::string all = "outer inner azimuth accel_x accel_y accel_z table_accel";
    lie({kSamples, 8}, {0}, all + " humidity");
    EXPECT_EQ(refusal(), path_ + ": " + kQuality +
                             ": found 8 numbers in a row, one of them humidity, expected at most "
                             "7 (" +
                             all + "); a newer vibrigd wrote it");
    // AND one that has another in the place of a known one, which is no wider
    lie({kSamples, 7}, {0}, "outer inner azimuth accel_x accel_y accel_z humidity");
    EXPECT_THAT(refusal(), AllOf(HasSubstr("one of them humidity"), HasSubstr("a newer vibrigd")));
    lie({kSamples, 8}, {0});
    EXPECT_THAT(refusal(), AllOf(HasSubstr(path_ + ": " + kQuality), HasSubstr("found 8 numbers"),
                                 HasSubstr("expected 7 at most")));
}

TEST_F(CampaignFile, ThatContradictsItselfIsRefused) {
    write();
    const std::string all = "outer inner azimuth accel_x accel_y accel_z table_accel";
    lie({kSamples, 6}, {0}, all);
    EXPECT_THAT(refusal(), HasSubstr("found 6 numbers in a row, expected 7 by its names outer"));
    lie({kSamples, 8}, {0}, all);
    EXPECT_THAT(refusal(), HasSubstr("found 8 numbers in a row, expected 7 by its names outer"));
    lie({kSamples, 2}, {0}, "outer outer");
    EXPECT_THAT(refusal(), HasSubstr("found outer twice among its names, expected it once"));
    lie({kSamples, 1}, {0}, " ");
    EXPECT_THAT(refusal(), HasSubstr("found 1 numbers in a row, expected 0 by its names"));
    lie({kSamples, 0}, {});
    EXPECT_THAT(refusal(), HasSubstr("found 0 numbers in a row, expected 1 to 7"));
    lie({kSamples}, {0});
    EXPECT_THAT(refusal(), HasSubstr("found 1 dimensions, expected 2: rows and numbers in a row"));
    lie({kSamples, 7, 1}, {0});
    EXPECT_THAT(refusal(), HasSubstr("found 3 dimensions, expected 2"));
    // AND fewer rows than samples are as many samples, as in any column
    lie({kSamples - 2, 7}, {0});
    EXPECT_EQ(read_campaign(path_).samples.size(), kSamples - 2);
}

/// As other programs write attributes, and as a file that lies may have them.
TEST_F(CampaignFile, WithAttributesThatAreNotOneValueIsRefusedOrRead) {
    const std::string all = "outer inner azimuth accel_x accel_y accel_z table_accel";
    // Takes the place of an attribute: `count` of this type.
    const auto attribute = [&](const char* object, const char* name, hid_t type, hsize_t count,
                               const void* values) {
        const hid_t file = H5Fopen(path_.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
        H5Adelete_by_name(file, object, name, H5P_DEFAULT);
        const hid_t space = H5Screate_simple(1, &count, nullptr);
        const hid_t made = H5Acreate_by_name(file, object, name, type, space, H5P_DEFAULT,
                                             H5P_DEFAULT, H5P_DEFAULT);
        EXPECT_GE(H5Awrite(made, type, values), 0);
        H5Aclose(made);
        H5Sclose(space);
        H5Fclose(file);
    };
    const hid_t fixed = H5Tcopy(H5T_C_S1), variable = H5Tcopy(H5T_C_S1);
    H5Tset_size(fixed, 8);
    H5Tset_size(variable, H5T_VARIABLE);
    // GIVEN an array of texts where one is expected
    write();
    const std::vector<char> texts(8 * 4096, 'x');
    attribute(kQuality, "names", fixed, 4096, texts.data());
    EXPECT_EQ(refusal(),
              path_ + ": " + kQuality + ": attribute names: found no text, expected one");
    // AND an array of numbers
    fs::remove(path_);
    write();
    const std::vector<std::int64_t> numbers(4096, 1);
    attribute("/", "format_version", H5T_NATIVE_INT64, 4096, numbers.data());
    EXPECT_EQ(refusal(),
              path_ + ": /: attribute format_version: found no single number, expected one");
    // AND a text of variable length, as h5py writes it
    fs::remove(path_);
    write();
    const char* words = all.c_str();
    attribute(kQuality, "names", variable, 1, static_cast<const void*>(&words));
    EXPECT_EQ(read_campaign(path_).samples.size(), kSamples);
    // AND names that a terminal would obey
    lie({kSamples, 1}, {0}, "\033[2Jouter");
    EXPECT_THAT(refusal(), HasSubstr(R"(one of them \x1b[2Jouter)"));
    H5Tclose(fixed);
    H5Tclose(variable);
}

TEST_F(CampaignFile, OfMoreRowsThanItHoldsIsRefused) {
    write();
    const hid_t file = H5Fopen(path_.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
    const hid_t quality = H5Dopen2(file, kQuality, H5P_DEFAULT);
    const std::array<hsize_t, 2> size{hsize_t{1} << 60, 7};
    EXPECT_GE(H5Dset_extent(quality, size.data()), 0);
    H5Dclose(quality);
    H5Fclose(file);
    EXPECT_THAT(refusal(), AllOf(HasSubstr(path_ + ": " + kQuality),
                                 HasSubstr("expected as many as they hold")));
}

/// A build with one column more and one number more in a row goes on with an older one's table.
TEST_F(CampaignFile, OfAnOlderBuildIsGoneOnWithInItsOwnColumns) {
    const hdf5::Names older{{"b", "a"}, {}}, newer{{"a", "b", "c"}, {"a", "b"}};
    const auto columns = [](const hdf5::Names& names) {
        hdf5::ColumnSpec time{"time_ns", hdf5::Type::i64, 0, {}, "ns", ""};
        hdf5::ColumnSpec quality{"quality", hdf5::Type::u8, 0,     {names.now.size()}, "",
                                 "",        false,          &names};
        return std::vector<hdf5::ColumnSpec>{time, quality};
    };
    const auto put = [](hdf5::Table& table, std::int64_t time,
                        const std::vector<std::uint8_t>& quality) {
        table.put(&time, sizeof time);
        table.put(quality.data(), quality.size());
    };
    auto file = hdf5::File::create(path_);
    {
        hdf5::Table table(file, "/t", columns(older), 4, "");
        put(table, 10, {1, 2});
        table.commit();
    }
    {
        auto more = columns(newer);
        more.insert(more.begin() + 1, {"humidity", hdf5::Type::f64, 0, {}, "", "", true});
        hdf5::Table table(file, "/t", more);
        table.keep(1);
        const std::int64_t time = 20;
        const double humidity = 0.5;
        const std::vector<std::uint8_t> quality{3, 4, 5};
        table.put(&time, sizeof time);
        table.put(&humidity, sizeof humidity);
        table.put(quality.data(), quality.size());
        table.commit();
    }
    EXPECT_FALSE(file.has("/t/humidity"));
    EXPECT_THAT(file.integers("/t/time_ns").values, ElementsAre(10, 20));
    EXPECT_THAT(file.integers("/t/quality").values, ElementsAre(1, 2, 4, 3));
    // AND what is no older one's is refused
    const hdf5::Names fewer{{"a"}, {"a"}};
    EXPECT_THROW(hdf5::Table(file, "/t", columns(fewer)), hdf5::Error);
}

}  // namespace
}  // namespace vibrig::record
