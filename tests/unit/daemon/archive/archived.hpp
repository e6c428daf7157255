#pragma once

#include <filesystem>
#include <string>

#include "daemon/archive/deliver.hpp"
#include "tests/unit/daemon/record/parts.hpp"

namespace vibrig::archive {

/// A campaign in recordings/test-1, and an archive beside the recordings.
class Archived : public record::Parts {
  protected:
    Archived() {
        std::filesystem::create_directory(lab());
        record_it(0);
    }
    ~Archived() override {
        std::error_code ignored;
        std::filesystem::remove_all(lab(), ignored);
    }

    [[nodiscard]] std::filesystem::path lab() const { return recordings_.string() + "-lab"; }
    [[nodiscard]] Place place() const { return {lab().string(), index_in(lab().string())}; }
    /// Beginning and end are the same whatever else is.
    void record_it(drivers::Time first_sample) {
        std::filesystem::remove(folder_ / "campaign.h5");
        record::Head one = head(1);
        one.simulated = simulated_;
        one.configuration = "unit.serial = \"0017\"\nvibration.frequency_hz = 25.0\n";
        result_ = R"({"verdict":{"word":"valid","sentence":"valid"},"nis":1.1,"parameters":[)"
                  R"({"name":"D_Fx","value":2.5,"sigma":0.1},)"
                  R"({"name":"second","value":1.5,"sigma":0.2},{"name":"D_Ox"},{"name":"D_Sx"},)"
                  R"({"name":"D_IIx","value":0.5,"sigma":0.1}],"covariance":[[0.01],[0,0.04]]})";
        write(one, first_sample, {1, 2}, 2);
    }
    bool simulated_ = false;
    void add() const { static_cast<void>(deliver(folder_.string(), place(), "rig", {})); }
};

}  // namespace vibrig::archive
