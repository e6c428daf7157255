#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "drivers/can/can_port.hpp"
#include "drivers/sample/sample.hpp"
#include "proto/dbc.hpp"

namespace vibrig::drivers {

/// A binding the DBC cannot honour: the configuration key ("can.signals.outer"), the value found
/// and what the DBC offers.
class BindingError : public std::runtime_error {
  public:
    BindingError(std::string key, std::string value, const std::string& offer);
    /// Several at once, a line each; at least one.
    explicit BindingError(std::vector<BindingError> all);
    /// Each of several; of one alone empty.
    [[nodiscard]] const std::vector<BindingError>& all() const noexcept { return all_; }
    [[nodiscard]] const std::string& key() const noexcept { return key_; }
    [[nodiscard]] const std::string& value() const noexcept { return value_; }

  private:
    std::string key_;
    std::string value_;
    std::vector<BindingError> all_;
};

struct AssemblerSettings {
    SignalBindings bindings;
    Time sample_period = 0;  ///< nominal, of one sync count; to be stated
    Time join_deadline =
        20 *
        kMillisecond;  ///< a sample is given out, complete or not, this long after its first frame
    Time stale_deadline = 100 * kMillisecond;  ///< a channel without a value for longer is stale
    std::uint32_t open_samples = 8;            ///< sync counts joined at a time (reordering depth)
    /// In each frame that carries a channel, 1 to 16; its count is that of the first one.
    int samples_per_frame = 1;
    /// Signals in another unit are refused. Not in a recording, which nobody can mend.
    bool units_checked = true;
};

/// received = used + unknown + duplicate + late + wrong_length
/// unknown: bound to nothing, remote, or of a sync count that no second one confirmed. late: its
/// sample is already out.
struct AssemblerCounters {
    std::uint64_t received = 0, used = 0, unknown = 0, duplicate = 0, late = 0, wrong_length = 0;
    std::uint64_t samples = 0, incomplete = 0;  ///< given out; of them with a missing channel
    std::uint64_t invalid = 0;  ///< given out with nothing missing, flagged or out of its range
    /// Of `duplicate`: with another content than the first, as two nodes of one id send; and the id
    /// of the newest.
    std::uint64_t contradicting = 0;
    std::uint32_t contradicting_id = 0;
    std::uint64_t gaps = 0;     ///< sync counts that never showed
    std::uint64_t resyncs = 0;  ///< jumps of the counter (device restart) or of its time
};

/// Joins frames of one sync count into Samples. One thread; no allocation after construction; no
/// clock of its own.
class SampleAssembler {
  public:
    using SampleHandler = std::function<void(const Sample&)>;

    /// Throws BindingError naming the configuration key, the signal, and what the DBC offers.
    SampleAssembler(const proto::Dbc& dbc, const AssemblerSettings& settings,
                    SampleHandler on_sample);
    ~SampleAssembler();

    /// Takes one frame; may give out samples.
    void feed(const ReceivedFrame& frame) noexcept;
    /// Gives out samples whose deadline has come. To be called at next_deadline() at the latest.
    void advance(Time now) noexcept;
    [[nodiscard]] Time next_deadline() const noexcept;
    [[nodiscard]] const PlatformStatus& platform() const noexcept;
    /// Newest time a good value of the channel came; 0: never. While the sync count is silent no
    /// later than that.
    [[nodiscard]] Time last_good(Channel channel) const noexcept;
    [[nodiscard]] bool stale(Channel channel, Time now) const noexcept;
    /// The sync count, where there is one, has not come for the deadline of a channel (or four of
    /// its periods), or for a second (or three of them) where it comes less often than that: counts
    /// and times go on by themselves, and nobody knows for how long they are right. All channels
    /// are stale then.
    [[nodiscard]] bool sync_silent(Time now) const noexcept;
    [[nodiscard]] const AssemblerCounters& counters() const noexcept;

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace vibrig::drivers
