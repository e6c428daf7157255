#include "daemon/study/parts.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <boost/crc.hpp>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <cstring>
#include <filesystem>

#include "daemon/study/study.hpp"
#include "proto/text.hpp"

namespace vibrig::study {

namespace fs = std::filesystem;

namespace {

constexpr std::string_view kMagic = "VIBRIG STUDY 1\r\n";
constexpr std::size_t kHead = kMagic.size() + std::tuple_size_v<StudyId> + 4;
constexpr std::uint32_t kLongest = 1 << 24;
constexpr const char* kClosed = ".part";
constexpr const char* kOpen = ".part.tmp";

using Crc32c = boost::crc_optimal<32, 0x1EDC6F41, 0xFFFFFFFF, 0xFFFFFFFF, true, true>;

template <typename T>
void put(std::string& bytes, T value) {
    bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

std::uint32_t crc_of(std::string_view bytes) {
    Crc32c crc;
    crc.process_bytes(bytes.data(), bytes.size());
    return crc.checksum();
}

std::uint32_t crc_of(std::uint64_t index, std::uint32_t length, std::string_view bytes) {
    Crc32c crc;
    crc.process_bytes(&index, sizeof index);
    crc.process_bytes(&length, sizeof length);
    crc.process_bytes(bytes.data(), bytes.size());
    return crc.checksum();
}

std::string head_of(const StudyId& id) {
    std::string head(kMagic);
    head.append(reinterpret_cast<const char*>(id.data()), id.size());
    put(head, crc_of(head));
    return head;
}

std::string host_name() {
    std::array<char, 65> name{};
    if (gethostname(name.data(), name.size() - 1) != 0 || name[0] == 0) return "host";
    std::string text(name.data());
    for (char& c : text) {
        if (std::isalnum(static_cast<unsigned char>(c)) == 0 && c != '.' && c != '-') c = '_';
    }
    return text;
}

std::optional<PartName> name_of(const std::string& file) {
    PartName out;
    out.file = file;
    std::string_view rest = file;
    out.closed = !rest.ends_with(kOpen);
    if (!out.closed) {
        rest.remove_suffix(std::strlen(kOpen));
    } else if (rest.ends_with(kClosed)) {
        rest.remove_suffix(std::strlen(kClosed));
    } else {
        return std::nullopt;
    }
    const auto shard_end = rest.find('-'), number = rest.rfind('-');
    if (shard_end == std::string_view::npos || number <= shard_end) return std::nullopt;
    const auto pid = rest.rfind('-', number - 1);
    const auto of = rest.find("of");
    int count = 0;
    if (pid == std::string_view::npos || pid <= shard_end || of >= shard_end) return std::nullopt;
    const bool good = proto::read_number(rest.substr(0, of), out.shard.number) &&
                      proto::read_number(rest.substr(of + 2, shard_end - of - 2), out.shard.of) &&
                      proto::read_number(rest.substr(pid + 1, number - pid - 1), out.pid) &&
                      proto::read_number(rest.substr(number + 1), count) &&
                      out.shard.number < out.shard.of;
    out.host = rest.substr(shard_end + 1, pid - shard_end - 1);
    return good ? std::optional(out) : std::nullopt;
}

std::FILE* opened(std::string path) {
    std::FILE* file = std::fopen(path.c_str(), "rbe");
    if (file == nullptr && errno == ENOENT && path.ends_with(kOpen))
        file = std::fopen(path.substr(0, path.size() - std::strlen(".tmp")).c_str(), "rbe");
    return file;
}

}  // namespace

bool PartName::abandoned() const {
    return !closed && host == host_name() && kill(static_cast<pid_t>(pid), 0) != 0 &&
           errno == ESRCH;
}

StudyId id_of(std::string_view hexadecimal) {
    StudyId id{};
    for (std::size_t i = 0; i < id.size() && 2 * i + 1 < hexadecimal.size(); ++i) {
        const char* at = hexadecimal.data() + 2 * i;
        std::from_chars(at, at + 2, id[i], 16);
    }
    return id;
}

std::vector<PartName> parts_in(const std::string& folder, std::vector<std::string>* others) {
    std::vector<PartName> parts;
    std::error_code error;
    for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error)) {
        const std::string file = at->path().filename().string();
        if (auto name = name_of(file)) {
            parts.push_back(*name);
        } else if (others != nullptr && !file.starts_with('.')) {
            others->push_back(file);
        }
    }
    if (error) throw StudyError(folder + ": cannot be read: " + error.message());
    std::ranges::sort(parts, {}, &PartName::file);
    // One that is renamed while the folder is read may be seen with both names.
    const auto same = [](const PartName& a, const PartName& b) {
        return b.file == a.file + ".tmp";
    };
    parts.erase(std::unique(parts.begin(), parts.end(), same), parts.end());
    return parts;
}

PartWriter::PartWriter(std::string folder, const StudyId& id, Shard shard)
    : folder_(std::move(folder)), id_(id), shard_(shard) {}

PartWriter::~PartWriter() {
    if (file_ >= 0) ::close(file_);
}

void PartWriter::fail(const char* what) {
    const std::string why = std::strerror(errno);
    throw StudyError((path_.empty() ? folder_ : path_) + ": cannot be " + what + ": " + why);
}

