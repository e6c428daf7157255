// What is written into an index.
#include <soci/soci.h>
#include <spdlog/fmt/fmt.h>

#include <cmath>
#include <filesystem>

#include "daemon/archive/index.hpp"
#include "daemon/record/campaign_file.hpp"
#include "estimator/identification/identification.hpp"

namespace vibrig::archive {

using soci::use;

std::string index_in(const std::string& folder) {
    return (std::filesystem::path(folder) / "recordings.sqlite3").string();
}

void Index::put(const Entry& entry, bool files) {
    database_.guarded([&] {
        Change change(database_.sql());
        auto& sql = database_.sql();
        remove_rows(entry.key);
        if (files) put_files(entry);
        put_rows(entry);
        // It has gone on since: what ended earlier is part of what ended last, whichever was
        // delivered first.
        sql << "UPDATE result SET superseded = 1 WHERE rig = :rig AND campaign IN (SELECT key FROM "
               "campaign WHERE name = :name AND started_utc_ns = :started) AND ended_utc_ns < "
               "(SELECT max(r.ended_utc_ns) FROM result r JOIN campaign c ON c.key = r.campaign "
               "WHERE r.rig = :rig2 AND c.name = :name2 AND c.started_utc_ns = :started2)",
            use(entry.rig, "rig"), use(entry.name, "name"), use(entry.started_utc_ns, "started"),
            use(entry.rig, "rig2"), use(entry.name, "name2"), use(entry.started_utc_ns, "started2");
        change.commit();
    });
}

void Index::remove_rows(const std::string& key) {
    for (const char* table :
         {"result", "coefficient", "covariance", "noise", "instrument", "temperature"})
        database_.sql() << fmt::format("DELETE FROM {} WHERE campaign = :key", table), use(key);
}

void Index::put_files(const Entry& entry) {
    auto& sql = database_.sql();
    sql << "DELETE FROM file WHERE campaign = :key", use(entry.key);
    sql << "DELETE FROM campaign WHERE key = :key", use(entry.key);
    sql << "INSERT INTO campaign (key, name, started_by, started_utc_ns, state) VALUES (:key, "
           ":name, :by, :started, :state)",
        use(entry.key), use(entry.name), use(entry.started_by), use(entry.started_utc_ns),
        use(entry.state);
    std::string name, sha256;
    int part = 0;
    std::int64_t bytes = 0;
    soci::statement insert =
        (sql.prepare
             << "INSERT INTO file (campaign, name, part, closed, from_utc_ns, to_utc_ns, "
                "rows, bytes, sha256) VALUES (:key, :name, :part, 1, 0, 0, 0, :bytes, :sha)",
         use(entry.key), use(name), use(part), use(bytes), use(sha256));
    for (const File& file : entry.files) {
        name = file.name;
        sha256 = file.sha256;
        bytes = file.bytes;
        part = 0;
        for (int n = 1; name.ends_with(".h5") && part == 0 && n <= 1000; ++n)
            if (record::part_name(n) == name) part = n;
        insert.execute(true);
    }
}

void Index::put_rows(const Entry& entry) {
    auto& sql = database_.sql();
    const int simulated = entry.simulated ? 1 : 0;
    sql << "INSERT INTO result (campaign, hash, rig, unit_type, unit_serial, reason, mark, "
           "ended_utc_ns, simulated, version, compiler, instruction_set, configuration_hash, "
           "verdict, sentence, nis, dwells) VALUES (:key, :hash, :rig, :type, :serial, :reason, "
           ":mark, :ended, :simulated, :version, :compiler, :set, :configuration, :verdict, "
           ":sentence, :nis, :dwells)",
        use(entry.key), use(entry.hash), use(entry.rig), use(entry.unit_type),
        use(entry.unit_serial), use(entry.reason), use(entry.mark), use(entry.ended_utc_ns),
        use(simulated), use(entry.version), use(entry.compiler), use(entry.instruction_set),
        use(entry.configuration_hash), use(entry.verdict), use(entry.sentence), use(entry.nis),
        use(entry.dwells);
    int position = 0;
    std::string name;
    Coefficient c;
    double at_hz = 0;
    soci::indicator noted = soci::i_null;
    soci::statement insert =
        (sql.prepare << "INSERT INTO coefficient (campaign, position, name, value, sigma, u_a, u, "
                        "expanded, at_hz) VALUES (:key, :position, :name, :value, :sigma, :ua, :u, "
                        ":big, :hz)",
         use(entry.key), use(position), use(name), use(c.value), use(c.sigma), use(c.u_a), use(c.u),
         use(c.expanded), use(at_hz, noted));
    bool any = false;
    for (std::size_t i = 0; i < entry.coefficients.size(); ++i) {
        if (!entry.coefficients[i]) continue;
        any = true;
        position = static_cast<int>(i);
        name = estimator::parameter_names()[i];
        c = *entry.coefficients[i];
        at_hz = c.at_hz.value_or(0);
        noted = c.at_hz ? soci::i_ok : soci::i_null;
        insert.execute(true);
    }
    if (any && !entry.covariance.empty()) {
        std::string text;
        for (const double v : entry.covariance)
            text += (text.empty() ? "" : " ") + (std::isfinite(v) ? fmt::format("{:.9g}", v) : "-");
        sql << "INSERT INTO covariance (campaign, lower_triangle) VALUES (:key, :text)",
            use(entry.key), use(text);
    }
    for (const auto& [what, value] : entry.noise)
        if (std::isfinite(value))
            sql << "INSERT INTO noise (campaign, name, value) VALUES (:key, :name, :value)",
                use(entry.key), use(what), use(value);
    for (const Instrument& of : entry.instruments)
        sql << "INSERT INTO instrument (campaign, name, serial, certificate, due) VALUES (:key, "
               ":name, :serial, :certificate, :due)",
            use(entry.key), use(of.name), use(of.serial), use(of.certificate), use(of.due);
    for (const Temperature& of : entry.temperatures)
        sql << "INSERT INTO temperature (campaign, sensor, mean_c, low_c, high_c) VALUES (:key, "
               ":sensor, :mean, :low, :high)",
            use(entry.key), use(of.sensor), use(of.mean), use(of.low), use(of.high);
}

void Index::note_vibration(const Entry& entry) {
    database_.guarded([&] {
        Change change(database_.sql());
        for (std::size_t i = 0; i < entry.coefficients.size(); ++i) {
            const auto& c = entry.coefficients[i];
            if (!c || !c->at_hz) continue;
            const int position = static_cast<int>(i);
            database_.sql() << "UPDATE coefficient SET at_hz = :hz WHERE campaign = :key AND "
                               "position = :position AND at_hz IS NULL",
                use(*c->at_hz), use(entry.key), use(position);
        }
        change.commit();
    });
}

void Index::forget(const std::string& key) {
    database_.guarded([&] {
        Change change(database_.sql());
        auto& sql = database_.sql();
        remove_rows(key);
        sql << "DELETE FROM file WHERE campaign = :key", use(key);
        sql << "DELETE FROM campaign WHERE key = :key", use(key);
        change.commit();
    });
}

}  // namespace vibrig::archive
