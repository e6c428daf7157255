#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "daemon/record/campaign_file.hpp"
#include "daemon/record/replay.hpp"

namespace vibrig::report {

/// A limit on a coefficient, in its unit; one side may be missing.
struct Limit {
    std::string coefficient;
    std::optional<double> low, high;
};

/// What the laboratory states of a certificate; the rest comes from the recording.
struct Issue {
    std::string number, by;
    std::int64_t utc_ns = 0;
    std::string laboratory, laboratory_address, accreditation;
    std::string location;  ///< where it was measured; empty: at the laboratory's address
    std::string customer, customer_address;
    std::string received, condition;  ///< of the item; a date, words
    std::vector<Limit> limits;
    double guard_band = 1;  ///< times U, by which each limit is drawn in (ISO 14253-1)
};

/// A certificate is not issued for this.
class Refused : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

/// Content of a calibration certificate by ISO/IEC 17025, 7.8: the fields of HTML, PDF and JSON.
/// `result`: as the replay gives it, in the form of result.json. Throws Refused when it is not
/// valid, has no combined uncertainty, or does not come out of its recording.
[[nodiscard]] nlohmann::ordered_json certificate_of(const record::Campaign& campaign,
                                                    const nlohmann::ordered_json& result,
                                                    const record::ReplayResult& replayed,
                                                    const Issue& issue);

/// "passes", "fails" or "inconclusive": for U > 0 and a guard band of `guard` U.
[[nodiscard]] std::string statement_of(const Limit& limit, double value, double expanded,
                                       double guard);

/// One page of HTML that says what the JSON says.
[[nodiscard]] std::string certificate_page(const nlohmann::ordered_json& certificate);

}  // namespace vibrig::report
