// How the filter came to its result, and what it left over.
#pragma once

#include "daemon/report/analysis.hpp"
#include "daemon/report/page.hpp"

namespace vibrig::report {

void add_convergence(Page& page, const record::Campaign& campaign, const Analysis& a);
void add_innovations(Page& page, const Analysis& a);
/// Noise of the gyros, by the residuals of their rates; and what the noise monitor reported.
void add_noise(Page& page, const record::Campaign& campaign, const Analysis& a);

}  // namespace vibrig::report
