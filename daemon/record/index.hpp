#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace vibrig::journal {
class Database;
struct Row;
}  // namespace vibrig::journal

namespace vibrig::record {

/// A file of a campaign as the index has it.
struct IndexedFile {
    std::string name;  ///< in the campaign's folder
    int part = 0;      ///< of an HDF5 file; 0: raw log
    bool closed = false;
    std::int64_t from_utc_ns = 0, to_utc_ns = 0;  ///< of its first and last row; 0: none
    std::int64_t rows = 0;                        ///< samples, or frames
    std::int64_t bytes = 0;
    std::string sha256;  ///< empty while it is written
};

struct IndexedCampaign {
    std::string key;  ///< its folder's name
    std::string name, started_by, state;
    std::int64_t started_utc_ns = 0;
    std::vector<IndexedFile> files;  ///< by name
};

/// recordings.sqlite3 beside the campaigns' folders: which there are and which files they have. All
/// of it can be had again from the files. One thread; everything throws journal::DatabaseError or
/// std::runtime_error.
class Index {
  public:
    using Tell = std::function<void(const std::string& words)>;
    enum class Use : std::uint8_t { write, ask };
    /// Opens or makes it; a damaged one is made anew, and reported. To ask one that may not be
    /// written, the right to read is enough.
    Index(std::string folder, const Tell& tell, Use use = Use::write);
    ~Index();

    /// Looks at a campaign's folder, or at one file of it, and notes what there is.
    void note(const std::string& campaign_folder);
    void note_file(const std::string& path);
    /// Forgets all and looks at every folder; the number of campaigns.
    std::size_t rebuild();

    /// All of them, by their begin.
    [[nodiscard]] std::vector<IndexedCampaign> campaigns();
    /// What one looks for by a folder's name or a campaign's: does not grow with the index.
    struct Named {
        bool is_key = false;
        std::vector<std::string> keys;  ///< of campaigns of that name, by their begin
    };
    [[nodiscard]] Named look_up(const std::string& key_or_name);
    [[nodiscard]] std::vector<IndexedFile> files_of(const std::string& key);
    /// So many keys at most, by their begin, and how many there are.
    [[nodiscard]] std::pair<std::vector<std::string>, std::size_t> some_keys(std::size_t most);

    [[nodiscard]] static std::string path_in(const std::string& folder);

  private:
    void open();
    void look(const std::string& path);
    void look_at_folder(const std::string& campaign_folder);
    /// False: it was found damaged, and made anew.
    bool or_make_anew(const std::function<void()>& act);
    void make_anew(const std::string& why);
    /// Where it is found damaged only now, it is made anew.
    [[nodiscard]] std::vector<journal::Row> ask(const char* sql,
                                                const std::vector<std::string>& texts = {});
    void put(const std::string& key, const IndexedFile& file);

    std::string folder_;
    Tell tell_;
    bool only_read_;
    std::unique_ptr<journal::Database> database_;
};

/// What CAMPAIGN means: a path, or the name or folder's name of a campaign that the index of one of
/// `folders` knows. Throws std::runtime_error with what was found and expected.
[[nodiscard]] std::string find_campaign(const std::string& argument,
                                        const std::vector<std::string>& folders,
                                        const Index::Tell& tell);
/// What the index beside a campaign's folder says of its files: throws if one is not there, tells
/// if one is not as it was closed. Silent without an index.
void compare_with_index(const std::string& campaign_folder, const Index::Tell& tell);
/// In words, the HDF5 files of a campaign whose SHA-256 is not that with which the index beside it
/// has them as closed. Empty: none, or no index. All of each is read.
[[nodiscard]] std::vector<std::string> changed_parts(const std::string& campaign_folder,
                                                     const Index::Tell& tell);
/// In words, the segments of a campaign's raw log that are not in its folder: by the numbers of
/// those that are, and by the index beside it. Empty: all are there.
[[nodiscard]] std::vector<std::string> gone_raw(const std::string& campaign_folder,
                                                const Index::Tell& tell);
/// Likewise those that end within a frame. For whoever needs the log: its sizes are read, which
/// takes a disk's time.
[[nodiscard]] std::vector<std::string> cut_raw(const std::string& campaign_folder);
/// In words, a segment that begins before the end of the one before it: it is of another campaign,
/// or a copy. Empty: none. All of the log is read.
[[nodiscard]] std::string misplaced_raw(const std::string& campaign_folder);
/// Those that are gone, and those that are cut.
[[nodiscard]] std::vector<std::string> missing_raw(const std::string& campaign_folder,
                                                   const Index::Tell& tell);

}  // namespace vibrig::record
