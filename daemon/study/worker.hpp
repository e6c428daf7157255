#pragma once

#include <cstdint>
#include <exception>
#include <new>
#include <string>
#include <system_error>

#include "daemon/study/campaign_record.hpp"
#include "daemon/study/study.hpp"

namespace vibrig::study {

/// Does tasks; one thread each.
class Worker {
  public:
    Worker() = default;
    virtual ~Worker() = default;
    Worker(const Worker&) = delete;
    Worker& operator=(const Worker&) = delete;

    /// What is kept of task `index`: the same bytes whenever and wherever. A task that throws is a
    /// record as well, but not what is the machine's and passes: std::bad_alloc and
    /// std::system_error get through.
    [[nodiscard]] virtual std::string run(std::uint64_t index) = 0;
};

/// What `task` gives. One that throws is a record as well: failed, with the reason; but not what is
/// the machine's and passes, nor what stops the study.
template <typename Task>
[[nodiscard]] std::string record_of(const Task& task) {
    try {
        return task();
    } catch (const StudyError&) {
        throw;
    } catch (const std::bad_alloc&) {
        throw;
    } catch (const std::system_error&) {
        throw;
    } catch (const std::exception& error) {
        return failed_record(error.what());
    }
}

}  // namespace vibrig::study
