#include "daemon/report/result_charts.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "daemon/plot/chart.hpp"
#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::report {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

TEST(Legend, ANameThatWouldNotFitIsDrawnIn) {
    tool::plot::Chart chart;
    for (const char* name : {"short", "measured by the controller"})
        chart.curves.push_back({.name = name, .x = {0, 1}, .y = {0, 1}, .low = {}, .high = {}});
    const auto svg = chart.svg();
    EXPECT_THAT(svg, HasSubstr("textLength=\"146.00\">measured by the controller<"));
    EXPECT_EQ(svg.find("textLength"), svg.rfind("textLength")) << "and only that";
}

class PlotOfAResult : public ::testing::Test {
  protected:
    PlotOfAResult() {
        result_.observable.fill(true);
        result_.sigma.fill(0.01);
        for (std::size_t i = 0; i < estimator::kParameters; ++i) result_.covariance[i][i] = 1;
        assessed_.done = true;
        assessed_.verdict.sentence = "doubtful, because of the moon";
        for (auto& c : assessed_.coefficients) c.u = 0.02;
        assessed_.rates.resize(3);
    }
    static std::string text_of(const fs::path& path) {
        std::ostringstream text;
        text << std::ifstream(path).rdbuf();
        return text.str();
    }
    TemporaryFolder folder_;
    estimator::Result result_;
    estimator::uncertainty::Assessment assessed_;
};

TEST_F(PlotOfAResult, IsOneFileOrAFolderOfThem) {
    plot_result((folder_ / "one.svg").string(), result_, assessed_, false);
    const std::string svg = text_of(folder_ / "one.svg");
    EXPECT_THAT(svg, HasSubstr("combined, u"));
    EXPECT_THAT(svg, HasSubstr("doubtful, because of the moon"));
    EXPECT_THAT(svg, ::testing::Not(HasSubstr("SIMULATED")));
    plot_result((folder_ / "all").string(), result_, assessed_, true);
    for (const char* name : {"uncertainties.svg", "correlation.svg", "residuals.svg"})
        EXPECT_THAT(text_of(folder_ / "all" / name),
                    ::testing::AllOf(HasSubstr("</svg>"), HasSubstr("SIMULATED: ")))
            << name;
}

TEST_F(PlotOfAResult, NamesAPathThatCannotBeWritten) {
    const std::string path = (folder_ / "none" / "one.svg").string();
    try {
        plot_result(path, result_, assessed_, false);
        FAIL() << "wrote it";
    } catch (const std::runtime_error& error) {
        EXPECT_THAT(error.what(), HasSubstr(path));
    }
}

TEST_F(PlotOfAResult, LeavesAHoleForWhatIsNotDetermined) {
    // GIVEN a result of which one coefficient is not determined, and nothing to assess
    result_.observable[4] = false;
    result_.covariance[4].fill(std::nan(""));
    for (auto& row : result_.covariance) row[4] = std::nan("");
    assessed_ = {};
    // WHEN it is drawn THEN nothing in the picture is no number
    plot_result((folder_ / "all").string(), result_, assessed_, false);
    for (const char* name : {"uncertainties.svg", "correlation.svg"})
        EXPECT_EQ(text_of(folder_ / "all" / name).find("nan"), std::string::npos) << name;
    EXPECT_FALSE(fs::exists(folder_ / "all" / "residuals.svg"));
}

}  // namespace
}  // namespace vibrig::report
