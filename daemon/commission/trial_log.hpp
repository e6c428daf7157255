#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "daemon/commission/register_trial.hpp"

namespace vibrig::commission {

/// What was written to a controller without the daemon, one JSON object a line, each on disk before
/// what it says is done: commission.folder, registers.jsonl. The daemon takes it into its journal
/// at its next start.
class TrialLog {
  public:
    using Json = nlohmann::ordered_json;

    /// `by`: the person; who ran it and when go into each line. Throws std::runtime_error that
    /// names the file.
    TrialLog(const std::string& folder, std::string by);
    ~TrialLog();
    TrialLog(const TrialLog&) = delete;
    TrialLog& operator=(const TrialLog&) = delete;

    [[nodiscard]] const std::string& path() const noexcept { return path_; }
    /// Throws as the constructor.
    void add(const char* what, Json data);

    /// The lines that there are, oldest first, which are then kept under another name beside it.
    /// Throws std::runtime_error that names the file.
    [[nodiscard]] static std::vector<Json> take(const std::string& folder);

  private:
    std::string path_, by_;
    int file_ = -1;
};

/// Each write through it is in the log first, with what the registers held.
class LoggedPort final : public TrialPort {
  public:
    LoggedPort(TrialPort& port, TrialLog& log, proto::ShakerRegisters map)
        : port_(port), log_(log), map_(std::move(map)) {}

    Answer read(proto::RegisterTable table, std::uint16_t address,
                std::span<std::uint16_t> words) override {
        return port_.read(table, address, words);
    }
    Answer write(std::uint16_t address, std::span<const std::uint16_t> words) override;
    void wait(double seconds) override { port_.wait(seconds); }
    [[nodiscard]] double now_s() const override { return port_.now_s(); }

  private:
    TrialPort& port_;
    TrialLog& log_;
    proto::ShakerRegisters map_;
};

}  // namespace vibrig::commission
