#pragma once

#include <atomic>
#include <cstdint>
#include <string>
#include <vector>

#include "daemon/domain/events.hpp"
#include "daemon/journal/journal.hpp"
#include "daemon/record/recorder.hpp"
#include "daemon/serve/event_log.hpp"
#include "drivers/annunciator/annunciator.hpp"
#include "drivers/base/clock.hpp"

namespace vibrig {

using journal::utc_now;

/// Every event of the daemon comes through here: to the list that people ask for, the journal, the
/// recording and the log, an alarm to the pager, too. Any thread that may lock.
class Events {
  public:
    explicit Events(const drivers::Clock& clock) : clock_(clock) {}

    // Before the threads start; null: nobody keeps it.
    void keep_in(journal::Journal* journal) noexcept { journal_ = journal; }
    void record_in(record::Recorder* recorder) noexcept { recorder_ = recorder; }
    /// As long as there are threads; null: no longer.
    void page_by(drivers::Annunciator* annunciator) noexcept { annunciator_.store(annunciator); }

    void log(Severity severity, const std::string& source, const std::string& text);
    /// The same without the pager.
    void enter(Severity severity, const std::string& source, const std::string& text);
    /// What is reported there is logged as of `source`; for as long as this lives.
    [[nodiscard]] EventSink sink(std::string source);
    /// To the pager and the horn.
    void announce(drivers::HornPattern pattern, const std::string& text);
    [[nodiscard]] std::vector<EventRecord> after(std::uint64_t id, std::size_t at_most) const {
        return list_.after(id, at_most);
    }

  private:
    const drivers::Clock& clock_;
    serve::EventLog list_;
    journal::Journal* journal_ = nullptr;
    record::Recorder* recorder_ = nullptr;
    std::atomic<drivers::Annunciator*> annunciator_{nullptr};
};

}  // namespace vibrig
