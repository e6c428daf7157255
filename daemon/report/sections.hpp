// Sections of the page of a campaign, each in a source of its own.
#pragma once

#include "daemon/record/campaign_file.hpp"
#include "daemon/record/replay.hpp"
#include "daemon/report/analysis.hpp"
#include "daemon/report/page.hpp"
#include "daemon/report/report.hpp"
#include "estimator/uncertainty/assessment.hpp"

namespace vibrig::report {

/// The verdict first, then what each coefficient is worth and why, then the dwells' residuals.
void add_uncertainty(Page& page, const estimator::uncertainty::Assessment& assessed,
                     double coverage);

/// What the coefficients mean, what it was like meanwhile, and what was left out and why.
void add_lead(Page& page, const record::Campaign& campaign, const record::ReplayResult& replayed);

/// What the positions and levels of a campaign were worth, as it was run.
void add_plan(Page& page, const record::Campaign& campaign, const Analysis& analysis);
/// The files with their hashes.
void add_files(Page& page, const record::Campaign& campaign);

/// How the filter came to its result, and what it left over.
void add_convergence(Page& page, const record::Campaign& campaign, const Analysis& a);
void add_innovations(Page& page, const Analysis& a);
/// Noise of the gyros, by the residuals of their rates; and what the noise monitor reported.
void add_noise(Page& page, const record::Campaign& campaign, const Analysis& a);

/// Temperatures, and the shaker's command beside what became of it.
void add_conditions(Page& page, const record::Campaign& campaign);
/// Zeros of the accelerometers taken in place, where they changed.
void add_zeros(Page& page, const record::Campaign& campaign);

/// What had been proved of stopping when the campaign began: who, when, all times and ratios, hash
/// of the keys it covers, and how the stop times of earlier proofs compare.
void add_proof(Page& page, const record::Campaign& campaign);

/// Adds, for a campaign at several frequencies: what the coefficients are over frequency, and what
/// is not known of that.
void add_spectrum(Page& page, const record::Campaign& campaign);
/// The coefficients without and with what the archive knew of the unit's type, where the campaign
/// was planned by it (campaign.prior).
void add_type(Page& page, const record::Campaign& campaign);

/// The coefficients beside those of an earlier campaign, with E_n.
void add_comparison(Page& page, const record::Campaign& campaign, const Analysis& a,
                    const std::optional<Earlier>& earlier);

}  // namespace vibrig::report