void PartWriter::open() {
    const std::string stem = folder_ + "/" + std::to_string(shard_.number) + "of" +
                             std::to_string(shard_.of) + "-" + host_name() + "-" +
                             std::to_string(getpid()) + "-";
    for (int n = 0; file_ < 0; ++n) {
        const std::string path = stem + std::to_string(n) + kOpen;
        if (fs::exists(stem + std::to_string(n) + kClosed)) continue;
        file_ = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
        if (file_ < 0 && errno != EEXIST) fail("written");
        if (file_ >= 0) path_ = path;
    }
    write(head_of(id_));
}

void PartWriter::write(std::string_view bytes) {
    while (!bytes.empty()) {
        const auto written = ::write(file_, bytes.data(), bytes.size());
        if (written < 0 && errno == EINTR) continue;
        if (written < 0) fail("written");
        bytes.remove_prefix(static_cast<std::size_t>(written));
    }
}

void PartWriter::append(const std::vector<TaskRecord>& records) {
    if (records.empty()) return;
    if (file_ < 0) open();
    std::string bytes;
    for (const TaskRecord& record : records) {
        const auto length = static_cast<std::uint32_t>(record.bytes.size());
        put(bytes, record.index);
        put(bytes, length);
        put(bytes, crc_of(record.index, length, record.bytes));
        bytes += record.bytes;
    }
    write(bytes);
    if (fdatasync(file_) != 0) fail("brought to the disk");
}

void PartWriter::close() {
    if (file_ < 0) return;
    const bool stored = fsync(file_) == 0;
    const bool closed = ::close(file_) == 0;
    file_ = -1;
    if (!stored || !closed) fail("brought to the disk");
    const std::string final_name = path_.substr(0, path_.size() - std::strlen(".tmp"));
    if (std::rename(path_.c_str(), final_name.c_str()) != 0) fail("renamed");
    path_ = final_name;
    const int folder = ::open(folder_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (folder < 0) return;
    static_cast<void>(fsync(folder));  // some network file systems refuse it
    ::close(folder);
}

PartReader::PartReader(const std::string& path, const StudyId& id, std::uint64_t tasks)
    : file_(opened(path)), tasks_(tasks) {
    if (!file_) {
        finish(End::unreadable, errno == ENOENT
                                    ? "gone while it was to be read: are parts being compacted?"
                                    : std::string("cannot be read: ") + std::strerror(errno));
        return;
    }
    std::setvbuf(file_.get(), nullptr, _IOFBF, 1 << 15);
    read_head(id);
}

void PartReader::read_head(const StudyId& id) {
    std::string head(kHead, '\0');
    const std::size_t got = std::fread(head.data(), 1, kHead, file_.get());
    const std::string expected = head_of(id);
    if (got < kHead) {
        finish(End::torn, "torn in its first " + std::to_string(kHead) + " bytes");
    } else if (head != expected) {
        const bool part = head.compare(0, kMagic.size(), kMagic) == 0;
        std::uint32_t crc = 0;
        std::memcpy(&crc, head.data() + kHead - 4, 4);
        if (part && crc == crc_of(std::string_view(head).substr(0, kHead - 4))) {
            finish(End::foreign, "a part of another study");
        } else {
            finish(End::damaged, "damaged in its first " + std::to_string(kHead) + " bytes");
        }
    }
    at_ = kHead;
}

bool PartReader::finish(End end, const std::string& why) {
    end_ = end;
    why_ = why;
    file_.reset();
    return false;
}

bool PartReader::next(TaskRecord& record) {
    if (end_ != End::none) return false;
    struct {
        std::uint64_t index = 0;
        std::uint32_t length = 0, crc = 0;
    } head;
    static_assert(sizeof head == 16);
    const auto behind = [&](const char* what) {
        return std::string(what) + " after " + std::to_string(records_) + " records, at byte " +
               std::to_string(at_);
    };
    const std::size_t got = std::fread(&head, 1, sizeof head, file_.get());
    if (got == 0) {
        if (std::ferror(file_.get()) != 0)
            return finish(End::unreadable, behind(std::strerror(errno)));
        return finish(End::whole, "");
    }
    if (got < sizeof head) return finish(End::torn, behind("torn"));
    if (head.length > kLongest || head.index >= tasks_)
        return finish(End::damaged, behind("damaged"));
    record.bytes.resize(head.length);
    if (std::fread(record.bytes.data(), 1, head.length, file_.get()) < head.length)
        return finish(End::torn, behind("torn"));
    if (crc_of(head.index, head.length, record.bytes) != head.crc || head.length == 0)
        return finish(End::damaged, behind("damaged"));
    if (last_ && head.index <= *last_) return finish(End::damaged, behind("out of order"));
    record.index = head.index;
    last_ = head.index;
    at_ += sizeof head + head.length;
    ++records_;
    return true;
}

Done done_in(const std::string& folder, const StudyId& id, std::uint64_t tasks, Shard shard) {
    Done out;
    const std::uint64_t begin = shard.begin(tasks), end = shard.end(tasks);
    out.tasks.resize(end - begin);
    for (const PartName& name : parts_in(folder)) {
        if (name.shard.end(tasks) <= begin || name.shard.begin(tasks) >= end) continue;
        PartReader reader(folder + "/" + name.file, id, tasks);
        for (TaskRecord record; reader.next(record);) {
            if (record.index < begin || record.index >= end) continue;
            if (out.tasks[record.index - begin]) continue;
            out.tasks[record.index - begin] = true;
            ++out.count;
            if (record.bytes[0] == 'F') ++out.failed;
        }
        if (!reader.why().empty()) out.damaged.push_back(name.file + ": " + reader.why());
    }
    return out;
}

}  // namespace vibrig::study
