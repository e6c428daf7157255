import os, shutil
os.chdir('/work/wt/journal')
def sub(p,a,b,n=1):
    s=open(p).read()
    assert a in s,(p,a[:80])
    s=s.replace(a,b,n); open(p,'w').write(s)
for f in ('chain.cpp','chain.hpp','chained_file.cpp','chained_file.hpp','signing_key.cpp','signing_key.hpp','verify.cpp','verify.hpp','journal.cpp','journal.hpp','database.cpp','database.hpp'):
    shutil.copy('/tmp/h9/'+f,'daemon/journal/'+f)
shutil.copy('/tmp/h9/tool_journal.cpp','daemon/tool/journal.cpp')
shutil.copy('/tmp/h9/chain_test.cpp','tests/unit/journal/chain_test.cpp')
sub('tests/unit/journal/CMakeLists.txt','add_executable(journal_test journal_test.cpp','add_executable(journal_test chain_test.cpp journal_test.cpp')
p='daemon/journal/CMakeLists.txt'
sub(p,'STATIC checkpoint.cpp database.cpp journal.cpp latches.cpp','STATIC chain.cpp chained_file.cpp checkpoint.cpp database.cpp journal.cpp latches.cpp\n    signing_key.cpp verify.cpp')
sub(p,'PkgConfig::SQLITE ZLIB','PkgConfig::SQLITE OpenSSL::Crypto ZLIB')
sub(p,'find_package(ZLIB REQUIRED)','find_package(OpenSSL 3.0 REQUIRED)\nfind_package(ZLIB REQUIRED)')
sub('daemon/tool/CMakeLists.txt','vibrig::plan vibrig::record','vibrig::journal vibrig::plan vibrig::record')
sub('daemon/tool/commands.hpp','void add_pki(','void add_journal(CLI::App& app, int& exit_code);\nvoid add_pki(')
sub('daemon/tool/vibrig.cpp','    vibrig::tool::add_pki(','    vibrig::tool::add_journal(app, exit_code);\n    vibrig::tool::add_pki(')
sub('daemon/status.hpp','''    std::uint64_t taken = 0, written = 0, dropped = 0;  ///< entries; taken = written + waiting
''','''    std::uint64_t taken = 0, written = 0, dropped = 0;  ///< entries; taken = written + waiting
    std::string public_key;  ///< its head is signed with, Ed25519, hex
    std::string head;        ///< hash of the newest entry of its chain, hex
    std::uint64_t entries = 0;
    bool verified = false;  ///< the whole of it, since the start
''')
sub('proto/vibrig.proto','''    uint64 dropped = 6;    // not taken: too many waited
}
''','''    uint64 dropped = 6;    // not taken: too many waited
    string public_key = 70;  // that its head is signed with: Ed25519, hexadecimal
    string head = 71;      // SHA-256 of the newest entry of its chain, hexadecimal
    uint64 entries = 72;   // of the chain
    bool verified = 73;    // all of it is what was written, as looked at since the start
}
''')
sub('daemon/serve/status_message.cpp','''    journal.set_dropped(status.journal.dropped);
''','''    journal.set_dropped(status.journal.dropped);
    journal.set_public_key(status.journal.public_key);
    journal.set_head(status.journal.head);
    journal.set_entries(status.journal.entries);
    journal.set_verified(status.journal.verified);
''')
p='daemon/daemon_unattended.cpp'
sub(p,'''    take_over_latches();
''','''    if (const auto& begins = journal_->recovery().begins; !begins.empty())
        log(Severity::info, "journal", begins);
    take_over_latches();
''')
sub(p,'''    const auto status = journal_->status();
    if (std::exchange(journal_was''','''    for (const std::string& found : journal_->take_found()) {
        latches_.add({journal::kJournalLatch, found, {}, {}, false, utc_now()});
        log(Severity::alarm, "journal", found);
    }
    const auto status = journal_->status();
    if (std::exchange(journal_was''')
p='daemon/daemon_commands.cpp'
sub(p,'''    if (arming_) return "another arming''','''    if (journal_ && !journal_->status().verified)
        return "the journal is still being verified: vibrig status --json, journal.verified";
    if (arming_) return "another arming''')
p='daemon/serve/readiness.cpp'
s=open(p).read()
a=s.index('    const auto& journal = status.journal;'); b=s.index('    add("losses"')
s=s[:a]+'''    const auto& journal = status.journal;
    std::string changed;
    for (const Latch& latch : status.interlock.latches) {
        if (latch.name == "journal") changed = latch.cause + ": vibrig ack journal";
    }
    add("journal", journal.path.empty() || (journal.running && changed.empty()),
        journal.path.empty() ? "none is kept"
        : !changed.empty()   ? changed
        : !journal.running   ? journal.note
        : journal.verified   ? "writes, as it was written"
                             : "writes, being verified");
'''+s[b:]
open(p,'w').write(s)
