// What an index is asked.
#include "daemon/archive/index.hpp"

#include <soci/soci.h>

#include <algorithm>
#include <limits>
#include <sstream>

namespace vibrig::archive {

using soci::into;
using soci::use;

namespace {

/// The conditions of a filter, with the values that they need.
class Where {
  public:
    explicit Where(const Filter& filter) : filter_(filter) {
        add(!filter_.serial.empty(), "r.unit_serial = :serial");
        add(!filter_.type.empty(), "r.unit_type = :type");
        add(!filter_.rig.empty(), "r.rig = :rig");
        add(!filter_.verdict.empty(), "r.verdict = :verdict");
        add(!filter_.name.empty(), "c.name = :name");
        add(filter_.since_utc_ns != 0, "c.started_utc_ns >= :since");
        add(filter_.until_utc_ns != 0, "c.started_utc_ns < :until");
        add(!filter_.superseded, "coalesce(r.superseded, 0) = 0");
    }
    [[nodiscard]] const std::string& text() const { return text_; }
    void bind(soci::statement& to) const {
        if (!filter_.serial.empty()) to.exchange(use(filter_.serial, "serial"));
        if (!filter_.type.empty()) to.exchange(use(filter_.type, "type"));
        if (!filter_.rig.empty()) to.exchange(use(filter_.rig, "rig"));
        if (!filter_.verdict.empty()) to.exchange(use(filter_.verdict, "verdict"));
        if (!filter_.name.empty()) to.exchange(use(filter_.name, "name"));
        if (filter_.since_utc_ns != 0) to.exchange(use(filter_.since_utc_ns, "since"));
        if (filter_.until_utc_ns != 0) to.exchange(use(filter_.until_utc_ns, "until"));
    }

