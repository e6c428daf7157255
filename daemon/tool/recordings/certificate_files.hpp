#pragma once

#include <string>
#include <vector>

namespace vibrig::tool {

/// OUTPUT.html, .json and .pdf of a certificate: under names of their own until it is issued, and
/// never in another one's place. All throw std::runtime_error that names the file.
class CertificateFiles {
  public:
    /// Refuses what is there already.
    explicit CertificateFiles(std::string output);
    /// Takes away what is neither issued nor to be kept.
    ~CertificateFiles();
    CertificateFiles(const CertificateFiles&) = delete;
    CertificateFiles& operator=(const CertificateFiles&) = delete;

    /// Where to write that of this kind, ".pdf".
    [[nodiscard]] std::string path(const char* kind) const;
    /// From now on nobody else gets the names.
    void take_names();
    /// Whether they stay whatever happens: they may be in the journal.
    void keep(bool kept) { kept_ = kept; }
    /// They get their names.
    void issue();
    /// In words, where they are so far.
    [[nodiscard]] std::string whereabouts() const;

  private:
    std::string output_, own_;
    std::vector<std::string> taken_;
    bool kept_ = false;
};

}  // namespace vibrig::tool
