#include "daemon/tool/design/plan_terms.hpp"

#include <algorithm>
#include <stdexcept>

namespace vibrig::tool::planner {

estimator::plan::Terms terms_without(const std::vector<std::string>& names) {
    const auto& all = estimator::plan::kTermNames;
    estimator::plan::Terms terms = estimator::plan::kAllTerms;
    for (const std::string& name : names) {
        const auto at = std::find(all.begin(), all.end(), name);
        if (at == all.end()) {
            throw std::runtime_error("--without: found \"" + name +
                                     "\", expected one of D0 D1 D2 D3 D11 D22 D33 D12 D13 D23");
        }
        terms[static_cast<std::size_t>(at - all.begin())] = false;
    }
    if (std::none_of(terms.begin(), terms.end(), [](bool has) { return has; }))
        throw std::runtime_error("--without: found all ten terms, expected one left at least");
    return terms;
}

}  // namespace vibrig::tool::planner
