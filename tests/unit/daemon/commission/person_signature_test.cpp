#include "daemon/commission/person_signature.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "daemon/commission/book.hpp"
#include "daemon/journal/signing_key.hpp"
#include "daemon/serve/pki.hpp"
#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::commission {
namespace {

using ::testing::HasSubstr;

constexpr std::int64_t kSecond_ns = 1'000'000'000;

/// A laboratory's authority, Ada of it, and an Ada of another one.
class Signed : public ::testing::Test {
  protected:
    void SetUp() override {
        std::filesystem::create_directories(folder);
        const auto lab = authority("lab"), other = authority("other");
        person("ada", "Ada", lab);
        person("bo", "Bo", lab);
        person("forged", "Ada", other);
    }

    serve::Identity authority(const std::string& name) const {
        serve::CertificateSettings settings;
        settings.use = serve::CertificateSettings::Use::authority;
        settings.common_name = name;
        const auto made = serve::make_identity(settings);
        put(name + ".crt", made.certificate);
        return made;
    }
    void person(const std::string& file, const std::string& name,
                const serve::Identity& issuer) const {
        serve::CertificateSettings settings;
        settings.common_name = name;
        settings.role = "operator";
        const auto made = serve::make_identity(settings, &issuer);
        put(file + ".crt", made.certificate);
        put(file + ".key", made.key);
    }
    void put(const std::string& name, const std::string& text) const {
        std::ofstream(folder / name, std::ios::binary) << text;
    }
    [[nodiscard]] std::string at(const std::string& name) const { return (folder / name).string(); }
    [[nodiscard]] std::string by(const std::string& who, const std::string& text) const {
        return sign_detached(text, at(who + ".crt"), at(who + ".key"));
    }

    [[nodiscard]] configuration::Loaded loaded(const std::string& more = {}) const {
        return configuration::parse("[commission]\nenforce = true\nsimulated = true\nfolder = \"" +
                                        folder.string() + "\"\n[server]\nclients_ca = \"" +
                                        at("lab.crt") + "\"\n" + more,
                                    "/rig.toml", false);
    }
    void prove(Book& book, const configuration::Loaded& as) const {
        PartRecord what;
        what.by = {"Ada", "Bo"};
        what.utc_ns = now;
        what.evidence = {{"ln_ratio", 13200}, {"rms_mg", 0.1}};
        what.version = "1";
        book.prove({kParts.begin(), kParts.end()}, what, as);
    }
    [[nodiscard]] static std::string statement(const Book& book, const std::vector<Part>& parts) {
        const Json status = book.status(now);
        std::map<Part, std::string> digests;
        for (const Part part : parts) digests[part] = status["parts"][name_of(part)]["digest"];
        return statement_of(status["rig"], digests);
    }
    /// What stands, and who has signed it.
    [[nodiscard]] static Standing of(const Book& book, Part part) {
        return book.standing(now)[static_cast<std::size_t>(part)];
    }
    /// The record says something else of a part, and every hash and the daemon's own signature are
    /// made anew, as root can.
    void forge(Part part, const std::string& key, const std::string& value) const {
        std::ifstream in(folder / "record.json");
        auto record = record_from_json({std::istreambuf_iterator<char>(in), {}});
        record.parts.at(part).keys.at(key) = value;
        const journal::SigningKey daemons(at("record.key"));
        put("record.json", to_json(record, &daemons));
    }

