// The row that a dwell leaves, and that of a random one once it is known what was played.
#include <cmath>
#include <utility>

#include "estimator/identification/identification_impl.hpp"

namespace vibrig::estimator {

bool Identification::Impl::row_of(const DwellSummary& summary, DwellRow& row) noexcept {
    if (!active_->batch.row(row)) return false;
    row.run = summary.run;
    row.position = summary.position;
    row.table_g = record_.info.table_g;
    row.common_clock = std::isfinite(record_.info.begin_s);
    if (row.common_clock) row.middle_s += record_.info.begin_s;
    take_level(summary, row);
    row.frequency_hz = summary.frequency_hz;
    row.nis_per_dof = summary.nis_per_dof;
    row.innovation_correlation = summary.innovation_correlation;
    row.commanded_hz = record_.info.frequency_hz;
    row.held_out = record_.info.held_out;
    row.apart = apart_;
    row.random = random_;
    row.profile = record_.info.random.profile;
    row.harmonics = harmonics_.shares(record_.period_s);
    if (row.frequency_hz > 0)
        row.sync_arcsec =
            sync_.amplitude_arcsec(row.frequency_hz, noise.angle_arcsec * noise.angle_arcsec);
    return true;
}

void Identification::Impl::take_level(const DwellSummary& summary, DwellRow& row) noexcept {
    row.vibration = summary.vibration();
    row.flagged = summary.flagged && !summary.followed;
    row.relative_error = summary.relative_error;
}

void Identification::Impl::keep_row(DwellRow& row) noexcept {
    row.after_power_loss = std::exchange(power_lost_, false);
    rows.push_back(row);
}

DwellSummary Identification::Impl::played(const PlayedRandom& played) noexcept {
    if (in_dwell_ || !last_random_) return {};
    Random last = *last_random_;
    last_random_.reset();
    if (last.kept) {
        power_lost_ = power_lost_ || rows.back().after_power_loss;
        rows.pop_back();
    }
    last.record.played = played;
    DwellVerdict verdict = judge(last.record, settings);
    DwellSummary& summary = verdict.summary;
    summary.noise = last.summary.noise;
    summary.left_out = verdict.rejected;
    if (!verdict.rejected && last.row && rows.size() < rows.capacity()) {
        take_level(summary, *last.row);
        last.row->psd = played.word == PlayedRandom::Word::good ? played.place : 0;
        keep_row(*last.row);
    }
    used += summary.used;
    used -= last.summary.used;
    rejected += summary.rejected;
    rejected -= last.summary.rejected;
    if (summary.left_out != last.summary.left_out) {
        const double sign = summary.left_out ? -1 : 1;
        nis_sum += sign * last.record.nis_sum;
        nis_count = summary.left_out ? nis_count - last.record.nis_count
                                     : nis_count + last.record.nis_count;
    }
    if (dwells_not_kept == 0 && !dwells.empty()) dwells.back() = summary;
    return summary;
}

}  // namespace vibrig::estimator
