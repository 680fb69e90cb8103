// Whole files, safely: read into memory, and replaced in one step (temporary name, fsync, rename, fsync of the folder).
// Nothing but a plain file is ever renamed over or removed.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace medulla::tables {

/// All bytes of a plain file; throws Error that names it, also where it holds more than `most` bytes. Never waits: a
/// pipe or a device is refused.
std::vector<unsigned char> read_file(const std::string& path,
                                     std::uint64_t most = std::numeric_limits<std::uint64_t>::max());

/// Throws Error that says why, unless `path` is a plain file that can be read.
void require_readable(const std::string& path);

/// `<path>.tmp-<host>-<process>-<number>`: no two processes of a cluster make the same one. Where such a name is longer
/// than the folder takes, one without the file's own name.
std::string temporary_name(const std::string& path);

/// Throws Error where the last part of `path` is longer than its folder takes.
void check_name(const std::string& path);

/// A plain file that appears under its name only when commit() is called, whole and on disk; otherwise nothing is left.
class PendingFile {
  public:
    /// Makes the temporary file; by default beside `path`, always on its file system.
    explicit PendingFile(std::string path, std::string temporary = {});
    ~PendingFile();
    PendingFile(const PendingFile&) = delete;
    PendingFile& operator=(const PendingFile&) = delete;

    void write(const void* data, std::size_t size);
    void commit();

  private:
    std::string path_, temporary_;
    int fd_ = -1;
    bool committed_ = false;
};

void write_file(const std::string& path, const void* data, std::size_t size);
void write_file(const std::string& path, const std::string& text);

/// Brings a folder's list of names to disk, where its file system can. Throws Error where that failed.
void sync_folder(const std::string& path);

/// Folder of a path: "." where it names none.
std::string folder_of(const std::string& path);

/// "folder", "pipe", "block device" .. of a file mode.
const char* kind_name(std::uint32_t mode);

}  // namespace medulla::tables
