#include "daemon/archive/deliver.hpp"

#include <fcntl.h>
#include <spdlog/fmt/fmt.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <optional>
#include <utility>

#include "daemon/archive/manifest.hpp"
#include "daemon/record/campaign_file.hpp"

namespace vibrig::archive {

namespace fs = std::filesystem;

namespace {

constexpr const char* kIncoming = ".incoming";
constexpr std::size_t kPiece = 1 << 20;

[[noreturn]] void fail(const fs::path& path, const char* doing) {
    throw ArchiveError(
        fmt::format("{}: cannot {}: {}", path.string(), doing, std::strerror(errno)));
}

/// A descriptor that closes itself.
class Descriptor {
  public:
    Descriptor(const fs::path& path, int flags) : path_(path) {
        number_ = ::open(path.c_str(), flags | O_CLOEXEC, 0644);
        if (number_ < 0) fail(path, "open it");
    }
    ~Descriptor() {
        if (number_ >= 0) ::close(number_);
    }
    Descriptor(const Descriptor&) = delete;
    Descriptor& operator=(const Descriptor&) = delete;
    [[nodiscard]] int number() const noexcept { return number_; }
    void sync() const {
        if (::fsync(number_) != 0) fail(path_, "bring it to the disk");
    }
    /// A mounted file system may refuse only now.
    void close() {
        if (::close(std::exchange(number_, -1)) != 0) fail(path_, "write it");
    }

  private:
    fs::path path_;
    int number_;
};

void sync_folder(const fs::path& folder) { Descriptor(folder, O_RDONLY | O_DIRECTORY).sync(); }

void write_all(const Descriptor& to, const fs::path& path, const char* bytes, std::size_t size) {
    while (size > 0) {
        const auto n = ::write(to.number(), bytes, size);
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) fail(path, "write it");
        bytes += n;
        size -= static_cast<std::size_t>(n);
    }
}

void copy_file(const fs::path& from, const fs::path& to,
               const std::function<void(std::size_t)>& copied) {
    const Descriptor source(from, O_RDONLY);
    Descriptor target(to, O_WRONLY | O_CREAT | O_TRUNC);
    std::vector<char> piece(kPiece);
    for (;;) {
        const auto n = ::read(source.number(), piece.data(), piece.size());
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) fail(from, "read it");
        if (n == 0) break;
        write_all(target, to, piece.data(), static_cast<std::size_t>(n));
        copied(static_cast<std::size_t>(n));
    }
    target.sync();
    // What is compared is to come from the disk.
    static_cast<void>(::posix_fadvise(target.number(), 0, 0, POSIX_FADV_DONTNEED));
    target.close();
}

/// One delivery of a rig at a time, whoever makes it.
class DeliveryLock {
  public:
    explicit DeliveryLock(const fs::path& path) : file_(path, O_RDWR | O_CREAT) {
        while (::flock(file_.number(), LOCK_EX) != 0)
            if (errno != EINTR) fail(path, "lock it");
    }

  private:
    Descriptor file_;
};

/// Held by everyone who delivers, so that whoever finds nobody else at it may remove what those who
/// were killed left.
class Underway {
  public:
    explicit Underway(const fs::path& incoming) : file_(path_in(incoming), flags(incoming)) {
        if (::flock(file_.number(), LOCK_EX | LOCK_NB) == 0) clear(incoming);
        while (::flock(file_.number(), LOCK_SH) != 0)
            if (errno != EINTR) fail(path_in(incoming), "lock it");
    }

  private:
    /// No rig's: their names do not begin so.
    static fs::path path_in(const fs::path& incoming) { return incoming / ".underway"; }
    /// Of somebody else it can be locked, too.
    static int flags(const fs::path& incoming) {
        std::error_code none;
        const fs::path path = path_in(incoming);
        const bool theirs = fs::exists(path, none) && ::access(path.c_str(), W_OK) != 0;
        return theirs ? O_RDONLY : O_RDWR | O_CREAT;
    }
    static void clear(const fs::path& incoming) {
        std::error_code none;
        for (const auto& entry : fs::directory_iterator(incoming, none))
            if (fs::is_directory(entry.symlink_status(none))) fs::remove_all(entry.path(), none);
    }
    Descriptor file_;
};

/// A name that is one folder below another, whatever a configuration says.
std::string as_name(std::string text) {
    std::ranges::replace(text, '/', '_');
    return text.empty() || text.front() == '.' ? "_" + text : text;
}

