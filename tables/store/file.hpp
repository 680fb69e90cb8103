// Reads whole files, and replaces them atomically (temporary name, fsync, rename, fsync of the folder).
// Only plain files are ever replaced or removed.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace medulla::tables {

/// All bytes of a plain file. Throws Error that names it, also if it has more than `most` bytes. Pipes and devices are
/// refused, so that it never blocks.
std::vector<unsigned char> read_file(const std::string& path,
                                     std::uint64_t most = std::numeric_limits<std::uint64_t>::max());

/// Throws Error with the reason unless `path` is a readable plain file.
void require_readable(const std::string& path);

/// `<path>.tmp-<host>-<process>-<number>`: unique among the processes of a cluster. Without the file's
/// name if that would be too long for the folder.
std::string temporary_name(const std::string& path);

/// Throws Error if the last part of `path` is too long for its folder.
void check_name(const std::string& path);

/// A plain file that appears under its name, complete and on disk, when commit() is called. Without commit() nothing is
/// left.
class PendingFile {
  public:
    /// Creates the temporary file, by default beside `path`; it must be on the same file system.
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

/// Synchronises a folder with the disk, if its file system supports that. Throws Error on failure.
void sync_folder(const std::string& path);

/// Folder of a path, "." if it has none.
std::string folder_of(const std::string& path);

/// "folder", "pipe", "block device" .. of a file mode.
const char* kind_name(std::uint32_t mode);

}  // namespace medulla::tables
