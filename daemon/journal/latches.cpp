#include "daemon/journal/latches.hpp"

#include <algorithm>
#include <utility>

#include "proto/person_name.hpp"

namespace vibrig::journal {

namespace {

void append(std::string& words, const std::string& separator, const std::string& more) {
    words += (words.empty() ? "" : separator) + more;
}

}  // namespace

void Latches::add(Latch latch) {
    std::erase_if(open_, [&](const Latch& open) { return open.name == latch.name; });
    open_.push_back(std::move(latch));
}

bool Latches::tripped() const noexcept {
    return std::ranges::any_of(open_, [](const Latch& l) { return l.name != kJournalLatch; });
}

std::string Latches::causes() const {
    std::string words;
    for (const Latch& latch : open_) {
        if (latch.name != kJournalLatch) append(words, "; ", latch.cause);
    }
    return words;
}

const Latch* Latches::find(std::string_view name) const noexcept {
    const auto found = std::ranges::find(open_, name, &Latch::name);
    return found == open_.end() ? nullptr : &*found;
}

Latches::Answer Latches::acknowledge(std::string_view what, const std::string& by) {
    const bool all = what == "trip" || what == "shaker";
    Answer answer;
    std::string over, refused;
    for (Latch& latch : open_) {
        if (all ? latch.name == kJournalLatch : latch.name != what) continue;
        const bool armer = !latch.armed_by.empty() && proto::same_person(latch.armed_by, by);
        const bool again = !latch.first.empty() && proto::same_person(latch.first, by);
        const bool enough = !latch.two_persons || (!latch.armed_by.empty() && !armer) ||
                            (!latch.first.empty() && !again);
        if (enough) {
            answer.over.push_back(latch.name);
            append(over, "; ", latch.cause);
        } else if (again || (armer && !latch.first.empty())) {
            append(refused, "; ",
                   latch.name + ": another person than " + latch.first + " acknowledges it too");
        } else {
            latch.first = by;
            answer.first.push_back(latch.name);
        }
    }
    answer.accepted = !answer.over.empty() || !answer.first.empty();
    std::erase_if(open_, [&](const Latch& latch) {
        return std::ranges::find(answer.over, latch.name) != answer.over.end();
    });
    if (!answer.accepted) {
        answer.words = refused.empty() ? "nothing to acknowledge" : refused;
        return answer;
    }
    if (!over.empty()) answer.words = "acknowledged: " + over;
    for (const std::string& name : answer.first)
        append(answer.words, "; ", name + ": a second person acknowledges it too");
    if (!refused.empty()) append(answer.words, "; ", refused);
    return answer;
}

}  // namespace vibrig::journal
