#include "daemon/campaign/safety_proof.hpp"

#include <openssl/evp.h>
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>

#include "estimator/filter/median.hpp"

namespace vibrig::campaign {

namespace {

using Json = nlohmann::ordered_json;

constexpr std::int64_t kHour_ns = 3'600'000'000'000;
constexpr std::size_t kMostChanges = 3;  // named; the rest is counted

std::map<std::string, std::string> lines_of(const std::string& keys) {
    std::map<std::string, std::string> found;
    std::istringstream in(keys);
    for (std::string line; std::getline(in, line);) {
        const auto equal = line.find('=');
        if (equal != std::string::npos) found[line.substr(0, equal)] = line.substr(equal + 1);
    }
    return found;
}

double value_of(const ProofRecord& record, std::string_view name) {
    const auto row = std::ranges::find(record.rows, name, &CheckRow::name);
    return row == record.rows.end() ? 0 : row->value;
}

// Stops that are timed in every proof.
constexpr std::array<const char*, 3> kTimedStops{"stop, table", "stop, platform", "watchdog, rest"};

/// "shaker.port is 503, was proved with 502; ..."
std::string changes(const std::string& then, const std::string& now) {
    const auto before = lines_of(then), after = lines_of(now);
    std::vector<std::string> found;
    for (const auto& [key, value] : after) {
        const auto it = before.find(key);
        if (it == before.end()) {
            found.push_back(fmt::format("{} is {}, was not known then", key, value));
        } else if (it->second != value) {
            found.push_back(fmt::format("{} is {}, was proved with {}", key, value, it->second));
        }
    }
    for (const auto& [key, value] : before) {
        if (!after.contains(key)) found.push_back(fmt::format("{} is gone, was {}", key, value));
    }
    std::string text;
    for (std::size_t i = 0; i < std::min(found.size(), kMostChanges); ++i)
        text += (i == 0 ? "" : "; ") + found[i];
    if (found.size() > kMostChanges)
        text += fmt::format("; and {} more", found.size() - kMostChanges);
    return text;
}

constexpr const char* kRemedy = ": prove it anew (vibrig selftest --by NAME)";

}  // namespace

void StopTimes::begin(drivers::Time now) {
    *this = {};
    from_ = now;
}

void StopTimes::look(const drivers::ShakerReading& reading, const rt::Rest& rest) {
    if (!controller_s && reading.valid && reading.time > from_ && !reading.running &&
        reading.still())
        controller_s = drivers::to_seconds(reading.time - from_);
    const auto stands = [this](const rt::RestWitness& witness, std::optional<double>& time_s) {
        if (!time_s && witness.verdict == rt::RestVerdict::still && witness.from >= from_)
            time_s = drivers::to_seconds(witness.from - from_);
    };
    stands(rest.table, table_s);
    stands(rest.platform, platform_s);
    table_known = table_known || rest.table.verdict != rt::RestVerdict::absent;
}

std::string sha256(const std::string& text) {
    std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
    unsigned int length = 0;
    if (EVP_Digest(text.data(), text.size(), digest.data(), &length, EVP_sha256(), nullptr) != 1)
        return {};
    std::string hex;
    for (unsigned int i = 0; i < length; ++i) hex += fmt::format("{:02x}", digest[i]);
    return hex;
}

SafetyProof::SafetyProof(ProofSettings settings)
    : settings_(std::move(settings)), keys_sha256_(sha256(settings_.keys)) {}

void SafetyProof::take_over(std::vector<ProofRecord> history) { history_ = std::move(history); }

void SafetyProof::begin(const std::string& by, double table_g) {
    record_ = {};
    record_.by = by;
    record_.table_g = table_g;
    record_.keys = settings_.keys;
    record_.keys_sha256 = keys_sha256_;
    record_.device = device_;
}

void SafetyProof::row(std::string name, std::string unit, double value, double low, double high) {
    record_.rows.push_back({std::move(name), std::move(unit), value, low, high});
}

const ProofRecord& SafetyProof::conclude(std::int64_t utc_ns, const std::string& why) {
    record_.utc_ns = utc_ns;
    record_.message = why;
    for (const CheckRow& row : record_.rows) {
        if (row.passed()) continue;
        record_.message += fmt::format("{}{} {:.4g}{}{}, expected {:.4g} to {:.4g}",
                                       record_.message.empty() ? "" : "; ", row.name, row.value,
                                       row.unit.empty() ? "" : " ", row.unit, row.low, row.high);
    }
    record_.passed = record_.message.empty();
    history_.push_back(record_);
    return history_.back();
}

std::vector<ProofRecord> SafetyProof::with_these_keys() const {
    std::vector<ProofRecord> some;
    std::ranges::copy_if(history_, std::back_inserter(some),
                         [this](const ProofRecord& one) { return of_this_rig(one); });
    return some;
}

std::vector<std::string> SafetyProof::buttons_left() const {
    std::vector<std::string> left = settings_.buttons;
    for (const auto& one : history_)
        if (one.passed && one.emergency_stop && of_this_rig(one)) std::erase(left, one.button);
    return left;
}

const ProofRecord* SafetyProof::newest_passed() const {
    const auto found = std::find_if(history_.rbegin(), history_.rend(),
                                    [](const auto& r) { return r.passed && r.table_g > 0; });
    return found == history_.rend() ? nullptr : &*found;
}

const ProofRecord* SafetyProof::newest_shaken() const {
    const auto found = std::find_if(history_.rbegin(), history_.rend(),
                                    [](const auto& r) { return r.table_g > 0; });
    return found == history_.rend() ? nullptr : &*found;
}

bool SafetyProof::ran_at_zero() const {
    return std::ranges::any_of(history_, [this](const ProofRecord& one) {
        return one.passed && one.table_g == 0 && !one.emergency_stop && of_this_rig(one);
    });
}

std::string SafetyProof::lacks_at_zero() const {
    if (!ran_at_zero())
        return "the controller has not run at 0 g yet: vibrig commission watchdog stop units "
               "excitation";
    std::string names;
    for (const auto& button : buttons_left())
        names += fmt::format("{}\"{}\"", names.empty() ? "" : ", ", button);
    if (names.empty()) return {};
    return fmt::format(
        "the emergency stop was not pressed at 0 g yet ({}), which comes before it shakes for the "
        "first time: vibrig commission stop",
        names);
}

std::string SafetyProof::refusal(std::int64_t utc_ns) const {
    if (!settings_.demanded) return {};
    const std::string what = "the safe state is not proved: ";
    // The last word counts: one that failed is not made good by an older one that passed.
    if (!history_.empty() && !history_.back().passed)
        return what + "the newest proof failed: " + history_.back().message + kRemedy;
    const ProofRecord* shaken = newest_shaken();
    if (shaken == nullptr) return what + "there is no proof" + kRemedy;
    const ProofRecord& newest = *shaken;
    if (!newest.passed) return what + "the newest proof failed: " + newest.message + kRemedy;
    const double age_h = static_cast<double>(utc_ns - newest.utc_ns) / kHour_ns;
    if (age_h < 0)
        return what + fmt::format("the newest proof is {:.1f} h in the future: is the clock right?",
                                  -age_h);
    if (age_h > settings_.valid_h)
        return what +
               fmt::format("it is {:.1f} h old, valid for {:g} h (selftest.proof_valid_h)", age_h,
                           settings_.valid_h) +
               kRemedy;
    if (newest.keys_sha256 != keys_sha256_)
        return what + "since then " + changes(newest.keys, settings_.keys) + kRemedy;
    if (!of_this_device(newest))
        return what +
               fmt::format("the shaker's controller is \"{}\", was \"{}\"", device_,
                           newest.device) +
               kRemedy;
    return {};
}

std::string SafetyProof::advice(std::int64_t utc_ns) const {
    const auto pressed = std::find_if(history_.rbegin(), history_.rend(),
                                      [](const auto& r) { return r.passed && r.emergency_stop; });
    const double days = pressed == history_.rend()
                            ? 0
                            : static_cast<double>(utc_ns - pressed->utc_ns) / (24 * kHour_ns);
    if (pressed != history_.rend() && days <= settings_.emergency_stop_days) return {};
    return (pressed == history_.rend()
                ? std::string("the emergency stop has never been proved")
                : fmt::format("the emergency stop was proved {:.0f} days ago", days)) +
           ": vibrig selftest --by NAME --emergency-stop";
}

std::string SafetyProof::trend() const {
    constexpr std::size_t kFewest = 5;  // earlier ones
    constexpr double kLeast_s = 0.1;    // a poll of the controller, a part of a rest window
    constexpr double kDeviations = 4;   // robust: 1.4826 times the median distance
    if (history_.empty() || !history_.back().passed) return {};
    const ProofRecord& newest = history_.back();
    std::string words;
    for (const char* name : kTimedStops) {
        std::vector<double> earlier, distance;
        for (auto it = history_.begin(); it != std::prev(history_.end()); ++it) {
            const bool like = it->passed && std::abs(it->table_g - newest.table_g) < 1e-9;
            if (const double time_s = value_of(*it, name); like && time_s > 0)
                earlier.push_back(time_s);
        }
        const double now_s = value_of(newest, name);
        if (earlier.size() < kFewest || now_s <= 0) continue;
        const double usual_s = estimator::median(earlier);
        for (const double time_s : earlier) distance.push_back(std::abs(time_s - usual_s));
        if (now_s <=
            usual_s + std::max(kLeast_s, kDeviations * 1.4826 * estimator::median(distance)))
            continue;
        words += fmt::format("{}{} takes longer: {:.2f} s, {:.2f} s in the median of {} earlier",
                             words.empty() ? "" : "; ", name, now_s, usual_s, earlier.size());
    }
    return words;
}

std::string SafetyProof::recording_json() const {
    if (history_.empty()) return {};
    const ProofRecord* shaken = newest_shaken();
    Json past = Json::array();
    for (const ProofRecord& record : history_) {
        Json times;
        for (const char* name : kTimedStops) {
            if (const double time_s = value_of(record, name); time_s > 0) times[name] = time_s;
        }
        past.push_back({{"utc_ns", record.utc_ns}, {"passed", record.passed}, {"times_s", times}});
    }
    return Json{{"demanded", settings_.demanded},
                {"trend", trend()},
                {"newest", Json::parse(to_json(shaken != nullptr ? *shaken : history_.back()))},
                {"history", past}}
        .dump();
}

void SafetyProof::fill(ProofStatus& status, std::int64_t utc_ns) const {
    constexpr std::size_t kShown = 50;
    status.demanded = settings_.demanded;
    status.refusal = refusal(utc_ns);
    status.advice = advice(utc_ns);
    if (history_.empty()) return;
    const ProofRecord& newest = history_.back();
    if (status.utc_ns == newest.utc_ns && !status.history.empty()) return;  // reported already
    status.by = newest.by;
    status.utc_ns = newest.utc_ns;
    status.passed = newest.passed;
    status.message = newest.message;
    status.rows = newest.rows;
    status.history.clear();
    for (std::size_t i = history_.size() - std::min(history_.size(), kShown); i < history_.size();
         ++i) {
        const ProofRecord& record = history_[i];
        status.history.push_back({record.utc_ns, record.passed, value_of(record, "stop, platform"),
                                  value_of(record, "watchdog, rest"),
                                  value_of(record, "stop, table")});
    }
    status.keys_sha256 = newest.keys_sha256;
    status.table_g = newest.table_g;
    status.trend = trend();
}

const ProofRecord* SafetyProof::newest_of_these_keys() const {
    const ProofRecord* newest = newest_shaken();
    return newest == nullptr || !of_this_rig(*newest) ? nullptr : newest;
}

std::optional<double> SafetyProof::transmission() const {
    const ProofRecord* newest = newest_of_these_keys();
    if (newest == nullptr || !(newest->transmission > 0)) return std::nullopt;
    return newest->transmission;
}

std::vector<std::pair<double, double>> SafetyProof::transmissions() const {
    const ProofRecord* newest = newest_of_these_keys();
    return newest == nullptr ? std::vector<std::pair<double, double>>{} : newest->transmissions;
}

std::vector<FoundInStep> SafetyProof::in_step() const {
    const ProofRecord* newest = newest_of_these_keys();
    return newest == nullptr ? std::vector<FoundInStep>{} : newest->in_step;
}

PadRingDown SafetyProof::pads() const {
    const ProofRecord* newest = newest_passed();
    return newest == nullptr ? PadRingDown{} : newest->pads;
}

}  // namespace vibrig::campaign
