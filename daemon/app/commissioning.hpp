#pragma once

#include <memory>
#include <string>

#include "daemon/app/commission_rig.hpp"
#include "daemon/app/outside.hpp"
#include "daemon/commission/book.hpp"
#include "daemon/commission/procedure.hpp"
#include "daemon/commission/progress.hpp"

namespace vibrig {

/// Commissioning at the local socket: a person's permissions and answers go to the procedure.
/// Control thread.
class Commissioning final : private commission::Keeper {
  public:
    /// All outlive it.
    Commissioning(Parts& parts, const Outside& outside, const commission::Book& book)
        : parts_(parts), outside_(outside), book_(book) {}

    /// `word` is what["do"]: begin, answer, answers, stop or end.
    [[nodiscard]] CommandReply command(const CommandRequest& request, const std::string& word,
                                       const commission::Json& what, drivers::Time now);
    /// The tool of this person is there.
    void attend(const std::string& by);
    /// Returns when to be called next at the latest.
    [[nodiscard]] drivers::Time step(drivers::Time now);

    [[nodiscard]] bool active() const noexcept { return procedure_ && procedure_->active(); }
    /// Who does what, on one line; empty: nobody anything.
    [[nodiscard]] std::string progress() const { return active() ? procedure_->progress() : ""; }
    /// Question, lines from number `after` on, and what was found; null before the first one.
    [[nodiscard]] commission::Json state(std::size_t after) const {
        return procedure_ ? procedure_->state(after) : commission::Json();
    }
    /// What the last one has decided; null: it has not.
    [[nodiscard]] const commission::Finding* decided() const noexcept;
    /// What was decided is in the record: what was kept on the way is not needed any more.
    void recorded() const { kept().remove(); }
    /// Into the journal. `row.by` as the audit has it: the name, and who the socket says it was.
    void enter(journal::Commissioned row);

  private:
    [[nodiscard]] CommandReply begin(const CommandRequest& request, const commission::Json& what,
                                     drivers::Time now);
    [[nodiscard]] commission::Progress kept() const;
    void end(drivers::Time now);
    void warn(const std::string& text);

    void event(const std::string& text) override;
    void note(const commission::Note& note) override;
    void keep(const commission::Json& log) override;

    Parts& parts_;
    const Outside& outside_;
    const commission::Book& book_;
    const configuration::Configuration& configuration_ = parts_.configuration;
    CommissionRig rig_{parts_};
    std::unique_ptr<commission::Procedure> procedure_;  ///< made when it is asked for
};

}  // namespace vibrig