void stage(const std::string& source, const fs::path& incoming, const Entry& entry,
           const Progress& progress) {
    const std::string manifest = manifest_json(entry, source);
    fs::remove_all(incoming);
    fs::create_directories(incoming);
    std::size_t all = 0, done = 0;
    for (const File& file : entry.files) all += static_cast<std::size_t>(file.bytes);
    for (const File& file : entry.files)
        copy_file(fs::path(source) / file.name, incoming / file.name, [&](std::size_t bytes) {
            done += bytes;
            if (progress) progress(done, all);
        });
    if (const auto wrong = differences(incoming.string(), entry.files); !wrong.empty())
        throw ArchiveError("the copy is not what was copied: " + wrong.front());
    const Descriptor file(incoming / kManifestName, O_WRONLY | O_CREAT | O_TRUNC);
    write_all(file, incoming / kManifestName, manifest.data(), manifest.size());
    file.sync();
    sync_folder(incoming);
}

bool is_that(const fs::path& folder, const Entry& entry) {
    return campaign_hash(list_files(folder.string())) == entry.hash;
}

/// `incoming` becomes `target`; what is damaged there makes room.
void show(const fs::path& incoming, const fs::path& target) {
    fs::path aside = incoming;
    aside += ".old";
    std::error_code ignored;
    fs::remove_all(aside, ignored);
    if (fs::exists(target)) fs::rename(target, aside);
    fs::rename(incoming, target);
    sync_folder(target.parent_path());
    fs::remove_all(aside, ignored);
}

}  // namespace

std::string host_name() {
    std::array<char, 256> name{};
    return ::gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "rig";
}

std::vector<std::string> campaign_folders(const std::string& folder, const Strange& strange) {
    if (!fs::is_directory(folder))
        throw ArchiveError(folder + ": found no such folder, expected a campaign's or one of them");
    if (!record::part_files(folder).empty()) return {folder};
    std::vector<std::string> found;
    const auto look = [&](const fs::directory_entry& entry) {
        std::error_code error;
        const bool is_folder = entry.is_directory(error);
        // A link to nowhere says so, too.
        if (error && error != std::errc::no_such_file_or_directory)
            strange(entry.path().string(), error.message());
        if (!is_folder || entry.path().filename().string().starts_with('.')) return false;
        if (record::part_files(entry.path().string()).empty()) return true;
        found.push_back(entry.path().string());
        return false;
    };
    for (const auto& entry : fs::directory_iterator(folder)) {
        if (!look(entry)) continue;
        std::error_code error;
        fs::directory_iterator below(entry.path(), error);
        if (error) strange(entry.path().string(), error.message());
        for (const auto& one : below) look(one);
    }
    std::ranges::sort(found);
    return found;
}

