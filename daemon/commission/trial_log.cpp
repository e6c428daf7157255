#include "daemon/commission/trial_log.hpp"

#include <fcntl.h>
#include <pwd.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <utility>

#include "daemon/commission/record.hpp"
#include "daemon/journal/signed_head.hpp"
#include "proto/durable_file.hpp"
#include "proto/json_text.hpp"

namespace vibrig::commission {

namespace {

constexpr const char* kName = "registers.jsonl";

[[noreturn]] void cannot(const std::string& path, const char* what) {
    throw std::runtime_error(path + ": cannot " + what + ": " + std::strerror(errno));
}

std::string in(const std::string& folder) {
    return (std::filesystem::path(folder) / kName).string();
}

std::string identity() {
    std::string text = "uid " + std::to_string(::getuid());
    if (const passwd* const user = ::getpwuid(::getuid()))
        text += ", " + std::string(user->pw_name);
    return text;
}

/// What a trial writes; null: not stated.
std::array<std::pair<const char*, const proto::Register*>, 6> written_roles(
    const proto::ShakerRegisters& map) {
    return {{{"frequency", &map.frequency},
             {"amplitude", &map.amplitude},
             {"ramp_time", &map.ramp_time},
             {"watchdog_timeout", &map.watchdog_timeout},
             {"watchdog", map.watchdog ? &*map.watchdog : nullptr},
             {"run", &map.run}}};
}

/// The stated register that begins there; empty: none.
std::string role_at(const proto::ShakerRegisters& map, std::uint16_t address) {
    for (const auto& [name, reg] : written_roles(map))
        if (reg != nullptr && reg->table == proto::RegisterTable::holding &&
            reg->address == address)
            return name;
    return {};
}

/// As it counts; nothing: of no stated register.
TrialLog::Json value_of(const proto::ShakerRegisters& map, const std::string& role,
                        std::span<const std::uint16_t> words) {
    for (const auto& [name, reg] : written_roles(map))
        if (role == name && reg != nullptr && reg->words() == words.size())
            return proto::decode(*reg, words);
    return nullptr;
}

}  // namespace

TrialLog::TrialLog(const std::string& folder, std::string by)
    : path_(in(folder)), by_(std::move(by)) {
    std::error_code error;  // whatever it is, the file then says it
    std::filesystem::create_directories(folder, error);
    file_ = ::open(path_.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC | O_NOFOLLOW, 0644);
    if (file_ < 0) cannot(path_, "be written");
    ::fchmod(file_, 0644);  // the daemon is another user
    // A line that a power cut has halved is not to take the next one with it.
    char last = '\n';
    if (const off_t size = ::lseek(file_, 0, SEEK_END); size > 0)
        static_cast<void>(::pread(file_, &last, 1, size - 1) == 1);
    if (last != '\n') static_cast<void>(::write(file_, "\n", 1) == 1);
    proto::sync_folder_of(path_);
}

TrialLog::~TrialLog() { ::close(file_); }

void TrialLog::add(const char* what, Json data) {
    const std::int64_t now = journal::utc_now();
    Json line{{"utc", instant_of(now)},
              {"utc_ns", now},
              {"by", by_},
              {"identity", identity()},
              {"what", what}};
    line.update(std::move(data));
    const std::string text = proto::json_text(line) + "\n";
    if (::write(file_, text.data(), text.size()) != static_cast<ssize_t>(text.size()) ||
        ::fdatasync(file_) != 0)
        cannot(path_, "be written");
}

std::vector<TrialLog::Json> TrialLog::take(const std::string& folder) {
    const std::string path = in(folder);
    std::error_code error;
    if (!std::filesystem::is_regular_file(path, error)) return {};
    std::vector<Json> lines;
    std::ifstream file(path);
    if (!file) cannot(path, "be read");
    for (std::string text; std::getline(file, text);) {
        Json line = Json::parse(text, nullptr, false);
        // One that a power cut has halved stands as it is.
        lines.push_back(line.is_object() ? std::move(line)
                                         : Json{{"what", "line"}, {"text", text}});
    }
    std::string kept;
    for (int n = 1; kept.empty() || std::filesystem::exists(kept, error); ++n)
        kept = path + "." + std::to_string(n);
    if (::rename(path.c_str(), kept.c_str()) != 0) cannot(path, "be renamed");
    return lines;
}

TriedRegisters::TriedRegisters(const std::string& folder)
    : path_((std::filesystem::path(folder) / "registers.json").string()) {}

TriedRegisters::Keys TriedRegisters::keys_of(const configuration::Loaded& loaded) {
    Keys keys;
    for (const auto& value : loaded.effective)
        if (value.key.starts_with("shaker.registers.")) keys[value.key] = value.value;
    return keys;
}

void TriedRegisters::keep(const Keys& keys, const std::string& by, const std::string& device,
                          std::int64_t utc_ns) const {
    const TrialLog::Json all{{"version", 1},
                             {"by", by},
                             {"identity", identity()},
                             {"device", device},
                             {"utc", instant_of(utc_ns)},
                             {"keys", keys}};
    proto::write_durably(path_, all.dump(1) + "\n", 0644);
}

std::string TriedRegisters::lacks(const Keys& keys) const {
    constexpr const char* kToDo =
        ": vibrig commission registers --write, with vibrigd stopped, the chain open and the power "
        "stage off";
    std::ifstream file(path_);
    const auto all = file ? TrialLog::Json::parse(file, nullptr, false) : TrialLog::Json();
    if (!all.is_object() || !all.contains("keys") || !all["keys"].is_object())
        return "the shaker's registers were not tried one by one, which comes before it runs" +
               std::string(kToDo);
    for (const auto& [key, value] : keys) {
        const auto was = all["keys"].find(key);
        const std::string then =
            was != all["keys"].end() && was->is_string() ? was->get<std::string>() : "not known";
        if (then != value)
            return key + " is " + value + ", was " + then + " when it was tried" + kToDo;
    }
    return {};
}

TrialPort::Answer LoggedPort::write(std::uint16_t address, std::span<const std::uint16_t> words) {
    std::vector<std::uint16_t> held(words.size());
    const bool read =
        port_.read(proto::RegisterTable::holding, address, held) == TrialPort::Answer::done;
    const auto role = role_at(map_, address);
    const std::vector<std::uint16_t> wanted(words.begin(), words.end());
    Json data{{"register", role}, {"table", "holding"}, {"address", address}};
    data["old"] = read ? Json{{"words", held}, {"value", value_of(map_, role, held)}} : Json();
    data["new"] = {{"words", wanted}, {"value", value_of(map_, role, words)}};
    log_.add("write", data);
    const auto answer = port_.write(address, words);
    log_.add("answer",
             {{"address", address}, {"answer", answer == Answer::done ? "done" : "refused"}});
    return answer;
}

}  // namespace vibrig::commission
