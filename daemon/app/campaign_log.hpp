#pragma once

#include <memory>
#include <string>

#include "daemon/app/events.hpp"
#include "daemon/campaign/ports.hpp"
#include "daemon/journal/journal.hpp"

namespace vibrig {

/// What the campaign has to say goes to the events and into the journal.
class CampaignLog final : public campaign::Log {
  public:
    /// `journal`: made before the campaign's first step; null: none is kept.
    CampaignLog(Events& events, const std::unique_ptr<journal::Journal>& journal)
        : events_(events), journal_(journal) {}

    void event(Severity severity, const std::string& text) override {
        events_.enter(severity, "campaign", text);
        // Whoever is not there wants to know that it does not go on.
        if (severity == Severity::alarm) events_.announce(drivers::HornPattern::abort, text);
    }
    void position_done(const estimator::DwellInfo& info, const estimator::DwellSummary& summary,
                       const StopDone& stop) override {
        if (journal_) journal_->dwell_done(info, summary, stop);
    }
    void loop_checked(const std::string& by, const std::string& out_of_band) override {
        if (journal_) journal_->loop_checked(by, out_of_band);
    }
    void proved(const campaign::ProofRecord& record) override {
        if (journal_) journal_->proved(record.by, campaign::to_json(record));
    }
    [[nodiscard]] std::int64_t utc_ns() const override { return utc_now(); }

  private:
    Events& events_;
    const std::unique_ptr<journal::Journal>& journal_;
};

}  // namespace vibrig
