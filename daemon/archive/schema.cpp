#include "daemon/archive/schema.hpp"

namespace vibrig::archive {

namespace {

/// As record::Index makes them.
const std::vector<std::string> kRecordings{
    R"(CREATE TABLE IF NOT EXISTS campaign (key TEXT PRIMARY KEY, name TEXT NOT NULL,
        started_by TEXT NOT NULL, started_utc_ns BIGINT NOT NULL, state TEXT NOT NULL))",
    R"(CREATE TABLE IF NOT EXISTS file (campaign TEXT NOT NULL, name TEXT NOT NULL,
        part INTEGER NOT NULL, closed INTEGER NOT NULL, from_utc_ns BIGINT NOT NULL,
        to_utc_ns BIGINT NOT NULL, rows BIGINT NOT NULL, bytes BIGINT NOT NULL,
        sha256 TEXT NOT NULL, PRIMARY KEY (campaign, name)))"};

const std::vector<std::string> kResults{
    R"(CREATE TABLE result (campaign TEXT PRIMARY KEY, hash TEXT NOT NULL, rig TEXT NOT NULL,
        unit_type TEXT NOT NULL, unit_serial TEXT NOT NULL, reason TEXT NOT NULL,
        mark TEXT NOT NULL, ended_utc_ns BIGINT NOT NULL, simulated INTEGER NOT NULL,
        version TEXT NOT NULL, compiler TEXT NOT NULL, instruction_set TEXT NOT NULL,
        configuration_hash TEXT NOT NULL, verdict TEXT NOT NULL, sentence TEXT NOT NULL,
        nis DOUBLE PRECISION NOT NULL, dwells BIGINT NOT NULL))",
    R"(CREATE TABLE coefficient (campaign TEXT NOT NULL, position INTEGER NOT NULL,
        name TEXT NOT NULL, value DOUBLE PRECISION NOT NULL, sigma DOUBLE PRECISION NOT NULL,
        u_a DOUBLE PRECISION NOT NULL, u DOUBLE PRECISION NOT NULL,
        expanded DOUBLE PRECISION NOT NULL, PRIMARY KEY (campaign, position)))",
    R"(CREATE TABLE covariance (campaign TEXT PRIMARY KEY, lower_triangle TEXT NOT NULL))",
    R"(CREATE TABLE noise (campaign TEXT NOT NULL, name TEXT NOT NULL,
        value DOUBLE PRECISION NOT NULL, PRIMARY KEY (campaign, name)))",
    R"(CREATE TABLE instrument (campaign TEXT NOT NULL, name TEXT NOT NULL,
        serial TEXT NOT NULL, certificate TEXT NOT NULL, due TEXT NOT NULL))",
    R"(CREATE TABLE temperature (campaign TEXT NOT NULL, sensor TEXT NOT NULL,
        mean_c DOUBLE PRECISION NOT NULL, low_c DOUBLE PRECISION NOT NULL,
        high_c DOUBLE PRECISION NOT NULL, PRIMARY KEY (campaign, sensor)))"};

const std::vector<std::string> kManyCampaigns{
    "ALTER TABLE result ADD COLUMN superseded INTEGER NOT NULL DEFAULT 0",
    "CREATE UNIQUE INDEX result_hash ON result (hash)",
    "CREATE INDEX result_unit ON result (unit_serial)",
    "CREATE INDEX instrument_campaign ON instrument (campaign)",
    "CREATE INDEX campaign_started ON campaign (started_utc_ns)"};

/// NULL: noted before there was this column, or a linear one's.
const std::vector<std::string> kVibration{
    "ALTER TABLE coefficient ADD COLUMN at_hz DOUBLE PRECISION"};

}  // namespace

const std::vector<std::vector<std::string>>& migrations() {
    static const std::vector<std::vector<std::string>> all{kRecordings, kResults, kManyCampaigns,
                                                           kVibration};
    return all;
}

int newest_version() { return static_cast<int>(migrations().size()); }

}  // namespace vibrig::archive
