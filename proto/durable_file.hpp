#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace vibrig::proto {

/// The whole file, on disk before it takes the old one's place, its folder too. An old one's mode
/// and owner are kept, a symbolic link is followed; `mode`: of one that is new. Throws
/// std::runtime_error that names the file.
void write_durably(const std::string& path, std::string_view text, unsigned mode = 0644);

/// Refuses an output, found through symbolic links, that is a file of a recording (HDF5, a
/// database, or what lies beside a campaign's files), has the name of one, or is one of those that
/// were named by name_inputs(). Throws std::runtime_error that names it.
void check_output(const std::string& path);
/// Refuses two outputs of one name: the second would take the first one's place. Devices and "-"
/// may be named twice. Throws std::runtime_error that names it.
void refuse_same(const std::vector<std::string>& outputs);
/// The files that this run of the program reads; what is no file among them does not matter.
void name_inputs(std::vector<std::string> paths);

/// What a command writes for whoever asked: as PATH.unfinished until it is whole, so that neither
/// half a file nor a full disk takes the place of a good one. Devices, pipes and descriptors are
/// written as they are. All throw std::runtime_error that names the file.
class OutputFile {
  public:
    explicit OutputFile(const std::string& path);
    /// Takes away what was not finished.
    ~OutputFile();
    OutputFile(const OutputFile&) = delete;
    OutputFile& operator=(const OutputFile&) = delete;

    /// Where to write.
    [[nodiscard]] const std::string& place() const noexcept { return place_; }
    /// What was written and closed is brought to the disk and gets its name.
    void finish();

  private:
    std::string path_, target_, place_;
};

/// All of an OutputFile.
void write_output(const std::string& path, std::string_view text);

/// A file's name in its folder survives a power cut. Throws std::runtime_error naming the folder.
void sync_folder_of(const std::string& path);

}  // namespace vibrig::proto
