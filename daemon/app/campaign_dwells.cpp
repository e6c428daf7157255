// What becomes of a dwell. The verdict on them: campaign_verdict.cpp.
#include "daemon/app/campaign_dwells.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>

#include "daemon/app/campaign_forecast.hpp"
#include "daemon/app/judged.hpp"
#include "daemon/app/start_checks.hpp"
#include "daemon/commission/acceptance.hpp"
#include "daemon/configuration/random_profiles.hpp"
#include "daemon/plan/type_prior.hpp"
#include "daemon/results/result_json.hpp"
#include "estimator/filter/settings_check.hpp"

namespace vibrig {

std::string result_configuration(const configuration::Loaded& loaded) {
    std::string text;
    for (const auto& value : loaded.effective) {
        const auto section = value.key.substr(0, value.key.find('.'));
        if (section == "server" || section == "log" || section == "threads" ||
            section == "journal" || section == "archive" || section == "mqtt" ||
            section == "clock" || section == "guard" || section == "annunciator" ||
            section == "record" || section == "unit" || section == "instrument" ||
            section == "selftest" || section == "commission" || value.key == "campaign.results" ||
            value.key == "campaign.arming_valid_s" || value.key == "campaign.second_person")
            continue;
        text += value.key + " = " + value.value + "\n";
    }
    return text;
}

CampaignDwells::CampaignDwells(const With& with)
    : with_(with),
      configuration_(with.loaded.configuration),
      files_(configuration_.results,
             [&events = with.events](Severity severity, const std::string& text) {
                 events.log(severity, "campaign", text);
             }),
      adaptive_(adaptive_plan(configuration_)) {}

void CampaignDwells::begin() {
    planning_.abandon();  // of a campaign that was aborted
    assessing_.abandon();
    with_.book.begin(planned_dwells());
    files_.begin();
    verdict_logged_.clear();
    take_type_prior();
    const std::lock_guard lock(mutex_);
    verdict_ = {};
    result_ = {};
    for (const std::string& line : check_plan(configuration_))
        with_.events.log(Severity::warning, "campaign", line);
}

/// Of an adaptive campaign only those that are its beginning.
std::size_t CampaignDwells::planned_dwells() const {
    const auto& campaign = configuration_.campaign;
    return std::max(campaign.stops.size(), campaign.table_g.size() * campaign.positions_deg.size());
}

bool CampaignDwells::order(const rt::DwellOrder& order) {
    const bool taken = with_.book.order(with_.stage, order);
    if (taken && !order.cancel) ordered_ = order;
    if (taken && with_.recorder)
        with_.recorder->ordered(order, with_.clock.now(), with_.book.identification().noise());
    return taken;
}

void CampaignDwells::swept(const estimator::spectrum::Sweep& sweep,
                           const std::vector<std::array<double, 2>>& readings) {
    with_.book.spectrum().sweeps.push_back(sweep);
    if (!with_.recorder) return;
    record::Swept rows;
    for (const auto& [time_s, hz] : readings)
        rows.push_back(
            {ordered_.from + drivers::from_seconds(time_s), sweep.run, sweep.position, hz});
    with_.recorder->swept(std::move(rows));
}

std::optional<campaign::Next> CampaignDwells::next(const std::array<double, 3>& here_deg,
                                                   double elapsed_s) {
    // Between two dwells the identification is this thread's; the shaker is at rest. It takes
    // tenths of a second, on a busy machine more than this thread may be away. The rig's clock
    // waits for this thread, so that there the time is none.
    std::optional<plan::AdaptivePlan::Decision> decision;
    const auto choose = [this, here_deg, elapsed_s,
                         covariance = with_.book.identification().covariance(),
                         result = whole_result(), prior = type_prior_] {
        plan::Start start{plan::widened(covariance, configuration_.estimator, result), ""};
        if (prior)
            start = plan::start_of(*prior, std::move(start.covariance), configuration_.estimator,
                                   result);
        auto chosen = adaptive_->next(start.covariance, here_deg, elapsed_s, result.rows.size());
        chosen.words += start.words;
        return chosen;
    };
    if (with_.at_once) {
        decision = choose();
    } else if (planning_.asked()) {
        decision = planning_.take();
    } else {
        planning_.ask(choose);
    }
    if (!decision) return {};
    campaign::Next next;
    next.more = decision->verdict == plan::AdaptivePlan::Verdict::go_on;
    next.stop = {decision->run.position_deg, decision->run.table_g};
    next.left = decision->left;
    next.words = decision->words;
    return next;
}

/// A campaign begins or goes on: what the archive knows of the unit's type by now.
void CampaignDwells::take_type_prior() {
    type_prior_.reset();
    if (!configuration_.campaign.type_prior) return;
    const archive::Outbox::TypeKnown known =
        with_.outbox ? with_.outbox->type_known()
                     : archive::Outbox::TypeKnown{"", "nothing is recorded, so nothing archived"};
    try {
        if (known.json.empty())
            throw std::runtime_error(known.why_not.empty() ? "the archive has not answered yet"
                                                           : known.why_not);
        type_prior_ = std::make_shared<const plan::TypePrior>(plan::type_prior_of(known.json));
        with_.events.log(Severity::info, "campaign",
                         fmt::format("starts from {} units of type {} in the archive",
                                     type_prior_->of.units, type_prior_->type));
    } catch (const std::runtime_error& error) {
        with_.events.log(
            Severity::warning, "campaign",
            std::string("is planned without its type, campaign.prior = \"type\": ") + error.what());
    }
}

std::string CampaignDwells::resume_gate() const {
    return interrupted_ ? with_.fitness.resume_gate() : "the filter as it was is gone";
}

void CampaignDwells::resume(const std::string& by) {
    planning_.abandon();
    take_type_prior();
    with_.book.continue_from(std::move(interrupted_->book), planned_dwells());
    files_.begin();
    if (with_.journal) with_.journal->campaign_resumed(interrupted_->id, by);
    interrupted_.reset();
    auto result = with_.book.identification().result();
    resumed_ = result.dwells.size();
    keep(std::move(result));
    verdict_due_ = true;
}

estimator::spectrum::Shaken CampaignDwells::shaken() const {
    const auto& spectrum = with_.book.spectrum();
    return {configuration::numbered_kinds(configuration_), spectrum.sweeps, spectrum.psds};
}

void CampaignDwells::end(bool complete) {
    to_write_ = complete ? ToWrite::complete : ToWrite::partial;
    with_.book.noise().report();
}

void CampaignDwells::offer_unfinished(journal::Unfinished& unfinished,
                                      campaign::Campaign& campaign) {
    // The monitor shows its curves again when the campaign goes on; what it said was said before.
    Interrupted fresh{
        dwells::DwellBook(configuration_.estimator, [](Severity, const std::string&) {}),
        unfinished.id};
    std::vector<estimator::DwellSummary> done;
    std::string why = journal::replay(unfinished.dwells, fresh.book,
                                      drivers::from_seconds(configuration_.campaign.dwell_s));
    std::vector<StopDone> stops;
    for (const auto& dwell : unfinished.dwells) {
        done.push_back(dwell.summary);
        if (dwell.stop_known) stops.push_back(dwell.stop);
        auto& spectrum = fresh.book.spectrum();
        if (!dwell.stop.psd.empty()) spectrum.psd_before = dwell.stop.psd;
        if (dwell.info.played && dwell.info.played->word == estimator::PlayedRandom::Word::good)
            spectrum.psds.push_back(
                configuration::reported_bands(configuration_, dwell.info.random.profile,
                                              dwell.info.random.level_db, dwell.stop.psd));
    }
    const std::size_t count = done.size();
    if (why.empty() && !campaign.offer(std::move(done), std::move(stops)))
        why = "its positions are not the first ones of this campaign";
    if (!why.empty()) {
        with_.events.log(
            Severity::warning, "journal",
            fmt::format("campaign {} ({}): {}: cold start", unfinished.id, unfinished.name, why));
        return;
    }
    with_.events.log(
        Severity::warning, "journal",
        fmt::format("campaign {} ({}, started by {}) was interrupted with {} positions done: arm "
                    "and resume it, or start anew",
                    unfinished.id, unfinished.name, unfinished.started_by, count));
    interrupted_ = std::move(fresh);
    unfinished.dwells.clear();
}

void CampaignDwells::take_done(campaign::Campaign& campaign) {
    files_.try_again();
    keep_revised(campaign);
    rt::DwellDone done;
    while (with_.book.take_done(with_.stage, done)) {
        auto result = with_.book.identification().result();
        campaign.on_dwell_done(done.summary);
        // Of a random dwell it is not known yet what was played.
        if (!campaign.psd_awaited()) record_dwell(done.summary);
        campaign.qualify(result);
        keep(std::move(result));
        verdict_due_ = true;
    }
    take_verdict(campaign);
}

void CampaignDwells::record_dwell(const estimator::DwellSummary& summary) {
    if (!with_.recorder) return;
    // The identification is this thread's: the dwell is over and no other is ordered.
    estimator::Estimate estimate;
    with_.book.identification().solved(estimate);
    record::Dwell dwell;
    dwell.time = with_.clock.now();
    dwell.summary = summary;
    dwell.reason = summary.reason;
    dwell.value = estimate.value;
    dwell.sigma = estimate.sigma;
    dwell.observable = estimate.observable;
    dwell.covariance = with_.book.identification().covariance();
    dwell.numbers = record::numbers_after(with_.book.identification(), summary);
    with_.recorder->dwell_done(std::move(dwell));
}

void CampaignDwells::write_out(campaign::Campaign& campaign) {
    if (written() || !with_.book.free()) return;
    assessing_.abandon();
    keep_revised(campaign);
    const auto& identification = with_.book.identification();
    write_result(judge(configuration_.estimator, whole_result(), again(),
                       estimator::uncertainty::Stage::ended, identification.rows(),
                       identification.means(), shaken()),
                 campaign);
}

/// What marks the campaign, that its result is against the certificate included.
std::string CampaignDwells::marked(std::string mark) {
    auto value = result_.value;
    for (std::size_t i = 0; i < value.size(); ++i)
        if (!result_.observable[i]) value[i] = std::nan("");
    against_certificate_ = commission::against_certificate(configuration_.commission.certificate,
                                                           value, result_.sigma);
    if (against_certificate_.empty()) return mark;
    with_.events.log(Severity::alarm, "campaign", "campaign marked: " + against_certificate_);
    return mark.empty() ? against_certificate_ : mark + "; " + against_certificate_;
}

void CampaignDwells::write_result(const Judged& judged, campaign::Campaign& campaign) {
    const bool complete = std::exchange(to_write_, ToWrite::nothing) == ToWrite::complete;
    const auto& assessed = judged.assessed;
    take_anew(judged, campaign);
    if (!result_.dwells.empty())  // of no data nothing is to be said
        with_.events.log(severity_of(assessed.verdict.level), "campaign",
                         "result " + assessed.verdict.sentence);
    const std::string mark = marked(campaign.mark());
    std::string text;
    const auto ended_utc_ns = utc_now();
    {
        const std::lock_guard lock(mutex_);
        if (!mark.empty()) result_.warnings.push_back("campaign marked: " + mark);
        for (const auto& doubt : estimator::doubtful_keys(configuration_.estimator))
            result_.warnings.push_back(doubt.words());
        for (const auto& words : judged.contradictions) result_.warnings.push_back(words);
        std::optional<tool::KnownType> type;
        if (type_prior_) type = tool::KnownType{type_prior_->type, type_prior_->of};
        const auto& unit = configuration_.paperwork;
        const tool::CampaignNames names{configuration_.campaign.name, ended_utc_ns, unit.unit_type,
                                        unit.unit_serial};
        text = tool::result_json(result_, assessed, configuration_.simulated(), nullptr,
                                 judged.live.get(), judged.spectrum ? &*judged.spectrum : nullptr,
                                 type ? &*type : nullptr, &names);
    }
    StatusData ended;
    campaign.fill(ended, with_.clock.now());
    files_.write(text, complete);
    // The journal first: the recording is closed with the head of this very entry.
    std::uint64_t entry = 0;
    if (with_.journal)
        entry = with_.journal->campaign_ended(name_of(ended.state), ended.reason, text);
    if (with_.recorder)
        with_.recorder->campaign_ended(
            {name_of(ended.state), ended.reason, mark, text, ended_utc_ns, entry});
}

estimator::Result CampaignDwells::result() const {
    const std::lock_guard lock(mutex_);
    return result_;
}

VerdictStatus CampaignDwells::verdict() const {
    const std::lock_guard lock(mutex_);
    return verdict_;
}

}  // namespace vibrig