    static inline const std::int64_t now = std::time(nullptr) * kSecond_ns;
    TemporaryFolder folder;
};

TEST_F(Signed, ATextIsThatOfWhoHasSignedIt) {
    const std::string text = "gimbals 0123\n", cms = by("ada", text);
    EXPECT_EQ(signer_of_detached(text, cms, at("lab.crt"), now), "Ada");
    // A certificate that has run out since takes nothing back, one that was not yet valid does.
    EXPECT_EQ(signer_of_detached(text, cms, at("lab.crt"), now + 3600 * kSecond_ns), "Ada");
    const auto refused = [this](const std::string& of, const std::string& signature,
                                std::int64_t when) {
        EXPECT_THROW(static_cast<void>(signer_of_detached(of, signature, at("lab.crt"), when)),
                     std::invalid_argument);
    };
    refused("gimbals 0124\n", cms, now);
    refused(text, by("forged", text), now);
    refused(text, cms, now - 86400 * 365 * kSecond_ns);
    refused(text, "", now);
    refused(text, cms.substr(0, cms.size() / 2), now);
    refused(text, "no hex", now);
    EXPECT_THROW(static_cast<void>(by("nobody", text)), std::runtime_error);
    EXPECT_THROW(static_cast<void>(sign_detached(text, at("ada.crt"), at("bo.key"))),
                 std::runtime_error);
}

TEST_F(Signed, ARecordIsSignedByParts) {
    const auto as = loaded();
    Book book(as);
    prove(book, as);
    const std::vector<Part> parts{Part::bus, Part::gimbals};
    book.sign(parts, "Ada", by("ada", statement(book, parts)));
    const Book again(as);  // of the file
    EXPECT_EQ(again.trouble(), "");
    EXPECT_TRUE(of(again, Part::gimbals).proven) << of(again, Part::gimbals).why;
    EXPECT_EQ(of(again, Part::gimbals).signed_by, "Ada");
    EXPECT_EQ(of(again, Part::earth).signed_by, "");
    EXPECT_EQ(again.refusal(now), "");
    // Proven anew by somebody who signs nothing, it carries the old signature no longer.
    Book third(as);
    prove(third, as);
    EXPECT_TRUE(of(third, Part::gimbals).proven);
    EXPECT_EQ(of(third, Part::gimbals).signed_by, "");
}

TEST_F(Signed, WhatIsNotThePersonsIsNotTaken) {
    const auto as = loaded();
    Book book(as);
    prove(book, as);
    const std::vector<Part> parts{Part::gimbals};
    const auto text = statement(book, parts);
    const auto refused = [&](const std::vector<Part>& of, const std::string& name,
                             const std::string& cms, const char* word) {
        try {
            book.sign(of, name, cms);
            ADD_FAILURE() << "taken: " << word;
        } catch (const std::invalid_argument& wrong) {
            EXPECT_THAT(wrong.what(), HasSubstr(word));
        }
    };
    refused(parts, "Ada", by("bo", text), "it is that of Bo");
    refused(parts, "Ada", by("forged", text), "");
    refused({Part::earth}, "Ada", by("ada", text), "");
    refused({}, "Ada", by("ada", text), "nothing to sign");
    refused(parts, "Ada", "", "no CMS signature");
    EXPECT_EQ(of(Book(as), Part::gimbals).signed_by, "");
    const auto nobodys = configuration::parse(
        "[commission]\nsimulated = true\nfolder = \"" + folder.string() + "\"\n", "/rig.toml",
        false);
    Book without(nobodys);
    EXPECT_THROW(without.sign(parts, "Ada", by("ada", text)), std::invalid_argument);
}

/// Root reads the daemon's key, and takes a person's signature out; the journal still has it.
TEST_F(Signed, ASignatureThatHasVanishedIsMissed) {
    const auto as = loaded();
    {
        Book book(as);
        prove(book, as);
        const std::vector<Part> parts{Part::gimbals};
        book.sign(parts, "Ada", by("ada", statement(book, parts)));
        EXPECT_TRUE(of(book, Part::gimbals).proven);
    }
    const std::vector<std::pair<std::string, std::string>> journal{{"gimbals", "Ada"}};
    {
        Book whole(as);
        whole.expect_signed(journal);
        EXPECT_TRUE(of(whole, Part::gimbals).proven) << of(whole, Part::gimbals).why;
    }
    std::ifstream in(folder / "record.json");
    auto record = record_from_json({std::istreambuf_iterator<char>(in), {}});
    record.persons.clear();
    const journal::SigningKey daemons(at("record.key"));
    put("record.json", to_json(record, &daemons));
    Book robbed(as);
    EXPECT_TRUE(of(robbed, Part::gimbals).proven) << "by itself it looks right";
    robbed.expect_signed(journal);
    EXPECT_FALSE(of(robbed, Part::gimbals).proven);
    EXPECT_THAT(robbed.refusal(now),
                HasSubstr("the signature of Ada, which the journal has, is gone from the record"));
    EXPECT_TRUE(of(robbed, Part::earth).proven);
    // Proven anew by two persons it needs none.
    prove(robbed, as);
    EXPECT_TRUE(of(robbed, Part::gimbals).proven);
}

TEST_F(Signed, AForgedRecordIsNamedAndVoid) {
    const auto as = loaded();
    Book book(as);
    prove(book, as);
    const std::vector<Part> parts{Part::bus, Part::gimbals};
    book.sign(parts, "Ada", by("ada", statement(book, parts)));
    forge(Part::gimbals, "platform.encoder_sign", "[1, -1, 1]");
    // The configuration says the same: all else fits.
    const auto edited = loaded("[platform]\nencoder_sign = [1, -1, 1]\n");
    const Book forged(edited);
    EXPECT_EQ(forged.trouble(), "");
    for (const Part part : parts) {
        EXPECT_FALSE(of(forged, part).proven);
        EXPECT_THAT(of(forged, part).why,
                    HasSubstr("the signature of Ada is not that of what the record says"));
    }
    EXPECT_THAT(forged.refusal(now), HasSubstr("not commissioned: the signature of Ada"));
    // Of an authority that nobody states any more nobody knows.
    const auto nobodys = configuration::parse(
        "[commission]\nenforce = true\nsimulated = true\nfolder = \"" + folder.string() + "\"\n",
        "/rig.toml", false);
    EXPECT_THAT(of(Book(nobodys), Part::bus).why, HasSubstr("server.clients_ca"));
}

}  // namespace
}  // namespace vibrig::commission
