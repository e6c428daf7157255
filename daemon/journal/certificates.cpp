#include "daemon/journal/certificates.hpp"

#include "daemon/journal/database.hpp"

namespace vibrig::journal {

namespace {
constexpr const char* kTable = R"(
CREATE TABLE IF NOT EXISTS certificate (id INTEGER PRIMARY KEY, utc_ns INTEGER NOT NULL,
    number TEXT NOT NULL UNIQUE, campaign TEXT NOT NULL, person TEXT NOT NULL,
    pdf_sha256 TEXT NOT NULL, json_sha256 TEXT NOT NULL);
)";
}  // namespace

bool certificate_issued(const std::string& path, const std::string& number) {
    Database database(path);
    database.execute(kTable);
    return !database.ask("SELECT id FROM certificate WHERE number = ?", {std::string_view(number)})
                .empty();
}

void note_certificate(const std::string& path, const IssuedCertificate& c) {
    Database database(path);
    database.execute(kTable);
    database.run(
        "INSERT INTO certificate (utc_ns, number, campaign, person, pdf_sha256, json_sha256) "
        "VALUES (?, ?, ?, ?, ?, ?)",
        {c.utc_ns, std::string_view(c.number), std::string_view(c.campaign),
         std::string_view(c.person), std::string_view(c.pdf_sha256),
         std::string_view(c.json_sha256)});
}

}  // namespace vibrig::journal
