#include "daemon/dwells/dwell_book.hpp"

#include <utility>

#include "daemon/rt/dwell_feed.hpp"
#include "daemon/rt/ring.hpp"
#include "estimator/spectrum/read_sweep.hpp"

namespace vibrig::dwells {

DwellBook::DwellBook(const estimator::Settings& settings, EventSink event, Noise noise)
    : settings_(settings),
      decides_(noise),
      identification_(settings),
      noise_(settings, std::move(event)) {}

void DwellBook::begin(std::size_t dwells) {
    identification_ = estimator::Identification(settings_);
    identification_.reserve(dwells);
    noise_.reset();
    spectrum_ = {};
}

void DwellBook::continue_from(DwellBook&& other, std::size_t dwells) {
    identification_ = std::move(other.identification_);
    identification_.reserve(dwells);
    noise_.continue_from(std::move(other.noise_));
    spectrum_ = std::move(other.spectrum_);
}

void DwellBook::use_noise(const estimator::NoiseLevels& levels) noexcept {
    dwells::use_noise(identification_, levels);
}

bool DwellBook::order(rt::EstimatorStage& stage, const rt::DwellOrder& order) noexcept {
    const bool taken = stage.order(order);
    if (taken && !order.cancel) ++with_stage_;
    return taken;
}

bool DwellBook::take_done(rt::EstimatorStage& stage, rt::DwellDone& done) {
    if (!stage.take_done(done)) return false;
    // With another dwell at the stage the filter is not this thread's.
    if (--with_stage_ > 0) return true;
    rt::BlockRecord block;
    while (stage.take_block(block))
        if (decides_ == Noise::decided) noise_.add(block);
    conclude(done.summary);
    return true;
}

void DwellBook::conclude(estimator::DwellSummary& dwell) {
    if (decides_ == Noise::decided) noise_.conclude(dwell, identification_);
}

void DwellBook::played(const estimator::PlayedRandom& played, estimator::DwellSummary& summary) {
    const auto known = identification_.played(played);
    if (known.samples > 0) summary = known;
}

estimator::DwellSummary DwellBook::take_again(const Again& dwell) {
    rt::Ring<rt::BlockRecord> blocks{256};
    rt::DwellFeed feed(identification_, blocks);
    if (!dwell.measurements.empty()) feed.begin(dwell.info, dwell.length);
    for (const auto& measurement : dwell.measurements) feed.add(measurement);
    auto summary = feed.begun() ? feed.end(false) : feed.none_of(dwell.info);
    blocks.consume([this](const rt::BlockRecord& block) { noise_.add(block); }, 256);
    conclude(summary);
    if (dwell.info.played) played(*dwell.info.played, summary);
    if (dwell.info.sweep.any() && !summary.left_out) {
        estimator::spectrum::ReadSweep sweep(settings_, dwell.info.run, dwell.info.position);
        for (const auto& [time_s, hz] : dwell.swept_hz) sweep.frequency(time_s, hz);
        for (const auto& measurement : dwell.measurements) sweep.add(measurement);
        spectrum_.sweeps.push_back(sweep.finish());
    }
    return summary;
}

void use_noise(estimator::Identification& identification,
               const estimator::NoiseLevels& levels) noexcept {
    const auto& now = identification.noise();
    if (levels.angle_arcsec > 0 && !(levels == now)) identification.set_noise(levels);
}

}  // namespace vibrig::dwells
