#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "daemon/archive/deliver.hpp"
#include "daemon/serve/documents.hpp"

namespace vibrig::tool {

/// An archive as pages: units, a unit's trend, a campaign, its files; no script, nothing from
/// elsewhere. Each request opens the index anew, so that a server that was gone is met again.
class ArchivePages {
  public:
    explicit ArchivePages(archive::Place place) : place_(std::move(place)) {}
    /// As serve::Documents.
    [[nodiscard]] serve::Document answer(std::string_view path, std::string_view query) const;

  private:
    [[nodiscard]] std::string front(archive::Index& index) const;
    [[nodiscard]] std::string unit(const std::vector<archive::Entry>& campaigns) const;
    [[nodiscard]] std::string campaign(archive::Index& index, const archive::Entry& entry) const;
    [[nodiscard]] serve::Document file(const archive::Entry& entry, std::string_view name) const;

    archive::Place place_;
};

}  // namespace vibrig::tool
