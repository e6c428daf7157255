#pragma once

#include <map>
#include <string>

#include "daemon/record/campaign_file.hpp"

namespace vibrig::record {

/// That the files in a folder are those of one campaign, and all of them. Each member throws
/// std::runtime_error with what is missing or is another's.
class WholeCampaign {
  public:
    /// `parts`: by their numbers, not empty; none below the last may be missing.
    WholeCampaign(std::string folder, std::string campaign, std::map<int, std::string> parts);
    void check(int number, const Campaign& part) const;
    /// `state` of the last one: that the campaign goes on is written when the next one is open.
    void check_end(const std::string& state) const;

  private:
    std::string folder_, campaign_;
    std::map<int, std::string> parts_;
};

}  // namespace vibrig::record
