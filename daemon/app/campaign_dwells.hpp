#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "daemon/app/events.hpp"
#include "daemon/app/fitness.hpp"
#include "daemon/app/result_files.hpp"
#include "daemon/archive/outbox.hpp"
#include "daemon/campaign/campaign.hpp"
#include "daemon/campaign/ports.hpp"
#include "daemon/dwells/dwell_book.hpp"
#include "daemon/plan/adaptive.hpp"
#include "daemon/plan/aside.hpp"
#include "daemon/rt/estimator_stage.hpp"
#include "daemon/rt/stirred_waiter.hpp"
#include "estimator/identification/result.hpp"
#include "estimator/spectrum/shaken.hpp"

namespace vibrig::estimator::uncertainty {
struct Assessment;
}
namespace vibrig::plan {
struct TypePrior;
}

namespace vibrig {

struct Again;
struct Judged;

/// What of the configuration results depend on; not where things are kept or how one talks to the
/// daemon.
[[nodiscard]] std::string result_configuration(const configuration::Loaded& loaded);

/// What becomes of a dwell: the estimator's order, noise, verdict, an adaptive campaign's next one,
/// the result. Control thread, except where it says any.
class CampaignDwells final : public campaign::Dwells {
  public:
    /// Whom it works with; all of them outlive it.
    struct With {
        const configuration::Loaded& loaded;
        const drivers::Clock& clock;
        rt::StirredWaiter& control;  ///< woken when something was thought over
        dwells::DwellBook& book;
        rt::EstimatorStage& stage;                          ///< made with the book's identification
        const std::unique_ptr<record::Recorder>& recorder;  ///< null: nothing is recorded
        const std::unique_ptr<journal::Journal>& journal;   ///< made by start(); null: none is kept
        const std::unique_ptr<archive::Outbox>& outbox;     ///< likewise; null: no archive
        const Fitness& fitness;
        Events& events;
        bool at_once;        ///< the rig's clock waits for this thread: no thought takes time
        bool memory_locked;  ///< and is not given back
    };
    explicit CampaignDwells(const With& with);

    void begin() override;
    [[nodiscard]] bool order(const rt::DwellOrder& order) override;
    void swept(const estimator::spectrum::Sweep& sweep,
               const std::vector<std::array<double, 2>>& readings) override;
    [[nodiscard]] campaign::Played played(const campaign::ReportedPsd& reported) override;
    [[nodiscard]] bool free() const override { return with_.book.free() && written(); }
    void levelled(const LevelDrift& drift) override { with_.book.levelled(drift); }
    [[nodiscard]] std::optional<campaign::Next> next(const std::array<double, 3>& here_deg,
                                                     double elapsed_s) override;
    [[nodiscard]] std::string resume_gate() const override;
    void resume(const std::string& by) override;
    void end(bool complete) override;

    /// Offers the campaign what an earlier life has left of it in the journal.
    void offer_unfinished(journal::Unfinished& unfinished, campaign::Campaign& campaign);
    /// Dwells before the interruption, once after each resume().
    [[nodiscard]] std::optional<std::size_t> take_resumed() {
        return std::exchange(resumed_, std::nullopt);
    }
    /// What the estimator is done with, and the verdict on all so far when it is there.
    void take_done(campaign::Campaign& campaign);
    /// Writes what is left to be written, now.
    void write_out(campaign::Campaign& campaign);
    /// What the campaign found against the certificate, once.
    [[nodiscard]] std::string take_against_certificate() {
        return std::exchange(against_certificate_, {});
    }
    /// No result waits to be written.
    [[nodiscard]] bool written() const { return to_write_ == ToWrite::nothing; }
    /// The campaign has ended, and its last verdict is being thought over.
    [[nodiscard]] bool concluding() const { return concluding_ && to_write_ == ToWrite::complete; }
    [[nodiscard]] NoiseStatus noise() const { return with_.book.noise().status(); }

    // Any thread.
    [[nodiscard]] estimator::Result result() const;  ///< without its rows
    [[nodiscard]] VerdictStatus verdict() const;

  private:
    [[nodiscard]] std::optional<Again> again() const;
    [[nodiscard]] std::size_t planned_dwells() const;
    [[nodiscard]] bool verdict_wanted();
    void record_dwell(const estimator::DwellSummary& summary);
    [[nodiscard]] std::string take_psd(const campaign::ReportedPsd& reported,
                                       estimator::PlayedRandom& played);
    void keep_revised(campaign::Campaign& campaign);
    void take_type_prior();
    void keep(estimator::Result result);
    [[nodiscard]] estimator::Result whole_result() const;
    [[nodiscard]] estimator::spectrum::Shaken shaken() const;
    /// What can be believed of the dwells so far; the verdict on all of them writes the result.
    void take_verdict(campaign::Campaign& campaign);
    void tell_verdict(const Judged& judged, campaign::Campaign& campaign);
    void write_result(const Judged& judged, campaign::Campaign& campaign);
    [[nodiscard]] std::string marked(std::string mark);
    void take_anew(const Judged& judged, campaign::Campaign& campaign);

    const With with_;
    const configuration::Configuration& configuration_;
    ResultFiles files_;
    /// As it was when the campaign was interrupted; until it is resumed.
    struct Interrupted {
        dwells::DwellBook book;
        std::int64_t id = 0;
    };
    std::optional<Interrupted> interrupted_;
    bool revised_ = false;    ///< a dwell is another one than the result kept has
    rt::DwellOrder ordered_;  ///< the newest
    std::optional<std::size_t> resumed_;
    std::optional<plan::AdaptivePlan> adaptive_;
    std::shared_ptr<const plan::TypePrior> type_prior_;  ///< null: it is planned without
    /// What the control thread may not wait for.
    plan::Aside<plan::AdaptivePlan::Decision> planning_{[this] { with_.control.notify(); }};
    /// Tens of milliseconds, with hundreds of dwells seconds.
    plan::Aside<std::shared_ptr<const Judged>> assessing_{[this] { with_.control.notify(); }};
    bool verdict_due_ = false;  ///< on the dwells so far
    bool concluding_ = false;   ///< the last verdict is asked for
    std::string verdict_logged_, against_certificate_;
    enum class ToWrite : std::uint8_t { nothing, partial, complete } to_write_ = ToWrite::nothing;

    mutable std::mutex mutex_;  ///< guards what follows, which only this thread changes
    estimator::Result result_;  ///< without its rows
    VerdictStatus verdict_;
};

}  // namespace vibrig