  private:
    void add(bool wanted, const char* condition) {
        if (wanted) text_ += (text_.empty() ? " WHERE " : " AND ") + std::string(condition);
    }
    const Filter& filter_;
    std::string text_;
};

void prepare(soci::statement& statement, const std::string& text) {
    statement.alloc();
    statement.prepare(text);
    statement.define_and_bind();
    statement.execute();
}

std::vector<double> numbers_of(const std::string& text) {
    std::vector<double> numbers;
    std::istringstream words(text);
    for (std::string word; words >> word;)
        numbers.push_back(word == "-" ? std::numeric_limits<double>::quiet_NaN()
                                      : std::strtod(word.c_str(), nullptr));
    return numbers;
}

}  // namespace

std::optional<std::string> Index::key_of(const std::string& hash) {
    return database_.guarded([&]() -> std::optional<std::string> {
        std::string key;
        soci::indicator known = soci::i_null;
        database_.sql() << "SELECT max(campaign) FROM result WHERE hash = :hash", use(hash),
            into(key, known);
        if (known != soci::i_ok) return {};
        return key;
    });
}

std::vector<std::string> Index::rivals_of(const Entry& entry) {
    return database_.guarded([&] {
        std::string key;
        soci::statement ask =
            (database_.sql().prepare
                 << "SELECT c.key FROM campaign c JOIN result r ON r.campaign = c.key WHERE "
                    "c.name = :name AND c.started_utc_ns = :started AND (r.rig = :rig OR "
                    "nullif(r.unit_serial, '') = :serial) AND r.ended_utc_ns = :ended AND r.hash "
                    "<> :hash AND c.key <> :key ORDER BY c.key",
             use(entry.name, "name"), use(entry.started_utc_ns, "started"), use(entry.rig, "rig"),
             use(entry.unit_serial, "serial"), use(entry.ended_utc_ns, "ended"),
             use(entry.hash, "hash"), use(entry.key, "key"), into(key));
        ask.execute();
        std::vector<std::string> found;
        while (ask.fetch()) found.push_back(key);
        return found;
    });
}

std::vector<Entry> Index::campaigns(const Filter& filter) {
    return database_.guarded([&] {
        const Where where(filter);
        soci::statement ask(database_.sql());
        Entry one;
        int simulated = 0, superseded = 0;
        where.bind(ask);
        ask.exchange(into(one.key));
        for (auto* text :
             {&one.name, &one.started_by, &one.state, &one.hash, &one.rig, &one.unit_type,
              &one.unit_serial, &one.reason, &one.mark, &one.version, &one.compiler,
              &one.instruction_set, &one.configuration_hash, &one.verdict, &one.sentence})
            ask.exchange(into(*text));
        for (auto* number : {&one.started_utc_ns, &one.ended_utc_ns, &one.dwells})
            ask.exchange(into(*number));
        ask.exchange(into(one.nis));
        ask.exchange(into(simulated));
        ask.exchange(into(superseded));
        std::string text =
            "SELECT c.key, c.name, c.started_by, c.state, coalesce(r.hash, ''), coalesce(r.rig, "
            "''), coalesce(r.unit_type, ''), coalesce(r.unit_serial, ''), coalesce(r.reason, ''), "
            "coalesce(r.mark, ''), coalesce(r.version, ''), coalesce(r.compiler, ''), "
            "coalesce(r.instruction_set, ''), coalesce(r.configuration_hash, ''), "
            "coalesce(r.verdict, ''), coalesce(r.sentence, ''), c.started_utc_ns, "
            "coalesce(r.ended_utc_ns, 0), coalesce(r.dwells, 0), coalesce(r.nis, 0), "
            "coalesce(r.simulated, 0), coalesce(r.superseded, 0) FROM campaign c LEFT JOIN result "
            "r ON r.campaign = c.key" +
            where.text() + " ORDER BY c.started_utc_ns DESC, c.key DESC";
        if (filter.newest > 0) text += " LIMIT " + std::to_string(filter.newest);
        prepare(ask, text);
        std::vector<Entry> found;
        while (ask.fetch()) {
            one.simulated = simulated != 0;
            one.superseded = superseded != 0;
            found.push_back(one);
        }
        std::ranges::reverse(found);
        return found;
    });
}

void Index::take_coefficients(const Filter& filter, std::map<std::string, Entry*>& by_key) {
    const Where where(filter);
    soci::statement ask(database_.sql());
    std::string key;
    int position = 0;
    Coefficient c;
    double at_hz = 0;
    soci::indicator noted = soci::i_null;
    where.bind(ask);
    ask.exchange(into(key));
    ask.exchange(into(position));
    for (auto* number : {&c.value, &c.sigma, &c.u_a, &c.u, &c.expanded})
        ask.exchange(into(*number));
    ask.exchange(into(at_hz, noted));
    prepare(ask,
            "SELECT k.campaign, k.position, k.value, k.sigma, k.u_a, k.u, k.expanded, k.at_hz FROM "
            "result r JOIN campaign c ON c.key = r.campaign JOIN coefficient k ON k.campaign = "
            "r.campaign" +
                where.text());
    while (ask.fetch()) {
        const auto of = by_key.find(key);
        if (of == by_key.end() || position < 0 ||
            static_cast<std::size_t>(position) >= estimator::kParameters)
            continue;
        c.at_hz = noted == soci::i_ok ? std::optional(at_hz) : std::nullopt;
        of->second->coefficients[static_cast<std::size_t>(position)] = c;
    }
}

std::vector<Entry> Index::results(const Filter& filter, bool covariance) {
    auto found = campaigns(filter);
    std::erase_if(found, [](const Entry& one) { return one.hash.empty(); });
    std::map<std::string, Entry*> by_key;
    for (Entry& one : found) by_key[one.key] = &one;
    database_.guarded([&] {
        take_coefficients(filter, by_key);
        if (!covariance) return;
        const Where where(filter);
        soci::statement ask(database_.sql());
        std::string key, text;
        where.bind(ask);
        ask.exchange(into(key));
        ask.exchange(into(text));
        prepare(ask,
                "SELECT k.campaign, k.lower_triangle FROM result r JOIN campaign c ON c.key = "
                "r.campaign JOIN covariance k ON k.campaign = r.campaign" +
                    where.text());
        while (ask.fetch())
            if (const auto of = by_key.find(key); of != by_key.end())
                of->second->covariance = numbers_of(text);
    });
    return found;
}

std::optional<Entry> Index::campaign(const std::string& key) {
    return database_.guarded([&]() -> std::optional<Entry> {
        auto& sql = database_.sql();
        std::string serial, hash;
        std::int64_t started = 0;
        soci::indicator known = soci::i_null;
        sql << "SELECT c.started_utc_ns, coalesce(r.unit_serial, ''), coalesce(r.hash, '') FROM "
               "campaign c LEFT JOIN result r ON r.campaign = c.key WHERE c.key = :key",
            use(key), into(started, known), into(serial), into(hash);
        if (!sql.got_data()) return {};
        Filter filter;
        filter.serial = serial;
        filter.since_utc_ns = started;
        filter.until_utc_ns = started + 1;
        filter.superseded = true;
        for (Entry& one : hash.empty() ? campaigns(filter) : results(filter, true)) {
            if (one.key != key) continue;
            one.files = files(key);
            Instrument instrument;
            soci::statement instruments =
                (sql.prepare << "SELECT name, serial, certificate, due FROM instrument WHERE "
                                "campaign = :key",
                 use(key), into(instrument.name), into(instrument.serial),
                 into(instrument.certificate), into(instrument.due));
            instruments.execute();
            while (instruments.fetch()) one.instruments.push_back(instrument);
            Temperature of;
            soci::statement temperatures =
                (sql.prepare << "SELECT sensor, mean_c, low_c, high_c FROM temperature WHERE "
                                "campaign = :key ORDER BY sensor",
                 use(key), into(of.sensor), into(of.mean), into(of.low), into(of.high));
            temperatures.execute();
            while (temperatures.fetch()) one.temperatures.push_back(of);
            std::pair<std::string, double> noise;
            soci::statement noises =
                (sql.prepare << "SELECT name, value FROM noise WHERE campaign = :key ORDER BY name",
                 use(key), into(noise.first), into(noise.second));
            noises.execute();
            while (noises.fetch()) one.noise.push_back(noise);
            return one;
        }
        return {};
    });
}

std::vector<Unit> Index::units() {
    return database_.guarded([&] {
        Unit one;
        soci::statement ask =
            (database_.sql().prepare
                 << "SELECT r.unit_serial, max(r.unit_type), count(*), max(c.started_utc_ns), "
                    "coalesce((SELECT n.verdict FROM result n JOIN campaign d ON d.key = "
                    "n.campaign WHERE n.unit_serial = r.unit_serial AND n.superseded = 0 ORDER BY "
                    "d.started_utc_ns DESC LIMIT 1), '') FROM result r JOIN campaign c ON c.key = "
                    "r.campaign WHERE r.superseded = 0 AND r.unit_serial IN (SELECT q.unit_serial "
                    "FROM (SELECT m.unit_serial, b.started_utc_ns FROM campaign b JOIN result m "
                    "ON m.campaign = b.key ORDER BY b.started_utc_ns DESC LIMIT " +
                        std::to_string(kOfNewest) +
                        ") q) GROUP BY r.unit_serial ORDER BY r.unit_serial",
             into(one.serial), into(one.type), into(one.campaigns), into(one.last_utc_ns),
             into(one.verdict));
        ask.execute();
        std::vector<Unit> found;
        while (ask.fetch()) found.push_back(one);
        return found;
    });
}

std::vector<File> Index::files(const std::string& key) {
    return database_.guarded([&] {
        File one;
        soci::statement ask = (database_.sql().prepare
                                   << "SELECT name, bytes, sha256 FROM file WHERE campaign = :key "
                                      "ORDER BY name",
                               use(key), into(one.name), into(one.bytes), into(one.sha256));
        ask.execute();
        std::vector<File> found;
        while (ask.fetch()) found.push_back(one);
        return found;
    });
}

std::vector<std::string> Index::without_result() {
    return database_.guarded([&] {
        std::string key;
        soci::statement ask =
            (database_.sql().prepare
                 << "SELECT c.key FROM campaign c LEFT JOIN result r ON r.campaign = c.key WHERE "
                    "r.campaign IS NULL AND c.state <> 'running' ORDER BY c.key",
             into(key));
        ask.execute();
        std::vector<std::string> found;
        while (ask.fetch()) found.push_back(key);
        return found;
    });
}

}  // namespace vibrig::archive
