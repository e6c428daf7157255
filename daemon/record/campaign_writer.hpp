#pragma once

#include <array>
#include <memory>
#include <string>

#include "daemon/domain/events.hpp"
#include "daemon/record/disk.hpp"
#include "daemon/record/hdf5.hpp"
#include "daemon/record/records.hpp"

namespace vibrig::record {

inline constexpr std::int64_t kFormatVersion = 2;
/// Attribute: SHA-256 of /configuration.
inline constexpr const char* kConfigurationDigest = "configuration_sha256";

/// How a campaign, or this file of it, ended; but for its result. Of a closed file.
void write_end(hdf5::File& file, const Ended& ended);

/// A campaign's HDF5 file while the campaign goes on: rows are kept until commit(), from then on a
/// reader sees them. One thread; everything throws hdf5::Error.
class CampaignWriter {
  public:
    CampaignWriter(const std::string& path, const Head& head);

    void put(const drivers::Sample& sample);
    void put(const Order& order);
    void put(const Dwell& dwell);
    void put(const Swept& swept);
    void put(const Played& played);
    void put(const EstimateRow& row);
    void put(const EventRecord& event);
    void put(const ConditionRow& row);
    void put(const Gap& gap);

    void commit();
    /// Writes how it ended and closes the file.
    void end(const Ended& ended);

    [[nodiscard]] std::size_t samples_waiting() const { return samples_->waiting(); }
    [[nodiscard]] const std::string& path() const { return file_->path(); }

  private:
    void write_head(const Head& head);
    /// Samples last: whoever sees a sample also sees the order that it belongs to.
    [[nodiscard]] auto tables() {
        return std::array{&orders_,    &dwells_, &sweeps_, &played_,     &psd_lines_,
                          &estimates_, &events_, &gaps_,   &conditions_, &samples_};
    }

    std::unique_ptr<hdf5::File> file_;
    std::unique_ptr<WriterLock> lock_;
    std::unique_ptr<hdf5::Table> samples_, orders_, dwells_, sweeps_, played_, psd_lines_,
        estimates_, events_, gaps_, conditions_;
    std::size_t interlock_rows_ = 0;
};

}  // namespace vibrig::record