namespace {

/// The same recording as the index has it, of whichever rig; nothing: it has none, or the folder is
/// gone.
std::optional<Entry> known_in(const Place& place, const fs::path& root, const std::string& hash) {
    std::error_code none;
    // Nothing is made before the campaign is there.
    if (!is_server(place.index) && !fs::exists(place.index, none)) return {};
    Index index(place.index, Database::Mode::write);
    const auto key = index.key_of(hash);
    if (!key || !fs::is_directory(root / *key, none)) return {};
    return index.campaign(*key);
}

/// A copy that was cut, or changed, must not take the place of the recording unseen. What went on
/// later ended later.
void refuse_rival(const Place& place, const fs::path& root, const std::string& source,
                  const Entry& entry) {
    std::error_code none;
    if (!is_server(place.index) && !fs::exists(place.index, none)) return;
    Index index(place.index, Database::Mode::write);
    for (const std::string& key : index.rivals_of(entry)) {
        if (!fs::is_directory(root / key, none)) continue;
        throw Refused(
            source + ": found other files of a campaign that the archive has as " +
            (root / key).string() +
            ", with the same beginning and end, expected the same ones; one of them was changed or "
            "is not whole, and this one is not archived beside the other");
    }
}

/// Into the archive, where it is not there.
void bring(const fs::path& own, const fs::path& root, const Place& place, Delivery& delivery,
           const Progress& progress) {
    if (!fs::is_directory(root))
        throw ArchiveError(root.string() + ": found no such folder, expected the archive's");
    Entry& entry = delivery.entry;
    const fs::path incoming_root = root / kIncoming;
    fs::create_directories(incoming_root);
    const Underway underway(incoming_root);
    const auto known = known_in(place, root, entry.hash);
    delivery.elsewhere = known && known->rig != entry.rig;
    if (delivery.elsewhere) entry.rig = known->rig;
    const DeliveryLock lock(incoming_root / (as_name(entry.rig) + ".lock"));
    const std::string name = as_name(entry.key);
    fs::path target = known ? root / known->key : root / entry.rig / name;
    const bool there = fs::exists(target);
    // Of another time: the campaign went on, or another rig has this one's name.
    if (!known && there && origin_in(target.string()).hash != entry.hash)
        target += "~" + entry.hash.substr(0, 8);
    entry.key = known ? known->key : entry.rig + "/" + target.filename().string();
    delivery.folder = target.string();
    // Of one that was registered where it lay there is no manifest.
    if ((known || fs::exists(target / kManifestName)) && fs::exists(target) &&
        is_that(target, entry)) {
        delivery.kind = Delivery::Kind::was_there;
        return;
    }
    delivery.kind = fs::exists(target) ? Delivery::Kind::mended : Delivery::Kind::copied;
    const fs::path incoming =
        incoming_root / (as_name(entry.rig) + "-" + name + "-" + entry.hash.substr(0, 8));
    try {
        stage(own.string(), incoming, entry, progress);
    } catch (...) {
        std::error_code none;
        fs::remove_all(incoming, none);
        throw;
    }
    fs::create_directories(target.parent_path());
    show(incoming, target);
}

/// Into the index, where the same recording under another name is the same campaign.
void note(const Place& place, const fs::path& root, bool inside, Delivery& delivery) {
    Entry& entry = delivery.entry;
    Index index(place.index, Database::Mode::write);
    const auto of_another = [&] {
        auto known = index.key_of(entry.hash);
        return known && *known != entry.key ? known : std::nullopt;
    };
    auto known = of_another();
    if (known && !inside && !fs::exists(root / *known)) {
        index.forget(*known);
        known.reset();
    }
    try {
        if (!known) return index.put(entry, true);
    } catch (const ArchiveError&) {
        known = of_another();
        if (!known) throw;
    }
    // Another rig was faster: one of them is enough.
    std::error_code none;
    if (delivery.kind == Delivery::Kind::copied) fs::remove_all(delivery.folder, none);
    if (const auto there = index.campaign(*known)) entry.rig = there->rig;
    entry.key = *known;
    delivery.kind = Delivery::Kind::was_there;
    delivery.elsewhere = true;
}

}  // namespace

Delivery deliver(const std::string& campaign_folder, const Place& place, const std::string& rig,
                 const Progress& progress) {
    Delivery delivery;
    Entry& entry = delivery.entry;
    entry = read_entry(campaign_folder);
    if (entry.key.empty()) entry.key = fs::path(campaign_folder).filename().string();
    const fs::path root = fs::weakly_canonical(place.folder);
    const fs::path own = fs::weakly_canonical(campaign_folder);
    const fs::path within = own.lexically_relative(root);
    const bool inside = !within.empty() && *within.begin() != "..";
    entry.rig = as_name(rig);
    if (inside) {
        const auto origin = origin_in(own.string());
        if (!origin.rig.empty()) entry.rig = origin.rig;
        // Registered as it is, it would be the genuine one from then on.
        if (!origin.hash.empty() && origin.hash != entry.hash)
            throw Refused(fmt::format(
                "{}: found files with the hash {}, expected {} of {}: it was damaged or changed in "
                "the archive; vibrig archive add of the rig's folder mends it",
                own.string(), entry.hash, origin.hash, (own / kManifestName).string()));
        entry.key = within.string();
        delivery.kind = Delivery::Kind::was_there;
        delivery.folder = own.string();
    }
    refuse_rival(place, root, own.string(), entry);
    // What an index beside it says of its files as they were closed: silent of a copy.
    if (!inside)
        for (const auto& words : record::changed_parts(campaign_folder, [](const auto&) {}))
            throw Refused(words);
    if (!inside) bring(own, root, place, delivery, progress);
    note(place, root, inside, delivery);
    return delivery;
}

void read_results(Index& index, const std::string& folder, const std::string& rig,
                  const std::function<void(const std::string&)>& tell, const Progress& progress) {
    const auto keys = index.without_result();
    for (std::size_t i = 0; i < keys.size(); ++i) {
        const fs::path path = fs::path(folder) / keys[i];
        if (progress) progress(i, keys.size());
        // Somebody has taken it away: what was noted of it stays.
        if (!fs::exists(path)) continue;
        try {
            Entry entry = read_entry(path.string());
            entry.key = keys[i];
            entry.rig = rig;
            index.put(entry, false);
        } catch (const std::exception& error) {
            tell(error.what());
        }
    }
}

}  // namespace vibrig::archive
