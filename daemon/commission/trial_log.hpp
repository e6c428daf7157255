#pragma once

#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "daemon/commission/register_trial.hpp"
#include "daemon/configuration/configuration.hpp"

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

/// That each written register was tried, chain open and power stage off: commission.folder,
/// registers.json. It stands on shaker.registers.* as --check prints them.
class TriedRegisters {
  public:
    using Keys = std::map<std::string, std::string>;

    explicit TriedRegisters(const std::string& folder);
    /// Throws std::runtime_error that names the file.
    void keep(const Keys& keys, const std::string& by, const std::string& device,
              std::int64_t utc_ns) const;
    /// Why these were not tried; empty: they were.
    [[nodiscard]] std::string lacks(const Keys& keys) const;

    /// Keys of an effective configuration.
    [[nodiscard]] static Keys keys_of(const configuration::Loaded& loaded);

  private:
    std::string path_;
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
